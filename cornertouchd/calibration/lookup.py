"""The paper's lookup table, made from reference points along the frame (section 6.1.1)."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cornertouchd.calibration.calibration import CalibrationError, TapsDoNotFitError
from cornertouchd.calibration.error_map import map_from_line_sigmas, places_mm
from cornertouchd.calibration.fitted import SMALLEST_SHARE_KEPT, Fitted, distances_mm, line_sigma_mm
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.rig_corners import CORNERS, corner_mm, corner_number
from cornertouchd.geometry import wrap_angle
from cornertouchd.locating.lookup_table import LookupTable
from cornertouchd.locating.vanishing_point import DegeneratePointsError, solve_projection
from cornertouchd.model import BoolArray, FloatArray

ON_FRAME_MM = 15.0
"""A fingertip pressed against the frame is centred 5 mm inside it, a thick one before a deep bezel
twice that; the outermost taps of a grid are a tenth of a side inside, which is 35 mm and more."""

FEWEST_ROWS = 8
"""Rows are pairs of neighbours that are both seen.  With fewer on two sides, the one that cuts off
the far corner is more than a tenth of the table."""

FITTED_TO_NEAR_SIDES = 2
"""What the points on a camera's near sides fix of it: its projection centre."""

REMEDY = (
    "touch places along the frame at equal distances, 5 mm inside it (the paper has 225 on "
    "350 x 400 mm), and record them with their x and y, or choose another method"
)


def fit_lookup_tables(given: ReferenceTouches) -> Fitted:
    """Make a lookup table for every camera (Wang et al. 2011, section 6.1.1).

    A camera's table has the reference points on its two far sides; those on the near sides appear
    in the same columns.  Its projection centre is that of the paper's 2x3 projection, which is a
    pinhole.  On simulated rigs with 225 points, half a millimetre off each, it comes out to .4 mm,
    and touches to .4 to .5 mm RMSE.  Barrel lenses move the centre: on 350x400 mm by 15 mm, touches
    by 2.6; on 2400x1350 mm by 52 and 15 to 18, and half of the touches are not found by the default
    crossing.

    Points of the table lie on their lines by construction and have no residual; those on the near
    sides tell how good the lines are.  Raises `CalibrationError` naming camera, reason and remedy.
    """
    _require_points_along_frame(given)
    models, residuals, dropped = [], [], []
    for camera, columns in zip(given.formats, given.touches.columns_px, strict=True):
        centres = np.where(given.touches.known, columns.mean(axis=1), np.nan)
        table = _points_of_table(camera, given)
        missed = np.zeros(len(centres), bool)
        missed[table] = _out_of_order(camera, centres[table])
        centres[missed] = np.nan
        centre = _projection_centre(camera, given, centres)
        model = LookupTable(
            centre,
            tuple((float(x), float(y)) for x, y in given.touches.points_mm[table]),
            tuple(centres[table].tolist()),
        )
        off_mm = distances_mm(model, given.touches.points_mm, centres)
        off_mm[table] = np.nan
        models.append(model)
        residuals.append(off_mm)
        dropped.append(missed)
    sigmas_mm = _sigmas_mm(given.surface_mm, models, residuals)
    return Fitted(
        tuple(models),
        np.array(residuals),
        np.array(dropped),
        map_from_line_sigmas(given.surface_mm, models, sigmas_mm),
    )


def _require_points_along_frame(given: ReferenceTouches) -> None:
    points = given.touches.points_mm[given.touches.known]
    if not len(points):
        raise CalibrationError(f"there are no reference points: {REMEDY}")
    inside = _distances_to_sides_mm(points, given.surface_mm).min(axis=1)
    worst = int(np.argmax(inside))
    if inside[worst] > ON_FRAME_MM:
        x, y = points[worst]
        raise CalibrationError(
            f"the reference point at ({x:.1f}, {y:.1f}) mm lies {inside[worst]:.1f} mm from the "
            f"frame, at most {ON_FRAME_MM:.0f} fit a lookup table: {REMEDY}"
        )


def _distances_to_sides_mm(points_mm: FloatArray, surface_mm: tuple[float, float]) -> FloatArray:
    """Return how far points (P, 2) are from the top, right, bottom and left side, (P, 4)."""
    (width, height), (x, y) = surface_mm, points_mm.T
    distances: FloatArray = np.abs(np.stack([y, width - x, height - y, x], axis=1))
    return distances


def _points_of_table(camera: str, given: ReferenceTouches) -> NDArray[np.intp]:
    """Return which reference points are on the far sides of the camera, clockwise along them."""
    corner = corner_number(camera)
    width, height = given.surface_mm
    known = np.flatnonzero(given.touches.known)
    points = given.touches.points_mm[known]
    nearest_side = np.argmin(_distances_to_sides_mm(points, given.surface_mm), axis=1)
    turned = (nearest_side - corner) % 4  # 0 begins at the camera, 1 and 2 are far
    x, y = points.T
    along_side = np.choose(nearest_side, [x, y, width - x, height - y])
    order = np.lexsort((along_side, turned))
    return known[order[np.isin(turned[order], (1, 2))]]


def _out_of_order(camera: str, columns_px: FloatArray) -> BoolArray:
    """Return which of the columns (P,) along the frame, NaN unseen, break the order of the others.

    Raises `CalibrationError` if there are too many of them, or too few others.
    """
    seen = np.flatnonzero(np.isfinite(columns_px))
    kept = max(
        _longest_rising(columns_px[seen]), _longest_rising(-columns_px[seen]), key=np.count_nonzero
    )
    count = int(np.count_nonzero(kept))
    if count < SMALLEST_SHARE_KEPT * len(seen):
        raise TapsDoNotFitError(
            f"camera {camera}: only {count} of the {len(seen)} reference points that it sees on "
            f"its far sides follow each other in order, {SMALLEST_SHARE_KEPT:.0%} are needed: "
            "check them (x and y exchanged? millimetres? the right frame sets?)"
        )
    rows = int(np.count_nonzero(np.diff(seen[kept]) == 1))
    if rows < FEWEST_ROWS:
        raise CalibrationError(
            f"camera {camera}: sees {rows} pairs of neighbouring reference points on its far "
            f"sides, {FEWEST_ROWS} are needed at least: {REMEDY}"
        )
    wrong = np.zeros(len(columns_px), bool)
    wrong[seen[~kept]] = True
    return wrong


def _longest_rising(values: FloatArray) -> BoolArray:
    """Mark the longest rising subsequence."""
    lengths = np.ones(len(values), np.intp)
    before = np.full(len(values), -1)
    for index, value in enumerate(values):
        lower = np.flatnonzero(values[:index] < value)
        if len(lower):
            before[index] = lower[np.argmax(lengths[lower])]
            lengths[index] = lengths[before[index]] + 1
    marked = np.zeros(len(values), bool)
    index = int(np.argmax(lengths)) if len(values) else -1
    while index >= 0:
        marked[index] = True
        index = int(before[index])
    return marked


def _projection_centre(
    camera: str, given: ReferenceTouches, columns_px: FloatArray
) -> tuple[float, float]:
    """Return the projection centre by the paper's projection of all points that the camera sees."""
    seen = np.isfinite(columns_px)
    try:
        x, y = solve_projection(given.touches.points_mm[seen], columns_px[seen]).position_mm
    except DegeneratePointsError as error:
        raise CalibrationError(f"camera {camera}: {error}") from None
    corners = np.array([corner_mm(each, given.surface_mm) for each in CORNERS])
    corner = CORNERS[int(np.argmin(np.linalg.norm(corners - (x, y), axis=1)))]
    if corner != camera:
        raise CalibrationError(
            f"camera {camera}: its projection centre comes out at ({x:.0f}, {y:.0f}) mm, by the "
            f"corner of {corner}; is it in the corner of its name? If so, its lens is too far from "
            "a pinhole for this method: use auto"
        )
    return x, y


def _sigmas_mm(
    surface_mm: tuple[float, float],
    models: Sequence[LookupTable],
    residuals_mm: Sequence[FloatArray],
) -> FloatArray:
    """Return how far off the lines are, (cameras, places) of the error map, NaN without a line.

    A camera that sees no points of the near sides counts as without lines: nothing tells of them.
    """
    _, _, places = places_mm(surface_mm)
    sigmas = np.full((len(models), len(places)), np.nan)
    for camera, (model, residuals) in enumerate(zip(models, residuals_mm, strict=True)):
        sigma_mm = line_sigma_mm(residuals, FITTED_TO_NEAR_SIDES)
        sigmas[camera, _has_line(model, places)] = sigma_mm
    return sigmas


def _has_line(model: LookupTable, places_mm: FloatArray) -> BoolArray:
    """Tell to which places (P, 2) the table has a line, (P,)."""
    columns = np.array(model.columns_px)
    columns = np.sort(columns[np.isfinite(model.angles_rad(columns))])
    angles = model.angles_rad(columns)
    middle = angles.mean()
    away = places_mm - model.position_mm
    wanted = middle + wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - middle)
    rising = np.argsort(angles)
    seen_at = np.interp(wanted, angles[rising], columns[rising], left=np.nan, right=np.nan)
    return np.isfinite(model.angles_rad(seen_at))
