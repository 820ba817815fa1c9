"""A corner camera: where it stands, how its lens bends, which way each pixel looks.

World directions are (x, y, z): the surface's x and y, and z from the surface towards the user.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from cornertouchd.model import FloatArray

# Angles this far to either side of the optical axis are tabulated to turn columns into angles.
# It lies beyond the edge of any field a `Lens` accepts; the steps make the linear interpolation
# exact to 1e-8 rad, measured against the closed form in the other direction.
TABULATED_RAD = np.deg2rad(80.0)
TABLE_STEPS = 16_001

MAX_BARREL = 0.5
MAX_FIELD_RAD = np.deg2rad(140.0)


@dataclass(frozen=True, slots=True)
class Lens:
    """A lens with square pixels that pulls the picture inwards at its borders.

    The undistorted radius r and the distorted radius q, both over the focal length, follow
    r = q / (1 - barrel q²): the division model of Fitzgibbon 2001, near the axis the same as a
    radial k1 = -barrel.  Unlike that polynomial it never folds back in a wide field.  `barrel` 0
    is a pinhole.
    """

    focal_px: float
    centre_column_px: float
    centre_row_px: float
    barrel: float

    @classmethod
    def with_field(
        cls,
        field_rad: float,
        width_px: int,
        centre_px: tuple[float, float],
        barrel: float,
    ) -> Self:
        """Return the lens that spreads the horizontal field over the width of the picture.

        `centre_px` is the column and row of the optical axis.  Raises `ValueError` for a field or
        a barrel that the model cannot show.
        """
        if not 0.0 < field_rad <= MAX_FIELD_RAD:
            raise ValueError(
                f"field_rad is {field_rad:.3g}; give one above 0 and up to {MAX_FIELD_RAD:.3g}"
            )
        if not 0.0 <= barrel <= MAX_BARREL:
            raise ValueError(f"barrel is {barrel:.3g}; give 0 (pinhole) to {MAX_BARREL}")
        border = float(np.tan(field_rad / 2.0))
        border *= float(_shrink(np.float64(border * border), barrel))
        return cls(width_px / 2.0 / border, *centre_px, barrel)

    def pixels(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return columns and rows of rays through (x, y) on the plane one unit before the lens."""
        scale = self.focal_px * _shrink(x * x + y * y, self.barrel)
        return self.centre_column_px + scale * x, self.centre_row_px + scale * y

    def plane(self, columns_px: FloatArray, rows_px: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where the rays of pixels cross the plane one unit before the lens."""
        x = (columns_px - self.centre_column_px) / self.focal_px
        y = (rows_px - self.centre_row_px) / self.focal_px
        grow = 1.0 / (1.0 - self.barrel * (x * x + y * y))
        return x * grow, y * grow


def _shrink(radius_squared: FloatArray | np.float64, barrel: float) -> FloatArray:
    """Return q / r of the division model, in the form that has no 0 / 0."""
    shrink: FloatArray = 2.0 / (1.0 + np.sqrt(1.0 + 4.0 * barrel * radius_squared))
    return shrink


@dataclass(frozen=True, slots=True)
class CornerCamera:
    """A camera as it is really mounted: the truth that a calibration tries to find.

    `yaw_rad` is the angle of its axis from +x towards +y, `pitch_rad` lifts the axis off the
    surface, `roll_rad` turns the camera about it (its right side sinks).
    """

    id: str
    x_mm: float
    y_mm: float
    height_mm: float
    yaw_rad: float
    pitch_rad: float
    roll_rad: float
    lens: Lens

    def axes(self) -> FloatArray:
        """Return the world directions of right, down and forward as the rows of a (3, 3)."""
        cy, sy = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        cp, sp = np.cos(self.pitch_rad), np.sin(self.pitch_rad)
        cr, sr = np.cos(self.roll_rad), np.sin(self.roll_rad)
        forward = np.array([cy * cp, sy * cp, sp])
        level = np.array([-sy, cy, 0.0])
        below = np.array([cy * sp, sy * sp, -cp])
        return np.stack([cr * level + sr * below, cr * below - sr * level, forward])

    def rays(self, columns_px: FloatArray, rows_px: FloatArray) -> FloatArray:
        """Return the unit world directions (3, ...) in which pixels (...) look."""
        x, y = self.lens.plane(columns_px, rows_px)
        seen = np.stack([x, y, np.ones_like(x)])
        seen /= np.sqrt(np.sum(seen * seen, axis=0))
        directions: FloatArray = np.tensordot(self.axes().T, seen, axes=1)
        return directions

    def project(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return columns and rows (...) of world directions (3, ...) that lie before the lens."""
        right, down, forward = np.tensordot(self.axes(), directions, axes=1)
        return self.lens.pixels(right / forward, down / forward)

    def columns_px(self, angles_rad: FloatArray) -> FloatArray:
        """Return the columns of horizontal rays: what lies at the camera's own height."""
        level = np.stack([np.cos(angles_rad), np.sin(angles_rad), np.zeros_like(angles_rad)])
        return self.project(level)[0]

    def angles_rad(self, columns_px: FloatArray) -> FloatArray:
        """Return the angles of the horizontal rays that arrive in these columns.

        The inverse of `columns_px`, exact to 1e-8 rad; near `yaw_rad`, so they may exceed pi.
        """
        angles_rad = self.yaw_rad + np.linspace(-TABULATED_RAD, TABULATED_RAD, TABLE_STEPS)
        return np.interp(columns_px, self.columns_px(angles_rad), angles_rad)

    def column_of(self, x_mm: float, y_mm: float) -> float:
        """Return the column in which a place at the camera's height appears."""
        angle_rad = np.arctan2(y_mm - self.y_mm, x_mm - self.x_mm)
        return float(self.columns_px(np.atleast_1d(angle_rad))[0])
