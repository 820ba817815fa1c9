"""Watch one finger: where it is, and when it taps.

Every object here tells what to do (`hint`); none reads a clock or waits: time arrives with frames.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.observing import edges_of_touch, touches_seen
from cornertouchd.geometry import nearest_points_to_lines
from cornertouchd.guiding.tapping import FEWEST_CAMERAS, TapDetector, TapState
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import FloatArray, Frame
from cornertouchd.vision.finder import ShadowFinder

TREMOR_MM = 1.0
"""A finger that is held still wanders less than this (range)."""

JITTER_PX = 0.5
"""A shadow's middle wanders less than this by noise alone (range in .3 s)."""


@dataclass(frozen=True, slots=True)
class Sight:
    """What the cameras see of one finger: edges (cameras, 2), NaN unseen, and where it is (2,).

    `several` if there are more fingers than one; then nothing is told of any.
    """

    captured_at_s: float
    columns_px: FloatArray
    place_mm: FloatArray | None
    several: bool = False

    @property
    def seen_by(self) -> int:
        """How many cameras see it."""
        return int(np.count_nonzero(np.isfinite(self.columns_px).all(axis=1)))


class FingerWatch:
    """Looks for one finger in frame sets; finders and models are of the same cameras."""

    def __init__(self, finders: Mapping[str, ShadowFinder], models: Sequence[CameraModel]) -> None:
        self.finders = finders
        self.models = tuple(models)

    def look(self, frames: Sequence[Frame]) -> Sight:
        """Return what is seen; two cameras that see more than one finger are believed."""
        shadows = {frame.camera: self.finders[frame.camera].find(frame.pixels) for frame in frames}
        columns = np.array([edges_of_touch(shadows.get(camera, ())) for camera in self.finders])
        at_s = frames[0].captured_at_s
        if sum(touches_seen(seen) > 1 for seen in shadows.values()) > 1:
            return Sight(at_s, np.full_like(columns, np.nan), None, several=True)
        return Sight(at_s, columns, place_mm(self.models, columns))


class TapWatch:
    """Waits for taps that `needed` cameras see."""

    def __init__(self, watch: FingerWatch, needed: int = FEWEST_CAMERAS) -> None:
        self._watch = watch
        self._detector = TapDetector(len(watch.models), needed)

    @property
    def held_share(self) -> float:
        """How long the finger has been held, 0..1 of what makes a tap."""
        return self._detector.held_share

    @property
    def hidden(self) -> int:
        """How many touches too few cameras saw, since the last tap."""
        return self._detector.hidden

    def forget_hidden(self) -> None:
        """Count them anew."""
        self._detector.hidden = 0

    @property
    def state(self) -> TapState:
        """What the finger does."""
        return self._detector.state

    @property
    def hint(self) -> str:
        """What to do."""
        return {
            TapState.AWAY: "tap the marked place, and hold still",
            TapState.TOO_SHORT: "too short: hold still a moment longer",
            TapState.HIDDEN: "too few cameras see the finger: hold it upright, away from others",
            TapState.SEVERAL: "only one finger, please",
            TapState.MOVING: "hold still",
            TapState.HOLDING: "hold still",
            TapState.TAPPED: "lift the finger",
        }[self._detector.state]

    def feed(self, frames: Sequence[Frame]) -> FloatArray | None:
        """Take a frame set; return a tap, (cameras, 2) edges, NaN unseen, when it is one."""
        sight = self._watch.look(frames)
        if sight.several:
            self._detector.disturb(sight.captured_at_s)
            return None
        still_px = _still_px(self._watch.models, sight)
        return self._detector.update(sight.captured_at_s, sight.columns_px, still_px)


def place_mm(models: Sequence[CameraModel], columns_px: FloatArray) -> FloatArray | None:
    """Return where a touch with these edges (cameras, 2) is, None if it cannot be told."""
    middles = columns_px.mean(axis=1)
    angles = np.array(
        [model.angles_rad(np.array([u]))[0] for model, u in zip(models, middles, strict=True)]
    )
    origins = np.array([model.position_mm for model in models])
    place: FloatArray = nearest_points_to_lines(origins, angles[:, None])[0]
    return place if np.isfinite(place).all() else None


def _still_px(models: Sequence[CameraModel], sight: Sight) -> FloatArray:
    """Return how far each camera's shadow of a finger that is held still may wander."""
    still_px = np.full(len(models), JITTER_PX)
    if sight.place_mm is None:
        return still_px
    for camera, model in enumerate(models):
        middle = sight.columns_px[camera].mean(keepdims=True)
        away_mm = np.linalg.norm(sight.place_mm - model.position_mm)
        mm_per_px = float(np.abs(model.slopes_rad_px(middle))[0] * away_mm)
        if mm_per_px > 0.0:
            still_px[camera] = np.hypot(JITTER_PX, TREMOR_MM / mm_per_px)
    return still_px
