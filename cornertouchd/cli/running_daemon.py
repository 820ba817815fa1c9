"""Where the running daemon is asked."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from cornertouchd.cli.working import config_name
from cornertouchd.places import SERVICE_RUNTIME, runtime_directory
from cornertouchd.runtime.asking import SOCKET_NAME, RefusedError, read_document


def socket_of(surface: str | None = None) -> Path:
    """Return where the service is asked, or the daemon of this user if there is no service.

    Of several that run as cornertouchd@SURFACE, that of this surface.
    """
    if surface:
        return SERVICE_RUNTIME / surface / SOCKET_NAME
    of_service = SERVICE_RUNTIME / SOCKET_NAME
    return of_service if of_service.exists() else runtime_directory(os.environ) / SOCKET_NAME


def find_daemon(config_file: Path | None) -> Path | None:
    """Return the socket of the daemon that runs with this configuration, None if none does."""
    name = config_name(config_file)
    for path in _sockets():
        hello = _hello(path)
        if hello is not None and hello.get("configuration") == name:
            return path
    return None


def _sockets() -> Iterator[Path]:
    own = runtime_directory(os.environ) / SOCKET_NAME
    here = (own, SERVICE_RUNTIME / SOCKET_NAME, *sorted(SERVICE_RUNTIME.glob(f"*/{SOCKET_NAME}")))
    return (path for path in dict.fromkeys(here) if path.exists())


def _hello(path: Path) -> dict[str, Any] | None:
    try:
        return read_document(path, "hello")
    except PermissionError:
        click.echo(
            f"Warning: {path}: may not be asked by this user; be in the group cornertouchd",
            err=True,
        )
    except (OSError, RefusedError):
        pass  # it has died, or is just starting
    return None
