"""One receiver at the other end of a stream, which is never waited for."""

import collections
import contextlib
import functools
import selectors
import socket
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from cornertouchd.devices.stream_hub import Frame, Switchboard
from cornertouchd.wire.tuio_stream import Conversation

# Room for two frames of 200 contacts and hundreds with ten: what lies in here is old when a
# receiver that was stuck reads on, so there should be little.
SEND_BUFFER_BYTES = 32 * 1024
# A receiver of TUIO says nothing, a browser's handshake has a kilobyte and comes once.
MAX_INPUT_BYTES_PER_S = 16 * 1024
RECEIVE_BYTES = 4096


class PeerLostError(Exception):
    """The connection has ended or must be ended; the message says why, empty if all is well."""


class Outbox:
    """What is to be written to one receiver: what was begun, then the newest frame.

    A frame is a message for each profile.  What a receiver does not take in time is skipped: every
    frame is complete in itself, so the newest one tells also what the others would have told.
    """

    def __init__(self) -> None:
        self._begun: collections.deque[memoryview] = collections.deque()
        self._newest: Sequence[bytes] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nothing waits."""
        return not self._begun and not self._newest

    def tell(self, frame: Sequence[bytes]) -> bool:
        """Put a frame in; tell whether it takes the place of one that was not begun."""
        replaces = bool(self._newest)
        self._newest = frame
        return replaces

    def say(self, message: bytes) -> None:
        """Put in what must not be left out, ahead of a frame that was not begun."""
        self._begun.append(memoryview(message))

    def write(self, connection: socket.socket) -> int:
        """Write as much as goes without waiting, a call for each message.

        Returns how many messages were written to their ends.  Raises `OSError`.
        """
        whole = 0
        while not self.is_empty:
            if not self._begun:
                self._begun.extend(map(memoryview, self._newest))
                self._newest = ()
            message = self._begun[0]
            try:
                count = connection.send(message)
            except BlockingIOError:
                break
            if count < len(message):
                self._begun[0] = message[count:]
            else:
                self._begun.popleft()
                whole += 1
        return whole


@dataclass(slots=True)
class Tally:
    """What happened to all receivers of a link together."""

    messages: int = 0
    frames_skipped: int = 0
    refused: int = 0
    errors: int = 0


class StreamPeer:
    """A connection to one receiver.  Used by the thread of the hub only.

    `connection` must be connected and must not block.
    """

    def __init__(
        self,
        connection: socket.socket,
        name: str,
        conversation: Conversation,
        tally: Tally,
        now_s: float,
    ) -> None:
        self.connection = connection
        self.name = name
        self.conversation = conversation
        self.joined_at_s = self.taken_at_s = now_s
        self._tally = tally
        self._outbox = Outbox()
        self._input_bytes = 0
        self._counted_from_s = now_s

    @property
    def is_ready(self) -> bool:
        """Whether it is told of touches."""
        return self.conversation.is_ready

    @property
    def is_waited_for(self) -> bool:
        """Whether something lies here that it did not take yet."""
        return not self._outbox.is_empty

    def tell(self, frame: Sequence[bytes], now_s: float) -> None:
        """Write a frame now, or as soon as it takes one.  Raises `PeerLostError`."""
        self._tally.frames_skipped += self._outbox.tell(frame)
        self.write(now_s)

    def write(self, now_s: float) -> None:
        """Write what waits, as much as goes.  Raises `PeerLostError`."""
        try:
            written = self._outbox.write(self.connection)
        except OSError as error:
            raise PeerLostError(error.strerror or str(error)) from error
        self._tally.messages += written
        if written or self._outbox.is_empty:
            self.taken_at_s = now_s
        if self.conversation.is_over and self._outbox.is_empty:
            raise PeerLostError("")

    def read(self, now_s: float) -> None:
        """Take in what came and answer it.  Raises `PeerLostError`."""
        try:
            data = self.connection.recv(RECEIVE_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            raise PeerLostError(error.strerror or str(error)) from error
        if not data:
            raise PeerLostError("")
        self._count_input(len(data), now_s)
        answer = self.conversation.receive(data)
        if answer:
            self._outbox.say(answer)
        self.write(now_s)

    def close(self) -> None:
        """Say farewell, as far as that goes without waiting, and end the connection."""
        with self.connection, contextlib.suppress(OSError):  # it may have gone first
            farewell = self.conversation.farewell()
            if farewell:
                self._outbox.say(farewell)
            self._outbox.write(self.connection)
            self.connection.shutdown(socket.SHUT_WR)

    def _count_input(self, count: int, now_s: float) -> None:
        if now_s - self._counted_from_s >= 1.0:
            self._counted_from_s, self._input_bytes = now_s, 0
        self._input_bytes += count
        if self._input_bytes > MAX_INPUT_BYTES_PER_S:
            raise PeerLostError(f"it sent more than {MAX_INPUT_BYTES_PER_S} bytes within a second")


class StreamPeers:
    """The receivers of one link, each watched for what it needs.

    `on_lost` is told who is gone and why, empty if that is nothing special; `on_ready` who may be
    told of touches from now on.
    """

    def __init__(
        self,
        board: Switchboard,
        on_ready: Callable[[StreamPeer, float], None],
        on_lost: Callable[[StreamPeer, str], None],
    ) -> None:
        self._board = board
        self._on_ready = on_ready
        self._on_lost = on_lost
        self._peers: dict[StreamPeer, int] = {}  # and what each is watched for

    def __len__(self) -> int:
        return len(self._peers)

    def __iter__(self) -> Iterator[StreamPeer]:
        return iter(tuple(self._peers))

    @property
    def is_waited_for(self) -> bool:
        """Whether a receiver has not taken all that it was told."""
        return any(peer.is_waited_for for peer in self._peers)

    def add(self, peer: StreamPeer, now_s: float) -> None:
        """Begin with a receiver."""
        self._peers[peer] = 0
        self._watch(peer)
        if peer.is_ready:
            self._on_ready(peer, now_s)

    def tell(self, peer: StreamPeer, frame: Frame, now_s: float) -> None:
        """Tell one a frame, if there is any."""
        if frame:
            self._do(peer, lambda: peer.tell(frame, now_s))

    def lose(self, peer: StreamPeer, reason: str) -> None:
        """End with a receiver."""
        self._end(peer)
        self._on_lost(peer, reason)

    def close(self) -> None:
        """End with all of them; that is no loss."""
        for peer in self:
            self._end(peer)

    def _end(self, peer: StreamPeer) -> None:
        del self._peers[peer]
        self._board.forget(peer.connection.fileno())
        peer.close()

    def _look_after(self, peer: StreamPeer, events: int, now_s: float) -> None:
        was_ready = peer.is_ready
        if events & selectors.EVENT_WRITE:
            self._do(peer, lambda: peer.write(now_s))
        if events & selectors.EVENT_READ and peer in self._peers:
            self._do(peer, lambda: peer.read(now_s))
        if peer.is_ready and not was_ready and peer in self._peers:
            self._on_ready(peer, now_s)

    def _do(self, peer: StreamPeer, action: Callable[[], None]) -> None:
        """Do something with a receiver, which ends it if that fails."""
        try:
            action()
        except PeerLostError as lost:
            self.lose(peer, str(lost))
        except Exception:
            self.lose(peer, "a fault in the program")  # or it would come again at once
            raise
        else:
            self._watch(peer)

    def _watch(self, peer: StreamPeer) -> None:
        events = selectors.EVENT_READ | (selectors.EVENT_WRITE * peer.is_waited_for)
        if self._peers[peer] != events:
            self._peers[peer] = events
            self._board.watch(
                peer.connection.fileno(), events, functools.partial(self._look_after, peer)
            )


def never_waiting(connection: socket.socket) -> socket.socket:
    """Return the socket prepared: nothing blocks, nothing is gathered, little lies in wait."""
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
    return connection
