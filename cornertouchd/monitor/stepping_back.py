"""The page lets the daemon go first."""

import contextlib
import os
from pathlib import Path

NICENESS = 10
"""Touches come first on a machine that has too much to do."""

OOM_SCORE = "1000"
"""Where memory is short, the page goes and not the daemon."""


def step_back() -> None:
    """Ask the system for both; not every one grants that."""
    with contextlib.suppress(OSError):
        os.nice(NICENESS)
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(OOM_SCORE)
