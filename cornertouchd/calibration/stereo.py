"""Where cameras stand to each other, from a board that two of them see at once.

Pairs are calibrated one by one and chained to the first camera (Wang et al. 2011, section 6.1.3:
C1C2, C1C4, C2C3 or C4C3).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from cornertouchd.calibration.board_sights import common_corners
from cornertouchd.calibration.boards import FEWEST_CORNERS
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.lenses import LensFit, undistorted
from cornertouchd.model import FloatArray

FEWEST_COMMON = 4
"""One would do if no corner were off; four average and let one be dropped."""

OUTLIER_MEDIANS = 3.0
"""A board that fits this many times worse than the median one was moved between the pictures."""

SCALE_PX = 400.0
"""Rays are given to OpenCV as pixels of a pinhole of this focal length: its stopping rule is meant
for pixels."""
PRECISELY = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-9)


@dataclass(frozen=True)
class Pose:
    """From coordinates X to those of a camera: `rotation` (3, 3) @ X + `shift_mm`."""

    rotation: FloatArray
    shift_mm: FloatArray

    @property
    def centre_mm(self) -> FloatArray:
        """The projection centre in the coordinates X."""
        centre: FloatArray = -self.rotation.T @ self.shift_mm
        return centre

    @property
    def inverse(self) -> "Pose":
        """The way back."""
        return Pose(self.rotation.T, self.centre_mm)

    def after(self, first: "Pose") -> "Pose":
        """Return the pose that goes through `first`, then through this one."""
        return Pose(self.rotation @ first.rotation, self.rotation @ first.shift_mm + self.shift_mm)


@dataclass(frozen=True)
class _CommonView:
    """Corners that two cameras saw at once, and where their rays cross the planes before them."""

    corners_mm: FloatArray
    first: FloatArray
    second: FloatArray


def chain_poses(lenses: Mapping[str, LensFit]) -> dict[str, Pose]:
    """Return the pose of every camera relative to the first.

    Each is reached over as few pairs as can be, and of those by the one that saw the most boards
    together.  Raises `CalibrationError` naming a camera that cannot be reached.
    """
    first = next(iter(lenses))
    poses = {first: Pose(np.eye(3), np.zeros(3))}
    while len(poses) < len(lenses):
        waiting = {
            camera: _best_link(camera, poses, lenses) for camera in lenses if camera not in poses
        }
        reached = {
            camera: _calibrate_pair(views).after(poses[through])
            for camera, (through, views) in waiting.items()
            if len(views) >= FEWEST_COMMON
        }
        if not reached:
            camera, (through, views) = next(iter(waiting.items()))
            raise CalibrationError(
                f"cameras {through} and {camera}: {len(views)} pictures show the board to both, "
                f"{FEWEST_COMMON} are needed: hold it in the middle of the surface, facing the "
                "side between them"
            )
        poses |= reached
    return {camera: poses[camera] for camera in lenses}


def _best_link(
    camera: str, reached: Mapping[str, Pose], lenses: Mapping[str, LensFit]
) -> tuple[str, list[_CommonView]]:
    """Return the camera with which this one saw most boards, and these without outliers."""
    links = [(other, _common_views(lenses[other], lenses[camera])) for other in reached]
    through, views = max(links, key=lambda link: len(link[1]))
    return through, _agreeing(views) if len(views) >= FEWEST_COMMON else views


def _common_views(a: LensFit, b: LensFit) -> list[_CommonView]:
    seen_by_b = {view.set: view for view in b.views}
    views = []
    for view in (view for view in a.views if view.set in seen_by_b):
        corners, in_a, in_b = common_corners(view, seen_by_b[view.set])
        first, second = undistorted(a.lens, in_a), undistorted(b.lens, in_b)
        good = np.isfinite(np.hstack([first, second])).all(axis=1)
        if np.count_nonzero(good) >= FEWEST_CORNERS:
            views.append(_CommonView(corners[good], first[good], second[good]))
    return views


def _agreeing(views: Sequence[_CommonView]) -> list[_CommonView]:
    """Return the views that agree on how the cameras stand to each other.

    Each view alone says how; the one that speaks for most others (least median of the errors) is
    believed.
    """
    first = [_board_pose(view.corners_mm, view.first) for view in views]
    second = [_board_pose(view.corners_mm, view.second) for view in views]
    errors = np.array(
        [
            [_error_px(view, pair.after(pose)) for view, pose in zip(views, first, strict=True)]
            for pair in (b.after(a.inverse) for a, b in zip(first, second, strict=True))
        ]
    )
    medians = np.median(errors, axis=1)
    believed = int(np.argmin(medians))
    kept = errors[believed] <= OUTLIER_MEDIANS * medians[believed]
    return [view for view, keep in zip(views, kept.tolist(), strict=True) if keep]


def _board_pose(corners_mm: FloatArray, plane: FloatArray) -> Pose:
    """Return the pose that takes a board to a camera that sees it so."""
    board = np.column_stack([corners_mm, np.zeros(len(corners_mm))])
    _, turn, shift = cv2.solvePnP(board, plane.reshape(-1, 1, 2), np.eye(3), np.zeros(5))
    return Pose(np.asarray(cv2.Rodrigues(turn)[0], np.float64), np.ravel(shift))


def _error_px(view: _CommonView, pose: Pose) -> float:
    """Return how far (RMS) the second camera sees the corners from where `pose` puts them."""
    x, y, z = pose.rotation[:, :2] @ view.corners_mm.T + pose.shift_mm[:, None]
    return SCALE_PX * float(np.sqrt(np.mean((np.stack([x / z, y / z]) - view.second.T) ** 2)))


def _calibrate_pair(views: Sequence[_CommonView]) -> Pose:
    """Return the pose of the second camera relative to the first."""
    pinhole = np.diag([SCALE_PX, SCALE_PX, 1.0])
    boards = [np.column_stack([view.corners_mm, np.zeros(len(view.corners_mm))]) for view in views]
    _, _, _, _, _, rotation, shift, _, _ = cv2.stereoCalibrate(
        [board.astype(np.float32) for board in boards],
        [(SCALE_PX * view.first).astype(np.float32) for view in views],
        [(SCALE_PX * view.second).astype(np.float32) for view in views],
        pinhole,
        np.zeros(5),
        pinhole,
        np.zeros(5),
        (1, 1),  # the size of pictures counts only where intrinsics are looked for
        flags=cv2.CALIB_FIX_INTRINSIC,
        criteria=PRECISELY,
    )
    return Pose(np.asarray(rotation, np.float64), np.ravel(shift))
