"""How long frame sets take from the picture to the receivers, as a histogram."""

from bisect import bisect_left
from dataclasses import dataclass

BOUNDS_S = (
    0.002, 0.003, 0.004, 0.005, 0.006, 0.008, 0.01, 0.012, 0.015, 0.02, 0.025, 0.03, 0.04, 0.05,
    0.075, 0.1, 0.25,
)  # fmt: skip
"""Upper bounds of the buckets: a millisecond apart where a rig in order is, wider above."""


@dataclass(frozen=True, slots=True)
class Latency:
    """What was noted: `counts` of the buckets, the last of which has no bound; sum and number."""

    bounds_s: tuple[float, ...] = BOUNDS_S
    counts: tuple[int, ...] = (0,) * (len(BOUNDS_S) + 1)
    sum_s: float = 0.0

    def quantile_s(self, share: float) -> float | None:
        """Return the bound that this share of the frame sets is below; None without any.

        Infinite if that is beyond the last bound.
        """
        left = share * sum(self.counts)
        if not left:
            return None
        for bound_s, count in zip((*self.bounds_s, float("inf")), self.counts, strict=True):
            left -= count
            if left <= 0.0:
                return bound_s
        return float("inf")


NO_LATENCY = Latency()


class LatencyHistogram:
    """Notes latencies.  `note` is for one thread and takes .3 us; any may read."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_S) + 1)
        self._sum_s = 0.0

    def note(self, latency_s: float) -> None:
        """Count one frame set."""
        self._counts[bisect_left(BOUNDS_S, latency_s)] += 1
        self._sum_s += latency_s

    def read(self) -> Latency:
        """Return what was noted so far."""
        return Latency(counts=tuple(self._counts), sum_s=self._sum_s)
