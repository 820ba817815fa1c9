"""TUIO over streams: how bundles are told apart, and what else the two ends say.

Over TCP each bundle comes after its length, a big-endian int32; over WebSocket each is a binary
message without it (the reference client of TUIO 1.1 and TUIO/WEB).
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, Protocol

# The reference client reads TCP into a buffer of this size, and a datagram holds no more.
MAX_BUNDLE_BYTES = 65_536

_LENGTH = struct.Struct(">i")


class MalformedStreamError(Exception):
    """What comes over TCP is no row of bundles with their lengths; nothing after it can be read."""


class Conversation(Protocol):
    """What a server and one client say to each other besides touches, without any I/O."""

    @property
    def is_ready(self) -> bool:
        """Whether the client may be told of touches."""
        ...

    @property
    def is_over(self) -> bool:
        """Whether the connection is to be closed, once all answers are sent."""
        ...

    @property
    def refusal(self) -> str:
        """Why the client was sent away; empty if it was not."""
        ...

    def receive(self, data: bytes) -> bytes:
        """Take in what the client sent and return the answer, often none."""
        ...

    def farewell(self) -> bytes:
        """Return what ends the conversation, often nothing."""
        ...


class SilentConversation:
    """That over TCP: none.  Whatever a client says is passed over."""

    is_ready = True
    is_over = False
    refusal = ""

    def receive(self, data: bytes) -> bytes:  # noqa: ARG002
        """Answer nothing."""
        return b""

    def farewell(self) -> bytes:
        """Say nothing: the end of the stream is the end."""
        return b""


def length_prefixed(bundle: bytes) -> bytes:
    """Return a bundle as it goes over TCP."""
    return _LENGTH.pack(len(bundle)) + bundle


@dataclass(frozen=True, slots=True)
class Dialect:
    """How bundles go over a stream, and what else is said."""

    name: Literal["tcp", "websocket"]
    wrap: Callable[[bytes], bytes]
    converse: Callable[[], Conversation]


TCP = Dialect("tcp", length_prefixed, SilentConversation)


class PrefixedBundles:
    """Takes a TCP stream apart again."""

    def __init__(self) -> None:
        self._received = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Return the bundles that are whole now.

        Raises `MalformedStreamError` for a length that no bundle has.
        """
        self._received += data
        whole = []
        while len(self._received) >= _LENGTH.size:
            (length,) = _LENGTH.unpack_from(self._received)
            if not 0 < length <= MAX_BUNDLE_BYTES:
                raise MalformedStreamError(
                    f"a bundle of {length} bytes, must be 1..{MAX_BUNDLE_BYTES}; "
                    "is it TUIO with a length before each bundle?"
                )
            end = _LENGTH.size + length
            if len(self._received) < end:
                break
            whole.append(bytes(self._received[_LENGTH.size : end]))
            del self._received[:end]
        return whole
