"""What tracing a picture needs to know of each column of the strip, as it is now."""

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import compiled
from cornertouchd.model import BoolArray, FloatArray
from cornertouchd.vision.reference import Reference

BLACK, CHANGED, FULL, SURFACE, HEIGHT = 0, 1, 2, 3, 4
"""What is known of a column: its grey level without LEDs; what its light was at the calibration, as
a share of the light now, NaN where it tells nothing; its grey level at full scale; the row of the
surface line, and the height above it at which the levels of edges are 1."""

Tables = tuple[FloatArray, NDArray[np.float32]]


class StripNow:
    """Tables of one camera's strip, made anew when its reference is another.

    An edge is followed down few columns, so all that is known of one lies side by side; light is
    taken from many columns of one row, so there each thing lies in a row of its own.
    """

    def __init__(
        self,
        calibrated: Reference,
        surface_px: FloatArray,
        height_px: FloatArray,
        saturated_grey: float,
    ) -> None:
        self._calibrated = calibrated.light
        self._surface_px, self._height_px = surface_px, height_px
        self._saturated_grey = saturated_grey
        self._kept = calibrated, self._tables(calibrated)

    def of(self, reference: Reference) -> Tables:
        """Return all of each column, (width_px, 5), and the first three once more, (3, width_px).

        A column that has changed since the calibration is taken to have done so in all rows.
        """
        kept_for, tables = self._kept
        if kept_for is not reference:
            tables = self._tables(reference)
            self._kept = reference, tables
        return tables

    def _tables(self, reference: Reference) -> Tables:
        return _tables(
            reference.black,
            reference.scale,
            reference.usable,
            reference.clipped,
            self._calibrated,
            self._surface_px,
            self._height_px,
            self._saturated_grey,
        )


@compiled(
    "Tuple((f8[:,::1], f4[:,::1]))("
    "f8[::1], f8[::1], b1[::1], b1[::1], f8[::1], f8[::1], f8[::1], f8)"
)
def _tables(
    black: FloatArray,
    scale: FloatArray,
    usable: BoolArray,
    clipped: BoolArray,
    calibrated: FloatArray,
    surface_px: FloatArray,
    height_px: FloatArray,
    saturated_grey: float,
) -> Tables:
    """Return the tables of a strip, (width_px, 5) and (3, width_px)."""
    width = len(black)
    by_column, in_rows = np.empty((width, 5)), np.empty((3, width), np.float32)
    for column in range(width):
        by_column[column, BLACK] = black[column]
        changed = calibrated[column] * scale[column]
        by_column[column, CHANGED] = changed if usable[column] else np.nan
        by_column[column, FULL] = np.inf if clipped[column] else saturated_grey
        by_column[column, SURFACE] = surface_px[column]
        by_column[column, HEIGHT] = height_px[column]
        for known in range(3):
            in_rows[known, column] = by_column[column, known]
    return by_column, in_rows
