"""Whether a camera has moved since it was calibrated, told from touches as they happen.

The lines of one touch from all cameras should meet in one point.  What keeps them from it, touch
after touch, is explained for each camera in turn by a shift and a turn of that camera alone: the
one without which the others agree has moved.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, hypot

import numpy as np

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.fitted import rms
from cornertouchd.calibration.touch_lines import TouchLines, lines_of_touch
from cornertouchd.model import BoolArray, Contact, FloatArray, FrameSet, Touch

APART_MM = 10.0
"""A finger that rests tells nothing new; a fingertip further on its errors are others."""

LARGEST_SKEW_MM = 0.2
"""A touch that moves further than this between the pictures of one frame set is left out."""

CELLS = 8
MOST_IN_A_CELL = 3
FEWEST_CELLS = 10
"""Places are told apart by a grid over the surface: a button that is pressed all day shall neither
fill the window nor be all that is known."""

WINDOW = 100
FEWEST_TOUCHES = 30
TOUCHES_BETWEEN_LOOKS = 10

SMALLEST_OFF_MM = 0.2
"""Lines must be off by more than this, and by more than the calibration leads to expect where the
touches were.  Rigs that had not moved reach 0.05 mm where a scribble was used, 0.45 of the expected
error after 16 taps that were 0.5 mm off (simulated), 0.7 of it when only the border is touched
(path-traced).  A shift of 0.5 mm across the view is 0.45 mm."""

LARGEST_RESIDUAL_MM = 1.0
"""A calibration whose method does not fit the lenses better cannot tell that cameras move; auto
fits them, and its residuals are those of the taps."""

OVER_AT = 0.7
"""A drift is over when lines are off by less than this share of what made it one."""

OTHER_SIZE = 1.5
"""A drift that grows or shrinks by less is still the same."""

UNEXPLAINED_SHARE = 0.5
"""The camera that moved leaves less than this share of the misfit unexplained (0.01 to 0.3)."""

AGREE_SHARE = 0.7
"""Without it the others agree so much better than without any other camera (0.01 to 0.5)."""

KEPT_SHARE = 0.8
"""The worst fifth is left out: sleeves, second fingers, what was seen before the camera moved."""

LOOKS_TO_BLAME_ONE = 2
LOOKS_TO_TELL = 8
"""Looks in a row with the same finding until it is told; when the camera is not known it takes
longer: so long as the window holds touches from before and after, none explains it."""

CAMERAS_TO_BLAME_ONE = 4
"""Of three lines that do not meet each may be the wrong one."""

SHIFT_PRIOR_MM = 3.0
TURN_PRIOR_RAD = np.deg2rad(1.0)
"""Keeps shift and turn small where touches lie too close together to tell them apart."""

TOLD_MM = 0.3
"""A shift, or what a turn does to the lines, that is worth telling."""


@dataclass(frozen=True, slots=True)
class Drift:
    """Something has moved; `camera` is None where it cannot be told what.

    `off_mm` is the RMS distance of the camera's lines from touches, of which `turn_mm` is what its
    turn by `turned_rad` does; `moved_mm` is its shift.
    """

    camera: str | None
    off_mm: float
    moved_mm: float
    turned_rad: float
    turn_mm: float

    def is_like(self, other: "Drift") -> bool:
        """Tell whether both say much the same."""
        ratio = self.off_mm / other.off_mm
        return self.camera == other.camera and 1 / OTHER_SIZE < ratio < OTHER_SIZE

    def __str__(self) -> str:
        if self.camera is None:
            return f"cameras have moved, their lines are off by {self.off_mm:.1f} mm; recalibrate"
        told = []
        if self.moved_mm >= TOLD_MM or self.turn_mm < TOLD_MM:
            told.append(f"moved about {self.moved_mm:.1f} mm")
        if self.turn_mm >= TOLD_MM:
            told.append(f"turned by about {abs(degrees(self.turned_rad)):.2f} degrees")
        return f"camera {self.camera} has {' and '.join(told)}; recalibrate"


class DriftWatch:
    """Watches the touches on one surface.  Owned by the fusion thread.

    `drift` is what is known at present, the same object until something changes.
    """

    def __init__(self, calibration: Calibration) -> None:
        self._cameras = calibration.cameras
        self._surface_mm = calibration.surface_mm
        self._expected = calibration.expected
        fits = calibration.residual_mm <= LARGEST_RESIDUAL_MM  # not if that is NaN
        self._can_tell = calibration.method == "auto" or fits
        self._window: list[TouchLines] = []
        self._new = 0
        self._suspect: str | None = None
        self._looks = 0
        self._last: Touch | None = None
        self.drift: Drift | None = None

    def follow(
        self, frame_set: FrameSet, contacts: Sequence[Contact], touches: Sequence[Touch]
    ) -> None:
        """Take note of a touch that is alone on the surface and somewhere else than before."""
        if (
            not self._can_tell
            or len(contacts) != 1
            or len(touches) != 1
            or not contacts[0].touching
        ):
            return
        touch = touches[0]
        if not self._is_elsewhere(touch) or _is_skewed(frame_set, touch):
            return
        self._last = touch  # also if nothing comes of it: it is not looked at again where it rests
        lines = lines_of_touch(frame_set, contacts[0], self._cameras)
        if lines is None:
            return
        self._keep(lines)
        self._new += 1
        if self._new >= TOUCHES_BETWEEN_LOOKS and self._knows_enough():
            self._new = 0
            self._look()

    def _is_elsewhere(self, touch: Touch) -> bool:
        last = self._last
        return (
            last is None
            or last.id != touch.id
            or hypot(touch.x_mm - last.x_mm, touch.y_mm - last.y_mm) > APART_MM
        )

    def _keep(self, lines: TouchLines) -> None:
        """Put a touch into the window; the oldest in its cell, or of all, makes room."""
        cell = self._cell(lines)
        beside = [known for known in self._window if self._cell(known) == cell]
        if len(beside) >= MOST_IN_A_CELL:
            self._window.remove(beside[0])
        elif len(self._window) >= WINDOW:
            del self._window[0]
        self._window.append(lines)

    def _cell(self, lines: TouchLines) -> tuple[int, int]:
        width_mm, height_mm = self._surface_mm
        return int(CELLS * lines.x_mm // width_mm), int(CELLS * lines.y_mm // height_mm)

    def _knows_enough(self) -> bool:
        cells = {self._cell(lines) for lines in self._window}
        return len(self._window) >= FEWEST_TOUCHES and len(cells) >= FEWEST_CELLS

    def _look(self) -> None:
        found = self._explain()
        bound_mm = max(SMALLEST_OFF_MM, self._expected_mm())
        if found.off_mm <= bound_mm * (OVER_AT if self.drift else 1.0):
            self._looks = 0
            self.drift = None
            return
        self._looks = self._looks + 1 if found.camera == self._suspect else 1
        self._suspect = found.camera
        told_before = self.drift is not None and self.drift.is_like(found)
        needed = LOOKS_TO_TELL if found.camera is None else LOOKS_TO_BLAME_ONE
        if self._looks >= needed and not told_before:
            self.drift = found

    def _expected_mm(self) -> float:
        """Return the RMS error to expect at the places of the window."""
        places = np.array([(lines.x_mm, lines.y_mm) for lines in self._window])
        column = np.abs(places[:, :1] - self._expected.x_mm).argmin(axis=1)
        row = np.abs(places[:, 1:] - self._expected.y_mm).argmin(axis=1)
        return rms(np.nan_to_num(self._expected.errors_mm[row, column]))

    def _explain(self) -> Drift:
        """Return the camera whose movement explains the window, or what is off if none does."""
        misfits = np.array([lines.misfits for lines in self._window])
        freedom = np.array([lines.freedom for lines in self._window])
        effects = np.array([lines.effects for lines in self._window])
        sigmas_mm = np.array([lines.sigmas_mm for lines in self._window])
        total = np.sum(misfits**2, axis=1)
        moves = [
            _fit_move(total, misfits[:, n], freedom[:, n], effects[:, n])
            for n in range(len(self._cameras))
        ]
        best, second, *_ = sorted(moves, key=lambda move: move.unexplained)
        blamed = moves.index(best)
        cameras = np.median(np.count_nonzero(freedom, axis=1))
        if (
            cameras >= CAMERAS_TO_BLAME_ONE
            and best.unexplained < UNEXPLAINED_SHARE * _trimmed_mean(total)
            and best.unexplained < AGREE_SHARE * second.unexplained
        ):
            seen = freedom[:, blamed] > 0
            to_mm = effects[seen, blamed] * sigmas_mm[seen, blamed, None]
            return Drift(
                self._cameras[blamed].id,
                rms(to_mm @ best.move),
                hypot(best.move[0], best.move[1]),
                float(best.move[2]),
                rms(to_mm[:, 2] * best.move[2]),
            )
        of_one_camera = np.sum((misfits * sigmas_mm) ** 2, axis=1) / freedom.max(axis=1)
        return Drift(None, float(np.sqrt(_trimmed_mean(of_one_camera))), 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class _Move:
    """Shift in x and y (mm) and turn (rad) of one camera, and the mean misfit that they leave."""

    move: FloatArray
    unexplained: float


def _fit_move(
    total: FloatArray, misfits: FloatArray, freedom: FloatArray, effects: FloatArray
) -> _Move:
    """Fit the movement of one camera to the touches, leaving out those that it explains worst.

    `total` (touches,) are the squared misfits of all cameras together.
    """
    prior = np.diag(np.array([SHIFT_PRIOR_MM, SHIFT_PRIOR_MM, TURN_PRIOR_RAD]) ** -2)
    kept = np.full(len(total), True)
    for _ in range(3):
        weighted = effects[kept] * freedom[kept, None]
        move = np.linalg.solve(weighted.T @ effects[kept] + prior, effects[kept].T @ misfits[kept])
        off = effects @ move
        left = total - 2 * misfits * off + freedom * off**2
        kept = _lowest(left)
    return _Move(move, float(np.mean(left[kept])))


def _trimmed_mean(values: FloatArray) -> float:
    return float(np.mean(values[_lowest(values)]))


def _lowest(values: FloatArray) -> BoolArray:
    """Tell which values are among the lowest `KEPT_SHARE`."""
    last = int(KEPT_SHARE * len(values)) - 1
    return np.asarray(values <= np.partition(values, last)[last])


def _is_skewed(frame_set: FrameSet, touch: Touch) -> bool:
    times_s = [seen.captured_at_s for seen in frame_set.observations]
    speed_mm_s = hypot(touch.vx_mm_s, touch.vy_mm_s)
    return speed_mm_s * (max(times_s) - min(times_s)) > LARGEST_SKEW_MM
