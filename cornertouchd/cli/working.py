"""What `run` and `demo` share: start a daemon, wait for the signal, stop it, say what happened."""

import logging
from collections.abc import Callable
from pathlib import Path

import click

from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.stop_signal import StopSignal

REPORT_S = 1.0
"""Time between two looks at what the daemon does."""


def log_to_stderr(level: int = logging.INFO) -> None:
    """Log as a service does: one line each, the journal adds the time."""
    logging.basicConfig(level=level, format="%(levelname)s %(message)s", force=True)


def work(
    daemon: Daemon, stop: StopSignal, seconds: float | None, report: Callable[[Daemon], None]
) -> None:
    """Run the daemon until the signal comes or `seconds` are over; report once a second."""
    daemon.start()
    try:
        left_s = float("inf") if seconds is None else seconds
        while left_s > 0 and not stop.wait(min(REPORT_S, left_s)):
            left_s -= REPORT_S
            report(daemon)
    finally:
        daemon.stop()


def config_name(path: Path | None) -> str:
    """Return what tells this configuration from others on the same machine."""
    return str(path.resolve()) if path else ""


def write_picture(path: Path, picture: bytes) -> None:
    """Write a picture.  Raises `click.ClickException` if the disk refuses."""
    try:
        path.write_bytes(picture)
    except OSError as error:
        raise click.ClickException(f"{path}: cannot be written: {error.strerror}") from error
