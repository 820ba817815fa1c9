"""A record of a TUIO stream: lines of JSON that people and `grep` can read.

The first line says what it is, every further one is a packet (over streams: a bundle) in the order
of arrival:

    {"format": "cornertouchd-tuio", "version": 1, "transport": "udp"}
    {"at_s": 0.010214, "sender": "127.0.0.1:41234", "packet": "2362756e646c6500..."}

`at_s` counts from the start of the record; `packet` is in hexadecimal digits.  Unknown keys are
passed over.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from cornertouchd.errors import ReportedError
from cornertouchd.wire.tuio_rules import Transport

FORMAT, VERSION = "cornertouchd-tuio", 1
TRANSPORTS: tuple[Transport, ...] = ("udp", "tcp", "websocket")


class RecordError(ReportedError):
    """A line of a record that cannot be used."""


@dataclass(frozen=True, slots=True)
class Packet:
    """What came, from whom and when."""

    at_s: float
    sender: str
    data: bytes


def header_line(transport: Transport) -> str:
    """Return the first line."""
    return json.dumps({"format": FORMAT, "version": VERSION, "transport": transport})


def packet_line(packet: Packet) -> str:
    """Return the line of a packet."""
    return json.dumps(
        {"at_s": round(packet.at_s, 6), "sender": packet.sender, "packet": packet.data.hex()}
    )


def read_header(line: str) -> Transport:
    """Return how the stream came.  Raises `RecordError`."""
    header = _object(line, 1)
    if header.get("format") != FORMAT:
        raise RecordError(f"line 1: no record of TUIO: format is not {FORMAT!r}")
    if header.get("version") != VERSION:
        raise RecordError(
            f"line 1: version {header.get('version')!r}, this program reads {VERSION}; update it"
        )
    for transport in TRANSPORTS:
        if header.get("transport") == transport:
            return transport
    raise RecordError(f"line 1: transport must be one of {', '.join(TRANSPORTS)}")


def read_packets(lines: Iterable[str]) -> Iterator[Packet]:
    """Yield the packets of the lines after the first.  Raises `RecordError`, with the line."""
    for number, line in enumerate(lines, start=2):
        told = _object(line, number)
        at_s, sender, digits = told.get("at_s"), told.get("sender"), told.get("packet")
        if not (
            isinstance(at_s, (int, float))
            and isinstance(sender, str)
            and isinstance(digits, str)
            and at_s >= 0.0
        ):
            raise RecordError(f"line {number}: needs at_s (from 0), sender and packet")
        try:
            data = bytes.fromhex(digits)
        except ValueError as error:
            raise RecordError(f"line {number}: packet is not hexadecimal: {error}") from error
        yield Packet(float(at_s), sender, data)


def _object(line: str, number: int) -> dict[str, Any]:
    try:
        told = json.loads(line)
    except ValueError as error:
        raise RecordError(f"line {number}: no JSON: {error}") from error
    if not isinstance(told, dict):
        raise RecordError(f"line {number}: no JSON object")
    return told
