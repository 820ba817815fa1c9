"""The real clock."""

import time


class MonotonicClock:
    """CLOCK_MONOTONIC: the clock on which drivers stamp pictures."""

    def now_s(self) -> float:
        """Return CLOCK_MONOTONIC seconds."""
        return time.monotonic()

    def sleep_until(self, time_s: float) -> None:
        """Return when `now_s()` has reached `time_s`."""
        wait_s = time_s - self.now_s()
        if wait_s > 0:
            time.sleep(wait_s)
