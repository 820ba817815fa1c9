"""Paints the show of `uvc.show` ahead of time, and calibrates its rig as a user would.

Or what a rig sees that a user calibrates: `paint_scenes`.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from uvc.descriptors import PRODUCT, VENDOR
from uvc.pictures import save_jpegs
from uvc.rig import serial
from uvc.show import (
    CAMERAS,
    HEIGHT_PX,
    LOOP_S,
    RATE_HZ,
    SURFACE_MM,
    WIDTH_PX,
    Place,
    Show,
    fingers_at,
)

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.file import save_calibration
from cornertouchd.config import Settings
from cornertouchd.guiding.targets import targets_for, validation_targets
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.hand import SCRIBBLE_SPEED_MM_S, place_on_rows
from cornertouchd.simulation.rig import SimulatedRig

DIAMETER_MM = 10.0
NOISES = 8
"""A finger that is held still, or none: so many pictures, each with noise of its own."""
SCRIBBLE_S = 4.0
"""All over the surface once, at the speed of a simulated person."""


def paint_show(folder: Path) -> Show:
    """Fill a folder with pictures, truth and calibration; takes some seconds."""
    rig = SimulatedRig(SURFACE_MM, WIDTH_PX, HEIGHT_PX, HEIGHT_PX)
    times_s = [number / RATE_HZ for number in range(round(LOOP_S * RATE_HZ))]
    show = Show(folder, tuple(fingers_at(time_s) for time_s in times_s))
    _paint(rig, show.places_mm, show)
    for pictures in show.pictures.values():
        save_jpegs(pictures)
    show.save()
    save_calibration(_as_usb_cameras(calibrate_rig(rig, Settings())), show.calibration)
    return show


def paint_scenes(folder: Path) -> Show:
    """Fill a folder with pictures of all that a guided calibration asks for, and the show after it.

    scenes.json has the first picture and the number of pictures of "empty", of "X Y" for each place
    to tap, of "scribble" and of "show".
    """
    rig = SimulatedRig(SURFACE_MM, WIDTH_PX, HEIGHT_PX, HEIGHT_PX)
    times_s = [number / RATE_HZ for number in range(round(LOOP_S * RATE_HZ))]
    show = Show(folder, tuple(fingers_at(time_s) for time_s in times_s))
    targets = [*targets_for("auto", SURFACE_MM).tolist(), *validation_targets(SURFACE_MM).tolist()]
    steps = range(round(SCRIBBLE_S * RATE_HZ))
    scenes: dict[str, Sequence[Sequence[Place]]] = {
        "empty": [()] * NOISES,
        **{f"{x:g} {y:g}": [((x, y),)] * NOISES for x, y in targets},
        "scribble": [
            (place_on_rows(SURFACE_MM, SCRIBBLE_SPEED_MM_S * step / RATE_HZ),) for step in steps
        ],
        "show": show.places_mm,
    }
    pictures: list[Sequence[Place]] = []
    spans = {}
    for name, scene in scenes.items():
        spans[name] = len(pictures), len(scene)
        pictures += scene
    _paint(rig, pictures, show)
    (folder / "scenes.json").write_text(json.dumps(spans))
    show.save()
    return show


def _paint(rig: SimulatedRig, pictures: Sequence[Sequence[Place]], show: Show) -> None:
    for camera in CAMERAS:
        loop = np.empty((len(pictures), HEIGHT_PX, WIDTH_PX), np.uint8)
        for number, places in enumerate(pictures):
            fingers = [Finger(*place, DIAMETER_MM) for place in places]
            loop[number] = rig.render(camera, number, fingers)
        np.save(show.pictures[camera], loop)


def _as_usb_cameras(calibration: Calibration) -> Calibration:
    """Return the calibration as of cameras with serial numbers, so that a swap is noticed."""
    kind = f"{VENDOR:04x}:{PRODUCT:04x}"
    cameras = tuple(
        replace(camera, identity=f"usb {kind} serial {serial(camera.id)}")
        for camera in calibration.cameras
    )
    return replace(calibration, cameras=cameras)
