"""A receiver of TUIO that is a TCP server: the daemon connects, again and again if it must."""

import errno
import functools
import logging
import os
import selectors
import socket

from cornertouchd.devices.name_lookup import Address, NameLookup, Resolve, addresses_of
from cornertouchd.devices.stream_hub import Frame, Switchboard
from cornertouchd.devices.stream_peer import StreamPeer, StreamPeers, Tally, never_waiting
from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.wire.tuio_stream import SilentConversation, length_prefixed

log = logging.getLogger(__name__)

CONNECT_S = 5.0
RETRY_FIRST_S = 0.5
RETRY_MAX_S = 16.0
# A server that ends sooner may be one that crashes at every start.
RECOVERED_AFTER_S = 10.0


resolve_stream = functools.partial(addresses_of, kind=socket.SOCK_STREAM)


class TcpDestination:
    """Connects to one TCP server and tells it of touches; fills `stream_hub.StreamLink`.

    While it is not there, the waiting between two tries grows from half a second to 16.  A name is
    resolved by a thread of its own.
    """

    def __init__(
        self, board: Switchboard, host: str, port: int, resolve: Resolve = resolve_stream
    ) -> None:
        self._board = board
        self._host = host
        self._port = port
        self._lookup = NameLookup(host, port, resolve)
        self._shown = f"TUIO over tcp to {host.encode(errors='backslashreplace').decode()}:{port}"
        self._connecting: socket.socket | None = None
        self._others: list[Address] = []
        self._give_up_at_s = float("inf")
        self._connected_at_s = self._looked_at_s = float("-inf")
        self._retry_at_s = float("-inf")
        self._retry_after_s = RETRY_FIRST_S
        self._peers = StreamPeers(board, self._welcome, self._part_from)
        self._tally = Tally()
        self._frame: Frame = ()
        self._fault: str | None = None

    @property
    def status(self) -> DestinationStatus:
        """How it fares; any thread may ask."""
        return DestinationStatus(
            self._host,
            self._port,
            self._tally.messages,
            self._tally.errors,
            self._fault,
            "tcp",
            len(self._peers),
            self._tally.frames_skipped,
        )

    @property
    def is_waited_for(self) -> bool:
        """Whether the server has not taken all that it was told."""
        return self._peers.is_waited_for

    def tell(self, bundles: Frame, now_s: float) -> None:
        """Tell the server a frame, if it is there."""
        self._frame = tuple(map(length_prefixed, bundles))
        for peer in self._peers:
            self._peers.tell(peer, self._frame, now_s)

    def look(self, now_s: float) -> None:
        """Go on with connecting, if it is not connected."""
        self._looked_at_s = now_s
        if len(self._peers):
            if now_s - self._connected_at_s >= RECOVERED_AFTER_S:
                self._recover()
        elif self._connecting is not None:
            if now_s >= self._give_up_at_s:
                self._fail(OSError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT)))
        elif self._lookup.is_under_way:
            self._take_answer(now_s)
        elif now_s >= self._retry_at_s:
            self._find()

    def close(self) -> None:
        """End the connection."""
        self._peers.close()
        self._drop_attempt()

    def _find(self) -> None:
        """Have the name resolved aside, numeric addresses too: it costs nothing but a thread."""
        try:
            self._lookup.begin()
        except OSError as error:
            self._fail(error)

    def _take_answer(self, now_s: float) -> None:
        answer = self._lookup.take()
        if answer is None:
            return
        if isinstance(answer, OSError):
            self._fail(answer)
        else:
            self._others = answer
            self._connect(OSError(errno.EADDRNOTAVAIL, "the name has no address"), now_s)

    def _connect(self, error: OSError, now_s: float) -> None:
        """Begin to connect to the next address; `error` is what is wrong if there is none."""
        while self._others:
            family, address = self._others.pop(0)
            try:
                connecting = never_waiting(socket.socket(family, socket.SOCK_STREAM))
            except OSError as refusal:
                error = refusal
                continue
            code = connecting.connect_ex(address)
            if code not in {0, errno.EINPROGRESS}:
                connecting.close()
                error = OSError(code, os.strerror(code))
                continue
            self._connecting = connecting
            self._give_up_at_s = now_s + CONNECT_S
            finish = functools.partial(self._finish, connecting)
            self._board.watch(connecting.fileno(), selectors.EVENT_WRITE, finish)
            return
        self._fail(error)

    def _finish(self, connecting: socket.socket, _events: int, now_s: float) -> None:
        """See what came of connecting."""
        code = connecting.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if code:
            self._drop_attempt()
            self._connect(OSError(code, os.strerror(code)), now_s)
            return
        self._board.forget(connecting.fileno())
        self._connecting = None
        self._others = []
        self._connected_at_s = now_s
        name = f"{self._host}:{self._port}"
        self._peers.add(
            StreamPeer(connecting, name, SilentConversation(), self._tally, now_s), now_s
        )

    def _welcome(self, peer: StreamPeer, now_s: float) -> None:
        """Tell a server that was just reached all that is known."""
        self._peers.tell(peer, self._frame, now_s)

    def _part_from(self, peer: StreamPeer, reason: str) -> None:  # noqa: ARG002  there is but one
        self._retry_later(reason or "the other side has closed the connection")

    def _fail(self, error: OSError) -> None:
        self._drop_attempt()
        self._retry_later(error.strerror or str(error))

    def _retry_later(self, reason: str) -> None:
        """Try again, each time after twice as long; log it once."""
        self._retry_at_s = self._looked_at_s + self._retry_after_s
        self._retry_after_s = min(2.0 * self._retry_after_s, RETRY_MAX_S)
        self._tally.errors += 1
        if self._fault is None:
            log.warning("%s: %s; tried again until it works", self._shown, reason)
        self._fault = reason

    def _recover(self) -> None:
        self._retry_after_s = RETRY_FIRST_S
        if self._fault is not None:
            log.info("%s: connected", self._shown)
            self._fault = None

    def _drop_attempt(self) -> None:
        if self._connecting is not None:
            self._board.forget(self._connecting.fileno())
            self._connecting.close()
            self._connecting = None
