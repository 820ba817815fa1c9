"""The default method: the angle of the directing line as a polynomial of the column.

theta(u) = sum of a_k w^k, k = 0..7, w = (u - N/2) / (N/2) with N the picture's width: an inverse
model (pixel to ray) that needs no undistortion, free of the trade between yaw and principal point
that makes forward lens models ill-conditioned.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyder, polyval

from cornertouchd.model import FloatArray


@dataclass(frozen=True)
class AnglePolynomial:
    """A camera at `position_mm` whose angle is a polynomial of the column."""

    position_mm: tuple[float, float]
    coefficients_rad: tuple[float, ...]
    width_px: int

    def angles_rad(self, columns_px: FloatArray) -> FloatArray:
        """Return the angles of the directing lines of columns."""
        return self._evaluate(columns_px, self.coefficients_rad)

    def slopes_rad_px(self, columns_px: FloatArray) -> FloatArray:
        """Return how fast the angle changes with the column, radians per pixel."""
        derivative = polyder(np.asarray(self.coefficients_rad))
        return self._evaluate(columns_px, tuple(derivative)) / (self.width_px / 2)

    def _evaluate(self, columns_px: FloatArray, coefficients: tuple[float, ...]) -> FloatArray:
        w = (columns_px - self.width_px / 2) / (self.width_px / 2)
        return np.asarray(polyval(w, coefficients), np.float64)
