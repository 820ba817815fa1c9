"""Find the strip in empty pictures: its rows, column by column, and the columns that show it.

In the band of rows each column shows, from the top: darkness, the lit strip, a thin dark line where
frame and screen meet (the surface, z = 0), the strip mirrored in a glossy screen, darkness.  The
mirror image tells about height just as the strip does, but it is not the strip.  On a matt screen
there is none, and the strip's lower end is taken for the surface.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial

from cornertouchd.model import BoolArray, FloatArray

SMALLEST_LEVEL = 6.0
"""Grey levels over dark below which a column shows no strip: three times the noise of a picture."""

LIT_SHARE = 0.3
"""Rows brighter than this share of the column's peak are lit.  A mirror image below it is treated
as absent; every half-level edge lies above it."""

SURFACE_DIP = 0.1
"""The surface line is at least this much darker than the strip above and below it."""

CURVE_DEGREE = 4
"""Degree of the strip's rows along one side of the frame: tilt, barrel and perspective together
leave under 0.1 px (rendered pictures)."""

WIDEST_GAP_PX = 40
"""A dark LED hides fewer columns than this, the camera in the next corner too."""

STEP_PX = 2.0
GROWTH = 0.2
"""From one column to the next the strip's height changes by noise and perspective (under 0.1 px a
column on every rig simulated); the own strip differs by its whole height."""


class StripNotFoundError(Exception):
    """The pictures do not show a strip; the message says what they show instead."""


@dataclass(frozen=True, slots=True)
class Strip:
    """Rows of the strip in a camera's picture; every array is (width_px,), rows continuous.

    `surface_px` is where the strip's rows meet the screen (z = 0), `top_px` its upper end,
    `bottom_px` the lower end of the mirror image (of the strip itself where there is none).
    `horizon_px` is the row on which rays run at the height of the camera, whatever the distance.
    Seen by a camera that hangs upside down, strip and mirror image have changed places.
    `visible` is False in columns that show something else than the strip: the own, adjacent
    strips, the frame corner, the camera in the far corner.
    """

    top_px: FloatArray
    surface_px: FloatArray
    bottom_px: FloatArray
    horizon_px: FloatArray
    visible: BoolArray
    mirrored: bool
    dark_level: float

    @property
    def height_px(self) -> FloatArray:
        """Height of the direct strip, (width_px,)."""
        return self.surface_px - self.top_px

    @property
    def upside_down(self) -> bool:
        """Whether the mirror image lies above the strip: the camera's horizon is in the strip."""
        return self.mirrored and bool(np.mean(self.horizon_px - self.surface_px) > 0.0)


@dataclass(frozen=True, slots=True)
class _ColumnRows:
    """What single columns show: rows, NaN where a column shows no clear strip, (width_px,)."""

    top: FloatArray
    surface: FloatArray
    bottom: FloatArray
    level: FloatArray


def find_strip(empty: FloatArray) -> Strip:
    """Return where the strip lies in `empty`, the mean of empty pictures, (rows, width_px).

    Raises `StripNotFoundError` if too few columns show a strip that begins and ends in the band.
    """
    dark = float(np.percentile(empty, 10))
    lit = empty - dark
    rows = _rows_by_column(lit)
    clear = np.isfinite(rows.top)
    if np.count_nonzero(clear) < empty.shape[1] // 4:
        raise StripNotFoundError(_what_is_wrong(empty, dark, int(np.count_nonzero(clear))))
    mirrored = bool(np.mean(np.isfinite(rows.surface[clear])) > 0.5)
    surface = rows.surface if mirrored else rows.bottom
    corner = _far_corner(rows)
    far = _connected_with(corner, rows.bottom - rows.top)
    top_px, top_seen = _two_curves(np.where(far, rows.top, np.nan), corner)
    surface_px, surface_seen = _two_curves(np.where(far, surface, np.nan), corner)
    bottom_px = surface_px
    if mirrored:
        bottom_px, _ = _two_curves(np.where(far, rows.bottom, np.nan), corner)
    visible = top_seen & surface_seen & ~_darkened(lit, corner)
    height = (bottom_px - top_px) / 2 if mirrored else surface_px - top_px
    horizon_px = surface_px - _camera_height_share(surface_px, height, visible) * height
    return Strip(top_px, surface_px, bottom_px, horizon_px, visible, mirrored, dark)


def _rows_by_column(lit: FloatArray) -> _ColumnRows:
    rows, width = lit.shape
    found = np.full((4, width), np.nan)
    peaks = np.sort(lit, axis=0)[-min(4, rows)]
    for u in np.flatnonzero(peaks > SMALLEST_LEVEL):
        column = lit[:, u]
        bright = np.flatnonzero(column > LIT_SHARE * peaks[u])
        first, last = int(bright[0]), int(bright[-1])
        if first == 0 or last == rows - 1 or last - first < 3:
            continue
        found[:, u] = _rows_of_column(column, first, last)
    return _ColumnRows(*found)


def _rows_of_column(column: FloatArray, first: int, last: int) -> tuple[float, ...]:
    """Return top, surface (NaN if there is no dark line), bottom row and the level of the strip."""
    dip = _surface_dip(column, first, last)
    if dip is None:
        level = float(np.median(column[first + 1 : last]))
        top = _crossing(column, first - 1, level / 2)
        return top, np.nan, _fall(column, first, level / 2), level
    row, surface = dip
    level = float(np.median(column[first + 1 : row - 1])) if row - first > 2 else column[first]
    mirror = float(np.median(column[row + 2 : last])) if last - row > 2 else column[last]
    top = _crossing(column, _rise(column, first, level / 2) - 1, level / 2)
    bottom = _fall(column, row + 1, mirror / 2)
    return top, surface, bottom, level


def _surface_dip(column: FloatArray, first: int, last: int) -> tuple[int, float] | None:
    """Return the row of the dark line inside a lit run, whole and sub-pixel (parabola)."""
    low, high = first + 2, last - 1
    if high - low < 1:
        return None
    row = low + int(np.argmin(column[low:high]))
    above, below = float(column[first:row].max()), float(column[row + 1 : last + 1].max())
    at = float(column[row])
    if at > (1 - SURFACE_DIP) * min(above, below):
        return None
    # the mirror image is dimmer: without that step, which would pull the lowest point over
    before, after = float(column[row - 1]) / above, float(column[row + 1]) / below
    curvature = before - 4 * at / (above + below) + after
    if curvature <= 0:
        return None
    return row, row + 0.5 + 0.5 * (before - after) / curvature


def _rise(column: FloatArray, first: int, level: float) -> int:
    """Return the first row from `first` on that is brighter than `level`."""
    return first + int(np.argmax(column[first:] > level))


def _fall(column: FloatArray, start: int, level: float) -> float:
    """Return the sub-pixel row at which the brightness falls through `level` for the last time."""
    last = start + int(np.flatnonzero(column[start:] > level)[-1])
    return _crossing(column, last, level) if last + 1 < len(column) else float(last)


def _crossing(column: FloatArray, row: int, level: float) -> float:
    """Return where the brightness crosses `level` between the centres of `row` and `row + 1`."""
    step = column[row + 1] - column[row]
    return float(row + 0.5 + (level - column[row]) / step) if step else row + 1.0


def _far_corner(rows: _ColumnRows) -> float:
    """Return the column of the far corner: there the strip is farthest away, so lowest."""
    height = rows.bottom - rows.top
    columns = np.flatnonzero(np.isfinite(height))
    smooth = _running_median(height[columns], 15)
    middle = (columns > 0.15 * len(height)) & (columns < 0.85 * len(height))
    if not middle.any():
        raise StripNotFoundError("the strip does not reach the middle of the picture")
    lowest = smooth[middle].min()
    return float(np.median(columns[middle][smooth[middle] <= lowest + 0.05])) + 0.5


def _connected_with(corner: float, height: FloatArray) -> BoolArray:
    """Tell the columns of the two far sides: from the corner outwards the strip grows steadily.

    Behind a gap, with another height, begins the own strip next to the camera.
    """
    connected = np.zeros(len(height), bool)
    seen = np.flatnonzero(np.isfinite(height))
    for side in (seen[seen <= corner][::-1], seen[seen > corner]):
        last, last_px = int(corner), float(np.median(height[side[:15]])) if len(side) else 0.0
        for column in side.tolist():
            gap = abs(column - last)
            if gap > WIDEST_GAP_PX:
                break
            if abs(height[column] - last_px) <= STEP_PX + GROWTH * gap:
                connected[column] = True
                last, last_px = column, float(height[column])
    return connected


def _two_curves(rows: FloatArray, corner: float) -> tuple[FloatArray, BoolArray]:
    """Fit one smooth curve to either side of the corner; tell which columns it is backed in."""
    columns = _column_centres(len(rows))
    curve = np.full(len(rows), np.nan)
    backed = np.zeros(len(rows), bool)
    for side in (columns <= corner, columns > corner):
        used = side & np.isfinite(rows) & (np.abs(columns - corner) > 3)
        if np.count_nonzero(used) < 4 * CURVE_DEGREE:
            continue
        fit, used = _robust_curve(columns, rows, used)
        curve[side] = fit(columns[side])
        seen = columns[used]
        backed |= side & (columns >= seen.min()) & (columns <= seen.max())
    if not backed.any():
        raise StripNotFoundError("no continuous strip on either side of the far corner")
    known = np.flatnonzero(np.isfinite(curve))
    return np.interp(columns, columns[known], curve[known]), backed


def _robust_curve(
    columns: FloatArray, rows: FloatArray, usable: BoolArray
) -> tuple[Polynomial, BoolArray]:
    """Fit a polynomial, six times leaving out what is more than four sigmas off."""
    used = usable
    fit = Polynomial.fit(columns[used], rows[used], CURVE_DEGREE)
    for _ in range(6):
        off = np.abs(fit(columns) - rows)
        sigma = 1.4826 * float(np.median(off[used])) + 0.02
        used = usable & (off < 4 * sigma)
        fit = Polynomial.fit(columns[used], rows[used], CURVE_DEGREE)
    return fit, used


def _darkened(lit: FloatArray, corner: float) -> BoolArray:
    """Tell the columns around the far corner that are darker than their neighbourhood.

    They show the corner of the frame and the camera that sits in it; a dark LED elsewhere is part
    of the strip.
    """
    width = lit.shape[1]
    level = np.sort(lit, axis=0)[-min(6, lit.shape[0]) :].mean(axis=0)
    usual = np.maximum(_running_median(level, 31), 1.0)
    off_px = np.abs(_column_centres(width) - corner)
    dark: BoolArray = (off_px < max(12.0, 0.03 * width)) & (level < 0.75 * usual)
    return dark if dark.any() else off_px < 1.0


def _column_centres(width: int) -> FloatArray:
    return np.arange(width, dtype=np.float64) + 0.5


def _camera_height_share(surface: FloatArray, height: FloatArray, visible: BoolArray) -> float:
    """Return the camera's height as a share of the strip's.

    The horizon h(u) is smooth (camera tilt and roll: quadratic), and surface = h + share * height;
    the height varies with the distance of the strip, so the two can be told apart.  Outside
    0.25..0.75 the fit is not believed: no rig has its cameras there, unless they hang upside down;
    then it is negative.
    """
    w = np.linspace(-1, 1, len(surface))
    terms = np.stack([np.ones_like(w), w, w * w, height], axis=1)
    share = np.linalg.lstsq(terms[visible], surface[visible], rcond=None)[0][3]
    if -0.75 <= share <= -0.25:
        return float(share)
    return float(np.clip(share, 0.25, 0.75))


def _running_median(values: FloatArray, size: int) -> FloatArray:
    padded = np.pad(values, size // 2, mode="reflect" if len(values) > size else "edge")
    medians: FloatArray = np.median(np.lib.stride_tricks.sliding_window_view(padded, size), axis=1)
    return medians


def _what_is_wrong(empty: FloatArray, dark: float, clear: int) -> str:
    peak = float(np.percentile(empty, 99.5))
    if peak - dark < SMALLEST_LEVEL:
        return (
            f"the pictures are dark (brightest {peak:.0f}, darkest {dark:.0f} of 255): "
            "switch the LED frame on or raise the exposure"
        )
    return (
        f"only {clear} of {empty.shape[1]} columns show a lit strip that begins and ends inside "
        f"the {empty.shape[0]} rows of the picture: choose rows that hold the whole strip and its "
        "mirror image, with a few dark rows above and below"
    )
