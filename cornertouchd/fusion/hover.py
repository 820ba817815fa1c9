"""Hover: the light that passes between a finger and its mirror image where they should meet.

A finger that touches and its mirror image make an hourglass; its waist lies on the surface line
and is dark.  One that hovers leaves a gap there, through which the strip shines.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.edge_rows import row_of_three
from cornertouchd.fusion.rays import (
    BOTTOM,
    HORIZON,
    NEAREST_MM,
    ROWS_PER_SLOPE,
    SHEAR,
    VISIBLE,
    Views,
    between,
    column_at,
    direction_at,
)
from cornertouchd.model import FloatArray

# The gap is looked for on seven rows, 1.5 px above and below where it should be; in the middle 35 %
# of the finger's width, at least so many columns to each side.
ROWS, ROW_STEP_PX = 7, 0.5
WIDTH_SHARE, LEAST_HALF_WIDTH_PX = 0.35, 0.6
# What is thicker than a finger has its waist in the middle all the same.
LARGEST_RADIUS_MM = 8.0
# Rows by which the gap must lie above the end of the mirror image, and columns by which it must
# lie beside what hides the strip.
END_PX, NOTCH_PX = 1.2, 2.5
SAMPLES = 5
# A finger that touches is not black at the waist: skin is lit from the other sides, and light
# beside the waist is blurred over it, the more the smaller it looks.  99 % of touches seen by one
# camera stay below .23 at .65 px/mm, .19 at 1 and .18 at 3 (path-traced pictures; simulated ones
# below .20, .18, .09).  Simulated fingers that hover at all show twice this, at 2 mm five times.
SKIN_LIGHT, BLURRED_LIGHT = 0.19, 0.045
# By how much the mean over 1, 2, 3, 4 cameras stays below that.
LESS_IF_AGREED = (1.0, 0.8, 0.68, 0.56)
MOST_AGREED = len(LESS_IF_AGREED)
# Pens are narrower at the tip than where the light is looked for: .24 to .56 of it when they touch,
# .86 and more when they do not; so does a finger whose round tip has just come into view.
THINNEST_FINGER_MM, THIN_LIGHT = 3.0, 0.47


class KeptLight(NamedTuple):
    """The light of a camera below what it sees: `light` (R, N) and so on of its `Outlines`."""

    light: NDArray[np.float32]
    light_at: NDArray[np.int32]
    light_row_px: NDArray[np.int32]


@borrowing
def gap_number(total: float, cameras: int, radius_mm: float) -> float:
    """Return the light at the waist in units of the most that a touching finger lets through.

    It is the mean over the cameras that could tell, NaN if none; `total` is the sum over them of
    the light that each sees in units of `light_of_touch`.
    """
    if cameras == 0:
        return np.nan
    agreed = (
        1.0 if radius_mm < THINNEST_FINGER_MM else LESS_IF_AGREED[min(cameras, MOST_AGREED) - 1]
    )
    return total / cameras / agreed


@borrowing
def light_of_touch(pixels_per_mm: float, radius_mm: float) -> float:
    """Return the light at the waist that 99 % of what touches stays below, seen by one camera."""
    if radius_mm < THINNEST_FINGER_MM:
        return THIN_LIGHT
    return SKIN_LIGHT + BLURRED_LIGHT / pixels_per_mm


@borrowing
def light_gap(
    views: Views,
    kept: KeptLight,
    camera: int,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    light: FloatArray,
) -> tuple[float, float]:
    """Return the share of light at the waist of a finger, and the pixels of a millimetre there.

    The light is NaN if the camera cannot tell: the place is too near, beyond the end of the mirror
    image, beside what hides the strip, or the light was not kept there.
    """
    eyes, first_column, by_column, directions = views
    eye_x, eye_y, eye_z = row_of_three(eyes, camera)
    dx, dy = x_mm - eye_x, y_mm - eye_y
    away_mm = np.hypot(dx, dy)
    radius_mm = min(radius_mm, LARGEST_RADIUS_MM)
    if not away_mm > radius_mm + NEAREST_MM:
        return np.nan, np.nan
    level_px = column_towards(views, camera, dx, dy)
    if not level_px >= 0.0:
        return np.nan, np.nan
    below, share = column_at(first_column, camera, level_px)
    drop_px = eye_z * between(by_column, below, share, ROWS_PER_SLOPE) / away_mm
    middle_px = level_px + between(by_column, below, share, SHEAR) * drop_px
    _, _, angle_per_px = direction_at(first_column, directions, camera, level_px)
    pixels_per_mm = 1.0 / (abs(angle_per_px) * away_mm)
    half_px = max(WIDTH_SHARE * radius_mm * pixels_per_mm, LEAST_HALF_WIDTH_PX)
    if not _is_in_sight(views, camera, middle_px, half_px):
        return np.nan, pixels_per_mm
    light[:] = 0.0
    for sample in range(SAMPLES):
        column_px = middle_px + half_px * (2.0 * sample / (SAMPLES - 1) - 1.0)
        below, share = column_at(first_column, camera, column_px)
        rows_per_slope_px = between(by_column, below, share, ROWS_PER_SLOPE)
        waist_px = between(by_column, below, share, HORIZON) + eye_z * rows_per_slope_px / away_mm
        left_px = between(by_column, below, share, BOTTOM) - waist_px
        if not np.copysign(1.0, rows_per_slope_px) * left_px > END_PX:
            return np.nan, pixels_per_mm
        first_px = waist_px - ROWS // 2 * ROW_STEP_PX
        _add_light(kept, int(column_px), first_px, light)
    brightest = np.nan
    for row in range(ROWS):
        if np.isfinite(light[row]) and not light[row] <= brightest:
            brightest = light[row]
    return brightest / SAMPLES, pixels_per_mm


@borrowing
def column_towards(views: Views, camera: int, dx: float, dy: float) -> float:
    """Return the column on the horizon that looks along (dx, dy), NaN if none does.

    Directions turn one way from column to column, by less than half a turn altogether.
    """
    first = views.first_column[camera] + camera
    low, high = 0, views.first_column[camera + 1] - views.first_column[camera]
    while low < high and not np.isfinite(views.directions[first + low, 0]):
        low += 1
    while low < high and not np.isfinite(views.directions[first + high, 0]):
        high -= 1
    turned_low = _turned(views, first + low, dx, dy)
    turned_high = _turned(views, first + high, dx, dy)
    ahead = (views.directions[first + low, 0] + views.directions[first + high, 0]) * dx + (
        views.directions[first + low, 1] + views.directions[first + high, 1]
    ) * dy
    if not (turned_low * turned_high < 0.0 and ahead > 0.0):
        return np.nan
    while high - low > 1:
        middle = (low + high) // 2
        turned = _turned(views, first + middle, dx, dy)
        if not turned * turned_low <= 0.0:
            low, turned_low = middle, turned
        else:
            high, turned_high = middle, turned
    return float(low + turned_low / (turned_low - turned_high))


@borrowing
def _turned(views: Views, place: int, dx: float, dy: float) -> float:
    """Return how far (dx, dy) lies beside a column's direction, positive on one side of it."""
    return float(views.directions[place, 0] * dy - views.directions[place, 1] * dx)


@borrowing
def _is_in_sight(views: Views, camera: int, middle_px: float, half_px: float) -> bool:
    """Whether the strip is seen in these columns and beside them."""
    first, last = middle_px - half_px - NOTCH_PX, middle_px + half_px + NOTCH_PX
    width_px = views.first_column[camera + 1] - views.first_column[camera]
    if not (first >= 0.0 and last <= width_px):
        return False
    for column in range(int(first), min(int(last) + 1, width_px)):
        if views.by_column[views.first_column[camera] + column, VISIBLE] == 0.0:
            return False
    return True


@borrowing
def _add_light(kept: KeptLight, column: int, first_px: float, light: FloatArray) -> None:
    """Add the light of a column at rows from `first_px` on, NaN where it was not kept."""
    rows, columns = kept.light.shape
    place = kept.light_at[column]
    row = first_px - 0.5 - kept.light_row_px[column]
    for step in range(ROWS):
        if 0 <= place < columns and 0.0 <= row < rows - 1:
            above = int(row)
            share = row - above
            light[step] += (1.0 - share) * kept.light[above, place] + share * kept.light[
                above + 1, place
            ]
        else:
            light[step] = np.nan
        row += ROW_STEP_PX
