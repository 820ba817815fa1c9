"""The servers of the daemon as it runs: a crowd of clients, garbage at its ports, its own rules."""

import contextlib
import json
import os
import random
import selectors
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from pythonosc.osc_bundle import OscBundle

from cornertouchd.cli import main
from cornertouchd.runtime.asking import SOCKET_NAME, read_document
from cornertouchd.wire.tuio_stream import PrefixedBundles

DEADLINE_S = 60.0
STARTS_WITHIN_S = 300.0  # where nothing is compiled yet
FUZZ_S = float(os.environ.get("CORNERTOUCHD_FUZZ_SECONDS", "2"))
# What a daemon grows by while it warms up; a connection that leaked its buffers would show, for
# thousands come and go.
LARGEST_GROWTH_BYTES = 24 * 2**20

# Slow enough that a busy machine keeps up, so that whatever is skipped is skipped for the clients.
CONFIGURATION = """
[cameras]
source = "simulated"
rate_hz = 20.0
[pairing]
deadline_ms = 40.0
[simulation]
touches = 10
[tuio.websocket]
enabled = true
port = {websocket}
connections_max = 120
profiles = ["2Dcur", "2Dblb"]
[tuio.tcp]
enabled = true
port = {tcp}
profiles = ["2Dcur"]
[[tuio.destinations]]
port = {udp}
[[tuio.destinations]]
transport = "tcp"
port = {server}
[monitor]
enabled = false
keep_s = 0
"""
SHAKE = (
    b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


class Daemon:
    """`cornertouchd run` on the simulated rig, with all that it serves."""

    def __init__(self, place: Path) -> None:
        self.ports = {
            "websocket": free_port(),
            "tcp": free_port(),
            "udp": free_port(socket.SOCK_DGRAM),
            "server": free_port(),
        }
        self._place = place
        config = place / "kiosk.toml"
        config.write_text(CONFIGURATION.format(**self.ports))
        self.said: list[str] = []
        self.process = subprocess.Popen(
            [sys.executable, "-m", "cornertouchd", "run", "--config", str(config)],
            env={**os.environ, "RUNTIME_DIRECTORY": str(place), "STATE_DIRECTORY": str(place)},
            stderr=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.wait_until(lambda: self.status() is not None, STARTS_WITHIN_S)
        self.wait_until(lambda: self.status()["fusion"]["touches_now"] > 0)

    def status(self) -> Any:
        """What it tells of itself; None while it does not."""
        try:
            return read_document(self._place / SOCKET_NAME, "status")
        except (OSError, json.JSONDecodeError):
            return None

    def destination(self, name: str) -> Any:
        return next(
            each for each in self.status()["destinations"] if each["port"] == self.ports[name]
        )

    def missed_over(self, frame_sets: int) -> int:
        """How many frame sets are missed while so many are not."""
        before = self.status()["fusion"]
        self.wait_until(
            lambda: self.status()["fusion"]["frame_sets"] >= before["frame_sets"] + frame_sets
        )
        after = self.status()["fusion"]
        return int(after["skipped"] + after["dropped"] - before["skipped"] - before["dropped"])

    @property
    def resident_bytes(self) -> int:
        pages = Path(f"/proc/{self.process.pid}/statm").read_text().split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE")

    def wait_until(self, condition: Callable[[], Any], within_s: float = DEADLINE_S) -> None:
        until_s = time.monotonic() + within_s
        while not condition():
            assert self.process.poll() is None, self.said
            assert time.monotonic() < until_s, self.said
            time.sleep(0.05)

    def stop(self) -> None:
        self.process.terminate()
        try:
            self.process.wait(DEADLINE_S)
        finally:
            self.process.kill()
            self._reader.join(DEADLINE_S)
            assert self.process.stderr is not None
            self.process.stderr.close()

    def _read(self) -> None:
        assert self.process.stderr is not None
        self.said.extend(self.process.stderr)


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    running = Daemon(tmp_path_factory.mktemp("daemon"))
    yield running
    running.stop()
    assert running.process.returncode == 0
    assert not any("Traceback" in line for line in running.said), "".join(running.said)


# --- a crowd -------------------------------------------------------------------------------------


class Page:
    """A client over WebSocket that notes the numbers of the frames it is told."""

    def __init__(self, port: int, receive_buffer: int = 0) -> None:
        self.socket = socket.socket()
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(DEADLINE_S)
        self.socket.connect(("127.0.0.1", port))
        self.socket.sendall(SHAKE)
        self.frames: list[int] = []
        self._received = b""
        while b"\r\n\r\n" not in self._received:
            self._received += self.socket.recv(4096)
        head, _, self._received = self._received.partition(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 101 ")

    def read(self) -> None:
        self._received += self.socket.recv(65536)
        while message := self._message():
            (fseq,) = struct.unpack(">i", message[-4:])  # decoding it all would load the machine
            if b"/tuio/2Dcur" in message and fseq >= 0:
                self.frames.append(fseq)

    def _message(self) -> bytes:
        """Take the next whole message out of what was received."""
        head, short = 2, self._received[1] if len(self._received) > 1 else 0
        if short == 126:
            head = 4
        if len(self._received) < head:
            return b""
        length = struct.unpack_from(">H", self._received, 2)[0] if head == 4 else short
        message = self._received[head : head + length]
        if not length or len(message) < length:
            return b""
        self._received = self._received[head + length :]
        return message


def test_fifty_of_a_hundred_pages_are_stuck_and_nobody_misses_a_frame_set(daemon: Daemon) -> None:
    alone = daemon.missed_over(20)
    before = daemon.status()["fusion"]
    with contextlib.ExitStack() as stack, selectors.DefaultSelector() as selector:
        pages = [Page(daemon.ports["websocket"]) for _ in range(50)]
        stuck = [Page(daemon.ports["websocket"], receive_buffer=2048) for _ in range(50)]
        for page in (*pages, *stuck):
            stack.callback(page.socket.close)
        for page in pages:
            selector.register(page.socket, selectors.EVENT_READ, page)
        daemon.wait_until(lambda: daemon.destination("websocket")["clients"] == 100)
        skipped = 0
        look_at_s = 0.0
        until_s = time.monotonic() + DEADLINE_S
        while skipped < 200 or min(len(page.frames) for page in pages) < 40:
            assert time.monotonic() < until_s
            for key, _ in selector.select(1.0):
                key.data.read()
            if time.monotonic() >= look_at_s:
                look_at_s = time.monotonic() + 0.5
                skipped = daemon.destination("websocket")["frames_skipped"]
        after = daemon.status()["fusion"]
    assert after["frame_sets"] > before["frame_sets"]
    assert after["dropped"] == before["dropped"]
    assert after["faults"] == before["faults"]
    # a machine that is too busy for the cameras alone tells nothing about the crowd
    assert after["skipped"] == before["skipped"] or alone > 0
    for page in pages:
        assert page.frames == list(range(page.frames[0], page.frames[-1] + 1))


# --- what it tells keeps the rules ---------------------------------------------------------------


@pytest.mark.parametrize("transport", ["udp", "tcp", "websocket"])
def test_all_that_it_sends_keeps_the_rules(daemon: Daemon, transport: str, tmp_path: Path) -> None:
    record = tmp_path / "stream.jsonl"
    where = ["--transport", transport, "--port", str(daemon.ports[transport])]
    options = ["--check", "--seconds", "1.5", "--record", str(record)]
    checked = CliRunner().invoke(main, ["listen", *where, *options])
    assert (checked.exit_code, checked.stdout) == (0, ""), checked.stderr
    again = CliRunner().invoke(main, ["listen", str(record), "--check"])
    assert (again.exit_code, again.stdout) == (0, "")
    profiles = {
        message.address
        for line in record.read_text().splitlines()[1:]
        for message in OscBundle(bytes.fromhex(json.loads(line)["packet"]))
    }
    both = {"/tuio/2Dcur", "/tuio/2Dblb"}
    assert profiles == (both if transport == "websocket" else {"/tuio/2Dcur"})


def test_a_server_is_told_by_the_daemon_that_connects_to_it(daemon: Daemon) -> None:
    bundles = PrefixedBundles()
    with socket.create_server(("127.0.0.1", daemon.ports["server"])) as server:
        server.settimeout(DEADLINE_S)
        connection, _ = server.accept()
        with connection:
            connection.settimeout(DEADLINE_S)
            told: list[bytes] = []
            while len(told) < 20:
                told += bundles.feed(connection.recv(65536))
    assert all(bundle.startswith(b"#bundle") for bundle in told)


# --- garbage -------------------------------------------------------------------------------------


def masked_frame(chance: random.Random) -> bytes:
    """Bytes that look like a frame of a client, with anything in them."""
    payload = chance.randbytes(chance.choice([0, 1, 5, 125, 126, 1000, 3000]))
    first = chance.choice([0x81, 0x82, 0x88, 0x89, 0x8A, 0x01, 0x00, 0xC2, chance.randrange(256)])
    length = len(payload)
    size = bytes([0x80 | length]) if length < 126 else b"\xfe" + struct.pack(">H", length)
    return bytes([first]) + size + chance.randbytes(4) + payload


def garbage(chance: random.Random) -> Iterator[bytes]:
    """What one client sends."""
    kind = chance.randrange(6)
    if kind == 0:
        yield chance.randbytes(chance.randrange(1, 4000))
    elif kind == 1:
        yield SHAKE
        for _ in range(chance.randrange(1, 8)):
            yield masked_frame(chance)
    elif kind == 2:
        yield SHAKE[: chance.randrange(len(SHAKE))]
    elif kind == 3:
        damaged = bytearray(SHAKE)
        for _ in range(chance.randrange(1, 6)):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        yield bytes(damaged)
    elif kind == 4:
        yield b"GET / HTTP/1.1\r\n" + b"X-Field: " + b"a" * chance.randrange(9000) + b"\r\n"
    else:
        for _ in range(chance.randrange(1, 6)):
            yield chance.randbytes(8000)


def attack(port: int, chance: random.Random) -> int:
    """Be a client that means no good; return how many bytes went."""
    sent = 0
    with contextlib.suppress(OSError), socket.socket() as attacker:
        attacker.settimeout(0.5)
        attacker.connect(("127.0.0.1", port))
        for piece in garbage(chance):
            attacker.sendall(piece)
            sent += len(piece)
        if chance.random() < 0.5:  # gone without a word
            attacker.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        elif chance.random() < 0.2:
            attacker.recv(65536)
    return sent


def test_garbage_at_every_port_ends_nothing_and_fills_nothing(daemon: Daemon) -> None:
    chance = random.Random(9)
    began_s = time.monotonic()
    measured_bytes = 0
    rounds = sent = 0
    with socket.create_server(("127.0.0.1", daemon.ports["server"])) as server:
        server.settimeout(0.001)
        while time.monotonic() < began_s + FUZZ_S:
            rounds += 1
            for name in ("websocket", "tcp"):
                sent += attack(daemon.ports[name], chance)
            with contextlib.suppress(OSError), server.accept()[0] as connection:
                connection.sendall(chance.randbytes(9000))
            if not measured_bytes and time.monotonic() > began_s + FUZZ_S / 3.0:
                measured_bytes = daemon.resident_bytes
            assert daemon.process.poll() is None, daemon.said
    assert daemon.resident_bytes < measured_bytes + LARGEST_GROWTH_BYTES
    daemon.wait_until(lambda: daemon.destination("websocket")["clients"] < 60)
    page = Page(daemon.ports["websocket"])
    with page.socket:
        while len(page.frames) < 3:
            page.read()
    daemon.wait_until(lambda: daemon.destination("tcp")["clients"] == 0)
    print(f"{rounds} rounds, {sent} bytes, {daemon.resident_bytes - measured_bytes} bytes grown")
    assert len(daemon.said) < 100, "it must not fill the journal"
