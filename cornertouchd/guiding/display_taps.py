"""Four taps at the corners of a picture: where the display lies on the surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.display import CORNERS
from cornertouchd.calibration.observing import find_strips, make_finders
from cornertouchd.config import VisionSettings
from cornertouchd.guiding.finger_watch import FingerWatch, TapWatch, place_mm
from cornertouchd.guiding.status import Result, Status, Step
from cornertouchd.guiding.tapping import TapState
from cornertouchd.model import FloatArray, Frame

SAME_PLACE_MM = 20.0
"""Two corners of a display are farther apart than this: a second tap so near is the same one."""


def watch_with(
    calibration: Calibration, camera_ids: Sequence[str], vision: VisionSettings
) -> FingerWatch:
    """Return what finds a finger by a calibration in force, with these of its cameras.

    Raises `CalibrationError` for a camera that it does not have.
    """
    cameras = [calibration.camera(camera_id) for camera_id in camera_ids]
    empties = {camera.id: camera.empty for camera in cameras}
    finders = make_finders(find_strips(empties), empties, vision)
    return FingerWatch(finders, [camera.model for camera in cameras])


class DisplayTaps:
    """A step that waits for a tap at each corner of the picture."""

    def __init__(self, watch: FingerWatch) -> None:
        self._watch = watch
        self._taps = TapWatch(watch)
        self._places: list[FloatArray] = []
        self._said = ""

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        number = len(self._places)
        quiet = self._taps.state in (TapState.AWAY, TapState.TAPPED)
        return Status(
            "display",
            self._said if self._said and quiet else self._taps.hint,
            number / len(CORNERS),
            number=number + 1,
            of=len(CORNERS),
            name=f"{CORNERS[number]} of the picture",
            tapped_mm=tuple((float(x), float(y)) for x, y in self._places),
            held=self._taps.held_share,
        )

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set; return the four places when all corners have been tapped."""
        tap = self._taps.feed(frames)
        place = None if tap is None else place_mm(self._watch.models, tap)
        if place is None:
            return self
        if any(np.linalg.norm(place - other) < SAME_PLACE_MM for other in self._places):
            self._said = "that corner has been tapped before: tap the next one"
            return self
        self._said = ""
        self._places.append(place)
        return TappedCorners(np.array(self._places)) if len(self._places) == 4 else self


@dataclass(frozen=True)
class TappedCorners(Result):
    """The last step: where the corners of the picture are, (4, 2) in the order of their names."""

    places_mm: FloatArray
