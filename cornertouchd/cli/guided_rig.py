"""Cameras for a guided command: real ones, or a simulated rig with a simulated person."""

import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite, nan
from pathlib import Path
from typing import IO

import click

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.config import Settings
from cornertouchd.guiding.status import Status
from cornertouchd.ports import CameraPort
from cornertouchd.runtime.assembly import make_ports
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.led_desk import shining
from cornertouchd.simulation.board_holder import BoardHolder
from cornertouchd.simulation.camera import painted_ports, rig_ports
from cornertouchd.simulation.hand import LIFTED_S, Hand, Person
from cornertouchd.simulation.show import make_rig

SIMULATED_RATE_HZ = 50.0
"""Half the usual rate: one processor then paints and looks with time to spare."""

BOARD_RATE_HZ = 4.0
"""A whole picture with a board takes longer to paint, and to look at."""

PICTURE_INSET_MM = 15.0
"""The simulated picture is so much smaller than the surface, on every side."""

Act = Callable[[Status], None]
"""Lets the simulated person do what a status asks for."""


@dataclass(frozen=True)
class GuidedRig:
    """Cameras to watch, and what happens before each frame set is looked at."""

    ports: Sequence[CameraPort]
    act: Act


@contextmanager
def guided_rig(settings: Settings, simulate: bool, finger: Path | None) -> Iterator[GuidedRig]:
    """Yield the configured cameras, the LED frame lit, or with `simulate` a simulated rig.

    Without `finger` a simulated person does there all that is asked for.  Else the finger goes
    where that file (or pipe, or terminal; - is stdin) says: `X Y` in millimetres puts it there, an
    empty line lifts it.
    """
    clock = MonotonicClock()
    if not simulate:
        with shining(settings):
            yield GuidedRig(make_ports(settings, clock), lambda _: None)
        return
    rig = make_rig(settings)
    hand = Hand()
    seed = settings.simulation.seed
    ports = _enabled(rig_ports(rig, hand.fingers_at, clock, SIMULATED_RATE_HZ), settings)
    if finger is None:
        person = Person(hand, rig.surface_mm, seed)
        yield GuidedRig(ports, lambda status: _obey(person, status, rig.surface_mm, clock.now_s()))
        return
    threading.Thread(target=_move, args=(hand, _open(finger)), daemon=True).start()
    yield GuidedRig(ports, lambda _: None)


@contextmanager
def whole_picture_rig(settings: Settings, simulate: bool, plan: BoardPlan) -> Iterator[GuidedRig]:
    """Yield the cameras with all their rows; with `simulate` a person holds boards before them."""
    clock = MonotonicClock()
    units = {
        name: unit.model_copy(update={"row_offset_px": 0, "rows_px": 0})
        for name, unit in settings.cameras.units.items()
    }
    cameras = settings.cameras.model_copy(update={"units": units})
    whole = settings.model_copy(update={"cameras": cameras})
    if not simulate:
        with shining(settings):
            yield GuidedRig(make_ports(whole, clock), lambda _: None)
        return
    rig = make_rig(settings, settings.cameras.height_px)
    holder = BoardHolder(rig, plan, settings.simulation.seed)
    ports = _enabled(painted_ports(rig.formats, holder.paints, clock, BOARD_RATE_HZ), settings)
    yield GuidedRig(ports, lambda status: holder.hold(status.number, clock.now_s()))


def _enabled(ports: Sequence[CameraPort], settings: Settings) -> Sequence[CameraPort]:
    return [port for port in ports if port.id in settings.cameras.enabled_ids]


def _obey(person: Person, status: Status, surface_mm: tuple[float, float], now_s: float) -> None:
    if status.target_mm is not None:
        person.tap(status.target_mm, now_s)
    elif status.step == "display":
        person.tap(_corner_mm(status.number, surface_mm), now_s)
    elif status.step == "scribble":
        person.scribble(now_s)
    else:
        person.rest()


def _corner_mm(number: int, surface_mm: tuple[float, float]) -> tuple[float, float]:
    """Return where corner 1 to 4 of the simulated picture is, clockwise from its top left."""
    right, bottom = surface_mm[0] - PICTURE_INSET_MM, surface_mm[1] - PICTURE_INSET_MM
    left = top = PICTURE_INSET_MM
    return ((left, top), (right, top), (right, bottom), (left, bottom))[number - 1]


def _open(orders: Path) -> IO[str]:
    """Open a file of orders.  Raises `click.ClickException`."""
    if str(orders) == "-":
        return sys.stdin
    try:
        return orders.open(errors="replace")
    except OSError as error:
        raise click.ClickException(f"{orders}: cannot be read: {error.strerror}") from error


def _move(hand: Hand, lines: IO[str]) -> None:
    """Move the finger as the lines say; one that says nothing sensible is passed over.

    A lifted finger stays away as long as a person's does, or no picture might show that it was.
    Whoever else closed the file would wait here for a pipe's next line.
    """
    lifted_s = -LIFTED_S
    for line in lines:
        words = line.split()
        try:
            place_mm = [float(word) for word in words]
        except ValueError:
            place_mm = [nan]
        if not words:
            hand.lift()
            lifted_s = time.monotonic()
        elif len(place_mm) == 2 and all(map(isfinite, place_mm)):
            time.sleep(max(0.0, lifted_s + LIFTED_S - time.monotonic()))
            hand.touch(*place_mm)
        else:
            click.echo(f"{line.strip()!r} is not X Y in millimetres", err=True)
    hand.lift()
