"""The journal learns the level of every line; a terminal reads it in words."""

import logging
import os
import sys
from pathlib import Path

import pytest

from cornertouchd.cli.journal import JournalFormatter, is_journal


def record(level: int, text: str) -> logging.LogRecord:
    return logging.LogRecord("cornertouchd", level, __file__, 1, text, (), None)


@pytest.mark.parametrize(
    ("level", "prefix"), [(logging.INFO, "<6>"), (logging.WARNING, "<4>"), (logging.ERROR, "<3>")]
)
def test_the_level_stands_before_the_line(level: int, prefix: str) -> None:
    assert JournalFormatter("%(message)s").format(record(level, "C1 lost")) == f"{prefix}C1 lost"


def test_each_line_of_a_traceback_has_the_level() -> None:
    failed = record(logging.ERROR, "a frame set was lost")
    try:
        int("a stage's bug")
    except ValueError:
        failed.exc_info = sys.exc_info()
    lines = JournalFormatter("%(message)s").format(failed).splitlines()
    assert len(lines) > 3
    assert all(line.startswith("<3>") for line in lines)


def test_the_journal_is_known_by_device_and_inode(tmp_path: Path) -> None:
    with (tmp_path / "stderr").open("w") as stream:
        status = os.fstat(stream.fileno())
        assert is_journal(stream, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino}"})
        assert not is_journal(stream, {"JOURNAL_STREAM": f"{status.st_dev}:{status.st_ino + 1}"})
        assert not is_journal(stream, {})


def test_a_closed_stderr_is_no_journal(tmp_path: Path) -> None:
    with (tmp_path / "stderr").open("w") as stream:
        pass
    assert not is_journal(stream, {"JOURNAL_STREAM": "1:2"})
