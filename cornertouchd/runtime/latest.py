"""The one hand-off between threads: a box that keeps the newest value of every camera."""

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Latest(Generic[T]):
    """Keeps the newest value under each key until it is taken; counts what it dropped.

    Guarantees: `put` never blocks on the taker, so a slow fusion thread never slows a camera; a
    taker gets each value at most once and the oldest put first.  Assumes one taker, any number of
    putters.
    """

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._values: dict[str, T] = {}
        self._dropped: dict[str, int] = {}

    def put(self, key: str, value: T) -> None:
        """Put the newest value; one that was not taken yet is dropped and counted."""
        with self._filled:
            if self._values.pop(key, None) is not None:
                self._dropped[key] = self._dropped.get(key, 0) + 1
            self._values[key] = value
            self._filled.notify()

    def take(self, timeout_s: float) -> list[T]:
        """Return what was put since the last call; wait up to `timeout_s` if that is nothing."""
        with self._filled:
            if not self._values:
                self._filled.wait(timeout_s)
            values = list(self._values.values())
            self._values.clear()
            return values

    def dropped(self) -> dict[str, int]:
        """Return how many values were dropped under each key."""
        with self._filled:
            return dict(self._dropped)
