"""The server's end of a WebSocket connection (RFC 6455) without its socket."""

import logging
import re
from collections.abc import Sequence

from websockets.datastructures import Headers
from websockets.exceptions import InvalidOrigin
from websockets.frames import Frame, Opcode
from websockets.http11 import Request
from websockets.protocol import State
from websockets.server import ServerProtocol
from websockets.typing import Origin

from cornertouchd.wire.tuio_stream import Dialect

# Clients of TUIO say nothing; a greeting of theirs fits.
MAX_MESSAGE_BYTES = 1024
GOING_AWAY = 1001

# The library logs every connection, and what is wrong with bytes that are no WebSocket as an error
# of its own; what of that concerns a person is told by `refusal`.
_LIBRARY_LOG = logging.getLogger(f"{__name__}.protocol")
_LIBRARY_LOG.setLevel(logging.CRITICAL)

ANY_ORIGIN = "*"
ANY_PORT = ":*"


def binary_message(payload: bytes) -> bytes:
    """Return a whole message as a server sends it: the same bytes for all clients."""
    return Frame(Opcode.BINARY, payload).serialize(mask=False, extensions=[])


def websocket_dialect(origins: Sequence[str]) -> Dialect:
    """Return the dialect of browsers; a page must come from one of these origins.

    Each is scheme://host[:port], where port may be "*", or "null", or "*" for all.
    """
    patterns = _origin_patterns(origins)
    return Dialect("websocket", binary_message, lambda: WebSocketConversation(patterns))


def _origin_patterns(origins: Sequence[str]) -> list[Origin | re.Pattern[str] | None] | None:
    """Return what `ServerProtocol` compares the Origin of a page with; None lets all in.

    Programs that name no origin are no pages.
    """
    if ANY_ORIGIN in origins:
        return None
    return [None, *(_origin_pattern(origin) for origin in origins)]


def _origin_pattern(origin: str) -> re.Pattern[str]:
    exact = re.escape(origin.removesuffix(ANY_PORT))
    return re.compile(exact + r"(:\d+)?" * origin.endswith(ANY_PORT), re.IGNORECASE)


class WebSocketConversation:
    """Handshake, pings and closing with one client; fills `tuio_stream.Conversation`."""

    def __init__(self, origins: Sequence[Origin | re.Pattern[str] | None] | None) -> None:
        self._protocol = ServerProtocol(
            origins=origins, max_size=MAX_MESSAGE_BYTES, logger=_LIBRARY_LOG
        )
        self._is_over = False
        self._refusal = ""

    @property
    def is_ready(self) -> bool:
        """Whether the handshake is done and neither end has begun to close."""
        return self._protocol.state is State.OPEN and not self._is_over

    @property
    def is_over(self) -> bool:
        """Whether the connection is to be closed, once all answers are sent."""
        return self._is_over

    @property
    def refusal(self) -> str:
        """Why the handshake was refused; empty if it was not."""
        return self._refusal

    def receive(self, data: bytes) -> bytes:
        """Take in what the client sent and return the answer; its messages are passed over."""
        if self._is_over:
            return b""
        self._protocol.receive_data(data)
        events = self._protocol.events_received()
        if events and isinstance(events[0], Request):
            if len(events) > 1:
                # The library would take these frames for good; a browser waits for the answer.
                self._refusal, self._is_over = "it sent frames before the handshake was done", True
                return b""
            self._answer(events[0])
        return self._to_send()

    def farewell(self) -> bytes:
        """Return a closing frame, if the handshake is done and neither end has sent one."""
        if not self.is_ready:
            return b""
        self._protocol.send_close(GOING_AWAY)
        return self._to_send()

    def _answer(self, request: Request) -> None:
        response = self._protocol.accept(request)
        if isinstance(self._protocol.handshake_exc, InvalidOrigin):
            origin = _first(request.headers, "Origin")
            self._refusal = f"a page from {origin!r}, which is not in tuio.websocket.origins"
        elif self._protocol.handshake_exc is not None:
            self._refusal = "no WebSocket handshake"
        self._protocol.send_response(response)

    def _to_send(self) -> bytes:
        chunks = self._protocol.data_to_send()
        # an empty chunk asks to end the stream
        self._is_over = b"" in chunks or self._protocol.close_expected()
        if self._protocol.handshake_exc is not None and not self._refusal:
            self._refusal = "no WebSocket handshake"
        return b"".join(chunks)


def _first(headers: Headers, name: str) -> str:
    return next(iter(headers.get_all(name)), "")
