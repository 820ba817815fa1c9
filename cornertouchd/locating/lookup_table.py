"""The paper's lookup table (Wang et al. 2011, section 6.1.1, eq. 6 and 7).

A column is looked up between the two reference points that the camera sees on either side of it.
It belongs to the place that divides the way between them as it divides their columns; the
directing line runs from the projection centre through that place.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cornertouchd.geometry import wrap_angle
from cornertouchd.model import FloatArray

SMALLEST_ROW_PX = 0.01
"""Neighbours in one column, but for the noise, tell nothing of the columns between them."""


@dataclass(frozen=True, slots=True)
class _Rows:
    """Pairs of neighbouring points that are both seen, by rising column; all arrays (pairs, ...).

    From `start_px` to `end_px` the place moves from `start_mm` by `mm_per_px` a column.
    """

    start_px: FloatArray
    end_px: FloatArray
    start_mm: FloatArray
    mm_per_px: FloatArray


@dataclass(frozen=True)
class LookupTable:
    """One camera's column of the paper's table (Fig. 8).

    `points_mm` are the reference points on the far sides of the frame, in their order along it;
    `columns_px` where the camera sees them, NaN where it does not.  Columns may rise or fall along
    the frame.  There is no line beside a point that is not seen, up to the next that is.
    """

    position_mm: tuple[float, float]
    points_mm: tuple[tuple[float, float], ...]
    columns_px: tuple[float, ...]

    def angles_rad(self, columns_px: FloatArray) -> FloatArray:
        """Return the angles of the directing lines of columns, NaN where the table has none.

        They point to the reference points, without a jump among them.
        """
        away, _ = self._look_up(columns_px)
        angles = np.arctan2(away[..., 1], away[..., 0])
        turned: FloatArray = self._middle_rad + wrap_angle(angles - self._middle_rad)
        return turned

    def slopes_rad_px(self, columns_px: FloatArray) -> FloatArray:
        """Return how fast the angle changes with the column, radians per pixel."""
        away, per_px = self._look_up(columns_px)
        across = away[..., 0] * per_px[..., 1] - away[..., 1] * per_px[..., 0]
        squares = np.sum(away * away, axis=-1)
        slopes: FloatArray = across / np.where(squares > 0.0, squares, np.nan)
        return slopes

    def _look_up(self, columns_px: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the way (..., 2) from the camera to the place of each column, and its derivative.

        The derivative (..., 2) is in mm per pixel; both are NaN where the table has no place.
        """
        rows = self._rows
        if not len(rows.start_px):
            nowhere = np.full((*columns_px.shape, 2), np.nan)
            return nowhere, nowhere
        row = np.searchsorted(rows.start_px, columns_px, side="right") - 1
        row = np.clip(row, 0, None)
        inside = (columns_px >= rows.start_px[row]) & (columns_px <= rows.end_px[row])
        mm_per_px = np.where(inside[..., None], rows.mm_per_px[row], np.nan)
        beyond_px = np.where(inside, columns_px - rows.start_px[row], np.nan)
        place_mm = rows.start_mm[row] + beyond_px[..., None] * mm_per_px
        return place_mm - self.position_mm, mm_per_px

    @cached_property
    def _rows(self) -> _Rows:
        columns, points = np.array(self.columns_px), np.array(self.points_mm).reshape(-1, 2)
        seen = np.flatnonzero(np.isfinite(columns))
        order = seen[np.argsort(columns[seen], kind="stable")]
        neighbours = (np.abs(np.diff(order)) == 1) & (np.diff(columns[order]) > SMALLEST_ROW_PX)
        start, end = order[:-1][neighbours], order[1:][neighbours]
        width_px = (columns[end] - columns[start])[:, None]
        return _Rows(
            columns[start], columns[end], points[start], (points[end] - points[start]) / width_px
        )

    @cached_property
    def _middle_rad(self) -> float:
        """The direction of the middle of the reference points."""
        x, y = np.mean(self.points_mm, axis=0) - self.position_mm
        return float(np.arctan2(y, x))
