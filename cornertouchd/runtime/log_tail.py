"""The last lines of the log, for whoever asks the daemon."""

import json
import logging
from collections import deque
from typing import Self

LINES_KEPT = 200


class LogTail(logging.Handler):
    """Keeps what our logger said last.  Use as a context manager; any thread may ask."""

    def __init__(self, lines_kept: int = LINES_KEPT) -> None:
        super().__init__()
        self._lines: deque[dict[str, object]] = deque(maxlen=lines_kept)

    def __enter__(self) -> Self:
        logging.getLogger("cornertouchd").addHandler(self)
        return self

    def __exit__(self, *_: object) -> None:
        logging.getLogger("cornertouchd").removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Keep a record."""
        text = self.format(record)
        self._lines.append({"at": record.created, "level": record.levelname, "text": text})

    def as_json(self) -> bytes:
        """Return `{"lines": [{"at", "level", "text"}, ...]}`, the oldest first; at is Unix time."""
        self.acquire()
        try:
            lines = list(self._lines)
        finally:
            self.release()
        return json.dumps({"lines": lines}).encode()
