"""What a contact may be: where on the surface, how large, and how far from round."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.config import CrossingSettings
from cornertouchd.model import BoolArray, FloatArray

# A finger at the very frame: shape and calibration may put its centre beside the surface.
SURFACE_MARGIN_MM = 2.0
# A disc that lies on that line is still on the surface.
ROUNDING_MM = 1e-6
# Nothing that touches is rounder; and a disc at a camera's pinhole has no other sigma.
ROUNDEST_SIGMA_MM = 0.02


@dataclass(frozen=True, slots=True)
class DiscLimits:
    """Where discs may lie, how large they may be, and how far from round."""

    surface_mm: tuple[float, float]
    smallest_radius_mm: float
    largest_radius_mm: float
    shape_sigma_mm: float

    def on_surface(self, points_mm: FloatArray) -> BoolArray:
        """Tell which points (..., 2) lie on the surface, or just beside it."""
        margin = SURFACE_MARGIN_MM + ROUNDING_MM
        far_corner = np.asarray(self.surface_mm) + margin
        inside: BoolArray = np.all((points_mm >= -margin) & (points_mm <= far_corner), axis=-1)
        return inside


def disc_limits(settings: CrossingSettings, surface_mm: tuple[float, float]) -> DiscLimits:
    """Take the limits of discs from the settings."""
    return DiscLimits(
        surface_mm=surface_mm,
        smallest_radius_mm=settings.smallest_radius_mm,
        largest_radius_mm=settings.largest_radius_mm,
        shape_sigma_mm=max(settings.shape_sigma_mm, ROUNDEST_SIGMA_MM),
    )
