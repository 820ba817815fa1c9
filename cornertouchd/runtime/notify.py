"""What the service manager is told: sd_notify(3), datagrams on $NOTIFY_SOCKET."""

import contextlib
import os
import socket
import time
from collections.abc import Mapping


class ServiceManager:
    """systemd, as it listens to the process that it started; without it nothing is said.

    Never blocks and never raises: a manager that does not listen is no reason to lose a touch.
    """

    def __init__(self, environ: Mapping[str, str]) -> None:
        address = environ.get("NOTIFY_SOCKET", "")
        # "@" stands for the zero byte of the abstract namespace
        self._address = "\0" + address[1:] if address.startswith("@") else address
        self._socket: socket.socket | None = None
        if self._address:
            with contextlib.suppress(OSError):
                self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
                self._socket.setblocking(False)
        self.watchdog_s = _watchdog_s(environ)

    @property
    def listens(self) -> bool:
        """Whether anybody asked to be told."""
        return self._socket is not None

    def ready(self, status: str) -> None:
        """Tell that the daemon does what it is for, or does so again after reloading."""
        self._tell("READY=1", f"STATUS={status}")

    def status(self, status: str) -> None:
        """Tell in one line what the daemon does now."""
        self._tell(f"STATUS={status}")

    def alive(self) -> None:
        """Feed the watchdog."""
        self._tell("WATCHDOG=1")

    def reloading(self) -> None:
        """Tell that the configuration is read again; `ready` ends it."""
        now_us = time.clock_gettime_ns(time.CLOCK_MONOTONIC) // 1000
        self._tell("RELOADING=1", f"MONOTONIC_USEC={now_us}")

    def stopping(self) -> None:
        """Tell that the daemon ends."""
        self._tell("STOPPING=1", "STATUS=stopping")

    def close(self) -> None:
        """Say no more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _tell(self, *lines: str) -> None:
        if self._socket is None:
            return
        with contextlib.suppress(OSError):
            # a line break within a line would begin another
            message = "\n".join(line.replace("\n", "; ") for line in lines)
            self._socket.sendto(message.encode(errors="replace"), self._address)


def _watchdog_s(environ: Mapping[str, str]) -> float | None:
    """Return how long the watchdog waits, None if it does not watch this process."""
    given = environ.get("WATCHDOG_USEC", "")
    watched = environ.get("WATCHDOG_PID", "") or str(os.getpid())
    if not given.isdecimal() or int(given) == 0 or watched != str(os.getpid()):
        return None
    return int(given) / 1e6
