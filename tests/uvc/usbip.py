"""USB/IP, the device's side: requests of the kernel's virtual host controller, and the replies.

Kernel documentation, usb/usbip_protocol: all integers are big-endian, every header has 48 bytes.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

HEADER_BYTES = 48
SUBMIT, UNLINK, RET_SUBMIT, RET_UNLINK = 1, 2, 3, 4
STALL = -32
"""EPIPE: the device does not know what is asked."""
CANCELLED = -104
"""ECONNRESET: the request was taken back in time."""


@dataclass(frozen=True, slots=True)
class Submit:
    """A transfer that the host wants: `data` goes out, or up to `length` bytes come in."""

    number: int
    endpoint: int
    length: int
    setup: bytes
    data: bytes


@dataclass(frozen=True, slots=True)
class Unlink:
    """The host takes the request `target` back."""

    number: int
    target: int


def take_requests(received: bytearray) -> Iterator[Submit | Unlink]:
    """Yield the whole requests at the beginning of what was received, and remove them there."""
    while len(received) >= HEADER_BYTES:
        command, number, _device, is_in, endpoint = struct.unpack_from(">5I", received)
        if command == UNLINK:
            (target,) = struct.unpack_from(">I", received, 20)
            del received[:HEADER_BYTES]
            yield Unlink(number, target)
            continue
        (length,) = struct.unpack_from(">I", received, 24)
        end = HEADER_BYTES + (0 if is_in else length)
        if len(received) < end:
            return
        setup, data = bytes(received[40:48]), bytes(received[HEADER_BYTES:end])
        del received[:end]
        yield Submit(number, endpoint, length, setup, data)


def done(number: int, length: int, status: int = 0) -> bytes:
    """Return the header that ends a transfer of so many bytes; those that come in follow it."""
    return struct.pack(">5IiiIII8x", RET_SUBMIT, number, 0, 0, 0, status, length, 0, 0, 0)


def unlinked(number: int, in_time: bool) -> bytes:
    """Return the reply to a request that takes another back."""
    return struct.pack(">5Ii24x", RET_UNLINK, number, 0, 0, 0, CANCELLED if in_time else 0)
