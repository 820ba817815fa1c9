"""One thread for all receivers of TUIO that are connected: over TCP and over WebSocket.

Guarantees: the fusion thread hands frames over without ever waiting; the receivers of one link get
the same bytes, each as fast as it takes them; whatever a receiver does or sends ends at most its
own connection.
"""

import collections
import contextlib
import logging
import os
import selectors
import threading
import time
from collections.abc import Callable, Sequence
from typing import Protocol

from cornertouchd.devices.udp_destination import DestinationStatus

log = logging.getLogger(__name__)

# Deadlines of handshakes, retries and the like are looked at so often.
LOOK_EVERY_S = 0.25
# Frames that wait for the thread: half a second at the usual rate, should the machine stand still.
MOST_FRAMES_WAITING = 64
# What every receiver gets to take the last frame; with the 70 ms that UDP takes for its repeats,
# the sink is closed within 200 ms.
FAREWELL_S = 0.1

Frame = Sequence[bytes]
"""The messages of one frame as they go over the wire, one a profile."""

OnReady = Callable[[int, float], None]
"""Called when a socket is ready: with the events of `selectors`, and the time."""


class Switchboard(Protocol):
    """Where links have their sockets watched; used by the thread of the hub only."""

    def watch(self, file: int, events: int, on_ready: OnReady) -> None:
        """Call `on_ready` from now on when the file is ready; may be called again to change it."""
        ...

    def forget(self, file: int) -> None:
        """Watch a file no more, before it is closed; fine for one that is not watched."""
        ...


class StreamLink(Protocol):
    """A server with its receivers, or the way to one server.

    Called from the thread of the hub only, but for `status`.  Never raises, never waits.
    """

    @property
    def status(self) -> DestinationStatus:
        """How it fares; any thread may ask."""
        ...

    def tell(self, bundles: Frame, now_s: float) -> None:
        """Tell all receivers a frame, a bundle for each profile."""
        ...

    def look(self, now_s: float) -> None:
        """Do what time demands; the first call begins to listen, or to connect."""
        ...

    @property
    def is_waited_for(self) -> bool:
        """Whether a receiver has not taken all that it was told."""
        ...

    def close(self) -> None:
        """End all connections."""
        ...


class StreamHub:
    """The thread.  `tell`, `start` and `close` are for one thread at a time."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._links: Sequence[StreamLink] = ()
        self._waiting: collections.deque[tuple[StreamLink, Frame]] = collections.deque()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="tuio streams", daemon=True)
        self._selector: selectors.BaseSelector
        self._bell = -1
        self._faults = 0

    @property
    def faults(self) -> int:
        """How often something went wrong here that should not; any thread may ask."""
        return self._faults

    @property
    def was_started(self) -> bool:
        """Whether it has begun to serve."""
        return self._thread.ident is not None

    def start(self, links: Sequence[StreamLink]) -> None:
        """Begin to serve these links.

        Raises `OSError` or `RuntimeError` if there are no more files or threads.
        """
        if self._bell < 0:
            self._selector = selectors.DefaultSelector()
            self._bell = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._links = links
        self._waiting = collections.deque(maxlen=MOST_FRAMES_WAITING * len(links))
        self._thread.start()

    def put(self, link: StreamLink, bundles: Frame) -> None:
        """Hand a frame over; `ring` must follow.  Never waits."""
        self._waiting.append((link, bundles))

    def ring(self) -> None:
        """Have the thread tell what was put."""
        with contextlib.suppress(BlockingIOError):  # it has been rung for often enough
            os.eventfd_write(self._bell, 1)

    def close(self) -> None:
        """Tell what was put, say farewell to all and end; takes at most 0.15 s."""
        self._stop.set()
        if self.was_started:
            self.ring()
            self._thread.join(FAREWELL_S + 0.05)
        if self._bell >= 0 and not self._thread.is_alive():
            self._selector.close()
            os.close(self._bell)

    def watch(self, file: int, events: int, on_ready: OnReady) -> None:
        """Call `on_ready` from now on when the file is ready."""
        try:
            self._selector.modify(file, events, on_ready)
        except KeyError:
            self._selector.register(file, events, on_ready)

    def forget(self, file: int) -> None:
        """Watch a file no more."""
        with contextlib.suppress(KeyError):
            self._selector.unregister(file)

    def _run(self) -> None:
        self._selector.register(self._bell, selectors.EVENT_READ, self._answer_bell)
        look_at_s = float("-inf")
        while not self._stop.is_set():
            now_s = self._now_s()
            if now_s >= look_at_s:
                look_at_s = now_s + LOOK_EVERY_S
                for link in self._links:
                    self._guarded(link.look, now_s)
            self._turn(look_at_s - now_s)
        self._take_leave()

    def _turn(self, longest_s: float) -> None:
        """See to the sockets that are ready, then tell what was put."""
        ready = self._selector.select(max(longest_s, 0.0))
        now_s = self._now_s()
        for key, events in ready:
            self._guarded(key.data, events, now_s)
        self._tell_waiting(now_s)  # after the bell was answered: what is put from now on rings it

    def _tell_waiting(self, now_s: float) -> None:
        while self._waiting:
            link, bundles = self._waiting.popleft()
            self._guarded(link.tell, bundles, now_s)

    def _answer_bell(self, _events: int, _now_s: float) -> None:
        with contextlib.suppress(BlockingIOError):
            os.eventfd_read(self._bell)

    def _take_leave(self) -> None:
        """Give the receivers time to take what they are told last."""
        until_s = self._now_s() + FAREWELL_S
        self._tell_waiting(self._now_s())
        while any(link.is_waited_for for link in self._links) and self._now_s() < until_s:
            self._turn(until_s - self._now_s())
        for link in self._links:
            self._guarded(link.close)

    def _guarded(self, action: Callable[..., None], *arguments: object) -> None:
        try:
            action(*arguments)
        except Exception:  # the other receivers go on
            self._faults += 1
            if self._faults == 1:
                log.exception("TUIO streams: a fault in the program; further ones are counted")
