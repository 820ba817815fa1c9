"""What `run` and `demo` share: start a daemon, wait for the signal, stop it, say what happened."""

import os
from collections.abc import Callable
from pathlib import Path

import click

from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.stop_signal import StopSignal

REPORT_S = 1.0
"""Time between two looks at what the daemon does."""


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


def require_writable(path: Path | None) -> None:
    """Raise `click.ClickException` unless a file can be put there; ask before the work is done."""
    if path is None:
        return
    above = path.parent
    while not above.exists():
        above = above.parent
    if path.exists() and not path.is_file():
        raise click.ClickException(f"{path}: is not a regular file; name another")
    if not above.is_dir() or not os.access(above, os.W_OK | os.X_OK):
        raise click.ClickException(
            f"{path}: {above} cannot be written to; name another place, or be a user who may"
        )


def write_picture(path: Path, picture: bytes) -> None:
    """Write a picture.  Raises `click.ClickException` if the disk refuses."""
    try:
        path.write_bytes(picture)
    except OSError as error:
        raise click.ClickException(f"{path}: cannot be written: {error.strerror}") from error
