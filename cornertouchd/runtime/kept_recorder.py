"""Frame sets of a running daemon: what it keeps in memory, and what comes, for recordings."""

import json
import socket
from collections.abc import Callable, Generator, Mapping
from pathlib import Path

from cornertouchd.model import Frame, PictureFormat
from cornertouchd.runtime.asking import LONGEST_LINE, READ_WITHIN_S, RefusedError, open_stream
from cornertouchd.runtime.recorder import FrameGrouping
from cornertouchd.wire.pictures import (
    LONGEST_FIRST_LINE,
    PictureDecoder,
    StreamedCamera,
    StreamHead,
    read_head,
)

LOOK_S = 0.1
"""How often it is looked whether to stop while no picture comes."""

SILENT_LOOKS = int(2 * READ_WITHIN_S / LOOK_S)
"""The daemon sends nothing for so long only while it has no pictures; it still says the end."""

READ_BYTES = 2**18


class KeptRecorder:
    """Asks the daemon at a socket for its pictures.  Use as a context manager.

    Of the last `last_s`, then for `seconds` more, or until it is stopped.  The daemon waits for
    nobody: what this reads too slowly is missing.  Raises `OSError` if no daemon answers,
    `RefusedError` if it does not tell, `PictureStreamError` if it tells something else.
    """

    def __init__(self, path: Path, last_s: float, seconds: float | None) -> None:
        self._connection = open_stream(path, "pictures", last_s=last_s, seconds=seconds)
        try:
            line, self._rest = _first_line(self._connection)
            self._head = read_head(_required(line, path))
        except BaseException:
            self._connection.close()
            raise
        seeing = self.cameras
        self._grouping = FrameGrouping([one.id for one in seeing], self._head.tolerance_s)
        self.missing = 0

    def __enter__(self) -> "KeptRecorder":
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()

    @property
    def head(self) -> StreamHead:
        """What the daemon says of its pictures."""
        return self._head

    @property
    def cameras(self) -> tuple[StreamedCamera, ...]:
        """The cameras that give pictures; if none does, all."""
        seeing = tuple(one for one in self._head.cameras if one.gives)
        return seeing or self._head.cameras

    @property
    def formats(self) -> Mapping[str, PictureFormat]:
        """Size and rows of their pictures."""
        return {one.id: one.format for one in self.cameras}

    @property
    def dropped(self) -> int:
        """Frames without fellows of the same instant."""
        return self._grouping.dropped

    def frame_sets(self, stop: Callable[[], bool]) -> Generator[tuple[Frame, ...]]:
        """Yield frame sets to the end, or until `stop()`, asked often.

        Raises `PictureStreamError` when the daemon goes away meanwhile.
        """
        decoder = PictureDecoder({one.id: one.format for one in self._head.cameras})
        formats = self.formats
        for data in self._received(stop):
            for one in decoder.feed(data):
                if not isinstance(one, Frame):
                    self.missing = one.missing
                elif one.camera in formats:
                    yield from self._grouping.add(one)
        decoder.finish()

    def _received(self, stop: Callable[[], bool]) -> Generator[bytes]:
        yield self._rest
        self._connection.settimeout(LOOK_S)
        has_stopped, silent = False, 0
        while silent < SILENT_LOOKS:
            if not has_stopped and stop():
                has_stopped = True
                self._connection.sendall(b'{"stop": true}\n')
            try:
                data = self._connection.recv(READ_BYTES)
            except TimeoutError:
                silent += has_stopped
                continue
            except ConnectionResetError:
                return
            if not data:
                return
            yield data


def _first_line(connection: socket.socket) -> tuple[bytes, bytes]:
    received = b""
    while b"\n" not in received and len(received) < LONGEST_FIRST_LINE:
        part = connection.recv(LONGEST_LINE)
        if not part:
            break
        received += part
    line, _, rest = received.partition(b"\n")
    return line, rest


def _required(line: bytes, path: Path) -> bytes:
    """Return the line; raise `RefusedError` if it says that there is nothing."""
    if line.startswith(b'{"error"'):
        raise RefusedError(f"{path}: {json.loads(line)['error']}")
    return line
