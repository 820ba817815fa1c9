"""What the commands log, and how."""

import logging
import os
import sys
from collections.abc import Mapping
from typing import TextIO

SYSLOG_LEVELS = {
    logging.DEBUG: 7,
    logging.INFO: 6,
    logging.WARNING: 4,
    logging.ERROR: 3,
    logging.CRITICAL: 2,
}
"""sd-daemon(3): the journal takes <N> at the begin of a line for the level of that line."""


class JournalFormatter(logging.Formatter):
    """Puts the level as the journal understands it before every line, tracebacks included."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the lines of a record."""
        level = SYSLOG_LEVELS.get(record.levelno, 6)
        return "\n".join(f"<{level}>{line}" for line in super().format(record).splitlines())


def log_to_stderr(level: int = logging.INFO) -> None:
    """Log as a service does: one line each, the journal adds the time and knows the level."""
    handler = logging.StreamHandler()
    if is_journal(sys.stderr, os.environ):
        handler.setFormatter(JournalFormatter("%(message)s"))
    else:
        handler.setFormatter(logging.Formatter("%(levelname)s %(message)s"))
    logging.basicConfig(level=level, handlers=[handler], force=True)


def is_journal(stream: TextIO, environ: Mapping[str, str]) -> bool:
    """Tell whether a stream goes to the journal, as $JOURNAL_STREAM says: device and inode."""
    try:
        status = os.fstat(stream.fileno())
    except (OSError, ValueError):  # no file at all, or closed
        return False
    return environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"
