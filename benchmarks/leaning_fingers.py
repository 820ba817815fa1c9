"""Single fingers that lean, on simulated rigs calibrated as a person would calibrate them."""

import tempfile
from dataclasses import dataclass
from math import hypot, pi, radians
from pathlib import Path

import numpy as np
from accuracy import calibrate_from
from calibration_sets import RIGS, SCRIBBLE_TOUCHES, RigKind, RigRecorder

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import Settings
from cornertouchd.fusion.pairing import frame_set_of
from cornertouchd.guiding.targets import targets_for
from cornertouchd.model import Contact, FrameSet
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

KINDS = tuple(kind for kind in RIGS if kind.barrel)
"""The small and the large rig with ordinary lenses."""

DIAMETERS_MM = (8.0, 16.0)
MOST_LEAN_RAD = radians(45.0)
INSET_MM = 10.0
FOUND_WITHIN_MM = 12.0
"""A contact farther away from the place of the tip is another one."""


@dataclass(frozen=True)
class CalibratedRig:
    """A rig, how it was calibrated, and the cameras that look at it."""

    rig: SimulatedRig
    calibration: Calibration
    cameras: dict[str, CameraPipeline]

    def observe(self, index: int, finger: Finger) -> FrameSet:
        """Return what the cameras see of a finger in their picture `index`."""
        frames = self.rig.frame_set(index, float(index), [finger])
        return frame_set_of([self.cameras[frame.camera].find(frame) for frame in frames])


def calibrated_rig(kind: RigKind, seed: int, tap_sigma_mm: float) -> CalibratedRig:
    """Return the rig of a seed, calibrated from 16 taps and a scribble by leaning fingers.

    A tap misses its target by `tap_sigma_mm` (standard deviation per axis).
    """
    with tempfile.TemporaryDirectory() as scratch:
        sets = Path(scratch)
        recorder = RigRecorder(kind, seed, sets)
        recorder.empty()
        recorder.taps("taps16", targets_for("auto", kind.surface_mm), tap_sigma_mm)
        recorder.fingers("scribble", SCRIBBLE_TOUCHES, MOST_LEAN_RAD)
        calibration = calibrate_from(sets / "taps16", sets / "empty", sets / "scribble")
    cameras = {one.id: CameraPipeline(one, Settings()) for one in calibration.cameras}
    return CalibratedRig(kind.make(seed), calibration, cameras)


def random_finger(
    surface_mm: tuple[float, float], rng: np.random.Generator, height_mm: float = 0.0
) -> Finger:
    """Return a finger anywhere, so high above the surface."""
    x_mm, y_mm = rng.uniform(INSET_MM, np.array(surface_mm) - INSET_MM).tolist()
    return Finger(
        x_mm,
        y_mm,
        diameter_mm=rng.uniform(*DIAMETERS_MM),
        lean_rad=rng.uniform(0.0, MOST_LEAN_RAD),
        lean_azimuth_rad=rng.uniform(-pi, pi),
        height_mm=height_mm,
    )


def contact_of(surface: SurfacePipeline, seen: FrameSet, finger: Finger) -> Contact | None:
    """Return the contact that a finger makes, whether it touches or not; None if there is none."""

    def away_mm(contact: Contact) -> float:
        return hypot(contact.x_mm - finger.x_mm, contact.y_mm - finger.y_mm)

    nearest = min(surface.cross(seen), key=away_mm, default=None)
    return nearest if nearest is not None and away_mm(nearest) < FOUND_WITHIN_MM else None
