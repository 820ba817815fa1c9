"""Faults of cameras, mid-touch: what the daemon said, what the client saw, how long it took."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from guest.client import Seen, TuioClient, compare, stood_still_s, wait_until
from guest.running import RunningDaemon
from uvc.rig import UvcRig
from uvc.show import CAMERAS, RATE_HZ, Show

from cornertouchd.runtime.faults import GOOD_TO_RECOVER
from cornertouchd.runtime.service import STATUS_EVERY_S

FAILS = re.compile(r"ERROR camera (C\d): |camera (C\d): columns \S+ see little or nothing: all")
WORKS = re.compile(r"camera (C\d): (?:works|columns \S+ see) again")
SILENT = re.compile(r"camera (C\d): more than \d+ messages")
NEAR_MM = 5.0
"""With cameras missing or mad, a touch this far from any finger is one that is not there."""
SETTLES_S = 1.0
TOLD_S = (GOOD_TO_RECOVER - 1) / RATE_HZ
"""A camera is said to work again so long after the first picture that is used, or longer."""
BACK_S = 2.0 + TOLD_S
"""A camera that is plugged in again is in service within 2 s of its node."""
RECOVERS_S = 20.0
"""A camera that fails while it is there is opened anew after growing delays; a quiet machine
needs 5 s."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What happens to cameras, for how long, how it ends, and when they have to work after that."""

    name: str
    cameras: tuple[str, ...]
    begin: Callable[[UvcRig, str], None]
    end: Callable[[UvcRig, str], None]
    lasts_s: float = 3.0
    recovers_s: float = RECOVERS_S


@dataclass(frozen=True, slots=True)
class Episode:
    """One fault, lived through.

    `recovered_s` is the longest time that one of its cameras took from when its cause was gone, or
    its node was there again, until the daemon said that it works.
    """

    fault: Fault
    said: tuple[str, ...]
    seen: Seen
    recovered_s: float


def _swap(rig: UvcRig, camera: str) -> None:
    """Put a camera on the first port that is free."""
    rig.plug(camera, min(set(range(8, 16)) - set(rig.ports.values())))


def _nothing(rig: UvcRig, camera: str) -> None:
    """A fault that ends by itself."""


FAULTS = (
    Fault("cable pulled", ("C2",), UvcRig.unplug, UvcRig.plug, recovers_s=BACK_S),
    Fault("plugged into another port", ("C2",), UvcRig.unplug, _swap, recovers_s=BACK_S),
    Fault("sends nothing", ("C3",), UvcRig.stall, UvcRig.go),
    Fault("pictures cut off", ("C4",), lambda rig, c: rig.short(c, 60), _nothing, 1.0),
    Fault("pictures marked bad", ("C1",), lambda rig, c: rig.err(c, 60), _nothing, 1.0),
    Fault("pictures of noise", ("C2",), UvcRig.noise, UvcRig.go),
    Fault("pictures dark", ("C3",), UvcRig.dark, UvcRig.go, 6.0),
    Fault("two cables pulled", ("C1", "C2"), UvcRig.unplug, UvcRig.plug, recovers_s=BACK_S),
    Fault("all four cables pulled", CAMERAS, UvcRig.unplug, UvcRig.plug, recovers_s=BACK_S),
    Fault("all four send nothing", CAMERAS, UvcRig.stall, UvcRig.go),
    Fault("all four send noise", CAMERAS, UvcRig.noise, UvcRig.go),
)


def live_through(
    fault: Fault, show: Show, rig: UvcRig, client: TuioClient, daemon: RunningDaemon
) -> Episode:
    """Let a fault happen and end; wait until all cameras work and touches are there again.

    Raises `TimeoutError` if that does not happen.
    """
    began_s = time.monotonic()
    for camera in fault.cameras:
        fault.begin(rig, camera)
    time.sleep(fault.lasts_s)
    mended_s: dict[str, float] = {}
    for camera in fault.cameras:
        fault.end(rig, camera)
        mended_s[camera] = time.monotonic()
    time.sleep(1.2 * STATUS_EVERY_S)  # until then the last status may be from before
    wait_until(
        lambda: daemon.is_whole() and not _in_trouble(daemon, began_s),
        RECOVERS_S,
        f"{fault.name}: all cameras at work",
    )
    whole_s = time.monotonic()
    time.sleep(SETTLES_S)
    said = daemon.said_since(began_s)
    recovered_s = max(_works_s(said, camera, whole_s) - mended_s[camera] for camera in mended_s)
    recovered_s -= stood_still_s(client.standstills, min(mended_s.values()), whole_s)
    seen = compare(client, show, rig, (began_s, time.monotonic()), NEAR_MM)
    return Episode(fault, tuple(line for _, line in said), seen, max(0.0, recovered_s))


def _works_s(said: list[tuple[float, str]], camera: str, whole_s: float) -> float:
    """Return when a camera was said to work again; 0 if nothing was wrong.

    After too many messages a camera has none left: then it is when the status had all cameras.
    """
    told_s = [at_s for at_s, line in said if (over := WORKS.search(line)) and over[1] == camera]
    if any(f"camera {camera}: more than" in line for _, line in said):
        return whole_s
    return told_s[-1] if told_s else 0.0


def _in_trouble(daemon: RunningDaemon, since_s: float) -> set[str]:
    """Return the cameras that had a fault and have not said that it is over, as far as they may."""
    trouble: set[str] = set()
    for _, line in daemon.said_since(since_s):
        if over := WORKS.search(line) or SILENT.search(line):
            trouble.discard(over[1])
        elif fault := FAILS.search(line):
            trouble.add(fault[1] or fault[2])
    return trouble
