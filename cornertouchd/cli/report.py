"""`cornertouchd report`: everything that helps to help, in one zip."""

import os
from datetime import datetime
from pathlib import Path

import click

from cornertouchd.cli.report_parts import parts_of
from cornertouchd.cli.running_daemon import find_daemon
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.config import ConfigError, Settings, find_settings, read_settings
from cornertouchd.runtime.support_report import secrets_in, write_report


@click.command()
@click.argument("file", type=click.Path(path_type=Path, dir_okay=False), required=False)
@click.option(
    "--last",
    "last_s",
    type=FiniteRange(min=0, min_open=True),
    default=10.0,
    show_default=True,
    help="So many seconds of all strips, as far as the daemon keeps them.",
)
@click.option("--config", "config_file", type=click.Path(path_type=Path), help="Settings.")
@click.option(
    "--socket",
    "socket_file",
    type=click.Path(path_type=Path),
    help="The daemon; else the one that runs with these settings, if one does.",
)
def report(
    file: Path | None, last_s: float, config_file: Path | None, socket_file: Path | None
) -> None:
    """Gather everything that helps to help in one zip.

    Configuration without tokens, calibration, status, log, check, versions, cameras, journal and
    the last seconds of all strips. It stays on this machine: send it to whom you like. What is
    missing, with the daemon down for example, is said.
    """
    path, settings = _settings(config_file)
    secrets = secrets_in(_text(path)) if path else ()
    target = file or Path(f"cornertouchd-report-{datetime.now().astimezone():%Y%m%d-%H%M%S}.zip")
    daemon = socket_file or find_daemon(path)
    try:
        contents = write_report(target, parts_of(path, settings, daemon, last_s), secrets)
    except OSError as error:
        raise click.ClickException(f"{target}: cannot be written: {error.strerror}") from error
    click.echo(f"{target} ({target.stat().st_size / 1e6:.1f} MB) holds\n{contents}", err=True)
    click.echo(target)


def _settings(config_file: Path | None) -> tuple[Path | None, Settings]:
    """Return the file and what it says; a bad one is part of the report, too."""
    path = find_settings(config_file, os.environ)
    try:
        return path, read_settings(path) if path else Settings()
    except ConfigError as error:
        click.echo(f"Warning: {error}; the defaults are taken for the report", err=True)
        return path, Settings()


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return ""  # the report says that it cannot be read
