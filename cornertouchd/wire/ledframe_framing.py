"""Messages of the LED frame on its serial line: COBS between zeros, closed by a CRC.

wire = 00 COBS(ctl seq op payload[0..48] crc_hi crc_lo) 00, ctl = kind << 6 | major version.
COBS: Cheshire and Baker, "Consistent Overhead Byte Stuffing", 1999.  The same framing in C, an
independent reading, is firmware/core/framing.c; the tests run both against each other.
"""

import binascii
from dataclasses import dataclass
from enum import IntEnum

PROTOCOL_MAJOR = 1
MAX_PAYLOAD_BYTES = 48
MAX_MESSAGE_BYTES = 3 + MAX_PAYLOAD_BYTES + 2
# One code byte before the message; the zeros around it are not counted.
MAX_STUFFED_BYTES = MAX_MESSAGE_BYTES + 1


class Kind(IntEnum):
    """What a message is."""

    REQUEST = 0
    RESPONSE = 1
    EVENT = 2


class FramingError(ValueError):
    """Bytes that are no message; the line garbled them, or something else speaks there."""


@dataclass(frozen=True, slots=True)
class Message:
    """One message; `sequence`, `op` and `major` are 0..255, 0..255 and 0..63."""

    kind: Kind
    sequence: int
    op: int
    payload: bytes = b""
    major: int = PROTOCOL_MAJOR


@dataclass(frozen=True, slots=True)
class FramingCounts:
    """What came over the line."""

    messages: int = 0
    bad: int = 0


def crc16(data: bytes) -> int:
    """Return the CRC-16/IBM-3740: polynomial 0x1021, start 0xFFFF; 0x29B1 of b"123456789"."""
    return binascii.crc_hqx(data, 0xFFFF)


def stuff(data: bytes) -> bytes:
    """Return at most 253 bytes without zeros, one longer.  Raises `ValueError` for more."""
    if len(data) > 253:
        raise ValueError(f"{len(data)} bytes to stuff, at most 253")
    return b"".join(bytes((len(run) + 1,)) + run for run in data.split(b"\0"))


def unstuff(data: bytes) -> bytes:
    """Undo `stuff`.  Raises `FramingError` for bytes that it never returns."""
    runs = []
    at = 0
    while at < len(data):
        length = data[at]
        if length == 0 or at + length > len(data):
            raise FramingError(f"run of {length} bytes at {at} of {len(data)}")
        runs.append(data[at + 1 : at + length])
        at += length
    if not runs:
        raise FramingError("no bytes")
    return b"\0".join(runs)


def encode(message: Message) -> bytes:
    """Return the message as it goes over the line, both zeros included.

    Raises `ValueError` for a payload of more than 48 bytes or numbers out of range.
    """
    if len(message.payload) > MAX_PAYLOAD_BYTES:
        raise ValueError(f"payload of {len(message.payload)} bytes, at most {MAX_PAYLOAD_BYTES}")
    if not 0 <= message.major < 64:
        raise ValueError(f"major version {message.major}, must be 0..63")
    control = message.kind << 6 | message.major
    content = bytes((control, message.sequence, message.op)) + message.payload
    return b"\0" + stuff(content + crc16(content).to_bytes(2, "big")) + b"\0"


def decode(stuffed: bytes) -> Message:
    """Return the message that stood between two zeros.  Raises `FramingError`."""
    content = unstuff(stuffed)
    if not 5 <= len(content) <= MAX_MESSAGE_BYTES:
        raise FramingError(f"message of {len(content)} bytes, must be 5..{MAX_MESSAGE_BYTES}")
    if crc16(content) != 0:  # of data with its own CRC behind it
        raise FramingError("wrong CRC")
    kind = content[0] >> 6
    if kind > Kind.EVENT:
        raise FramingError(f"message of kind {kind}")
    return Message(Kind(kind), content[1], content[2], content[3:-2], content[0] & 0x3F)


class StreamDecoder:
    """Finds messages in a stream of bytes; whatever came before, a zero starts anew."""

    def __init__(self) -> None:
        self._begun = bytearray()
        self._messages = 0
        self._bad = 0

    @property
    def counts(self) -> FramingCounts:
        """Return how many messages were found and how many frames were none."""
        return FramingCounts(self._messages, self._bad)

    def feed(self, data: bytes) -> list[Message]:
        """Return the messages that end in `data`."""
        *ended, begun = data.split(b"\0")
        found = []
        for part in ended:
            message = self._end(part)
            if message is not None:
                found.append(message)
        self._begun += begun[: MAX_STUFFED_BYTES + 1 - len(self._begun)]
        return found

    def _end(self, part: bytes) -> Message | None:
        stuffed = bytes(self._begun) + part
        self._begun.clear()
        if not stuffed:
            return None
        try:
            message = decode(stuffed)
        except FramingError:
            self._bad += 1
            return None
        self._messages += 1
        return message
