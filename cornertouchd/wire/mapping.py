"""Where a display lies on the surface, and what its pixels call a place there."""

import math
from dataclasses import dataclass

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


@dataclass(frozen=True, slots=True)
class DisplayMapping:
    """The rectangle of the surface that a display fills, and how its picture lies in it.

    `left_mm`, `top_mm`, `width_mm` and `height_mm` are along the surface's x and y.  The picture is
    turned clockwise by `rotation_deg` (0, 90, 180 or 270) as seen by who touches it: at 90 its
    top-left corner lies at the rectangle's top-right.  `mirror` swaps the picture's left and right,
    as a projector behind the surface does.  Raises `ValueError` for a rectangle without area or
    another rotation.
    """

    left_mm: float
    top_mm: float
    width_mm: float
    height_mm: float
    rotation_deg: int = 0
    mirror: bool = False

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

    @property
    def picture_mm(self) -> tuple[float, float]:
        """Width and height of the picture as who looks at it sees it."""
        swapped, _, _ = _AXES[self.rotation_deg, self.mirror]
        return (self.height_mm, self.width_mm) if swapped else (self.width_mm, self.height_mm)

    def contains(self, x_mm: float, y_mm: float) -> bool:
        """Whether a place of the surface is on the display, or at most 2 mm beside it."""
        return (
            -EDGE_TOLERANCE_MM <= x_mm - self.left_mm <= self.width_mm + EDGE_TOLERANCE_MM
            and -EDGE_TOLERANCE_MM <= y_mm - self.top_mm <= self.height_mm + EDGE_TOLERANCE_MM
        )

    def to_display(self, x_mm: float, y_mm: float) -> tuple[float, float]:
        """Return the place in the picture, both axes 0..1 from its top-left corner.

        A place beside the display gives the nearest one on its edge.
        """
        u = (x_mm - self.left_mm) / self.width_mm
        v = (y_mm - self.top_mm) / self.height_mm
        if not (0.0 <= u <= 1.0 and 0.0 <= v <= 1.0):
            u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        swapped, x_backwards, y_backwards = _AXES[self.rotation_deg, self.mirror]
        x, y = (v, u) if swapped else (u, v)
        return (1.0 - x if x_backwards else x), (1.0 - y if y_backwards else y)

    def velocity_to_display(self, vx_mm_s: float, vy_mm_s: float) -> tuple[float, float]:
        """Return the velocity in the picture, in widths and heights of it per second."""
        u_per_s = vx_mm_s / self.width_mm
        v_per_s = vy_mm_s / self.height_mm
        swapped, x_backwards, y_backwards = _AXES[self.rotation_deg, self.mirror]
        x_per_s, y_per_s = (v_per_s, u_per_s) if swapped else (u_per_s, v_per_s)
        return (-x_per_s if x_backwards else x_per_s), (-y_per_s if y_backwards else y_per_s)
