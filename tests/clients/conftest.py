"""Real TUIO programs, each in its own process, and the way from our sink to them."""

import contextlib
import os
import random
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NoReturn

import pytest

from cornertouchd.devices.stream_hub import StreamHub, StreamLink
from cornertouchd.devices.tuio_sink import TuioReceiver, TuioSink
from cornertouchd.devices.udp_destination import UdpDestination
from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio_blobs import Profile

HERE = Path(__file__).parent
DEADLINE_S = 15.0
WIDTH_MM, HEIGHT_MM = 800.0, 450.0
DISPLAY = DisplayMapping(0.0, 0.0, WIDTH_MM, HEIGHT_MM)
DIAMETER_MM = 9.0

Ways = Sequence[tuple[UdpDestination | StreamLink, tuple[Profile, ...]]]
Place = tuple[float, float]  # shares of the display, from its top-left corner


class ClientProgram:
    """A running client, and what it has said so far.

    `touches` are those it shows now, x and y by its id.  `added` are the places where touches came
    since `forget`, `updates` and `removed` how many moved and went.
    """

    def __init__(self, name: str, command: list[str], port: int) -> None:
        self.name = name
        self.port = port
        self.touches: dict[str, Place] = {}
        self.added: list[Place] = []
        self.updates = 0
        self.removed = 0
        self.said: list[str] = []
        self._ended = False
        self._changed = threading.Condition()
        self._process = subprocess.Popen(
            [*command, str(port)],
            cwd=HERE,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        """Return as soon as the condition holds; fail the test if it never does."""
        with self._changed:
            self._changed.wait_for(lambda: condition() or self._ended, DEADLINE_S)
            if not condition():
                pytest.fail(f"{self.name}: {what} never came; touches {self.touches}; {self.said}")

    def wait_for_places(self, *places: Place) -> None:
        """Wait until exactly these places are touched."""
        wanted = sorted(places)
        self.wait_until(lambda: sorted(self.touches.values()) == wanted, f"touches at {wanted}")

    def forget(self) -> None:
        """Count anew."""
        with self._changed:
            self.added = []
            self.updates = self.removed = 0

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        try:
            self._process.wait(DEADLINE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(DEADLINE_S)
        self._process.stdout.close()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with self._changed:
                self._take(line.split())
                self._changed.notify_all()
        with self._changed:
            self._ended = True
            self._changed.notify_all()

    def _take(self, words: list[str]) -> None:
        match words:
            case ["add", id_, x, y]:
                self.touches[id_] = _place(x, y)
                self.added.append(self.touches[id_])
            case ["update", id_, x, y]:
                self.touches[id_] = _place(x, y)
                self.updates += 1
            case ["remove", id_, _, _]:
                del self.touches[id_]
                self.removed += 1
            case _:
                self.said.append(" ".join(words))


def _place(x: str, y: str) -> Place:
    """To a thousandth of the display, since the clients compute in single precision."""
    return round(float(x), 3), round(float(y), 3)


def _give_up(reason: str) -> NoReturn:
    if os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS") == "1":
        pytest.fail(f"CORNERTOUCHD_REQUIRE_CLIENTS=1, but {reason}")
    pytest.skip(reason)


def _npm_command(program: str) -> list[str]:
    node = shutil.which("node")
    if node is None:
        _give_up("node is not installed")
    named = os.environ.get("CORNERTOUCHD_NPM_DIR")
    folders = [Path(named), Path(named, "node_modules")] if named else [HERE / "node_modules"]
    for folder in folders:
        if (folder / "tuio-client").is_dir() and (folder / "osc-js").is_dir():
            return [node, program, str(folder.resolve())]
    _give_up(f"tuio-client and osc-js are not in {folders[-1]}; run npm ci in {HERE}")


COMMANDS: dict[str, Callable[[], list[str]]] = {
    "kivy": lambda: [sys.executable, "kivy_client.py"],
    "qt": lambda: [sys.executable, "qt_client.py"],
    "npm": lambda: _npm_command("npm_client.mjs"),
    "python-tuio": lambda: [sys.executable, "python_tuio_client.py"],
}
"""Programs that listen to UDP."""

CONNECTING: dict[str, Callable[[], list[str]]] = {
    "npm over WebSocket": lambda: _npm_command("npm_websocket_client.mjs"),
    "TCP": lambda: [sys.executable, "tcp_client.py"],
}
"""Programs that connect to a server of ours."""


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@contextlib.contextmanager
def running(name: str, command: list[str], port: int) -> Iterator[ClientProgram]:
    """A client that is ready."""
    program = ClientProgram(name, command, port)
    try:
        program.wait_until(lambda: bool(program.said), "ready")
        if program.said[0].startswith("missing"):
            reason = program.said[0].removeprefix("missing ")
            _give_up(f"{name}: {reason}; install the extra cornertouchd[clients]")
        assert program.said[0] == "ready"
        yield program
    finally:
        program.close()


@pytest.fixture(scope="session", params=COMMANDS)
def running_client(request: pytest.FixtureRequest) -> Iterator[ClientProgram]:
    name: str = request.param
    with running(name, COMMANDS[name](), free_port()) as program:
        yield program


@pytest.fixture
def client(running_client: ClientProgram) -> ClientProgram:
    """A client that shows no touches and has not told of any."""
    with_nothing = Tracker(running_client.port)
    with_nothing.sink.close()
    with_nothing.kill()
    running_client.wait_for_places()
    running_client.forget()
    return running_client


class Tracker:
    """Our sink with a clock of its own: a hundred frames a second, sent as fast as they come."""

    _starts = 0

    def __init__(self, *ports: int, hub: StreamHub | None = None, links: Ways = ()) -> None:
        Tracker._starts += 1  # as time gives it: each start is far ahead of the one before
        seed = 1_000_000 * Tracker._starts
        receivers = [
            *(TuioReceiver(UdpDestination("127.0.0.1", port), DISPLAY) for port in ports),
            *(TuioReceiver(link, DISPLAY, profiles) for link, profiles in links),
        ]
        self.sink = TuioSink(receivers, "test@127.0.0.1", seed, seed, hub=hub)
        self.now_s = 0.0

    def send(self, places: dict[int, Place]) -> None:
        """Send one frame: the places of touches by their tracker's ids."""
        self.now_s += 0.01
        touches = (
            Touch(id_, x * WIDTH_MM, y * HEIGHT_MM, 10.0, 5.0, 0.0, DIAMETER_MM)
            for id_, (x, y) in places.items()
        )
        self.sink.send(TouchFrame(self.now_s, tuple(touches)), self.now_s)

    def rest(self, seconds: float) -> None:
        """Let time pass in which no frame comes."""
        for _ in range(round(seconds / 0.025)):
            self.now_s += 0.025
            self.sink.tick(self.now_s)

    def kill(self) -> None:
        """End without a farewell, as a killed process does."""
        for destination in self.sink._destinations:
            destination.close()


@pytest.fixture
def start_tracker() -> Iterator[Callable[[int], Tracker]]:
    trackers: list[Tracker] = []

    def start(port: int) -> Tracker:
        trackers.append(Tracker(port))
        return trackers[-1]

    yield start
    for tracker in trackers:
        tracker.kill()


class LossyRelay:
    """Passes datagrams on, but loses each with the same probability, by a seed."""

    def __init__(self, target_port: int, loss: float, seed: int) -> None:
        self.lost = 0
        self.passed = 0
        self._loss = loss
        self._random = random.Random(seed)
        self._target = ("127.0.0.1", target_port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ender:
            ender.sendto(b"", ("127.0.0.1", self.port))
        self._thread.join(DEADLINE_S)
        self._socket.close()

    def _run(self) -> None:
        while datagram := self._socket.recv(65536):
            if self._random.random() < self._loss:
                self.lost += 1
            else:
                self.passed += 1
                self._socket.sendto(datagram, self._target)


@pytest.fixture
def lossy_relay(client: ClientProgram) -> Iterator[LossyRelay]:
    """A way to the client that loses one packet in five."""
    relay = LossyRelay(client.port, loss=0.2, seed=11)
    yield relay
    relay.close()
