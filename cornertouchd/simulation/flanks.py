"""What lights fingers up: the strips near them, and the sun."""

from dataclasses import dataclass
from math import cos, hypot, sin

import numpy as np

from cornertouchd.model import FloatArray
from cornertouchd.simulation.border import STRIP_BOTTOM_MM, STRIP_SETBACK_MM
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.noise import Light

# Share of near infrared that skin throws back, evenly into all directions.
SKIN_REFLECTANCE = 0.55
# A lamp that adds less than this, in grey levels, is not worth its time.
DIMMEST = 0.5


@dataclass(frozen=True, slots=True)
class Lamp:
    """Light on a finger from the level direction `towards_rad` (from +x towards +y).

    `grey` is how bright it makes the flank that faces it squarely, in grey levels.
    """

    towards_rad: float
    grey: float


@dataclass(frozen=True, slots=True)
class Sun:
    """The sun, seen from the surface in direction `azimuth_rad`, `elevation_rad` above it.

    `grey` is how bright it makes a strip that faces it squarely, in grey levels; the LEDs make
    195.  Raises `ValueError` for a sun below the surface or a negative brightness.
    """

    azimuth_rad: float
    elevation_rad: float
    grey: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.elevation_rad < np.pi / 2.0:
            raise ValueError(
                f"sun: elevation_rad is {self.elevation_rad}; give 0 (grazing) to less than pi/2"
            )
        if not self.grey >= 0.0:
            raise ValueError(f"sun: grey is {self.grey}; give 0 (none) or more")

    @property
    def direction(self) -> FloatArray:
        """Unit direction (3,) in which it stands."""
        level = cos(self.elevation_rad)
        return np.array(
            [
                level * cos(self.azimuth_rad),
                level * sin(self.azimuth_rad),
                sin(self.elevation_rad),
            ]
        )

    @property
    def lamp(self) -> Lamp:
        """What it does to fingers."""
        grey = SKIN_REFLECTANCE * self.grey * cos(self.elevation_rad)
        return Lamp(self.azimuth_rad, grey)


def strip_lamps(
    finger: Finger, surface_mm: tuple[float, float], top_mm: float, grey: float
) -> tuple[Lamp, ...]:
    """Return what four strips, of this brightness and height, do to a finger.

    Seen from half its height, a long strip d away fills h / sqrt(d² + h²) of what a flank that
    faces it could see, h being half of how high it is.
    """
    half_mm = (top_mm - STRIP_BOTTOM_MM) / 2.0
    radius_mm = finger.diameter_mm / 2.0
    gaps_mm = (surface_mm[0] - finger.x_mm, surface_mm[1] - finger.y_mm, finger.x_mm, finger.y_mm)
    lamps = []
    for quarter, gap_mm in enumerate(gaps_mm):
        away_mm = max(gap_mm + STRIP_SETBACK_MM - radius_mm, 0.0)
        share = half_mm / hypot(away_mm, half_mm)
        lamps.append(Lamp(quarter * np.pi / 2.0, SKIN_REFLECTANCE * share * grey))
    return tuple(lamps)


def glow(lamps: tuple[Lamp, ...], bearing_rad: float, beside: Light) -> Light:
    """Return how bright a finger is, in grey levels, where rays meet it `beside` its axis.

    The finger is seen in direction `bearing_rad`; `beside` runs from -1 at its left edge to 1 at
    its right edge.
    """
    right = np.clip(beside, -1.0, 1.0)
    back = np.sqrt(1.0 - right * right)
    bright: Light = np.zeros_like(right)
    for lamp in lamps:
        if lamp.grey >= DIMMEST:
            turned_rad = lamp.towards_rad - bearing_rad
            facing = right * np.float32(sin(turned_rad)) - back * np.float32(cos(turned_rad))
            bright += np.float32(lamp.grey) * np.maximum(facing, np.float32(0.0))
    return bright
