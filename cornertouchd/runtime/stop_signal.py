"""SIGINT and SIGTERM, so that every command ends in the same clean way."""

import contextlib
import os
import select
import signal
from types import FrameType
from typing import Self

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class StopSignal:
    """Waits for SIGINT or SIGTERM.  Use as a context manager, in the main thread.

    The handler writes a byte into a pipe and nothing else: it takes no lock, and it does not matter
    which thread the kernel hands the signal to.  The former handlers come back at the end.
    """

    def __init__(self) -> None:
        self._reading, self._writing = os.pipe()
        os.set_blocking(self._writing, False)
        self._former: dict[signal.Signals, object] = {}

    def __enter__(self) -> Self:
        for number in STOP_SIGNALS:
            self._former[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._former.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        os.close(self._reading)
        os.close(self._writing)

    def wait(self, timeout_s: float) -> bool:
        """Wait up to `timeout_s` for the signal; tell whether it has come."""
        ready, _, _ = select.select([self._reading], [], [], max(0.0, timeout_s))
        return bool(ready)

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        with contextlib.suppress(BlockingIOError):  # the pipe is full: the first signal is enough
            os.write(self._writing, b"!")
