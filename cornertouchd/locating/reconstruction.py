"""The paper's 3D reconstruction (Wang et al. 2011, section 6.1.3): a camera with lens and pose.

What a camera sees at its own height lies on level rays, parallel to the surface.  The directing
line of a column is the one level ray that appears in it.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from cornertouchd.model import FloatArray

Axis = tuple[float, float, float]

REACH_RAD = np.deg2rad(89.0)
"""Level rays this far to either side of the optical axis are tabulated: no lens for a corner needs
more, and a pinhole sees nothing from 90 degrees on."""

TABLE_STEPS = 8_001
"""An odd number, so that the axis is one of them.  Interpolation is then exact to 1e-6 rad."""


@dataclass(frozen=True)
class BoardLens:
    """Intrinsics as OpenCV calibrates them, but with the first pixel's centre at 0.5.

    `kind` says how `distortion` is read: "pinhole" k1 k2 p1 p2 k3 k4 k5 k6, "fisheye" k1 k2 k3 k4.
    """

    kind: Literal["pinhole", "fisheye"]
    focal_px: tuple[float, float]
    centre_px: tuple[float, float]
    distortion: tuple[float, ...]

    def pixels(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return columns and rows (...) of directions (3, ...) right, down, forward.

        NaN for what a pinhole has beside or behind itself.
        """
        if self.kind == "fisheye":
            x, y = self._bend_as_fisheye(directions)
        else:
            x, y = self._bend_as_pinhole(directions)
        return (
            self.focal_px[0] * x + self.centre_px[0],
            self.focal_px[1] * y + self.centre_px[1],
        )

    def _bend_as_pinhole(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        right, down, forward = directions
        forward = np.where(forward > 0.0, forward, np.nan)
        x, y = right / forward, down / forward
        r2 = x * x + y * y
        radial = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
        return (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )

    def _bend_as_fisheye(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        k1, k2, k3, k4 = self.distortion
        right, down, forward = directions
        aside = np.hypot(right, down)
        theta = np.arctan2(aside, forward)
        t2 = theta * theta
        bent = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
        scale = np.divide(bent, aside, out=np.ones_like(bent), where=aside > 0.0)
        return right * scale, down * scale


@dataclass(frozen=True)
class Reconstruction:
    """A camera at `position_mm` of the surface.

    The rows of `rotation` are the camera's right, down and forward axes in the surface's x, y and
    z, where z points into the surface: with y down that makes them right-handed.
    """

    position_mm: tuple[float, float]
    rotation: tuple[Axis, Axis, Axis]
    lens: BoardLens
    width_px: int

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rising columns, the angles of their level rays, and how fast these change.

        It ends where the lens model folds: where columns would come a second time.
        """
        forward = self.rotation[2]
        straight_on = np.arctan2(forward[1], forward[0])
        angles = straight_on + np.linspace(-REACH_RAD, REACH_RAD, TABLE_STEPS)
        level = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)])
        columns, _ = self.lens.pixels(np.array(self.rotation) @ level)
        steps = np.diff(columns)
        middle = TABLE_STEPS // 2
        folds = np.flatnonzero(~(steps * np.sign(steps[middle]) > 0.0))
        first = folds[folds < middle].max(initial=-1) + 1
        last = folds[folds > middle].min(initial=TABLE_STEPS - 1)
        kept = slice(first, last + 1)
        columns, angles = columns[kept], angles[kept]
        order = np.argsort(columns)
        columns, angles = columns[order], angles[order]
        return columns, angles, np.gradient(angles, columns)

    def angles_rad(self, columns_px: FloatArray) -> FloatArray:
        """Return the angles of the level rays in columns, NaN where the lens model has none."""
        columns, angles, _ = self._table
        return np.interp(columns_px, columns, angles, left=np.nan, right=np.nan)

    def slopes_rad_px(self, columns_px: FloatArray) -> FloatArray:
        """Return how fast the angle changes with the column, radians per pixel."""
        columns, _, slopes = self._table
        return np.interp(columns_px, columns, slopes, left=np.nan, right=np.nan)
