"""What several commands share: names of configurations, files that are to be written."""

import os
from pathlib import Path

import click


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
