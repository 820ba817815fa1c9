"""Where a display lies on the surface, and what its pixels call a place there."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cornertouchd.geometry import homography_between, is_convex

# A finger on the very edge of the picture is measured up to this far beside it: the centre of a
# fingertip wanders by less than 1 mm, the rectangle is seldom measured better than to 1 mm.
EDGE_TOLERANCE_MM = 2.0

# How the picture's axes lie along those of the surface: whether x of the picture runs along y of
# the surface, whether its x then runs backwards, whether its y does.
_TURNED = {
    0: (False, False, False),
    90: (True, False, True),
    180: (False, True, True),
    270: (True, True, False),
}

# The same by rotation and mirror, which turns the picture's x round.
_AXES = {
    (rotation_deg, mirror): (swapped, x_backwards != mirror, y_backwards)
    for rotation_deg, (swapped, x_backwards, y_backwards) in _TURNED.items()
    for mirror in (False, True)
}


Corners = tuple[tuple[float, float], ...]
"""Where the corners of a picture lie: top-left, top-right, bottom-right, bottom-left, in mm."""


@dataclass(frozen=True, slots=True)
class DisplayMapping:
    """The rectangle of the surface that a display fills, and how its picture lies in it.

    `left_mm`, `top_mm`, `width_mm` and `height_mm` are along the surface's x and y.  The picture is
    turned clockwise by `rotation_deg` (0, 90, 180 or 270) as seen by who touches it: at 90 its
    top-left corner lies at the rectangle's top-right.  `mirror` swaps the picture's left and right,
    as a projector behind the surface does.  Where `corners_mm` are given they alone count, and the
    picture may be turned by any angle, or a trapezium.  Raises `ValueError` for a rectangle without
    area, another rotation, or corners that are not those of a convex quadrangle.
    """

    left_mm: float
    top_mm: float
    width_mm: float
    height_mm: float
    rotation_deg: int = 0
    mirror: bool = False
    corners_mm: Corners | None = None

    def __post_init__(self) -> None:
        for name in ("left_mm", "top_mm", "width_mm", "height_mm"):
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ValueError(f"display {name} is {value}; give a finite number of millimetres")
        for name in ("width_mm", "height_mm"):
            value = getattr(self, name)
            if value <= 0.0:
                raise ValueError(f"display {name} is {value}, must be above 0 mm; measure it")
        if self.rotation_deg not in _TURNED:
            raise ValueError(
                f"display rotation_deg is {self.rotation_deg}; choose one of 0, 90, 180, 270"
            )
        if self.corners_mm is not None:
            _straightening(self.corners_mm)

    @property
    def picture_mm(self) -> tuple[float, float]:
        """Width and height of the picture as who looks at it sees it."""
        if self.corners_mm is not None:
            return _mean_sides(self.corners_mm)
        swapped, _, _ = _AXES[self.rotation_deg, self.mirror]
        return (self.height_mm, self.width_mm) if swapped else (self.width_mm, self.height_mm)

    def contains(self, x_mm: float, y_mm: float) -> bool:
        """Whether a place of the surface is on the display, or at most 2 mm beside it."""
        if self.corners_mm is not None:
            return all(
                a * x_mm + b * y_mm + c >= -EDGE_TOLERANCE_MM for a, b, c in _edges(self.corners_mm)
            )
        return (
            -EDGE_TOLERANCE_MM <= x_mm - self.left_mm <= self.width_mm + EDGE_TOLERANCE_MM
            and -EDGE_TOLERANCE_MM <= y_mm - self.top_mm <= self.height_mm + EDGE_TOLERANCE_MM
        )

    def to_display(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """Return the place in the picture, both axes 0..1 from its top-left corner.

        A place beside the display gives the nearest one on its edge.
        """
        if self.corners_mm is not None:
            x, y, _ = _straightened(self.corners_mm, x_mm, y_mm)
            return min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0)
        u = (x_mm - self.left_mm) / self.width_mm
        v = (y_mm - self.top_mm) / self.height_mm
        if not (0.0 <= u <= 1.0 and 0.0 <= v <= 1.0):
            u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        if self.rotation_deg == 0 and not self.mirror:  # as most are
            return u, v
        swapped, x_backwards, y_backwards = _AXES[self.rotation_deg, self.mirror]
        x, y = (v, u) if swapped else (u, v)
        return (1.0 - x if x_backwards else x), (1.0 - y if y_backwards else y)

    def velocity_to_display(
        self, vx_mm_s: float, vy_mm_s: float, x_mm: float, y_mm: float
    ) -> tuple[float, float]:
        """Return the velocity at a place in the picture, in its widths and heights per second."""
        if self.corners_mm is not None:
            x, y, scale = _straightened(self.corners_mm, x_mm, y_mm)
            a, b, _, d, e, _, g, h, _ = _straightening(self.corners_mm)
            faster = g * vx_mm_s + h * vy_mm_s
            return (
                (a * vx_mm_s + b * vy_mm_s - x * faster) / scale,
                (d * vx_mm_s + e * vy_mm_s - y * faster) / scale,
            )
        u_per_s = vx_mm_s / self.width_mm
        v_per_s = vy_mm_s / self.height_mm
        if self.rotation_deg == 0 and not self.mirror:
            return u_per_s, v_per_s
        swapped, x_backwards, y_backwards = _AXES[self.rotation_deg, self.mirror]
        x_per_s, y_per_s = (v_per_s, u_per_s) if swapped else (u_per_s, v_per_s)
        return (-x_per_s if x_backwards else x_per_s), (-y_per_s if y_backwards else y_per_s)


# Above 0 on the display; places so far beside it that it is not are on no picture.
_HORIZON = 1e-9


@lru_cache(maxsize=64)
def _straightening(corners_mm: Corners) -> tuple[float, ...]:
    """Return the homography from the surface to the picture, row by row."""
    corners = np.array(corners_mm, np.float64)
    if corners.shape != (4, 2) or not np.isfinite(corners).all() or not is_convex(corners):
        raise ValueError(
            f"display corners_mm are {corners_mm}; give the four corners of the picture in their "
            "order, around it"
        )
    picture = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    return tuple(np.linalg.inv(homography_between(picture, corners)).ravel().tolist())


def _straightened(corners_mm: Corners, x_mm: float, y_mm: float) -> tuple[float, float, float]:
    """Return the place in the picture, and the scale that it was divided by."""
    a, b, c, d, e, f, g, h, i = _straightening(corners_mm)
    scale = max(g * x_mm + h * y_mm + i, _HORIZON)
    return (a * x_mm + b * y_mm + c) / scale, (d * x_mm + e * y_mm + f) / scale, scale


@lru_cache(maxsize=64)
def _edges(corners_mm: Corners) -> tuple[tuple[float, float, float], ...]:
    """Return the sides as a, b, c: a x + b y + c is the distance of a place inside from them."""
    corners = np.array(corners_mm)
    sides = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    offsets = -np.sum(normals * corners, axis=1)
    inside = np.sign(np.sum(normals * corners.mean(axis=0), axis=1) + offsets)
    lines = np.column_stack([normals, offsets]) * inside[:, None]
    return tuple((a, b, c) for a, b, c in lines.tolist())


@lru_cache(maxsize=64)
def _mean_sides(corners_mm: Corners) -> tuple[float, float]:
    """Return the mean lengths of the sides along the picture's x and y."""
    top_left, top_right, bottom_right, bottom_left = corners_mm
    width = math.dist(top_left, top_right) + math.dist(bottom_left, bottom_right)
    height = math.dist(top_left, bottom_left) + math.dist(top_right, bottom_right)
    return width / 2.0, height / 2.0
