"""How bright the strip is in a picture, side by side: which columns of a camera look where.

Pure.  Sides are numbered top, right, bottom, left; a camera looks at the two far ones.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Picture
from cornertouchd.vision.profile import ProfileSampler
from cornertouchd.vision.strip import find_strip
from cornertouchd.wire.ledframe import SIDE_NAMES

UNCOVERED_SHARE = 0.75
"""Hands cover less than three quarters of what a camera sees of a side; glints are narrower than a
quarter."""

STILL_SEEN = 0.3
"""Share of the calibrated light with which shadows are found: the least gain of the vision."""

FEWEST_COLUMNS = 8

MOST_COLUMNS = 64
"""Columns looked at on each side: as telling as all of them, at a tenth of the time."""


def sides_of_columns(
    angles_rad: FloatArray, position_mm: tuple[float, float], surface_mm: tuple[float, float]
) -> NDArray[np.int_]:
    """Return the side (N,) where lines (N,) from a camera leave the surface; -1 without a line."""
    east, south = np.cos(angles_rad), np.sin(angles_rad)
    width_mm, height_mm = surface_mm
    with np.errstate(divide="ignore", invalid="ignore"):
        to_upright = (np.where(east > 0.0, width_mm, 0.0) - position_mm[0]) / east
        to_level = (np.where(south > 0.0, height_mm, 0.0) - position_mm[1]) / south
    upright = np.abs(to_upright) < np.abs(to_level)
    sides = np.where(upright, np.where(east > 0.0, 1, 3), np.where(south > 0.0, 2, 0))
    return np.where(np.isfinite(angles_rad), sides, -1)


@dataclass(frozen=True, slots=True)
class SideBrightness:
    """Grey levels of one side of the strip in one picture, and whether it is at full scale."""

    side: int
    grey: float
    saturated: bool


class SideLight:
    """Measures the sides of the strip in one camera's pictures.  Immutable; any thread may use it.

    Raises `StripNotFoundError` for empty pictures without a strip.
    """

    def __init__(
        self,
        calibration: CameraCalibration,
        surface_mm: tuple[float, float],
        vision: VisionSettings,
    ) -> None:
        strip = find_strip(calibration.empty)
        sampler = ProfileSampler(strip, calibration.empty, vision)
        width_px = calibration.format.width_px
        angles_rad = calibration.model.angles_rad(np.arange(width_px, dtype=np.float64) + 0.5)
        at_side = sides_of_columns(angles_rad, calibration.model.position_mm, surface_mm)
        self._at_side = at_side
        self._full = vision.saturated_grey
        self._black = strip.dark_level
        self._pixels = {}
        for side in range(len(SIDE_NAMES)):
            here = np.flatnonzero((at_side == side) & sampler.known)
            if len(here) >= FEWEST_COLUMNS:
                chosen = here[:: -(-len(here) // MOST_COLUMNS)]
                taps = np.arange(len(sampler.taps.weights))[:, None]
                rows = sampler.taps.first_rows[chosen] + taps
                self._pixels[side] = rows, chosen, sampler.taps.weights[:, chosen]
        self._calibrated = {one.side: one.grey for one in self.measure(calibration.empty)}

    @property
    def sides(self) -> tuple[int, ...]:
        """The sides that the camera looks at."""
        return tuple(self._pixels)

    def measure(self, picture: Picture | FloatArray) -> tuple[SideBrightness, ...]:
        """Return how bright the uncovered strip is, a value for each of `sides`."""
        seen = []
        for side, (rows, columns, weights) in self._pixels.items():
            light = np.einsum("kw,kw->w", picture[rows, columns], weights)
            rank = int(UNCOVERED_SHARE * len(light))
            grey = float(np.partition(light, rank)[rank])
            seen.append(SideBrightness(side, grey, grey >= self._full))
        return tuple(seen)

    def shows_strip(self, seen: tuple[SideBrightness, ...]) -> bool:
        """Tell whether every side is bright enough to show shadows."""
        return all(
            one.grey - self._black >= STILL_SEEN * (self._calibrated[one.side] - self._black)
            for one in seen
        )

    def columns_of(self, sides: int) -> BoolArray:
        """Return which columns (width_px,) look at these sides, bits 0 to 3 top to left."""
        return np.isin(self._at_side, [side for side in range(4) if sides >> side & 1])

    def side_at(self, column: int) -> str:
        """Return the name of the side that a column looks at, empty if at none."""
        side = int(self._at_side[column])
        return SIDE_NAMES[side] if side >= 0 else ""
