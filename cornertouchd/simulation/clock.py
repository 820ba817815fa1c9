"""A clock whose time passes only when someone waits."""


class SimulatedClock:
    """Fills `ports.Clock` for one thread: waiting takes no time, and the time is then reached."""

    def __init__(self, start_s: float = 1000.0) -> None:
        self._now_s = start_s

    def now_s(self) -> float:
        """Return the time that has been waited for so far."""
        return self._now_s

    def sleep_until(self, time_s: float) -> None:
        """Let the time be `time_s`, or leave it if that has passed."""
        self._now_s = max(self._now_s, time_s)
