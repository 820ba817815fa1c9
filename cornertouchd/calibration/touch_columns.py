"""Where touches are seen, and how exactly a camera sees one."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.model import BoolArray, FloatArray

EDGE_SIGMA_PX = 0.1
SHAPE_SIGMA_MM = 0.1
"""What is left when a finger is not a disc; keeps near cameras from outweighing all others."""


@dataclass(frozen=True, slots=True)
class TouchColumns:
    """Where touches are seen: `columns_px` (cameras, points, 2) left and right edge, NaN unseen.

    `points_mm` (points, 2) and `diameters_mm` (points,) are NaN where unknown.
    """

    columns_px: FloatArray
    points_mm: FloatArray
    diameters_mm: FloatArray

    @property
    def known(self) -> BoolArray:
        """Which touches were at a known place, (points,)."""
        return np.asarray(np.isfinite(self.points_mm).all(axis=1))

    @property
    def seen(self) -> BoolArray:
        """Which camera saw which touch with both its edges, (cameras, points)."""
        return np.asarray(np.isfinite(self.columns_px).all(axis=2))
