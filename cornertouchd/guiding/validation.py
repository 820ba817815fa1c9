"""Check a calibration with fresh taps at named places."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.guiding.finger_watch import FingerWatch, place_mm
from cornertouchd.guiding.status import Status
from cornertouchd.guiding.target_taps import TargetTaps
from cornertouchd.guiding.targets import VALIDATION_NAMES, validation_targets
from cornertouchd.model import Frame

REFUSED_MM = 25.0
"""A tap farther off was not meant for the target: no calibration that fits is so wrong."""


@dataclass(frozen=True, slots=True)
class CheckedPlace:
    """How far off a fresh tap was located."""

    name: str
    target_mm: tuple[float, float]
    off_mm: float


class Validation:
    """A step that waits for one tap at each of the named places."""

    def __init__(self, watch: FingerWatch, surface_mm: tuple[float, float]) -> None:
        self._watch = watch
        self._taps = TargetTaps(watch, validation_targets(surface_mm), REFUSED_MM, VALIDATION_NAMES)

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        return self._taps.status("check")

    def feed(self, frames: Sequence[Frame]) -> "Validation | Validated":
        """Take a frame set; return the result when all places have been tapped."""
        self._taps.feed(frames)
        return self if self._taps.target is not None else Validated(self._places())

    def _places(self) -> tuple[CheckedPlace, ...]:
        found = []
        for number, tap in sorted(self._taps.taps.items()):
            target = self._taps.targets_mm[number]
            place = place_mm(self._watch.models, tap)
            off_mm = np.inf if place is None else float(np.linalg.norm(place - target))
            x_mm, y_mm = target.tolist()
            found.append(CheckedPlace(VALIDATION_NAMES[number], (x_mm, y_mm), off_mm))
        return tuple(found)


@dataclass(frozen=True)
class Validated:
    """All places have been tapped."""

    places: tuple[CheckedPlace, ...]

    @property
    def status(self) -> Status:
        """Nothing is left to do."""
        return Status("done", "", 1.0)

    @property
    def worst_mm(self) -> float:
        """The largest error."""
        return max(place.off_mm for place in self.places)

    def feed(self, frames: Sequence[Frame]) -> "Validated":  # noqa: ARG002
        """Stay."""
        return self
