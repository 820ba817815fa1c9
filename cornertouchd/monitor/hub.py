"""The browsers that look: each message is made once, and no browser holds up another.

For each viewer the newest message of each kind waits until he can take it.  One who is slow, or has
stopped, loses what is older; so what waits for him never grows.
"""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

from cornertouchd.monitor.counters import Counters

Message = bytes | str
STRIP = 2
"""The first byte of a strip; the second is the number of its camera."""


class FullError(Exception):
    """So many look already that there is no place for another."""


class Viewer:
    """One browser, as seen by whoever sends to it."""

    def __init__(self, counters: Counters) -> None:
        self.wants_strips = False
        self._counters = counters
        self._waiting: dict[object, Message] = {}
        self._filled = asyncio.Event()

    def offer(self, kind: object, message: Message) -> None:
        """Put the newest message of a kind; one that was not taken yet is lost and counted."""
        if self._waiting.pop(kind, None) is not None:
            self._counters.lost()
        self._waiting[kind] = message
        self._filled.set()

    async def take(self) -> Message:
        """Return the message that waits longest; wait for one if there is none."""
        while not self._waiting:
            self._filled.clear()
            await self._filled.wait()
        return self._waiting.pop(next(iter(self._waiting)))


class Hub:
    """All browsers.  For the thread of the event loop only."""

    def __init__(self, viewers_max: int, counters: Counters) -> None:
        self._viewers_max = viewers_max
        self._counters = counters
        self._viewers: set[Viewer] = set()
        self._changed = asyncio.Event()

    @property
    def is_watched(self) -> bool:
        """Whether anybody looks."""
        return bool(self._viewers)

    @property
    def wants_strips(self) -> bool:
        """Whether anybody wants strips."""
        return any(viewer.wants_strips for viewer in self._viewers)

    @property
    def is_full(self) -> bool:
        """Whether there is no place for another viewer."""
        return len(self._viewers) >= self._viewers_max

    @contextmanager
    def viewer(self) -> Iterator[Viewer]:
        """Let a browser look.  Raises `FullError`."""
        if self.is_full:
            raise FullError
        viewer = Viewer(self._counters)
        self._viewers.add(viewer)
        self._note()
        try:
            yield viewer
        finally:
            self._viewers.discard(viewer)
            self._note()

    def set_wants_strips(self, viewer: Viewer, *, wants: bool) -> None:
        """Let a viewer be told strips, or no longer."""
        if viewer.wants_strips != wants:
            viewer.wants_strips = wants
            self._note()

    async def change(self) -> None:
        """Wait until viewers come, go, or want something else; a change before this call counts."""
        await self._changed.wait()
        self._changed.clear()

    def tell(self, kind: str, text: str) -> None:
        """Tell all viewers a text, in place of what they were not told yet of its kind."""
        for viewer in self._viewers:
            viewer.offer(kind, text)

    def tell_live(self, message: bytes) -> None:
        """Pass on what the daemon tells; strips only to those who want them."""
        is_strip = message[0] == STRIP
        kind = bytes(message[:2]) if is_strip else message[0]
        for viewer in self._viewers:
            if viewer.wants_strips or not is_strip:
                viewer.offer(kind, message)

    def _note(self) -> None:
        self._counters.viewers(len(self._viewers))
        self._changed.set()
