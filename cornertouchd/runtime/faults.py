"""Repeated faults are logged once, then counted, then their end is logged."""

import logging
import time
from collections import deque
from collections.abc import Callable

GOOD_TO_RECOVER = 50
"""Half a second of pictures without a fault ends it; what comes and goes faster is one fault."""

MOST_LINES, IN_S = 10, 60.0
"""A loose plug can come and go every second for weeks: ten lines a minute tell as much about it as
a hundred, and leave room in the journal for what else happens."""


class FaultLog:
    """Speaks about the faults of one part of the daemon, `name`.  Used by one thread."""

    def __init__(self, name: str, now_s: Callable[[], float] = time.monotonic) -> None:
        self._log = logging.getLogger("cornertouchd")
        self._name = name
        self._now_s = now_s
        self._last_kind = ""
        self._in_a_row = 0
        self._good_in_a_row = 0
        self._told_at_s: deque[float] = deque(maxlen=MOST_LINES)
        self._is_silent = False
        self.count = 0

    def fault(
        self, kind: str, detail: object = "", *, traceback_of: BaseException | None = None
    ) -> None:
        """Count a fault; log it unless the one before was of the same kind.

        `detail` may differ from one to the next; `traceback_of` is logged with its traceback.
        """
        self.count += 1
        self._in_a_row += 1
        self._good_in_a_row = 0
        if kind != self._last_kind:
            self._last_kind = kind
            text = kind + (f": {detail}" if str(detail) else "")
            self._tell(logging.ERROR, text, traceback_of)

    def good(self) -> None:
        """Count that it worked; after enough of that, log that the faults are over.

        Where too much was said of late, later: the last word must be true.
        """
        if not self._in_a_row:
            return
        self._good_in_a_row += 1
        if self._good_in_a_row >= GOOD_TO_RECOVER and not self._has_said_enough():
            faults = "1 fault" if self._in_a_row == 1 else f"{self._in_a_row} faults"
            self._tell(logging.WARNING, f"works again after {faults}")
            self._in_a_row = 0
            self._last_kind = ""

    def _tell(self, level: int, text: str, traceback_of: BaseException | None = None) -> None:
        """Log a line, unless there were too many of late."""
        if self._has_said_enough():
            if not self._is_silent:
                self._log.warning(
                    "%s: more than %d messages within %g s; until it works again, faults are "
                    "counted only",
                    self._name,
                    MOST_LINES,
                    IN_S,
                )
            self._is_silent = True
            return
        self._is_silent = False
        self._told_at_s.append(self._now_s())
        self._log.log(level, f"{self._name}: {text}", exc_info=traceback_of)

    def _has_said_enough(self) -> bool:
        since_s = self._now_s() - self._told_at_s[0] if self._told_at_s else IN_S
        return len(self._told_at_s) == MOST_LINES and since_s < IN_S
