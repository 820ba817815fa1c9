"""Milliseconds from a picture to its packet, through the whole daemon, while the page is watched.

    python benchmarks/latency.py [--seconds 5] [--rounds 3] [--touches 5] [--check]
                                 [--markdown PAGE]

A process does what `cornertouchd demo` does, page included; another one looks at the page: nobody,
one viewer, twenty of which one has stopped to read, all with strips.  They take turns, so that what
else the machine does falls on all.  A picture's time is when the simulated camera took it, a
packet's when the kernel put it into the receiver's socket.

--check ends with status 1 if twenty viewers cost a frame set, or more than a tenth of the latency
that 99 of 100 stay below.
"""

import argparse
import multiprocessing
import os
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.synchronize import Event
from pathlib import Path

import doc_tables
import numpy as np

from cornertouchd.config import (
    CamerasSettings,
    DestinationSettings,
    MonitorSettings,
    Settings,
    SimulationSettings,
    TuioSettings,
)
from cornertouchd.model import TouchFrame
from cornertouchd.runtime.answers import answers_of
from cornertouchd.runtime.asking import AskSocket, read_document
from cornertouchd.runtime.assembly import find_calibration, make_ports, make_tuio_sink
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.health import HealthWatch
from cornertouchd.runtime.log_tail import LogTail
from cornertouchd.runtime.monitor_process import MonitorProcess, page_options

VIEWERS = {"nobody looks": 0, "one viewer": 1, "twenty, one has stopped": 20}
MOST_SLOWER = 1.1
SETTLE_S = 1.0
PATIENCE_S = 120.0
"""The first start compiles for a good while."""

STAMP = struct.Struct("<d")
BUNDLE, MARK = b"#bundle", b"mark"
SO_TIMESTAMPNS = 35
"""socket(7); Python has no name for it."""

TIMESPEC = struct.Struct("@qq")
COUNTED = ("frame_sets", "partial", "skipped", "dropped")


class Stamps:
    """A sink before or behind that of TUIO: marks the packets of a frame, or tells its time."""

    def __init__(self, receiver: tuple[str, int], *, marks: bool) -> None:
        self._marks = marks
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(receiver)

    def send(self, frame: TouchFrame, now_s: float) -> None:  # noqa: ARG002
        """Tell about a frame."""
        self._socket.send(MARK if self._marks else STAMP.pack(frame.captured_at_s))

    def lift_all(self, now_s: float) -> None:
        """Do nothing."""

    def tick(self, now_s: float) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Free the socket."""
        self._socket.close()


def serve(settings: Settings, path: Path, stop: Event) -> None:
    """Do what the demo does, until `stop`."""
    clock, parent = MonotonicClock(), os.getppid()
    to = settings.tuio.destinations[0]
    ports = make_ports(settings, clock)
    calibration = find_calibration(settings, os.environ)
    sinks = [
        Stamps((to.host, to.port), marks=True),
        make_tuio_sink(settings, calibration.surface_mm, "latency"),
        Stamps((to.host, to.port), marks=False),
    ]
    daemon = Daemon(ports, calibration, sinks, settings, clock)
    health = HealthWatch(daemon, clock)
    options = page_options(settings, path, os.environ)
    with (
        LogTail() as log,
        AskSocket(path, answers_of(daemon, health, log, "", lambda: None, clock)),
        MonitorProcess(lambda: options, clock) as page,
    ):
        daemon.start()
        while not stop.wait(0.25) and os.getppid() == parent:  # it may be killed
            health.look()
            page.look()
        daemon.stop()


@contextmanager
def looking(page: str, viewers: int) -> Iterator[None]:
    """Have so many viewers look in a process of their own."""
    if not viewers:
        yield
        return
    command = [sys.executable, str(Path(__file__).with_name("viewers.py")), page, str(viewers)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        if process.stdout.readline() != "looking\n":
            raise SystemExit("the viewers could not connect")
        yield
    finally:
        process.stdin.close()
        process.stdout.close()
        process.kill()
        process.wait()


def latencies_s(receiver: socket.socket, seconds: float) -> list[float]:
    """Return how long the packets of so many seconds took."""
    found: list[float] = []
    arrived_s: float | None = None
    ahead_s = time.time() - time.monotonic()
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        data, told, _, _ = receiver.recvmsg(65536, 128)
        if data == MARK:
            arrived_s = None  # those until here were repeats
        elif data.startswith(BUNDLE):
            whole_s, nanoseconds = TIMESPEC.unpack(told[0][2])
            arrived_s = whole_s + 1e-9 * nanoseconds - ahead_s
        elif arrived_s is not None:
            found.append(arrived_s - STAMP.unpack(data)[0])
            arrived_s = None
    return found


@dataclass
class Case:
    """What was measured while so many looked."""

    took_s: list[float] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=lambda: dict.fromkeys(COUNTED, 0))

    def quantile_ms(self, share: float) -> float:
        """Return what this share of the packets stayed below."""
        return 1000.0 * float(np.quantile(self.took_s, share))


def measure(seconds: float, rounds: int, touches: int) -> dict[str, Case]:
    """Let all take turns."""
    cases = {name: Case() for name in VIEWERS}
    spawn = multiprocessing.get_context("spawn")
    with (
        tempfile.TemporaryDirectory() as folder,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver,
    ):
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(PATIENCE_S)
        receiver.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        path, page_port = Path(folder) / "status.sock", free_port()
        settings = Settings(
            cameras=CamerasSettings(source="simulated"),
            simulation=SimulationSettings(touches=touches),
            tuio=TuioSettings(
                destinations=(
                    DestinationSettings(host="127.0.0.1", port=receiver.getsockname()[1]),
                )
            ),
            monitor=MonitorSettings(port=page_port),
        )
        stop = spawn.Event()
        daemon = spawn.Process(target=serve, args=(settings, path, stop), daemon=False)
        daemon.start()
        try:
            wait_for(page_port)
            for _ in range(rounds):
                for name, viewers in VIEWERS.items():
                    with looking(f"http://127.0.0.1:{page_port}", viewers):
                        latencies_s(receiver, SETTLE_S)
                        before = counts(path)
                        cases[name].took_s += latencies_s(receiver, seconds)
                        for key, value in counts(path).items():
                            cases[name].counts[key] += value - before[key]
        finally:
            stop.set()
            daemon.join(10.0)
            daemon.kill()
    return cases


def counts(path: Path) -> dict[str, int]:
    fusion = read_document(path, "status")["fusion"]
    return {key: fusion[key] for key in COUNTED}


def wait_for(port: int) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < until_s:
        with socket.socket() as trying:
            if trying.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.2)
    raise SystemExit("the page is not served")


def free_port() -> int:
    with socket.socket() as bound:
        bound.bind(("127.0.0.1", 0))
        port: int = bound.getsockname()[1]
    return port


def rows(cases: dict[str, Case]) -> list[list[str]]:
    closed = next(iter(cases.values()))
    return [
        [
            name,
            str(len(case.took_s)),
            *(f"{case.quantile_ms(share):.2f}" for share in (0.5, 0.9, 0.99)),
            f"{case.quantile_ms(0.5) / closed.quantile_ms(0.5):.2f}",
            f"{case.quantile_ms(0.99) / closed.quantile_ms(0.99):.2f}",
            *(str(case.counts[key]) for key in COUNTED[1:]),
        ]
        for name, case in cases.items()
    ]


TITLES = ("", "frame sets", "median ms", "p90", "p99", "median ratio", "p99 ratio", *COUNTED[1:])


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="of each turn")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--touches", type=int, default=5)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--markdown", type=Path, metavar="PAGE")
    options = parser.parse_args(arguments)
    cases = measure(options.seconds, options.rounds, options.touches)
    lines = doc_tables.table(TITLES, rows(cases))
    print("\n".join(lines))
    if options.markdown:
        doc_tables.put_into(options.markdown, "latency", lines)
    closed, *_, many = cases.values()
    slower = many.quantile_ms(0.99) > MOST_SLOWER * closed.quantile_ms(0.99)
    missed = many.counts["skipped"] + many.counts["dropped"]
    if options.check and (slower or missed):
        print(f"twenty viewers: {missed} frame sets missed, too slow: {slower}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
