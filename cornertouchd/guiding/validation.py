"""Check a calibration with fresh taps at named places, located as the daemon locates them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import Settings
from cornertouchd.fusion.pairing import frame_set_of
from cornertouchd.guiding.finger_watch import FingerWatch
from cornertouchd.guiding.status import Result, Status, Step
from cornertouchd.guiding.target_taps import TargetTaps
from cornertouchd.guiding.targets import VALIDATION_NAMES, validation_targets
from cornertouchd.model import Frame
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline

REFUSED_MM = 25.0
"""A tap farther off was not meant for the target: no calibration that fits is so wrong."""


@dataclass(frozen=True, slots=True)
class CheckedPlace:
    """How far off a fresh tap was located; infinite if the daemon finds no touch there."""

    name: str
    target_mm: tuple[float, float]
    off_mm: float


@dataclass(frozen=True)
class Validated(Result):
    """All places have been tapped, but for those that too few cameras see."""

    places: tuple[CheckedPlace, ...]

    @property
    def worst_mm(self) -> float:
        """The largest error."""
        return max((place.off_mm for place in self.places), default=np.inf)


class Validation:
    """A step that waits for one tap at each of the named places.

    `watch` tells when a finger taps; where it does is found through the whole pipeline.
    """

    def __init__(self, watch: FingerWatch, calibration: Calibration, settings: Settings) -> None:
        self._taps = TargetTaps(
            watch, validation_targets(calibration.surface_mm), REFUSED_MM, VALIDATION_NAMES
        )
        self._cameras = {
            camera.id: CameraPipeline(camera, settings) for camera in calibration.cameras
        }
        self._surface = SurfacePipeline(calibration, settings)
        self._found: list[CheckedPlace] = []

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        return self._taps.status("check")

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set; return the result when all places have been tapped.

        Raises `PictureError` for pictures that are not those of the calibration.
        """
        number = self._taps.target
        if self._taps.feed(frames) and number in self._taps.taps:
            self._found.append(self._check(number, frames))
        return self if self._taps.target is not None else Validated(tuple(self._found))

    def _check(self, number: int, frames: Sequence[Frame]) -> CheckedPlace:
        frame_set = frame_set_of(self._cameras[frame.camera].find(frame) for frame in frames)
        x_mm, y_mm = self._taps.targets_mm[number].tolist()
        off_mm = min(
            (
                float(np.hypot(contact.x_mm - x_mm, contact.y_mm - y_mm))
                for contact in self._surface.cross(frame_set)
            ),
            default=np.inf,
        )
        return CheckedPlace(VALIDATION_NAMES[number], (x_mm, y_mm), off_mm)
