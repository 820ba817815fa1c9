"""The intrinsics of one camera, from a board held before it in many poses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import cv2
import numpy as np

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.boards import FEWEST_CORNERS, PIXEL_CENTRE_PX
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.fitted import rms
from cornertouchd.locating.reconstruction import BoardLens
from cornertouchd.model import FloatArray, PictureFormat

FEWEST_VIEWS = 8
"""Every view has a pose of its own, six unknowns, and the lens has as many: eight views of twenty
corners leave enough to average over."""

SMALLEST_SPAN = 0.6
"""Share of the picture's width over which corners must lie, or the borders are a guess."""

SMALLEST_TILT_RAD = np.deg2rad(15.0)
"""Boards that all face the same way leave the focal length open."""

LARGEST_RESIDUAL_PX = 1.0
"""Corners are found to .1 px; at one pixel the model or the board is another."""

OUTLIER_MEDIANS = 4.0
"""Corners this many times farther off than the median one, and views whose RMS is that many times
the median view's, are left out: noise alone does that once in 60 000 corners."""

FISHEYE_GAIN = 0.95
"""The fisheye model must leave at most this share of the pinhole's residual: it has more freedom,
and where both explain the corners it errs half as much again between them."""

GUESSED_FOCAL_SHARE = 0.5
"""Of the width: a field of 90 degrees, as the corner of a frame asks for."""

NEWTON_STEPS = 12
SLOPE_STEP = 1e-5

PINHOLE_FLAGS = (
    cv2.CALIB_USE_INTRINSIC_GUESS
    | cv2.CALIB_RATIONAL_MODEL
    | cv2.CALIB_FIX_ASPECT_RATIO
    | cv2.CALIB_ZERO_TANGENT_DIST
    | cv2.CALIB_FIX_K3
    | cv2.CALIB_FIX_K5
    | cv2.CALIB_FIX_K6
)
"""Of the rational model's eight coefficients k1, k2 and k4 are set free.  On simulated rigs with
24 boards they err by .03 degrees; all eight by .06, because they follow the noise."""

# OpenCV 5 moved the flags of its fisheye model.
_FISHEYE: Any = cv2 if hasattr(cv2, "CALIB_RECOMPUTE_EXTRINSIC") else cv2.fisheye
FISHEYE_FLAGS: int = (
    cv2.CALIB_USE_INTRINSIC_GUESS | _FISHEYE.CALIB_RECOMPUTE_EXTRINSIC | _FISHEYE.CALIB_FIX_SKEW
)
PRECISELY = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-9)


@dataclass(frozen=True)
class LensFit:
    """A lens, how far corners are from where it puts them (RMS), and the views it explains."""

    lens: BoardLens
    residual_px: float
    views: tuple[BoardSight, ...]


@dataclass(frozen=True)
class _Solution:
    """A lens, the board's rotation (3, 3) in each view, and how far off each corner is (N,)."""

    lens: BoardLens
    rotations: tuple[FloatArray, ...]
    off_px: tuple[FloatArray, ...]

    @property
    def residual_px(self) -> float:
        return rms(np.concatenate(self.off_px))

    @property
    def tilt_rad(self) -> float:
        """Largest angle between the boards of two views."""
        normals = np.array([rotation[:, 2] for rotation in self.rotations])
        return float(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0).min()))


_Views = tuple[BoardSight, ...]
_Solver = Callable[[_Views, PictureFormat], _Solution]


def fit_lens(camera: str, sights: Sequence[BoardSight], size: PictureFormat) -> LensFit:
    """Return the lens of a camera: a pinhole with distortion or a fisheye, whichever fits better.

    Raises `CalibrationError` naming the camera when its views do not fix a lens.
    """
    views = tuple(sight for sight in sights if sight.camera == camera)
    _require_views(camera, views, size)
    fits = [_fit(solve, views, size) for solve in (_as_pinhole, _as_fisheye)]
    pinhole, fisheye = (fit[0].residual_px if fit else np.inf for fit in fits)
    best = fits[1] if fisheye < FISHEYE_GAIN * pinhole else fits[0]
    if best is None:
        raise CalibrationError(
            f"camera {camera}: no lens explains its {len(views)} pictures of the board; "
            "is it flat, and is it the board that was printed?"
        )
    solution, kept = best
    if solution.residual_px > LARGEST_RESIDUAL_PX:
        raise CalibrationError(
            f"camera {camera}: corners of the board are {solution.residual_px:.1f} px off, "
            f"{LARGEST_RESIDUAL_PX:g} is allowed: glue the board to something flat, hold it still, "
            "and check the number of its squares"
        )
    if solution.tilt_rad < SMALLEST_TILT_RAD:
        raise CalibrationError(
            f"camera {camera}: the board was always held the same way, within "
            f"{np.rad2deg(solution.tilt_rad):.0f} degrees, "
            f"{np.rad2deg(SMALLEST_TILT_RAD):.0f} are needed: tilt it"
        )
    return LensFit(solution.lens, solution.residual_px, kept)


def undistorted(lens: BoardLens, pixels_px: FloatArray) -> FloatArray:
    """Return where the rays of pixels (N, 2) cross the plane one unit before the lens, (N, 2).

    Newton's method; what OpenCV offers differs from version to version.
    """
    plane = (pixels_px - lens.centre_px) / lens.focal_px
    for _ in range(NEWTON_STEPS):
        off = pixels_px - _projected(lens, plane)
        slopes = [
            (_projected(lens, plane + step) - _projected(lens, plane - step)) / (2 * SLOPE_STEP)
            for step in SLOPE_STEP * np.eye(2)
        ]
        plane = plane + np.linalg.solve(np.stack(slopes, axis=2), off[..., None])[..., 0]
    return plane


def _projected(lens: BoardLens, plane: FloatArray) -> FloatArray:
    return np.stack(lens.pixels(np.vstack([plane.T, np.ones(len(plane))])), axis=1)


def _require_views(camera: str, views: _Views, size: PictureFormat) -> None:
    if len(views) < FEWEST_VIEWS:
        raise CalibrationError(
            f"camera {camera}: {len(views)} pictures of the board, {FEWEST_VIEWS} are needed: "
            "record all rows of the pictures, and hold the board where this camera sees it"
        )
    columns = np.concatenate([view.pixels_px[:, 0] for view in views])
    if np.ptp(columns) < SMALLEST_SPAN * size.width_px:
        raise CalibrationError(
            f"camera {camera}: the board was seen in columns {columns.min():.0f} to "
            f"{columns.max():.0f} of {size.width_px} only; hold it at the left and at the right of "
            "the view too"
        )


def _fit(solve: _Solver, views: _Views, size: PictureFormat) -> tuple[_Solution, _Views] | None:
    """Return the fit without outliers and the views left for it, or None if there is none."""
    try:
        first = solve(views, size)
        kept = _without_outliers(views, first.off_px)
        whole = sum(len(view.pixels_px) for view in views)
        if len(kept) < FEWEST_VIEWS or sum(len(view.pixels_px) for view in kept) == whole:
            return first, views
        return solve(kept, size), kept
    except cv2.error:  # no start is found, as for a fisheye when a board reaches beside the camera
        return None


def _without_outliers(views: Sequence[BoardSight], off_px: Sequence[FloatArray]) -> _Views:
    """Return the views that are no outliers, with those of their corners that are none."""
    largest = OUTLIER_MEDIANS * np.median(np.concatenate(off_px))
    view_errors = np.array([rms(off) for off in off_px])
    good_views = view_errors <= OUTLIER_MEDIANS * np.median(view_errors)
    kept = []
    for view, off, good_view in zip(views, off_px, good_views.tolist(), strict=True):
        good = off <= largest
        if good_view and np.count_nonzero(good) >= FEWEST_CORNERS:
            kept.append(
                replace(view, corners_mm=view.corners_mm[good], pixels_px=view.pixels_px[good])
            )
    return tuple(kept)


def _as_pinhole(views: _Views, size: PictureFormat) -> _Solution:
    _, matrix, bends, turns, shifts = cv2.calibrateCamera(
        [board.astype(np.float32) for board in _boards(views)],
        [(view.pixels_px - PIXEL_CENTRE_PX).astype(np.float32) for view in views],
        (size.width_px, size.height_px),
        _guessed_matrix(size),
        np.zeros(8),
        flags=PINHOLE_FLAGS,
        criteria=PRECISELY,
    )
    return _solution(_lens("pinhole", matrix, bends.ravel()[:8]), views, turns, shifts)


def _as_fisheye(views: _Views, size: PictureFormat) -> _Solution:
    _, matrix, bends, turns, shifts = cv2.fisheye.calibrate(
        [board[None] for board in _boards(views)],
        [(view.pixels_px - PIXEL_CENTRE_PX)[None] for view in views],
        (size.width_px, size.height_px),
        _guessed_matrix(size),
        np.zeros(4),
        flags=FISHEYE_FLAGS,
        criteria=PRECISELY,
    )
    return _solution(_lens("fisheye", matrix, bends.ravel()), views, turns, shifts)


def _boards(views: _Views) -> list[FloatArray]:
    return [np.column_stack([view.corners_mm, np.zeros(len(view.corners_mm))]) for view in views]


def _guessed_matrix(size: PictureFormat) -> FloatArray:
    focal = GUESSED_FOCAL_SHARE * size.width_px
    return np.array([[focal, 0, size.width_px / 2], [0, focal, size.height_px / 2], [0, 0, 1]])


def _lens(kind: Literal["pinhole", "fisheye"], matrix: Any, bends: Any) -> BoardLens:
    focal, centre = matrix[[0, 1], [0, 1]], matrix[:2, 2] + PIXEL_CENTRE_PX
    return BoardLens(
        kind,
        (float(focal[0]), float(focal[1])),
        (float(centre[0]), float(centre[1])),
        tuple(bends.tolist()),
    )


def _solution(
    lens: BoardLens, views: _Views, turns: Sequence[Any], shifts: Sequence[Any]
) -> _Solution:
    rotations = tuple(np.asarray(cv2.Rodrigues(turn)[0], np.float64) for turn in turns)
    off = []
    for view, board, rotation, shift in zip(views, _boards(views), rotations, shifts, strict=True):
        seen = np.stack(lens.pixels(rotation @ board.T + np.reshape(shift, (3, 1))))
        # beside a pinhole nothing is seen: as far off as can be
        off.append(np.nan_to_num(np.hypot(*(seen - view.pixels_px.T)), nan=np.inf))
    return _Solution(lens, rotations, tuple(off))
