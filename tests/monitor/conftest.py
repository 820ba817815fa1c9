"""A daemon on the simulated rig with its live page, both as real processes."""

import contextlib
import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

STARTS_WITHIN_S = 300.0
"""A machine that has nothing compiled yet takes minutes."""

DEADLINE_S = 30.0


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def wait_until(condition: Callable[[], Any], what: str, within_s: float = DEADLINE_S) -> Any:
    """Return what the condition gives as soon as that is true; fail if it never is."""
    until_s = time.monotonic() + within_s
    while time.monotonic() < until_s:
        if given := condition():
            return given
        time.sleep(0.02)
    pytest.fail(f"{what} did not come within {within_s:g} s")


class RunningDaemon:
    """A command that serves a page, and all that it said so far."""

    def __init__(self, place: Path, port: int, arguments: list[str]) -> None:
        self.port = port
        self.place = place
        self.said: list[str] = []
        self.process = subprocess.Popen(
            [sys.executable, "-m", "cornertouchd", *arguments],
            env={**os.environ, "XDG_RUNTIME_DIR": str(place), "STATE_DIRECTORY": str(place)},
            stderr=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def page_pids(self) -> list[int]:
        """The processes of the page: children of the daemon by that name."""
        asked = ("pgrep", "-P", str(self.process.pid), "-f", "cornertouchd[.]monitor")
        found = subprocess.run(asked, capture_output=True, text=True, check=False)
        return [int(pid) for pid in found.stdout.split()]

    def times_said(self, text: str) -> int:
        return sum(text in line for line in self.said)

    def wait_for(self, text: str, times: int = 1, within_s: float = STARTS_WITHIN_S) -> None:
        def said() -> bool:
            if self.process.poll() is not None:
                pytest.fail(f"it ended, status {self.process.returncode}: {self.said}")
            return self.times_said(text) >= times

        wait_until(said, f"{text!r}; it said {self.said[-20:]}", within_s)

    def get(self, path: str, **headers: str) -> tuple[int, bytes]:
        connection = http.client.HTTPConnection(self.address, timeout=DEADLINE_S)
        with contextlib.closing(connection):
            connection.request("GET", path, headers=headers)
            answer = connection.getresponse()
            return answer.status, answer.read()

    def health(self) -> dict[str, Any]:
        status, body = self.get("/api/health")
        assert status == 200, body
        return dict(json.loads(body))

    def metric(self, line: str) -> float:
        """The value of a line of the metrics, 0 if it is not there yet."""
        for told in self.get("/metrics")[1].decode().splitlines():
            if told.startswith(f"{line} "):
                return float(told.split()[-1])
        return 0.0

    def end(self) -> None:
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self._reader.join(DEADLINE_S)
        self.process.stderr.close()

    def _read(self) -> None:
        for line in self.process.stderr:
            self.said.append(line.rstrip("\n"))


Start = Callable[..., RunningDaemon]


def _demo(place: Path, port: int, *more: str) -> RunningDaemon:
    tuio = f"127.0.0.1:{free_port(socket.SOCK_DGRAM)}"
    arguments = ["demo", "--tuio", tuio, "--monitor-port", str(port), "--speed", "0.5", *more]
    return RunningDaemon(place, port, arguments)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningDaemon]:
    """The demo, shared by tests that leave it as it was."""
    yield from served(_demo(tmp_path_factory.mktemp("demo"), free_port()))


def served(running: RunningDaemon) -> Iterator[RunningDaemon]:
    """Give a daemon whose page has come; end it afterwards."""
    try:
        running.wait_for("live page: http://127.0.0.1")
        yield running
    finally:
        running.end()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start a demo of one's own, or `run` with lines of [monitor]."""
    running: list[RunningDaemon] = []

    def start_one(*monitor: str, arguments: tuple[str, ...] = (), port: int = 0) -> RunningDaemon:
        port = port or free_port()
        if not monitor:
            running.append(_demo(tmp_path, port, *arguments))
            return running[-1]
        running.append(simulated(tmp_path, port, *monitor))
        return running[-1]

    yield start_one
    for one in running:
        one.end()


def simulated(place: Path, port: int, *monitor: str) -> RunningDaemon:
    """Start `run` on a simulated rig with these lines of [monitor]; its time is left to others."""
    config = place / "touch.toml"
    write_config(config, port, *monitor)
    return RunningDaemon(place, port, ["run", "--config", str(config)])


def write_config(path: Path, port: int, *monitor: str) -> None:
    tuio = free_port(socket.SOCK_DGRAM)
    path.write_text(
        "\n".join(
            [
                '[cameras]\nsource = "simulated"\nrate_hz = 25',
                f"[[tuio.destinations]]\nport = {tuio}",
                f"[monitor]\nport = {port}",
                *monitor,
            ]
        )
    )
