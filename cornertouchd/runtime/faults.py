"""Repeated faults are logged once, then counted, then their end is logged."""

import logging


class FaultLog:
    """Speaks about the faults of one part of the daemon.  Used by one thread."""

    def __init__(self, name: str) -> None:
        self._log = logging.getLogger("cornertouchd")
        self._name = name
        self._last = ""
        self._in_a_row = 0
        self.count = 0

    def fault(self, message: str, error: BaseException | None = None) -> None:
        """Count a fault; log it, with the traceback of `error`, unless it is the same as before."""
        self.count += 1
        self._in_a_row += 1
        if message != self._last:
            self._last = message
            self._log.error("%s: %s", self._name, message, exc_info=error)

    def recovered(self) -> None:
        """Log that the faults are over, and how many there were."""
        if self._in_a_row:
            plural = "" if self._in_a_row == 1 else "s"
            self._log.warning(
                "%s: works again after %d fault%s", self._name, self._in_a_row, plural
            )
        self._in_a_row = 0
        self._last = ""
