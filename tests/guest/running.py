"""The daemon as a process in the guest, and what it says, by the clock."""

import contextlib
import os
import re
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

from uvc.rig import device
from uvc.show import CAMERAS, HEIGHT_PX, RATE_HZ, SURFACE_MM, WIDTH_PX, Show

STARTS_S = 120.0
ENDS_S = 10.0


def write_config(path: Path, show: Show, more: str = "", rate_hz: float = RATE_HZ) -> Path:
    """Write the settings of the simulated kiosk; `more` follows [cameras]."""
    lines = [
        "[surface]",
        f"width_mm = {SURFACE_MM[0]}",
        f"height_mm = {SURFACE_MM[1]}",
        "[calibration]",
        f'file = "{show.calibration}"',
        "[cameras]",
        f"width_px = {WIDTH_PX}",
        f"height_px = {HEIGHT_PX}",
        f"rate_hz = {rate_hz}",
        more,
    ]
    for camera in CAMERAS:
        lines += [f"[cameras.{camera}]", f'device = "{device(camera)}"']
    path.write_text("\n".join(lines) + "\n")
    return path


class RunningDaemon:
    """`cornertouchd run`; `said` are its messages, each with the time when it came.

    We are its service manager, too: it tells us every second how it does.
    """

    def __init__(self, config: Path) -> None:
        self.said: list[tuple[float, str]] = []
        self._status = ""
        self._manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._manager.setblocking(False)
        self._manager.bind("")  # the kernel chooses an abstract name
        self.process = subprocess.Popen(
            [sys.executable, "-m", "cornertouchd", "run", "--config", str(config)],
            env={**os.environ, "NOTIFY_SOCKET": "@" + self._manager.getsockname()[1:].decode()},
            stdin=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self._thread = threading.Thread(target=self._read, name="journal", daemon=True)
        self._thread.start()

    def _read(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self.said.append((time.monotonic(), line.rstrip()))
            print(f"   [{self.said[-1][0]:8.2f}] {line.rstrip()}", file=sys.stderr, flush=True)

    def said_since(self, time_s: float) -> list[tuple[float, str]]:
        """Return the messages from a time on."""
        return [(at_s, line) for at_s, line in self.said if at_s >= time_s]

    def has_said(self, pattern: str, since_s: float = 0.0) -> bool:
        """Tell whether a message from that time on matches a regular expression."""
        return any(re.search(pattern, line) for _, line in self.said_since(since_s))

    def is_whole(self) -> bool:
        """Tell whether the last status, of a second or less ago, has all cameras at work."""
        with contextlib.suppress(BlockingIOError):
            while True:
                told = self._manager.recv(4096).decode()
                if "STATUS=" in told:
                    self._status = told
        return f"STATUS={len(CAMERAS)} cameras" in self._status

    def stop(self) -> int:
        """End the daemon as a service manager does, and return its exit status."""
        self.process.terminate()
        try:
            return self.process.wait(timeout=ENDS_S)
        finally:
            self.process.kill()
            self.process.wait()
            self._thread.join()
            assert self.process.stderr is not None
            self.process.stderr.close()
            self._manager.close()
