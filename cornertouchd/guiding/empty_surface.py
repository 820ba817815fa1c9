"""The empty surface, learned while nothing moves before it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cornertouchd.calibration.observing import find_strips, make_finders, mean_pictures
from cornertouchd.config import VisionSettings
from cornertouchd.guiding.light_statistics import (
    LightStatistics,
    measure_light_statistics,
)
from cornertouchd.model import FloatArray, Frame
from cornertouchd.vision.finder import ShadowFinder
from cornertouchd.vision.strip import Strip

PICTURES = 48
"""Half a second; the noise of their mean is a seventh of a picture's."""


@dataclass(frozen=True)
class EmptySurface:
    """What each camera sees when nothing touches."""

    empties: Mapping[str, FloatArray]
    strips: Mapping[str, Strip]
    finders: Mapping[str, ShadowFinder]
    statistics: Mapping[str, LightStatistics]


class EmptyLearner:
    """Collects frame sets until one run of them shows nothing but the strip."""

    def __init__(self, vision: VisionSettings) -> None:
        self._vision = vision
        self._frame_sets: list[Sequence[Frame]] = []
        self.disturbed = False

    @property
    def share(self) -> float:
        """How much of a run has been seen, 0..1."""
        return len(self._frame_sets) / PICTURES

    def feed(self, frames: Sequence[Frame]) -> EmptySurface | None:
        """Take a frame set; return the empty surface once it is known.

        Raises `CalibrationError` naming a camera that shows no strip.
        """
        self._frame_sets.append(frames)
        if len(self._frame_sets) < PICTURES:
            return None
        seen, self._frame_sets = self._frame_sets, []
        empties = mean_pictures(seen)
        strips = find_strips(empties)
        finders = make_finders(strips, empties, self._vision)
        self.disturbed = any(finders[f.camera].find(f.pixels) for frames in seen for f in frames)
        if self.disturbed:
            return None
        statistics = {
            camera: measure_light_statistics(
                camera, [f.pixels for frames in seen for f in frames if f.camera == camera], strip
            )
            for camera, strip in strips.items()
        }
        return EmptySurface(empties, strips, finders, statistics)
