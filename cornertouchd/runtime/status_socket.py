"""A Unix socket that tells whoever connects how the daemon does, in one JSON document."""

import contextlib
import errno
import logging
import os
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Self

SOCKET_NAME = "status.sock"
MODE = 0o660
"""The user and the group of the daemon, nobody else: the answer names devices and receivers."""

LOOK_S = 0.2
"""How often it is looked whether to stop while nobody connects."""

PATIENCE_S = 1.0
"""Who does not read in this time gets no answer; the next one waits behind him."""

WAITING = 8

_log = logging.getLogger("cornertouchd")


class StatusSocket:
    """Answers at `path` with what `answer` returns.  Use as a context manager.

    A socket that cannot be made is logged: the daemon does its work without it.  One that a daemon
    left behind that has died is replaced, one that is answered is left alone.
    """

    def __init__(self, path: Path, answer: Callable[[], bytes]) -> None:
        self._path = path
        self._answer = answer
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None

    def __enter__(self) -> Self:
        try:
            listening = _listen(self._path)
        except OSError as error:
            _log.warning(
                "%s: no status can be asked for: %s; is another daemon running with the same "
                "runtime directory?",
                self._path,
                error.strerror or error,
            )
            return self
        self._thread = threading.Thread(
            target=self._serve, args=(listening,), name="status", daemon=True
        )
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread is None:
            return
        self._stop.set()
        self._thread.join(PATIENCE_S)
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _serve(self, listening: socket.socket) -> None:
        with listening:
            listening.settimeout(LOOK_S)
            while not self._stop.is_set():
                with contextlib.suppress(OSError):
                    asking, _ = listening.accept()
                    with asking:
                        asking.settimeout(PATIENCE_S)
                        asking.sendall(self._answer())


def read_status(path: Path) -> bytes:
    """Return what the daemon at this socket says.  Raises `OSError` if none does."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
        asking.settimeout(5.0 * PATIENCE_S)
        asking.connect(str(path))
        parts = []
        while part := asking.recv(65536):
            parts.append(part)
    return b"".join(parts)


def _listen(path: Path) -> socket.socket:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_socket():
        try:
            read_status(path)
        except OSError:
            path.unlink()
        else:
            raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE))
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        before = os.umask(0o777 & ~MODE)  # the mode holds from the first moment on
        try:
            listening.bind(str(path))
        finally:
            os.umask(before)
        listening.listen(WAITING)
    except OSError:
        listening.close()
        raise
    return listening
