"""What this process takes of the machine."""

import os
import resource
from dataclasses import dataclass
from pathlib import Path

STATM = Path("/proc/self/statm")


@dataclass(frozen=True, slots=True)
class ProcessUse:
    """Processor time since the start, and the memory that is in use now (proc_pid_statm(5))."""

    cpu_s: float
    memory_bytes: int


def process_use() -> ProcessUse:
    """Return what this process has taken until now."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    resident_pages = int(STATM.read_text().split()[1])
    return ProcessUse(used.ru_utime + used.ru_stime, resident_pages * os.sysconf("SC_PAGE_SIZE"))
