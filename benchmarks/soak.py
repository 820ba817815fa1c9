"""The demo for ten minutes, watched by a TUIO client that knows the simulated truth.

    python benchmarks/soak.py [--seconds 600] [--touches 10] [--seed 1]

A process does what `cornertouchd demo` does; beside the datagrams it tells at which instant of the
script the pictures of each frame were taken, so that the client can look up where the fingers were.
The process that paints the pictures notes when it was too late with them: an instant that two
cameras or more were not given in time is counted as never delivered; the daemon did not miss it.

Ends with status 1 unless, after the first second, no frame set is missed, no touch is farther than
8 mm from every finger (a ghost), no finger's touch changes its id, and the memory of the daemon
does not grow by 2 MB after it is warm.
"""

import argparse
import multiprocessing
import os
import socket
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from multiprocessing.connection import Connection
from multiprocessing.synchronize import Event

import numpy as np
from late_pictures import Lateness, make_timed_show
from process_watch import ProcessWatch
from scenes import matched

from cornertouchd.config import (
    CamerasSettings,
    DestinationSettings,
    Settings,
    SimulationSettings,
    TuioSettings,
)
from cornertouchd.model import FloatArray, TouchFrame
from cornertouchd.runtime.assembly import find_calibration, make_tuio_sink
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.simulation.camera import painted_ports
from cornertouchd.simulation.painting import PaintingProcess
from cornertouchd.simulation.show import make_rig, make_show
from cornertouchd.wire.tuio import Cursor
from cornertouchd.wire.tuio_reader import TuioReader

NEAR_MM = 8.0
RATE_HZ = 100.0
UNJUDGED_S = 1.0
PATIENCE_S = 120.0
"""The first start compiles for a good while."""

AFTERGLOW_FRAMES = 3
"""What is lifted rests for two frames where it was."""

LANDED_FRAMES = 10
"""A finger that is down for so long has to be told."""

RSS_GROWTH_MB = 2.0
RECEIVE_BUFFER_BYTES = 4 * 1024 * 1024
MOST_LINES = 20
"""Of ghosts and of id switches, the first so many are printed."""


def settings_of(touches: int, seed: int, port: int = 3333) -> Settings:
    """Return the settings with which the demo works."""
    return Settings(
        cameras=CamerasSettings(source="simulated", rate_hz=RATE_HZ),
        simulation=SimulationSettings(touches=touches, seed=seed),
        tuio=TuioSettings(destinations=(DestinationSettings(host="127.0.0.1", port=port),)),
    )


class Stamps:
    """A sink that tells when each frame was captured, and whether clients are told anything."""

    def __init__(self, out: Connection) -> None:
        self._out = out
        self._had_touches = False

    def send(self, frame: TouchFrame, now_s: float) -> None:  # noqa: ARG002
        """Tell about a frame."""
        has_touches = bool(frame.touches)
        self._out.send((frame.captured_at_s, has_touches or self._had_touches))
        self._had_touches = has_touches

    def lift_all(self, now_s: float) -> None:  # noqa: ARG002
        """Note that clients know of no touch any more."""
        self._had_touches = False

    def tick(self, now_s: float) -> None:
        """Do nothing."""

    def close(self) -> None:
        """Do nothing."""


def serve(settings: Settings, lateness: Lateness, out: Connection, stop: Event) -> None:
    """Do what the demo does until `stop`; tell first when the script began, at last the counts."""
    clock, parent = MonotonicClock(), os.getppid()
    calibration = find_calibration(settings, os.environ)
    formats = make_rig(settings).formats
    painting = PaintingProcess(partial(make_timed_show, settings, lateness), formats)
    paints = {camera: painting.painter(camera) for camera in formats}
    name = f"simulated rig seed {settings.simulation.seed}"
    ports = painted_ports(formats, paints, clock, RATE_HZ, rig_name=name)
    lateness.begin(ports[0].captured_at_s(0))
    sinks = [make_tuio_sink(settings, calibration.surface_mm, "soak"), Stamps(out)]
    daemon = Daemon(ports, calibration, sinks, settings, clock)
    out.send(ports[0].captured_at_s(0))
    daemon.start()
    while not stop.wait(1.0) and os.getppid() == parent:  # it may be killed
        pass
    daemon.stop()
    counts = daemon.fusion_counts()
    out.send(f"{counts.partial} partial, {counts.skipped} skipped, {counts.faults} faults")


@dataclass(frozen=True, slots=True)
class Told:
    """One frame as the client was told it: ids (M,) and places (M, 2) of its touches."""

    captured_at_s: float
    arrived_at_s: float
    ids: tuple[int, ...]
    places_mm: FloatArray


class Truth:
    """Where the fingers of the demo are, frame by frame of its script."""

    def __init__(self, touches: int, seed: int) -> None:
        rig, self._script = make_show(settings_of(touches, seed))
        self.surface_mm = np.array(rig.surface_mm)
        self._section = rig.truth.section

    def fingers_at(self, index: int) -> dict[int, tuple[float, float]]:
        """Return where the tip of each finger is that the cameras see, by its key."""
        return {
            timed.key: (timed.finger.x_mm, timed.finger.y_mm)
            for timed in self._script(index / RATE_HZ)
            if self._section(timed.finger) is not None
        }


@dataclass
class Findings:
    """What was seen after the first second."""

    frames: int = 0
    missed: int = 0
    not_delivered: int = 0
    touches: int = 0
    ghosts: int = 0
    switches: int = 0
    due: int = 0
    not_told: int = 0
    errors_mm: list[float] = field(default_factory=list)
    delays_ms: list[float] = field(default_factory=list)


class Judge:
    """Compares what is told with the truth, frame by frame."""

    def __init__(self, truth: Truth, lateness: Lateness, began_at_s: float) -> None:
        self._truth = truth
        self._lateness = lateness
        self._began_at_s = began_at_s
        self._last_index: int | None = None
        self._ids: dict[int, int] = {}
        self._down_since: dict[int, int] = {}
        self.findings = Findings()

    def see(self, told: Told) -> None:
        """Take a frame in."""
        found = self.findings
        index = round((told.captured_at_s - self._began_at_s) * RATE_HZ)
        if self._last_index is not None:
            for lacking in range(self._last_index + 1, index):
                delivered = self._lateness.was_delivered(lacking)
                found.missed += delivered
                found.not_delivered += not delivered
        self._last_index = index
        fingers = self._truth.fingers_at(index)
        keys, places = list(fingers), np.array(list(fingers.values())).reshape(-1, 2)
        seen, truly = matched(told.places_mm, places, NEAR_MM)
        found.frames += 1
        found.touches += len(told.ids)
        self._count_ghosts(told, index, set(seen.tolist()))
        self._count_switches([(keys[k], told.ids[i]) for i, k in zip(seen, truly, strict=True)])
        self._count_not_told(index, keys, {keys[k] for k in truly})
        if found.frames % 10 == 0:  # enough to tell, and it keeps the memory small
            found.errors_mm += np.hypot(*(told.places_mm[seen] - places[truly]).T).tolist()
            found.delays_ms.append(1000.0 * (told.arrived_at_s - told.captured_at_s))

    def _count_ghosts(self, told: Told, index: int, seen: set[int]) -> None:
        others = [number for number in range(len(told.ids)) if number not in seen]
        if not others:
            return
        around = np.array(
            [
                place
                for near in range(index - AFTERGLOW_FRAMES, index + 1)
                for place in self._truth.fingers_at(near).values()
            ]
        ).reshape(-1, 2)
        for number in others:
            apart_mm = np.hypot(*(around - told.places_mm[number]).T)
            if np.min(apart_mm, initial=np.inf) > NEAR_MM:
                self.findings.ghosts += 1
                if self.findings.ghosts <= MOST_LINES:
                    x_mm, y_mm = told.places_mm[number]
                    print(f"ghost in frame {index} at {x_mm:.1f}, {y_mm:.1f}", flush=True)

    def _count_switches(self, pairs: Sequence[tuple[int, int]]) -> None:
        """Count fingers whose touch has another id; fingers of the demo never meet."""
        for key, touch in pairs:
            before = self._ids.get(key, touch)
            if before != touch:
                self.findings.switches += 1
                if self.findings.switches <= MOST_LINES:
                    print(f"finger {key}: id {before} became {touch}", flush=True)
            self._ids[key] = touch

    def _count_not_told(self, index: int, keys: Sequence[int], told: set[int]) -> None:
        self._down_since = {key: self._down_since.get(key, index) for key in keys}
        self._ids = {key: touch for key, touch in self._ids.items() if key in self._down_since}
        landed = [key for key in keys if index - self._down_since[key] >= LANDED_FRAMES]
        self.findings.due += len(landed)
        self.findings.not_told += sum(key not in told for key in landed)


def frames_told(
    receiver: socket.socket, stamps: Connection, surface_mm: FloatArray, seconds: float
) -> Iterator[Told]:
    """Yield what is told for so many seconds, each frame with the time that it was captured."""
    reader = TuioReader()
    until_s = None
    while until_s is None or time.monotonic() < until_s:
        if not stamps.poll(PATIENCE_S):
            raise SystemExit("the daemon has stopped to tell frames")
        captured_at_s, clients_are_told = stamps.recv()
        until_s = until_s or captured_at_s + seconds
        cursors = _next_frame(receiver, reader) if clients_are_told else ()
        places = np.array([(cursor.x, cursor.y) for cursor in cursors]).reshape(-1, 2) * surface_mm
        ids = tuple(cursor.id for cursor in cursors)
        yield Told(captured_at_s, time.monotonic(), ids, places)


def _next_frame(receiver: socket.socket, reader: TuioReader) -> tuple[Cursor, ...]:
    """Receive until a frame is complete that is not a repeat; return its cursors."""
    before = sum(source.frames for source in reader.sources.values())
    while sum(source.frames for source in reader.sources.values()) == before:
        reader.feed(receiver.recv(65536), "demo", time.monotonic())
    (source,) = reader.sources.values()
    if source.lost_frames:
        raise SystemExit("a datagram was lost on the way: is the machine overloaded?")
    return tuple(source.cursors.values())


def soak(
    options: argparse.Namespace,
    receiver: socket.socket,
    lateness: Lateness,
    stamps: Connection,
    watch: ProcessWatch,
) -> Findings:
    """Watch the demo for as long as is asked; print how it goes once a minute."""
    truth = Truth(options.touches, options.seed)
    if not stamps.poll(PATIENCE_S):
        raise SystemExit(f"the daemon has not started within {PATIENCE_S:g} s")
    judge = Judge(truth, lateness, stamps.recv())
    first_s = tell_at_s = None
    for told in frames_told(receiver, stamps, truth.surface_mm, options.seconds):
        first_s = first_s or told.captured_at_s
        if told.captured_at_s < first_s + UNJUDGED_S:
            continue
        if tell_at_s is None:
            tell_at_s = told.captured_at_s + 60.0
            watch.begin()
        judge.see(told)
        watch.sample()
        if told.captured_at_s >= tell_at_s:
            tell_at_s += 60.0
            found = judge.findings
            print(
                f"{found.frames} frames, {found.missed} missed, {found.ghosts} ghosts, "
                f"{found.switches} id switches, {watch.rss_mb:.1f} MB",
                flush=True,
            )
    return judge.findings


def violations(found: Findings, watch: ProcessWatch) -> list[str]:
    """Return what must not have been."""
    growth_mb = watch.growth_mb()
    broken = {
        f"{found.missed} frame sets missed": found.missed > 0,
        f"{found.ghosts} ghosts": found.ghosts > 0,
        f"{found.switches} id switches": found.switches > 0,
        f"memory grew by {growth_mb:.2f} MB": growth_mb >= RSS_GROWTH_MB,
    }
    return [what for what, is_broken in broken.items() if is_broken]


def report(found: Findings, watch: ProcessWatch, counts: str) -> None:
    errors, delays = np.array(found.errors_mm), np.array(found.delays_ms)
    print(
        f"{found.frames} frames after the first second, {found.missed} missed and "
        f"{found.not_delivered} that the simulation never delivered; in all {counts}\n"
        f"{found.touches} touches told, {found.ghosts} ghosts, {found.switches} id switches; "
        f"{found.not_told} of {found.due} touches due were not told\n"
        f"error RMS {np.sqrt(np.mean(errors**2)):.2f} mm, p95 {np.percentile(errors, 95):.2f} mm, "
        "what smoothing lags behind included\n"
        f"from capture to the client {np.median(delays):.2f} ms, p99 "
        f"{np.percentile(delays, 99):.2f} ms, to paint the pictures included\n"
        f"memory {watch.rss_mb:.1f} MB, grew by {watch.growth_mb():.2f} MB\n"
        f"of a core: the daemon {watch.own_share:.0%}, to paint the pictures "
        f"{watch.children_share:.0%}"
    )


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=600.0)
    parser.add_argument("--touches", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    if not 1 <= options.touches <= 20:
        parser.error(f"--touches is {options.touches}; give 1 to 20")
    if options.seconds < 5.0:
        parser.error(f"--seconds is {options.seconds:g}; give 5 or more")
    return options


def main(arguments: Sequence[str] | None = None) -> int:
    options = parsed(arguments)
    context = multiprocessing.get_context("spawn")
    stamps, theirs = context.Pipe(duplex=False)
    stop = context.Event()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(PATIENCE_S)
        settings = settings_of(options.touches, options.seed, receiver.getsockname()[1])
        lateness = Lateness(tuple(make_rig(settings).formats), RATE_HZ)
        daemon = context.Process(target=serve, args=(settings, lateness, theirs, stop))
        daemon.start()
        theirs.close()
        watch = ProcessWatch(daemon.pid or 0)
        try:
            found = soak(options, receiver, lateness, stamps, watch)
        except EOFError:
            raise SystemExit("the daemon has ended; what it said stands above") from None
        finally:
            stop.set()
        counts = last_of(stamps)
        daemon.join()
    report(found, watch, counts)
    broken = violations(found, watch)
    for what in broken:
        print(f"violated: {what}", file=sys.stderr)
    return 1 if broken else 0


def last_of(stamps: Connection) -> str:
    """Return what the daemon says at its end; stamps before it are left unread."""
    while not isinstance(said := stamps.recv(), str):
        pass
    return said


if __name__ == "__main__":
    sys.exit(main())
