"""What a process takes of memory and processor, read from /proc."""

import os
import time
from pathlib import Path

PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 2**20
TICKS_PER_S = os.sysconf("SC_CLK_TCK")
SAMPLE_EVERY_S = 1.0

WARM_SHARE, WARM_S = 0.2, 30.0
"""Memory is compared after this share of the time, after `WARM_S` at the latest."""


class ProcessWatch:
    """Samples the memory of a process once a second, and what it and its children work."""

    def __init__(self, pid: int) -> None:
        self._pid = pid
        self._samples_mb: list[float] = []
        self._next_at_s = 0.0
        self._began_at_s = 0.0
        self._worked_s = (0.0, 0.0)
        self._shares = (0.0, 0.0)

    def begin(self) -> None:
        """Count from now."""
        self._began_at_s = time.monotonic()
        self._worked_s = self._work_s()

    def sample(self) -> None:
        """Look, if it is time to; the process must live."""
        now_s = time.monotonic()
        if now_s < self._next_at_s:
            return
        self._next_at_s = now_s + SAMPLE_EVERY_S
        pages = int(Path(f"/proc/{self._pid}/statm").read_text().split()[1])
        self._samples_mb.append(pages * PAGE_MB)
        passed_s = now_s - self._began_at_s
        if passed_s > 0.0:
            own, children = (
                (now - before) / passed_s
                for now, before in zip(self._work_s(), self._worked_s, strict=True)
            )
            self._shares = own, children

    @property
    def rss_mb(self) -> float:
        """Memory in use when it was sampled last."""
        return self._samples_mb[-1] if self._samples_mb else 0.0

    def growth_mb(self) -> float:
        """Return how much memory grew after it was warm: mean of the last tenth less the first."""
        count = len(self._samples_mb)
        warm = self._samples_mb[min(int(WARM_SHARE * count), int(WARM_S / SAMPLE_EVERY_S)) :]
        tenth = max(1, len(warm) // 10)
        first, last = warm[:tenth], warm[-tenth:]
        return sum(last) / len(last) - sum(first) / len(first) if warm else 0.0

    @property
    def own_share(self) -> float:
        """Share of a core that the process took."""
        return self._shares[0]

    @property
    def children_share(self) -> float:
        """Share of a core that its children took."""
        return self._shares[1]

    def _work_s(self) -> tuple[float, float]:
        """Return the processor time of the process and of its living children."""
        own = children = 0.0
        for stat in Path("/proc").glob("[0-9]*/stat"):
            try:
                pid, _, rest = stat.read_text().partition(" (")
            except OSError:  # it has ended meanwhile
                continue
            fields = rest.rpartition(") ")[2].split()
            parent, worked_s = int(fields[1]), (int(fields[11]) + int(fields[12])) / TICKS_PER_S
            if int(pid) == self._pid:
                own = worked_s
            elif parent == self._pid:
                children += worked_s
        return own, children
