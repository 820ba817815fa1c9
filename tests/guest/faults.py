"""Faults of cameras, mid-touch: what the daemon said, what the client saw, how long it took."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass

from guest.client import Seen, TuioClient, compare, wait_until
from guest.running import RunningDaemon
from uvc.rig import UvcRig
from uvc.show import CAMERAS, Show

NEAR_MM = 5.0
"""With cameras missing or mad, a touch this far from any finger is one that is not there."""
SETTLES_S = 1.0
RECOVERS_S = 45.0
"""Delays between attempts to open a camera add up when the machine is busy."""


@dataclass(frozen=True, slots=True)
class Fault:
    """What happens to cameras, for how long, and how it ends."""

    name: str
    cameras: tuple[str, ...]
    begin: Callable[[UvcRig, str], None]
    end: Callable[[UvcRig, str], None]
    lasts_s: float = 3.0


@dataclass(frozen=True, slots=True)
class Episode:
    """One fault, lived through; `recovered_s` counts from when the cause was gone."""

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
    Fault("cable pulled", ("C2",), UvcRig.unplug, UvcRig.plug),
    Fault("plugged into another port", ("C2",), UvcRig.unplug, _swap),
    Fault("sends nothing", ("C3",), UvcRig.stall, UvcRig.go),
    Fault("pictures cut off", ("C4",), lambda rig, c: rig.short(c, 60), _nothing, 1.0),
    Fault("pictures marked bad", ("C1",), lambda rig, c: rig.err(c, 60), _nothing, 1.0),
    Fault("pictures of noise", ("C2",), UvcRig.noise, UvcRig.go),
    Fault("pictures dark", ("C3",), UvcRig.dark, UvcRig.go, 6.0),
    Fault("two cables pulled", ("C1", "C2"), UvcRig.unplug, UvcRig.plug),
    Fault("all four cables pulled", CAMERAS, UvcRig.unplug, UvcRig.plug),
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
    for camera in fault.cameras:
        fault.end(rig, camera)
    mended_s = time.monotonic()
    wait_until(
        lambda: not _in_trouble(daemon, began_s), RECOVERS_S, f"{fault.name}: all cameras at work"
    )
    recovered_s = time.monotonic() - mended_s
    time.sleep(SETTLES_S)
    said = tuple(line for _, line in daemon.said_since(began_s))
    seen = compare(client, show, rig.start_s, (began_s, time.monotonic()), NEAR_MM)
    return Episode(fault, said, seen, recovered_s if said else 0.0)


def _in_trouble(daemon: RunningDaemon, since_s: float) -> set[str]:
    """Return the cameras that had a fault and have not said that it is over."""
    trouble: set[str] = set()
    for _, line in daemon.said_since(since_s):
        if over := re.search(r"camera (C\d): works again", line):
            trouble.discard(over[1])
        elif fault := re.search(r"ERROR camera (C\d): ", line):
            trouble.add(fault[1])
    return trouble
