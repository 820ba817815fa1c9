"""Where `cornertouchd listen` takes packets from, and the file that it keeps them in."""

import contextlib
import re
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Self

import click

from cornertouchd.devices.tuio_listening import INPUTS, StreamEndedError, TuioInput
from cornertouchd.errors import ReportedError
from cornertouchd.wire.tuio_record import (
    Packet,
    RecordError,
    header_line,
    packet_line,
    read_header,
    read_packets,
)
from cornertouchd.wire.tuio_rules import Transport

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORTS: dict[Transport, int] = {"udp": 3333, "tcp": 3333, "websocket": 8080}
SCHEMES: dict[str, Transport] = {"udp": "udp", "tcp": "tcp", "ws": "websocket"}


@dataclass(frozen=True, slots=True)
class Stream:
    """A stream of TUIO: at an address, or in a file."""

    transport: Transport
    host: str = ""
    port: int = 0
    file: Path | None = None

    @staticmethod
    def of(transport: Transport, host: str | None, port: int | None) -> "Stream":
        """Return that at an address; what is not given is as usual."""
        return Stream(transport, host or DEFAULT_HOST, port or DEFAULT_PORTS[transport])

    def __str__(self) -> str:
        if self.file is not None:
            return str(self.file)
        scheme = next(name for name, transport in SCHEMES.items() if transport == self.transport)
        return self.shown if scheme == "udp" else f"{scheme}://{self.shown}"

    @property
    def shown(self) -> str:
        """The address, or the name of the file."""
        return f"{self.host}:{self.port}" if self.file is None else self.file.name

    def opened(self, *, paced: bool) -> AbstractContextManager[TuioInput]:
        """Return its packets; those of a file as fast as they came if `paced`, else at once.

        Raises `ReportedError`.
        """
        if self.file is None:
            return INPUTS[self.transport](self.host, self.port)
        return _replayed(self.file, paced=paced)


class StreamAddress(click.ParamType[Stream]):
    """`udp://HOST:PORT`, `tcp://...`, `ws://...`, or a file."""

    name = "stream"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> Stream:
        """Return the stream."""
        text = str(value)
        if isinstance(value, Stream):
            return value
        scheme, separator, rest = text.partition("://")
        if not separator:
            return self._file(Path(text), param, ctx)
        found = re.fullmatch(r"(?:\[([0-9A-Fa-f:.]+)\]|([^\s:/\[\]]+))(?::(\d{1,5}))?/?", rest)
        transport = SCHEMES.get(scheme.lower())
        port = int(found[3] or 0) if found else 0
        if found is None or transport is None or port > 65535:
            self.fail(f"{text!r} is neither {'://..., '.join(SCHEMES)}://HOST:PORT nor a file")
        return Stream.of(transport, found[1] or found[2], port or None)

    def _file(self, file: Path, param: click.Parameter | None, ctx: click.Context | None) -> Stream:
        try:
            with file.open(encoding="utf-8") as lines:
                return Stream(read_header(lines.readline()), file=file)
        except OSError as error:
            self.fail(f"{file}: {error.strerror}", param, ctx)
        except (RecordError, UnicodeDecodeError) as error:
            self.fail(f"{file}: {error}", param, ctx)


class _Replayed:
    """The packets of a record."""

    def __init__(self, packets: Iterator[Packet], file: Path, *, paced: bool) -> None:
        self._packets = packets
        self._file = file
        self._paced = paced
        self._next: Packet | None = None
        self._began_at_s = time.monotonic()

    def receive(self, wait_s: float) -> tuple[bytes, str] | None:
        """Return the next packet and who sent it; None if it is not due yet."""
        try:
            packet = self._next or next(self._packets, None)
        except (RecordError, UnicodeDecodeError) as error:
            raise RecordError(f"{self._file}: {error}") from error
        if packet is None:
            raise StreamEndedError(f"{self._file}: all of it was read")
        due_in_s = packet.at_s - (time.monotonic() - self._began_at_s)
        if self._paced and due_in_s > wait_s:
            self._next = packet
            time.sleep(max(wait_s, 0.0))
            return None
        if self._paced and due_in_s > 0.0:
            time.sleep(due_in_s)
        self._next = None
        return packet.data, packet.sender


@contextlib.contextmanager
def _replayed(file: Path, *, paced: bool) -> Iterator[TuioInput]:
    try:
        lines = file.open(encoding="utf-8")
    except OSError as error:
        raise RecordError(f"{file}: {error.strerror}") from error
    with lines:
        lines.readline()
        yield _Replayed(read_packets(lines), file, paced=paced)


class RecordingInput:
    """Packets that are kept in a file as they come.  Use as a context manager."""

    def __init__(self, packets: TuioInput, file: Path, transport: Transport) -> None:
        self._packets = packets
        self._file = file
        self._transport = transport
        self._began_at_s = time.monotonic()
        self._writing: FileIO

    def __enter__(self) -> Self:
        with self._told():
            self._writing = FileIO(self._file, "w")
        try:
            self._write(header_line(self._transport))
        except ReportedError:
            self._writing.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with self._told():
            self._writing.close()

    def receive(self, wait_s: float) -> tuple[bytes, str] | None:
        """Return the next packet and who sent it, None if none comes in time."""
        came = self._packets.receive(wait_s)
        if came is not None:
            data, sender = came
            packet = Packet(time.monotonic() - self._began_at_s, sender, data)
            self._write(packet_line(packet))
        return came

    def _write(self, line: str) -> None:
        """Write a line at once: whatever ends the program, the file is whole up to there."""
        rest = memoryview(f"{line}\n".encode())
        with self._told():
            while rest:
                rest = rest[self._writing.write(rest) :]

    @contextlib.contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise ReportedError(f"record {self._file}: {error.strerror}") from error
