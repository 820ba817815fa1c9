"""The daemon's Unix socket: whoever connects asks for one thing by its name and is told.

He sends one line of JSON, `{"ask": NAME, ...}`.  What comes back depends on the name: one JSON
document and the end, or a stream until one of both has enough.
"""

import contextlib
import errno
import json
import logging
import os
import socket
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Self

from cornertouchd.errors import ReportedError

SOCKET_NAME = "status.sock"
MODE = 0o660
"""The user and the group of the daemon, nobody else: the answers name devices and receivers."""

LOOK_S = 0.2
"""How often it is looked whether to stop while nobody connects."""

ASK_WITHIN_S = 1.0
"""Programs ask at once; who connects and does not keeps a thread waiting."""

READ_WITHIN_S = 5.0
"""Who takes nothing for so long has died or hangs."""

LONGEST_LINE = 4096
MOST_ASKERS = 32
"""Each has a thread: a monitor, a recording, some status at once."""

WAITING = 16

_log = logging.getLogger("cornertouchd")


class RefusedError(ReportedError):
    """What is asked is not answered; the text says why."""


class Asker:
    """Whoever asks, while he is told.  Used by one thread."""

    def __init__(
        self,
        connection: socket.socket,
        request: Mapping[str, Any],
        rest: bytes,
        stopping: threading.Event,
    ) -> None:
        self._connection = connection
        self._stopping = stopping
        self._received = bytearray(rest)
        self._has_left = False
        self.request = request

    @property
    def has_enough(self) -> bool:
        """Whether the stream is to end: he has left, or the daemon stops."""
        return self._has_left or self._stopping.is_set()

    def send(self, data: bytes | bytearray | memoryview) -> None:
        """Tell him; waits for him if he is slow.  Raises `OSError` when he is gone or hangs."""
        self._connection.sendall(data)

    def pause(self, seconds: float) -> None:
        """Wait; not for long if the daemon stops."""
        self._stopping.wait(seconds)

    def further(self) -> list[Mapping[str, Any]]:
        """Return what else he has sent since, a JSON object a line; does not wait.

        Lines that are no objects are left out.  One that never ends counts as leaving.
        """
        patience_s = self._connection.gettimeout()
        self._connection.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while not self._has_left:
                part = self._connection.recv(LONGEST_LINE)
                self._received += part
                self._has_left = not part or len(self._received) > 16 * LONGEST_LINE
        self._connection.settimeout(patience_s)
        *lines, rest = bytes(self._received).split(b"\n")
        self._received[:] = rest
        objects = (_as_object(line) for line in lines)
        return [one for one in objects if one is not None]


Answer = Callable[[Asker], None]
"""Tells one who asks; called in a thread of its own.

May raise `OSError` of `Asker.send`, and `RefusedError` before anything was sent.
"""


def document(tell: Callable[[], bytes]) -> Answer:
    """Return an answer that is one document."""
    return lambda asker: asker.send(tell())


class AskSocket:
    """Answers at `path`, by the name that is asked for.  Use as a context manager.

    A socket that cannot be made is logged: the daemon does its work without it.  One that a daemon
    left behind that has died is replaced, one that is answered is left alone.
    """

    def __init__(self, path: Path, answers: Mapping[str, Answer]) -> None:
        self._path = path
        self._answers = answers
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._connections: dict[socket.socket, threading.Thread] = {}
        self._failed: set[str] = set()

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
            target=self._serve, args=(listening,), name="asking", daemon=True
        )
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._thread is None:
            return
        self._stop.set()
        self._thread.join(READ_WITHIN_S)
        with self._lock:
            left = dict(self._connections)
            for connection in left:
                with contextlib.suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
        for thread in left.values():
            thread.join(LOOK_S)
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _serve(self, listening: socket.socket) -> None:
        with listening:
            listening.settimeout(LOOK_S)
            while not self._stop.is_set():
                with contextlib.suppress(OSError):
                    connection, _ = listening.accept()
                    self._take(connection)

    def _take(self, connection: socket.socket) -> None:
        with self._lock:
            if len(self._connections) < MOST_ASKERS:
                thread = threading.Thread(
                    target=self._tell, args=(connection,), name="asked", daemon=True
                )
                self._connections[connection] = thread
                thread.start()
                return
        with connection, contextlib.suppress(OSError):
            connection.settimeout(LOOK_S)
            connection.recv(LONGEST_LINE)  # what is not read would cut off the answer
            connection.sendall(_error(f"{MOST_ASKERS} are asking already; close one of them"))

    def _tell(self, connection: socket.socket) -> None:
        try:
            with connection, contextlib.suppress(OSError):
                self._answer(connection)
        finally:
            with self._lock:
                del self._connections[connection]

    def _answer(self, connection: socket.socket) -> None:
        line, rest = _read_line(connection)
        connection.settimeout(READ_WITHIN_S)
        request = _as_object(line)
        if request is None:
            connection.sendall(_error('send one line of JSON first: {"ask": "status"}'))
            return
        name = str(request.get("ask", ""))
        answer = self._answers.get(name)
        if answer is None:
            known = ", ".join(self._answers)
            connection.sendall(_error(f"ask = {name[:40]!r}: must be one of {known}"))
            return
        try:
            answer(Asker(connection, request, rest, self._stop))
        except OSError:
            raise  # he is gone
        except RefusedError as error:
            connection.sendall(_error(str(error)))
        except Exception as error:  # noqa: BLE001  touches go on, whatever cannot be told
            if name not in self._failed:
                self._failed.add(name)
                _log.exception("%s cannot be told", name)
            connection.sendall(_error(f"{name} cannot be told: {error!r}"))


def open_stream(path: Path, ask: str, **arguments: object) -> socket.socket:
    """Ask the daemon at this socket and return the connection.  Raises `OSError` if none is."""
    connection = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        connection.settimeout(READ_WITHIN_S)
        connection.connect(str(path))
        connection.sendall(json.dumps({"ask": ask, **arguments}).encode() + b"\n")
    except OSError:
        connection.close()
        raise
    return connection


def read_document(path: Path, ask: str, **arguments: object) -> dict[str, Any]:
    """Return the document that the daemon at this socket answers with.

    Raises `OSError` if no daemon answers, `RefusedError` if it does not tell, or is none.
    """
    with open_stream(path, ask, **arguments) as connection:
        parts = []
        while part := connection.recv(65536):
            parts.append(part)
    told = _as_object(b"".join(parts))
    if told is None:
        raise RefusedError(f"{path}: is no socket of cornertouchd: it does not answer in JSON")
    if set(told) == {"error"}:
        raise RefusedError(f"{path}: {told['error']}")
    return told


def _read_line(connection: socket.socket) -> tuple[bytes, bytes]:
    """Return the first line, and what came with it behind that; empty if none came in time."""
    until_s = time.monotonic() + ASK_WITHIN_S
    received = b""
    while b"\n" not in received and len(received) < LONGEST_LINE:
        left_s = until_s - time.monotonic()
        if left_s <= 0.0:
            return b"", b""
        connection.settimeout(left_s)
        try:
            part = connection.recv(LONGEST_LINE)
        except TimeoutError:
            return b"", b""
        if not part:
            break
        received += part
    line, _, rest = received.partition(b"\n")
    return line, rest


def _as_object(line: bytes) -> dict[str, Any] | None:
    try:
        told = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return told if isinstance(told, dict) else None


def _error(text: str) -> bytes:
    return json.dumps({"error": text}).encode()


def _listen(path: Path) -> socket.socket:
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_socket():
        if _is_answered(path):
            raise OSError(errno.EADDRINUSE, os.strerror(errno.EADDRINUSE))
        path.unlink()
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


def _is_answered(path: Path) -> bool:
    try:
        open_stream(path, "status").close()
    except OSError:
        return False
    return True
