"""SIGINT and SIGTERM, so that every command ends in the same clean way."""

import signal
from typing import Self

STOP_SIGNALS = frozenset({signal.SIGINT, signal.SIGTERM})


class StopSignal:
    """Waits for SIGINT or SIGTERM.  Use as a context manager, in the main thread.

    The signals are blocked and waited for: no handler ever interrupts a lock that is being taken.
    Threads started inside inherit that, so the main thread is the one that hears them.
    """

    def __init__(self) -> None:
        self._came = False

    def __enter__(self) -> Self:
        signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
        return self

    def __exit__(self, *_: object) -> None:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)

    def wait(self, timeout_s: float) -> bool:
        """Wait up to `timeout_s` for the signal; tell whether it has come."""
        if not self._came:
            self._came = signal.sigtimedwait(STOP_SIGNALS, max(0.0, timeout_s)) is not None
        return self._came
