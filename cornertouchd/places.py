"""Where the daemon keeps things: state that must last, and caches that may be lost."""

from collections.abc import Mapping
from pathlib import Path

SERVICE_STATE = Path("/var/lib/cornertouchd")
SERVICE_RUNTIME = Path("/run/cornertouchd")


def state_directory(environ: Mapping[str, str]) -> Path:
    """Return the directory of calibrations.

    systemd's $STATE_DIRECTORY, else /var/lib/cornertouchd if it exists, else the user's own.
    """
    if environ.get("STATE_DIRECTORY"):
        return Path(environ["STATE_DIRECTORY"].split(":")[0])
    if SERVICE_STATE.is_dir():
        return SERVICE_STATE
    return _user_directory(environ, "XDG_STATE_HOME", ".local/state")


def cache_directory(environ: Mapping[str, str]) -> Path:
    """Return the directory of caches: systemd's $CACHE_DIRECTORY, else the user's own."""
    if environ.get("CACHE_DIRECTORY"):
        return Path(environ["CACHE_DIRECTORY"].split(":")[0])
    return _user_directory(environ, "XDG_CACHE_HOME", ".cache")


def runtime_directory(environ: Mapping[str, str]) -> Path:
    """Return the directory of sockets: systemd's $RUNTIME_DIRECTORY, else the user's own."""
    if environ.get("RUNTIME_DIRECTORY"):
        return Path(environ["RUNTIME_DIRECTORY"].split(":")[0])
    return _user_directory(environ, "XDG_RUNTIME_DIR", ".local/run")


def installed_kernels(prefix: str) -> Path:
    """Return where an installation under `prefix` keeps what it has compiled for all users."""
    return Path(prefix) / "compiled"


def _user_directory(environ: Mapping[str, str], variable: str, otherwise: str) -> Path:
    base = environ.get(variable) or str(Path.home() / otherwise)
    return Path(base) / "cornertouchd"
