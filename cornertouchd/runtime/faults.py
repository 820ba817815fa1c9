"""Repeated faults are logged once, then counted, then their end is logged."""

import logging

GOOD_TO_RECOVER = 50
"""Half a second of pictures without a fault ends it; what comes and goes faster is one fault."""


class FaultLog:
    """Speaks about the faults of one part of the daemon, `name`.  Used by one thread."""

    def __init__(self, name: str) -> None:
        self._log = logging.getLogger("cornertouchd")
        self._name = name
        self._last_kind = ""
        self._in_a_row = 0
        self._good_in_a_row = 0
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
            text = f"{self._name}: {kind}" + (f": {detail}" if str(detail) else "")
            self._log.error(text, exc_info=traceback_of)

    def good(self) -> None:
        """Count that it worked; after enough of that, log that the faults are over."""
        if not self._in_a_row:
            return
        self._good_in_a_row += 1
        if self._good_in_a_row >= GOOD_TO_RECOVER:
            faults = "1 fault" if self._in_a_row == 1 else f"{self._in_a_row} faults"
            self._log.warning("%s: works again after %s", self._name, faults)
            self._in_a_row = 0
            self._last_kind = ""
