"""The process of the live page: started, watched, started again, ended."""

import contextlib
import json
import logging
import os
import socket
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple, Self

from cornertouchd.config import Settings
from cornertouchd.monitor.options import PageOptions
from cornertouchd.places import state_directory
from cornertouchd.ports import Clock
from cornertouchd.runtime.faults import FaultLog

START_AFTER_S = 1.0
"""The first touches after a start come before the page."""

FIRST_WAIT_S, LONGEST_WAIT_S = 1.0, 60.0
"""A port that another program has is not free again within seconds."""

WELL_AFTER_S = 30.0
"""A page that has been served for so long was well: the next wait is short again."""

END_WITHIN_S = 2.0

_log = logging.getLogger("cornertouchd")


def page_options(
    settings: Settings, daemon_socket: Path, environ: Mapping[str, str]
) -> PageOptions | None:
    """Return how the settings want the page to be served, None if they want none."""
    monitor = settings.monitor
    if not monitor.enabled:
        return None
    return PageOptions(
        os.fspath(daemon_socket),
        monitor.host,
        monitor.port,
        monitor.token,
        monitor.names,
        monitor.allow_actions,
        monitor.viewers_max,
        os.fspath(state_directory(environ) / "recordings"),
    )


class _Child(NamedTuple):
    """The process, and the line to it, by which it knows that we live."""

    process: subprocess.Popen[bytes]
    line: socket.socket


class MonitorProcess:
    """Keeps the live page served as `wanted` says; it is asked at every look.

    Use as a context manager and call `look` often; for one thread.  Nothing waits for the page, and
    whatever becomes of it is told and no more.
    """

    def __init__(
        self,
        wanted: Callable[[], PageOptions | None],
        clock: Clock,
        say: Callable[[str], None] = _log.info,
    ) -> None:
        self._wanted = wanted
        self._options: PageOptions | None = None
        self._clock = clock
        self._say = say
        self._faults = FaultLog("live page", clock.now_s)
        self._child: _Child | None = None
        self._started_at_s = 0.0
        self._wait_s = FIRST_WAIT_S
        self._due_at_s = clock.now_s() + START_AFTER_S
        self._said = b""
        self._reason = ""
        self._is_served = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def look(self) -> None:
        """Start the page if it is wanted and due; hear what it says."""
        self._follow(self._wanted())
        child = self._child
        if child is None:
            if self._options is not None and self._clock.now_s() >= self._due_at_s:
                self._start(self._options)
            return
        self._hear(child)
        if child.process.poll() is not None:
            self._hear(child)  # its last words, which may have come in between
            self._note_end(child)
        elif self._is_served:
            self._faults.good()

    def _follow(self, wanted: PageOptions | None) -> None:
        """End a page that is to be served otherwise: the configuration has changed."""
        if wanted == self._options:
            return
        if self._options is not None:
            self._wait_s, self._due_at_s = FIRST_WAIT_S, self._clock.now_s()
        self._options = wanted
        self.close()

    def close(self) -> None:
        """End the page; takes two seconds at most."""
        child, self._child = self._child, None
        if child is None:
            return
        child.line.close()
        try:
            child.process.wait(END_WITHIN_S)
        except subprocess.TimeoutExpired:
            child.process.kill()
            child.process.wait()

    @property
    def pid(self) -> int | None:
        """The number of the process, None while there is none."""
        return None if self._child is None else self._child.process.pid

    def _start(self, options: PageOptions) -> None:
        self._started_at_s = self._clock.now_s()
        self._said, self._reason, self._is_served = b"", "", False
        command = [sys.executable, "-P", "-m", "cornertouchd.monitor", "--socket", options.socket]
        line, theirs = socket.socketpair()
        line.setblocking(False)
        with theirs:
            end = theirs.fileno()
            line.sendall(options.as_line())
            try:
                process = subprocess.Popen(command, stdin=end, stdout=end)  # noqa: S603  ours
            except OSError as error:
                line.close()
                self._fail(f"cannot be started: {error.strerror}")
                return
        self._child = _Child(process, line)

    def _hear(self, child: _Child) -> None:
        """Pass on what the page says: that it is served, or why not."""
        with contextlib.suppress(OSError):  # it says nothing, or has ended
            self._said += child.line.recv(4096)
        while b"\n" in self._said:
            line, _, self._said = self._said.partition(b"\n")
            said = json.loads(line)
            if "serving" in said:
                self._is_served = True
                self._say(f"live page: {said['serving']}")
            else:
                self._reason = said["failed"]

    def _note_end(self, child: _Child) -> None:
        if self._clock.now_s() - self._started_at_s >= WELL_AFTER_S:
            self._wait_s = FIRST_WAIT_S
        self.close()
        self._fail(self._reason or f"ended with status {child.process.returncode}")

    def _fail(self, reason: str) -> None:
        self._faults.fault("not served", f"{reason}; touches go on")
        self._due_at_s = self._clock.now_s() + self._wait_s
        self._wait_s = min(2.0 * self._wait_s, LONGEST_WAIT_S)
