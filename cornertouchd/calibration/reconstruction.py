"""The paper's 3D reconstruction (Wang et al. 2011, section 6.1.3).

Boards fix the cameras' lenses and poses, at least two reference points tie them to the surface.
All cameras of a rig stand at one height: the plane through their projection centres is parallel to
the surface, and their level rays run in it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cornertouchd.calibration.calibration import CalibrationError, TapsDoNotFitError
from cornertouchd.calibration.error_map import map_from_line_sigmas
from cornertouchd.calibration.fitted import Fitted, distances_mm, line_sigma_mm
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.lenses import LensFit, fit_lens
from cornertouchd.calibration.stereo import Pose, chain_poses
from cornertouchd.geometry import nearest_points_to_lines
from cornertouchd.locating.reconstruction import Axis, Reconstruction
from cornertouchd.model import BoolArray, FloatArray, PictureFormat

FEWEST_CAMERAS = 3
"""Fewer projection centres leave open how the surface's plane lies."""

FEWEST_POINTS = 2

FITTED_TO_TAPS = 3
"""A turn and a shift, of all cameras together."""

OUTLIER_MEDIANS = 3.0
OUTLIER_FLOOR_MM = 1.0
"""A tap is dropped when it is off by more than three times the median and more than a finger can
be trusted to hit."""

LARGEST_SCALE_ERROR = 0.03
"""Taps half a millimetre off leave under 1 % even on a small rig; printers that fit boards to their
page shrink them by 4 % and more."""


@dataclass(frozen=True)
class _Tie:
    """From the plane of the cameras to the surface: `turn` (2, 2) @ p + `shift_mm`."""

    turn: FloatArray
    shift_mm: FloatArray

    def place(self, points_mm: FloatArray) -> FloatArray:
        placed: FloatArray = points_mm @ self.turn.T + self.shift_mm
        return placed


def fit_reconstruction(given: ReferenceTouches) -> Fitted:
    """Calibrate lenses and poses from boards, and tie them to the surface by the taps.

    Raises `CalibrationError` naming camera, reason and remedy.
    """
    if not given.boards:
        raise CalibrationError(
            "the reconstruction needs pictures of a board: print one by `--print-board FILE`, "
            "record it before the cameras with all rows of their pictures, and give that "
            "recording as `--boards DIR`"
        )
    if len(given.formats) < FEWEST_CAMERAS:
        raise CalibrationError(
            f"the reconstruction needs {FEWEST_CAMERAS} cameras to find the surface's plane, "
            f"there are {len(given.formats)}; take another method"
        )
    lenses = {
        camera: fit_lens(camera, given.boards, size) for camera, size in given.formats.items()
    }
    level = _level_cameras(lenses, chain_poses(lenses), given.formats)
    columns = given.touches.columns_px.mean(axis=2)
    tie, used = _tie_to_surface(level, columns, given.touches.points_mm)
    models = tuple(_tied(camera, tie) for camera in level)
    points = np.where(
        given.touches.known[:, None], given.touches.points_mm, _triangulated(models, columns)
    )
    residuals = np.array(
        [distances_mm(model, points, seen) for model, seen in zip(models, columns, strict=True)]
    )
    # taps are few, so that all cameras' count together; what was triangulated would flatter
    sigma_mm = line_sigma_mm(residuals[:, used], FITTED_TO_TAPS)
    return Fitted(
        models,
        residuals,
        given.touches.seen & given.touches.known & ~used,
        map_from_line_sigmas(given.surface_mm, models, np.full(len(models), sigma_mm)),
    )


def _level_cameras(
    lenses: Mapping[str, LensFit],
    poses: Mapping[str, Pose],
    formats: Mapping[str, PictureFormat],
) -> list[Reconstruction]:
    """Return the cameras in the plane of their projection centres, wherever that lies.

    The plane's z points to where the cameras' down axes do: into the surface.
    """
    centres = np.array([pose.centre_mm for pose in poses.values()])
    _, _, (x, _, z) = np.linalg.svd(centres - centres.mean(axis=0))
    down = np.sum([pose.rotation[1] for pose in poses.values()], axis=0)
    z = z if z @ down > 0 else -z
    plane = np.stack([x, np.cross(z, x), z])
    return [
        Reconstruction(
            _pair(plane[:2] @ poses[camera].centre_mm),
            _axes(poses[camera].rotation @ plane.T),
            lenses[camera].lens,
            formats[camera].width_px,
        )
        for camera in lenses
    ]


def _tie_to_surface(
    cameras: Sequence[Reconstruction], columns_px: FloatArray, points_mm: FloatArray
) -> tuple[_Tie, BoolArray]:
    """Return the tie, and which taps (points,) it goes by."""
    seen_mm = _triangulated(cameras, columns_px)
    used = np.asarray(np.isfinite(np.hstack([seen_mm, points_mm])).all(axis=1))
    if np.count_nonzero(used) < FEWEST_POINTS:
        raise TapsDoNotFitError(
            f"{np.count_nonzero(used)} reference points were seen by two cameras, "
            f"{FEWEST_POINTS} are needed to tie the cameras to the surface: tap some, far from "
            "each other"
        )
    _require_same_scale(seen_mm[used], points_mm[used])
    tie = _rigid(seen_mm[used], points_mm[used])
    off = np.linalg.norm(tie.place(seen_mm) - points_mm, axis=1)
    largest = max(OUTLIER_MEDIANS * float(np.median(off[used])), OUTLIER_FLOOR_MM)
    good = used & (off <= largest)
    if FEWEST_POINTS <= np.count_nonzero(good) < np.count_nonzero(used):
        used, tie = good, _rigid(seen_mm[good], points_mm[good])
    return tie, used


def _triangulated(cameras: Sequence[Reconstruction], columns_px: FloatArray) -> FloatArray:
    """Return where each touch (points, 2) is, NaN where fewer than two cameras say."""
    origins = np.array([camera.position_mm for camera in cameras])
    angles = np.array(
        [camera.angles_rad(seen) for camera, seen in zip(cameras, columns_px, strict=True)]
    )
    return nearest_points_to_lines(origins, angles)


def _rigid(seen_mm: FloatArray, true_mm: FloatArray) -> _Tie:
    """Return the turn and shift with least squares from `seen_mm` to `true_mm`, both (N, 2)."""
    seen_middle, true_middle = seen_mm.mean(axis=0), true_mm.mean(axis=0)
    u, _, v = np.linalg.svd((true_mm - true_middle).T @ (seen_mm - seen_middle))
    turn = u @ np.diag([1.0, np.linalg.det(u @ v)]) @ v
    return _Tie(turn, true_middle - turn @ seen_middle)


def _require_same_scale(seen_mm: FloatArray, true_mm: FloatArray) -> None:
    """Raise `CalibrationError` when taps lie farther apart, or nearer, than the boards say."""
    pairs = np.triu_indices(len(seen_mm), 1)
    seen, true = (np.linalg.norm(p[:, None] - p, axis=2)[pairs] for p in (seen_mm, true_mm))
    apart = true > 0.0
    if not apart.any():
        raise CalibrationError(
            "all reference points are at one place; tap two at least, far from each other"
        )
    scale = float(np.median(seen[apart] / true[apart]))
    if abs(scale - 1.0) > LARGEST_SCALE_ERROR:
        raise CalibrationError(
            f"the boards make the distances between the taps {scale:.1%} of what they are, "
            f"{LARGEST_SCALE_ERROR:.0%} off is allowed: measure a square of the printed board "
            "and give its size, and check where the taps were"
        )


def _tied(camera: Reconstruction, tie: _Tie) -> Reconstruction:
    rotation = np.array(camera.rotation)
    rotation[:, :2] = rotation[:, :2] @ tie.turn.T
    return replace(
        camera,
        position_mm=_pair(tie.place(np.array([camera.position_mm]))[0]),
        rotation=_axes(rotation),
    )


def _pair(values: FloatArray) -> tuple[float, float]:
    x, y = values.tolist()
    return x, y


def _axes(rotation: FloatArray) -> tuple[Axis, Axis, Axis]:
    right, down, forward = ((x, y, z) for x, y, z in rotation.tolist())
    return right, down, forward
