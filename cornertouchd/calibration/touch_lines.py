"""The lines of one touch from all cameras, and what keeps them from meeting in one point."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.calibration.touch_columns import EDGE_SIGMA_PX, SHAPE_SIGMA_MM
from cornertouchd.geometry import normals
from cornertouchd.model import Contact, FloatArray, FrameSet, Observation

FEWEST_CAMERAS = 3
"""Two lines always meet."""

NEAREST_MM = 15.0
"""A shadow whose line passes this near to the touch is taken for its own."""


@dataclass(frozen=True, slots=True, eq=False)  # each touch is another
class TouchLines:
    """One touch; arrays are (cameras,), 0 where a camera has no line.

    `misfits` is how far each line passes from where all of them pass best, in standard deviations;
    `freedom` which share of an error of that line it shows.  `effects` (cameras, 3) is by how many
    standard deviations a line comes off when its camera shifts in x, in y (by 1 mm) or turns (by
    1 rad).
    """

    x_mm: float
    y_mm: float
    misfits: FloatArray
    freedom: FloatArray
    effects: FloatArray
    sigmas_mm: FloatArray


def lines_of_touch(
    frame_set: FrameSet, contact: Contact, cameras: Sequence[CameraCalibration]
) -> TouchLines | None:
    """Return the lines of the only touch there is, None if fewer than three cameras see it whole.

    Shadows elsewhere are no objection: a camera that has moved sees some all the time.
    """
    observations = {seen.camera: seen for seen in frame_set.observations}
    seen, angles, slopes = [], [], []
    for number, camera in enumerate(cameras):
        if camera.id not in observations:
            continue
        own = _own_line(observations[camera.id], contact, camera)
        if own is not None:
            seen.append(number)
            angles.append(own[0])
            slopes.append(own[1])
    if len(seen) < FEWEST_CAMERAS:
        return None
    origins = np.array([cameras[number].model.position_mm for number in seen])
    return _lines(len(cameras), seen, contact, origins, np.array(angles), np.array(slopes))


def _own_line(
    seen: Observation, contact: Contact, camera: CameraCalibration
) -> tuple[float, float] | None:
    """Return angle and slope (rad per pixel) of the shadow of a contact, if there is but one."""
    if not len(seen.shadows):
        return None
    edges = camera.model.angles_rad(seen.shadows.edges_px)
    middles = edges.mean(axis=1)
    away = np.array(contact.section_mm) - camera.model.position_mm
    near = np.flatnonzero(np.abs(normals(middles) @ away) < NEAREST_MM)
    if len(near) != 1:
        return None
    shadow = int(near[0])
    if not seen.shadows.valid[shadow].all():
        return None
    slope = np.diff(edges[shadow]) / np.diff(seen.shadows.edges_px[shadow])
    return float(middles[shadow]), float(np.abs(slope[0]))


def _lines(
    count: int,
    seen: list[int],
    contact: Contact,
    origins_mm: FloatArray,
    angles_rad: FloatArray,
    slopes_rad_px: FloatArray,
) -> TouchLines:
    n = normals(angles_rad)
    away = np.array(contact.section_mm) - origins_mm
    distances = np.linalg.norm(away, axis=1)
    sigmas = np.hypot(SHAPE_SIGMA_MM, distances * slopes_rad_px * EDGE_SIGMA_PX)
    rows = n / sigmas[:, None]
    # what the best place for the touch takes away; the misfits do not depend on the contact's
    left_over = np.eye(len(seen)) - rows @ np.linalg.solve(rows.T @ rows, rows.T)
    misfits, freedom, sigmas_mm = np.zeros(count), np.zeros(count), np.ones(count)
    effects = np.zeros((count, 3))
    misfits[seen] = left_over @ (np.sum(n * away, axis=1) / sigmas)
    freedom[seen] = np.diag(left_over)
    effects[seen] = np.column_stack([n, distances]) / sigmas[:, None]
    sigmas_mm[seen] = sigmas
    return TouchLines(*contact.section_mm, misfits, freedom, effects, sigmas_mm)
