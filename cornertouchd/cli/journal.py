"""What the commands log, and how."""

import logging


def log_to_stderr(level: int = logging.INFO) -> None:
    """Log as a service does: one line each, the journal adds the time."""
    logging.basicConfig(level=level, format="%(levelname)s %(message)s", force=True)
