"""A server of TUIO: whoever connects is told of touches, over TCP or WebSocket."""

import errno
import functools
import logging
import selectors
import socket

from cornertouchd.devices.stream_hub import Frame, Switchboard
from cornertouchd.devices.stream_peer import StreamPeer, StreamPeers, Tally, never_waiting
from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.wire.tuio_stream import Dialect

log = logging.getLogger(__name__)

# Who connects has this time to shake hands: a browser takes milliseconds.
HANDSHAKE_S = 5.0
# A receiver that has taken nothing for so long makes room when another one wants in.
STALLED_S = 10.0
# A port may still be that of the daemon's former configuration, for a fraction of a second.
RETRY_AFTER_S = 0.5
# More that connect at once wait in the kernel.
BACKLOG = 64
ACCEPTED_AT_ONCE = 16
# So many different reasons for trouble are logged; who makes up origins fills no journal.
MOST_REASONS = 20
# The kernel has no more files or memory: the next try comes with the next look.
EXHAUSTED = {errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM}


class StreamServer:
    """Serves the receivers that connect to one port; fills `stream_hub.StreamLink`.

    A port that cannot be had is tried again and again.  At most `connections_max` are connected;
    one more is sent away, unless another takes nothing any more: then that one goes.
    """

    def __init__(
        self, board: Switchboard, dialect: Dialect, host: str, port: int, connections_max: int
    ) -> None:
        self._board = board
        self._dialect = dialect
        self._host = host
        self._port = port
        self._connections_max = connections_max
        self._shown = f"TUIO over {dialect.name} at {host}:{port}"
        self._listener: socket.socket | None = None
        self._retry_at_s = float("-inf")
        self._tries = 0
        self._peers = StreamPeers(board, self._welcome, self._part_from)
        self._tally = Tally()
        self._frame: Frame = ()
        self._fault: str | None = None
        self._reasons_told: set[str] = set()

    @property
    def status(self) -> DestinationStatus:
        """How it fares; any thread may ask."""
        return DestinationStatus(
            self._host,
            self._port,
            self._tally.messages,
            self._tally.errors,
            self._fault,
            self._dialect.name,
            len(self._peers),
            self._tally.frames_skipped,
            self._tally.refused,
        )

    @property
    def listens(self) -> bool:
        """Whether clients can connect; any thread may ask."""
        return self._listener is not None

    @property
    def is_waited_for(self) -> bool:
        """Whether a receiver has not taken all that it was told."""
        return self._peers.is_waited_for

    def tell(self, bundles: Frame, now_s: float) -> None:
        """Tell all receivers a frame."""
        self._frame = tuple(map(self._dialect.wrap, bundles))
        for peer in self._peers:
            if peer.is_ready:
                self._peers.tell(peer, self._frame, now_s)

    def look(self, now_s: float) -> None:
        """Listen, if that is not so; end what takes too long."""
        for peer in self._peers:
            if not peer.is_ready and now_s - peer.joined_at_s >= HANDSHAKE_S:
                self._peers.lose(peer, f"no handshake within {HANDSHAKE_S:g} s")
        if self._listener is not None:
            self._watch(self._listener)  # if there was no room for more connections before
        elif now_s >= self._retry_at_s:
            self._listen(now_s)

    def close(self) -> None:
        """End all connections and free the port."""
        self._peers.close()
        if self._listener is not None:
            self._board.forget(self._listener.fileno())
            self._listener.close()
            self._listener = None

    def _listen(self, now_s: float) -> None:
        self._tries += 1
        try:
            self._listener = _listening_socket(self._host, self._port)
        except (OSError, ValueError) as error:
            self._retry_at_s = now_s + RETRY_AFTER_S
            if self._tries > 1 and self._fault is None:  # the first one may be in a reload
                self._tally.errors += 1
                self._fault = getattr(error, "strerror", None) or str(error)
                log.warning(
                    "%s: %s; tried again until it works, or set another port",
                    self._shown,
                    self._fault,
                )
            return
        if self._fault is not None:
            log.info("%s: clients can connect now", self._shown)
        self._tries, self._fault = 0, None
        self._watch(self._listener)

    def _watch(self, listener: socket.socket) -> None:
        let_in = functools.partial(self._let_in, listener)
        self._board.watch(listener.fileno(), selectors.EVENT_READ, let_in)

    def _let_in(self, listener: socket.socket, _events: int, now_s: float) -> None:
        """Let in who has connected."""
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                connection, address = listener.accept()
            except BlockingIOError:
                return
            except OSError as error:
                if error.errno in EXHAUSTED:
                    # Who knocks is still there and would be heard of at once, over and over.
                    self._board.forget(listener.fileno())
                    self._refuse(str(error.strerror))
                    return
                continue  # this one has gone again
            self._take_in(connection, f"{address[0]}:{address[1]}", now_s)

    def _take_in(self, connection: socket.socket, name: str, now_s: float) -> None:
        if len(self._peers) >= self._connections_max and not self._make_room(now_s):
            connection.close()
            self._refuse(f"{self._connections_max} are connected, which is connections_max")
            return
        never_waiting(connection)
        conversation = self._dialect.converse()
        self._peers.add(StreamPeer(connection, name, conversation, self._tally, now_s), now_s)

    def _make_room(self, now_s: float) -> bool:
        """End the connection of whoever has been stuck for longest, if anybody is."""
        stuck = [
            peer
            for peer in self._peers
            if peer.is_waited_for and now_s - peer.taken_at_s >= STALLED_S
        ]
        if not stuck:
            return False
        longest = min(stuck, key=lambda peer: peer.taken_at_s)
        self._peers.lose(longest, f"it took nothing for {STALLED_S:g} s, and another wants in")
        return True

    def _welcome(self, peer: StreamPeer, now_s: float) -> None:
        """Tell one that may hear of touches from now on all that is known."""
        self._peers.tell(peer, self._frame, now_s)

    def _part_from(self, peer: StreamPeer, reason: str) -> None:
        if peer.conversation.refusal:
            self._refuse(peer.conversation.refusal)
        elif reason:
            self._tally.errors += 1
            self._tell_once(f"{peer.name.rpartition(':')[0]} was disconnected: {reason}")

    def _refuse(self, reason: str) -> None:
        self._tally.refused += 1
        self._tell_once(f"a client was refused: {reason}")

    def _tell_once(self, what: str) -> None:
        """Log it, unless the same was logged before or a great deal was."""
        if what not in self._reasons_told and len(self._reasons_told) < MOST_REASONS:
            self._reasons_told.add(what)
            log.warning("%s: %s; further ones are counted only", self._shown, what)


def _listening_socket(host: str, port: int) -> socket.socket:
    """Return a socket that clients can connect to.  Raises `OSError` or `ValueError`."""
    family, kind, _, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listener = socket.socket(family, kind)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setblocking(False)
        listener.bind(address)
        listener.listen(BACKLOG)
    except OSError:
        listener.close()
        raise
    return listener
