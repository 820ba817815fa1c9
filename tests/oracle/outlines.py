"""Outlines in numpy: whole levels as arrays, one edge after the other.  Slow and readable."""

import numpy as np

from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray, Picture, Shadows
from cornertouchd.vision.outlines import (
    BRIGHT,
    DARK,
    FEW_EDGES,
    KEPT_SLOPE,
    MOST_MISSES,
    REACH_PX,
    WINDOW_PX,
    level_rows,
)
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import Strip

Edge = tuple[FloatArray, FloatArray]


class Levels:
    """What is left of the light of a picture, level by level."""

    def __init__(
        self,
        strip: Strip,
        empty: FloatArray,
        calibrated: Reference,
        now: Reference,
        settings: VisionSettings,
    ) -> None:
        self.rows_px = level_rows(strip)
        self.start = int(
            np.abs(self.rows_px - strip.horizon_px)[:, strip.visible].mean(axis=1).argmin()
        )
        self._full = np.where(now.clipped, np.inf, settings.saturated_grey)
        self._black, self._settings = now.black, settings
        believed = strip.visible & calibrated.usable & now.usable
        changed = calibrated.light / np.maximum(now.light, 1.0)
        self._change = np.where(believed, changed, np.nan)
        self._lit = empty - strip.dark_level

    def values(self, picture: Picture, gain: float) -> FloatArray:
        """Return them, (levels, width_px), NaN where the picture tells nothing."""
        pixels = picture.astype(np.float64)
        return np.array([self._level(pixels, rows) for rows in self.rows_px]) / gain

    def _level(self, pixels: FloatArray, rows_px: FloatArray) -> FloatArray:
        columns = np.arange(len(rows_px))
        place = rows_px - 0.5
        inside = (place >= 0) & (place < len(pixels) - 1)
        above = np.where(inside, np.floor(place), 0).astype(int)
        part = np.where(inside, place - above, 0.0)
        here, below = pixels[above, columns], pixels[above + 1, columns]
        empty = (1 - part) * self._lit[above, columns] + part * self._lit[above + 1, columns]
        told = inside & (np.maximum(here, below) < self._full)
        told &= empty >= self._settings.smallest_reference
        grey = (1 - part) * here + part * below - self._black
        return np.where(told, grey / np.where(empty > 0, empty, 1.0) * self._change, np.nan)


def trace(levels: Levels, values: FloatArray, shadows: Shadows, edge_level: float) -> Edge:
    """Return columns and rows of every edge, (K, 2, L) each."""
    shape = (len(shadows), 2, len(values))
    columns, rows = np.full(shape, np.nan), np.full(shape, np.nan)
    stride = 1 if np.count_nonzero(shadows.valid) <= FEW_EDGES else 2
    for number in range(len(shadows)):
        for side in range(2):
            if shadows.valid[number, side]:
                edge = float(shadows.edges_px[number, side])
                for order in (
                    range(levels.start, -1, -stride),
                    range(levels.start + stride, len(values), stride),
                ):
                    _follow(
                        levels.rows_px,
                        values if side == 0 else values[:, ::-1],
                        edge,
                        side == 1,
                        order,
                        stride,
                        edge_level,
                        columns[number, side],
                        rows[number, side],
                    )
    return columns, rows


def _follow(
    rows_px: FloatArray,
    values: FloatArray,
    edge: float,
    mirrored: bool,
    order: range,
    stride: int,
    edge_level: float,
    columns: FloatArray,
    rows: FloatArray,
) -> None:
    """Follow one edge.  Right edges are followed in the picture's mirror image, as left ones."""
    width = values.shape[1]
    last, last_row, slope, misses = edge, None, 0.0, 0
    for level in order:
        if misses == MOST_MISSES:
            return
        expected = last
        if slope:
            expected += slope * (_row(rows_px, level, last) - last_row)
        reach = WINDOW_PX * (stride + misses)
        found = _fall(values[level], expected, reach, edge_level, mirrored, width)
        if found is None:
            misses += 1
            continue
        row = _row(rows_px, level, found)
        if last_row is not None:
            slope = KEPT_SLOPE * slope + (1 - KEPT_SLOPE) * (found - last) / (row - last_row)
        columns[level], rows[level] = found, row
        last, last_row, misses = found, row, 0


def _row(rows_px: FloatArray, level: int, column: float) -> float:
    centres = np.arange(rows_px.shape[1]) + 0.5
    return float(np.interp(column, centres, rows_px[level]))


def _fall(
    values: FloatArray, expected: float, reach: int, level: float, mirrored: bool, width: int
) -> float | None:
    """Return the column of the fall of light nearest to the pair that is expected to show it."""
    pair = int(expected - 0.5)
    bright, dark = values[:-1] >= level, values[1:] < level
    falls = np.flatnonzero(bright & dark)  # numbers of the outer columns
    left = width - 2 - falls if mirrored else falls
    away = np.abs(left - pair)
    near = away <= reach
    if not near.any():
        return None
    order = np.lexsort((left[near], away[near]))  # of two as near, the left one
    outer = int(falls[near][order[0]])
    outside = values[max(0, outer - REACH_PX + 1) : outer + 1]
    inside = values[outer + 1 : outer + 1 + REACH_PX]
    if not ((outside > BRIGHT).any() and (inside < DARK).any()):
        return None
    column = outer + (values[outer] - level) / (values[outer] - values[outer + 1]) + 0.5
    return float(width - column if mirrored else column)
