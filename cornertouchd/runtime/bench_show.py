"""The simulated rig on which a benchmark runs, as large as the real one, and moving fingers."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, pi, sqrt

import numpy as np

from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.config import CamerasSettings, Settings, SimulationSettings, SurfaceSettings
from cornertouchd.model import Frame
from cornertouchd.runtime.simulated_rig import calibrate_rig, calibrated_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import Script, TimedFinger
from cornertouchd.simulation.show import ROWS_PX, make_rig
from cornertouchd.simulation.sway import sway_within

FINGERS_MM = (8.0, 14.0)
LEANS_RAD = (0.1, 0.5)
SPEEDS_MM_S = (150.0, 400.0)
INSET_MM = 15.0
"""Fingers stay this far inside their part of the surface."""

USUAL_CAMERAS = 4


@dataclass(frozen=True, slots=True)
class BenchRig:
    """A simulated rig and its calibration."""

    rig: SimulatedRig
    calibration: Calibration
    rate_hz: float

    def frame_sets(self, touches: int, sets: int, seed: int = 1) -> list[tuple[Frame, ...]]:
        """Return the pictures of so many instants with so many moving fingers."""
        script = always_down(self.rig.surface_mm, touches, seed)
        times_s = [index / self.rate_hz for index in range(sets)]
        return [
            self.rig.frame_set(index, time_s, [each.finger for each in script(time_s)])
            for index, time_s in enumerate(times_s)
        ]


def bench_rig(
    settings: Settings, environ: Mapping[str, str], real: Calibration | None = None
) -> BenchRig:
    """Return a simulated rig of the size of the real one, if that is calibrated, else as it is set.

    Its pictures have the usual number of rows: of taller ones no more is looked at.  Raises
    `CalibrationError` if no such rig can be.
    """
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    size_px = (settings.cameras.width_px, settings.cameras.height_px)
    cameras = len(settings.cameras.enabled_ids)
    if real is not None:
        form = real.cameras[0].format
        surface_mm, size_px = real.surface_mm, (form.width_px, form.height_px)
        cameras = len(real.cameras)
    simulated = _simulated(settings, surface_mm, size_px)
    if cameras == USUAL_CAMERAS:
        rig, calibration = make_rig(simulated), calibrated_rig(simulated, environ)
    else:
        rig = _with_cameras(simulated, cameras)
        calibration = calibrate_rig(rig, simulated)
    return BenchRig(rig, calibration, settings.cameras.rate_hz)


def _simulated(
    settings: Settings, surface_mm: tuple[float, float], size_px: tuple[int, int]
) -> Settings:
    """Return the settings of a simulated rig of this size."""
    return settings.model_copy(
        update={
            "surface": SurfaceSettings(width_mm=surface_mm[0], height_mm=surface_mm[1]),
            "cameras": CamerasSettings(
                source="simulated", width_px=size_px[0], height_px=size_px[1]
            ),
            "simulation": SimulationSettings(),
            "calibration": type(settings.calibration)(),
        }
    )


def _with_cameras(settings: Settings, cameras: int) -> SimulatedRig:
    """Return the simulated rig with another number of cameras.  Raises `CalibrationError`."""
    try:
        return SimulatedRig(
            (settings.surface.width_mm, settings.surface.height_mm),
            settings.cameras.width_px,
            settings.cameras.height_px,
            ROWS_PX,
            settings.simulation.seed,
            cameras=cameras,
        )
    except ValueError as error:
        raise CalibrationError(f"no rig like this can be simulated: {error}") from error


def always_down(surface_mm: tuple[float, float], touches: int, seed: int = 1) -> Script:
    """Return a script of fingers that sway, each in its part of the surface, and never lift."""
    rng = np.random.default_rng(seed)
    width_mm, height_mm = surface_mm
    columns = max(1, ceil(sqrt(touches * width_mm / height_mm)))
    rows = max(1, ceil(touches / columns))
    part_mm = (width_mm / columns, height_mm / rows)
    reach_mm = (part_mm[0] / 2.0 - INSET_MM, part_mm[1] / 2.0 - INSET_MM)
    swaying = []
    for number in range(touches):
        row, column = divmod(number, columns)
        middle_mm = ((column + 0.5) * part_mm[0], (row + 0.5) * part_mm[1])
        sway = sway_within(middle_mm, reach_mm, rng.uniform(*SPEEDS_MM_S), rng)
        leans_to_rad = pi / 2.0 + rng.uniform(-0.6, 0.6)  # the arm comes from the lower side
        swaying.append((sway, rng.uniform(*FINGERS_MM), rng.uniform(*LEANS_RAD), leans_to_rad))

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        return tuple(
            TimedFinger(key, Finger(*sway.place_mm(t_s), diameter_mm, lean_rad, leans_to_rad))
            for key, (sway, diameter_mm, lean_rad, leans_to_rad) in enumerate(swaying)
        )

    return fingers_at
