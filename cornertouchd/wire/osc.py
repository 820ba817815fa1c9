"""OSC 1.0 taken apart strictly, every piece with the place where it stands in the packet.

For the rules of TUIO, which a lenient reader would hide.  Specification:
https://opensoundcontrol.stanford.edu/spec-1_0.html.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

BUNDLE = b"#bundle\0"
_BUNDLE_HEAD_BYTES = 16
_NUMBERS = {"i": struct.Struct(">i"), "f": struct.Struct(">f")}
_WIDER_NUMBERS = {"h": struct.Struct(">q"), "d": struct.Struct(">d"), "t": struct.Struct(">Q")}
_SIZED = {**_NUMBERS, **_WIDER_NUMBERS}

Argument = int | float | str


class OscError(Exception):
    """Bytes that are no OSC; `offset` is where in the packet."""

    def __init__(self, offset: int, what: str) -> None:
        super().__init__(what)
        self.offset = offset


@dataclass(frozen=True, slots=True)
class OscMessage:
    """A message; `offset` is where it begins, `offsets` where each argument does."""

    offset: int
    address: str
    tags: str
    arguments: tuple[Argument, ...]
    offsets: tuple[int, ...]


def is_bundle(packet: bytes) -> bool:
    """Whether a packet begins as a bundle does."""
    return packet.startswith(BUNDLE)


def read_bundle(packet: bytes) -> Iterator[OscMessage]:
    """Yield the messages of a bundle one after the other.  Raises `OscError`."""
    if len(packet) < _BUNDLE_HEAD_BYTES:
        raise OscError(len(packet), "a bundle ends before its time tag does")
    offset = _BUNDLE_HEAD_BYTES
    while offset < len(packet):
        left = len(packet) - offset - 4
        if left < 0:
            raise OscError(offset, f"{left + 4} bytes are left where an element has its length")
        (size,) = struct.unpack_from(">i", packet, offset)
        if size <= 0 or size % 4:
            raise OscError(offset, f"an element of {size} bytes, must be 4, 8, 12, ...")
        if size > left:
            raise OscError(offset, f"an element of {size} bytes where {left} are left")
        offset += 4
        if packet.startswith(BUNDLE, offset):
            raise OscError(offset, "a bundle in a bundle")
        yield read_message(packet, offset, offset + size)
        offset += size


def read_message(packet: bytes, start: int, end: int) -> OscMessage:
    """Return the message that lies there.  Raises `OscError`."""
    if packet[start : start + 1] != b"/":
        raise OscError(start, "a message must begin with an address: /...")
    address, offset = _string(packet, start, end)
    if offset == end:
        raise OscError(offset, f"the message to {address} has no type tags")
    tags_at = offset
    tags, offset = _string(packet, offset, end)
    if not tags.startswith(","):
        raise OscError(tags_at, f"type tags {tags!r} must begin with a comma")
    arguments: list[Argument] = []
    offsets = []
    for tag in tags[1:]:
        offsets.append(offset)
        if tag == "s":
            text, offset = _string(packet, offset, end)
            arguments.append(text)
        elif tag in _SIZED:
            layout = _SIZED[tag]
            if offset + layout.size > end:
                raise OscError(offset, f"the message ends before its argument of type {tag}")
            arguments += layout.unpack_from(packet, offset)
            offset += layout.size
        else:
            raise OscError(tags_at, f"an argument of type {tag!r}, which TUIO has not")
    if offset != end:
        raise OscError(offset, f"{end - offset} bytes after the last argument")
    return OscMessage(start, address, tags[1:], tuple(arguments), tuple(offsets))


def _string(packet: bytes, start: int, end: int) -> tuple[str, int]:
    """Return the string that begins there, and where the next piece does."""
    stop = packet.find(b"\0", start, end)
    if stop < 0:
        raise OscError(start, "a string without end")
    after = start + (stop - start) // 4 * 4 + 4
    if after > end or packet[stop:after].strip(b"\0"):
        raise OscError(stop, "a string that is not filled up with zeros to a multiple of 4 bytes")
    text = packet[start:stop]
    if not text.isascii() or not text.decode("ascii").isprintable():
        raise OscError(start, f"a string that is not printable ASCII: {text[:20]!r}")
    return text.decode("ascii"), after
