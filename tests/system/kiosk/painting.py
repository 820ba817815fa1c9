"""Paints the show of `uvc.show` ahead of time, and calibrates its rig as a user would."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from uvc.descriptors import PRODUCT, VENDOR
from uvc.rig import serial
from uvc.show import CAMERAS, HEIGHT_PX, LOOP_S, RATE_HZ, SURFACE_MM, WIDTH_PX, Show, fingers_at

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.file import save_calibration
from cornertouchd.config import Settings
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

DIAMETER_MM = 10.0


def paint_show(folder: Path) -> Show:
    """Fill a folder with pictures, truth and calibration; takes some seconds."""
    rig = SimulatedRig(SURFACE_MM, WIDTH_PX, HEIGHT_PX, HEIGHT_PX)
    times_s = [number / RATE_HZ for number in range(round(LOOP_S * RATE_HZ))]
    show = Show(folder, tuple(fingers_at(time_s) for time_s in times_s))
    for camera in CAMERAS:
        loop = np.empty((len(times_s), HEIGHT_PX, WIDTH_PX), np.uint8)
        for number, places in enumerate(show.places_mm):
            fingers = [Finger(*place, DIAMETER_MM) for place in places]
            loop[number] = rig.render(camera, number, fingers)
        np.save(show.pictures[camera], loop)
    show.save()
    save_calibration(_as_usb_cameras(calibrate_rig(rig, Settings())), show.calibration)
    return show


def _as_usb_cameras(calibration: Calibration) -> Calibration:
    """Return the calibration as of cameras with serial numbers, so that a swap is noticed."""
    kind = f"{VENDOR:04x}:{PRODUCT:04x}"
    cameras = tuple(
        replace(camera, identity=f"usb {kind} serial {serial(camera.id)}")
        for camera in calibration.cameras
    )
    return replace(calibration, cameras=cameras)
