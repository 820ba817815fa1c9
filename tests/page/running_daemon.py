"""The daemon as a program, on the simulated rig, and a TUIO client that remembers everything."""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from cornertouchd.wire.tuio_reader import TuioReader

ROOT = Path(__file__).resolve().parents[2]
SURFACE_MM = (350.0, 400.0)
STARTS_WITHIN_S = 110.0
ENDS_WITHIN_S = 20.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class TuioMemory:
    """All places that touches were told at, in millimetres by their session ids."""

    def __init__(self) -> None:
        self.places: dict[int, list[tuple[float, float]]] = defaultdict(list)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port = int(self._socket.getsockname()[1])
        self._thread = threading.Thread(target=self._receive, daemon=True)
        self._thread.start()

    def told_at(self, x_mm: float, y_mm: float) -> set[int]:
        """Return which sessions were ever within a tenth of a millimetre of this place."""
        return {
            session
            for session, places in list(self.places.items())
            if any(abs(x - x_mm) < 0.1 and abs(y - y_mm) < 0.1 for x, y in list(places))
        }

    def close(self) -> None:
        self._socket.close()
        self._thread.join(1.0)

    def _receive(self) -> None:
        reader = TuioReader()
        self._socket.settimeout(0.2)
        while self._socket.fileno() >= 0:
            with contextlib.suppress(TimeoutError, OSError):
                for event in reader.feed(self._socket.recv(65536), "demo", time.monotonic()):
                    if event.kind != "remove":
                        place = event.cursor.x * SURFACE_MM[0], event.cursor.y * SURFACE_MM[1]
                        self.places[event.cursor.id].append(place)


def running_demo(
    directory: Path, page_port: int, tuio_port: int, *more: str
) -> contextlib.AbstractContextManager[None]:
    """Run the demo until the end of the block, which begins when its page answers."""
    tuio = f"127.0.0.1:{tuio_port}"
    command = ("demo", "--tuio", tuio, "--monitor-port", str(page_port), *more)
    return _running(directory, page_port, command)


def running_daemon(
    directory: Path, page_port: int, monitor: str
) -> contextlib.AbstractContextManager[None]:
    """The same with `run` and these lines of [monitor]."""
    config = directory / "touch.toml"
    config.write_text(
        f'[cameras]\nsource = "simulated"\n[monitor]\nport = {page_port}\n{monitor}\n'
    )
    return _running(directory, page_port, ("run", "--config", str(config)))


@contextlib.contextmanager
def _running(directory: Path, page_port: int, command: tuple[str, ...]) -> Iterator[None]:
    log = directory / "daemon.log"
    with log.open("ab") as said:
        daemon = subprocess.Popen(
            [sys.executable, "-m", "cornertouchd", *command],
            stdout=said,
            stderr=said,
            env={
                **os.environ,
                "PYTHONPATH": str(ROOT),
                "RUNTIME_DIRECTORY": str(directory),
                "STATE_DIRECTORY": str(directory),
            },
        )
        try:
            wait_for_page(f"http://127.0.0.1:{page_port}/", daemon, log)
            yield
        finally:
            daemon.terminate()
            daemon.wait(ENDS_WITHIN_S)


def wait_for_page(address: str, daemon: subprocess.Popen[bytes], log: Path) -> None:
    until_s = time.monotonic() + STARTS_WITHIN_S
    while time.monotonic() < until_s and daemon.poll() is None:
        with contextlib.suppress(OSError), urllib.request.urlopen(address, timeout=5.0):
            return
        time.sleep(0.1)  # until a program outside has started
    pytest.fail(f"no page at {address}: {log.read_text(errors='replace')[-2000:]}")
