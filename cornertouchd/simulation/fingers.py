"""Fingers: slanted rounded capsules that stand on the surface or hover above it."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import Self

import numpy as np

from cornertouchd.model import FloatArray

MAX_LEAN_RAD = 1.2

# A touching tip is flattened by this share of its radius: .6 mm for a finger of 12 mm, as fitted
# to the path-traced pictures.  It gives the waist between finger and mirror image its width.
FLATTENED_SHARE = 0.1


@dataclass(frozen=True, slots=True)
class Finger:
    """A capsule whose round tip touches the surface, slightly flattened, at (x, y).

    It rises from there, leaning by `lean_rad` from upright towards `lean_azimuth_rad` (from +x
    towards +y).  With a `height_mm` it hovers: the tip is round and that far above the surface.
    """

    x_mm: float
    y_mm: float
    diameter_mm: float = 10.0
    lean_rad: float = 0.0
    lean_azimuth_rad: float = 0.0
    height_mm: float = 0.0

    def __post_init__(self) -> None:
        if not self.diameter_mm > 0.0:
            raise ValueError(f"finger: diameter_mm is {self.diameter_mm}; give one above 0")
        if not 0.0 <= self.lean_rad <= MAX_LEAN_RAD:
            raise ValueError(f"finger: lean_rad is {self.lean_rad}; give 0 to {MAX_LEAN_RAD}")
        if not self.height_mm >= 0.0:
            raise ValueError(f"finger: height_mm is {self.height_mm}; give 0 (touching) or more")

    @property
    def tip_height_mm(self) -> float:
        """Height of the centre of the round tip, which is straight above (x, y)."""
        radius_mm = self.diameter_mm / 2.0
        if self.height_mm == 0.0:
            return radius_mm * (1.0 - FLATTENED_SHARE)
        return radius_mm + self.height_mm

    @property
    def axis(self) -> tuple[float, float, float]:
        """Unit direction in which the shaft rises."""
        level = sin(self.lean_rad)
        return (
            level * cos(self.lean_azimuth_rad),
            level * sin(self.lean_azimuth_rad),
            cos(self.lean_rad),
        )


@dataclass(frozen=True, slots=True)
class Section:
    """A finger cut by a plane parallel to the surface: its middle, and the mean of its widths."""

    x_mm: float
    y_mm: float
    diameter_mm: float


def section(finger: Finger, height_mm: float) -> Section | None:
    """Return the finger's cross-section at a height, or None if all of it is above.

    Its shape is an oval along the lean, an ellipse where the plane cuts only the shaft; the
    diameter is the geometric mean of its length and its breadth.
    """
    radius_mm = finger.diameter_mm / 2.0
    above_mm = height_mm - finger.tip_height_mm
    if above_mm <= -radius_mm:
        return None
    lean_sin, lean_cos = sin(finger.lean_rad), cos(finger.lean_rad)

    def farthest(sign: float) -> float:
        """Return how far the oval reaches along (+1) or against (-1) the lean."""
        along_axis_mm = max(0.0, (above_mm + sign * radius_mm * lean_sin) / lean_cos)
        off_mm = above_mm - along_axis_mm * lean_cos
        disc_mm = sqrt(max(0.0, radius_mm**2 - off_mm**2))
        return along_axis_mm * lean_sin + sign * disc_mm

    breadth_mm = 2.0 * sqrt(radius_mm**2 - min(0.0, above_mm) ** 2)
    length_mm = farthest(1.0) - farthest(-1.0)
    shift_mm = (farthest(1.0) + farthest(-1.0)) / 2.0
    return Section(
        finger.x_mm + shift_mm * cos(finger.lean_azimuth_rad),
        finger.y_mm + shift_mm * sin(finger.lean_azimuth_rad),
        sqrt(length_mm * breadth_mm),
    )


@dataclass(frozen=True, slots=True)
class Capsules:
    """F fingers as endless capsules seen from a camera; lengths in units of their own radius.

    `tips` (F, 3) are the centres of the round tips relative to the camera, `axes` (F, 3) the unit
    directions of the shafts, `radii_mm` (F,).
    """

    tips: FloatArray
    axes: FloatArray
    radii_mm: FloatArray

    @classmethod
    def seen_from(cls, origin_mm: FloatArray, fingers: Sequence[Finger]) -> Self:
        """Return the fingers relative to a place (3,)."""
        radii_mm = np.array([f.diameter_mm / 2.0 for f in fingers])
        tips_mm = np.array([(f.x_mm, f.y_mm, f.tip_height_mm) for f in fingers])
        axes = np.array([f.axis for f in fingers])
        return cls((tips_mm - origin_mm) / radii_mm[:, None], axes, radii_mm)
