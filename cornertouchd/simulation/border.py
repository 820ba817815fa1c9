"""The lit border as the cameras see it when nothing touches: LED strips, screen, barrels."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.model import FloatArray

# Where things stand in the path-traced pictures after which the simulation is modelled.
STRIP_SETBACK_MM = 7.0
"""The face of each strip lies this far outside the surface."""
STRIP_BOTTOM_MM = 0.8
"""The strip starts above the screen: seen as the dark line at z = 0, with its mirror image."""
CORNER_GAP_MM = 2.0
"""Each strip ends this far before the corner where two of them would meet."""

# The common 80 LEDs a metre.  A diffuser that spreads each over .4 pitches leaves a ripple of
# ± 8 %, and LEDs out of one batch differ by some 5 %: both as in the path-traced pictures.
LED_PITCH_MM = 12.5
LED_BLUR_MM = 0.4 * LED_PITCH_MM
LED_SPREAD = 0.05
TABLE_STEP_MM = 0.25

# The diffuser is dimmer at its upper and lower rim by this share.
RIM_LOSS = 0.12

# Reflectance of acrylic at normal incidence, for Schlick's approximation (1994).
NORMAL_REFLECTANCE = 0.04


@dataclass(frozen=True, slots=True)
class LedBorder:
    """Four LED strips around a surface, and what stands before them.

    `brightness` holds a table for each side (top, right, bottom, left) over the place along it,
    in steps of `TABLE_STEP_MM` from the end at x or y = -`STRIP_SETBACK_MM`.  `reflectance` is the
    share of grazing light that the screen mirrors: about .93 glossy, 0 matt.  `barrels_mm` (N, 2)
    are the cameras, upright cylinders that hide the strip.
    """

    surface_mm: tuple[float, float]
    top_mm: float
    brightness: tuple[FloatArray, ...]
    reflectance: float
    barrels_mm: FloatArray
    barrel_mm: float

    def light(self, origin_mm: FloatArray, rays: FloatArray, footprint_rad: float) -> FloatArray:
        """Return the light (...) that arrives at the origin (3,) from unit directions (3, ...).

        1 is the mean of a strip.  Every edge is softened over the footprint of a ray, so that a
        few rays a pixel suffice.  A barrel at the origin itself hides nothing.
        """
        level = np.hypot(rays[0], rays[1])
        ahead = rays[:2] / level
        distance_mm, side, along_mm = self._wall(origin_mm, ahead)
        height_mm = origin_mm[2] + distance_mm * rays[2] / level
        footprint_mm = distance_mm * footprint_rad

        lit = np.abs(height_mm) < self.top_mm + footprint_mm  # most of a whole picture is not
        light: FloatArray = np.zeros_like(height_mm)
        height_mm, ahead = height_mm[lit], ahead[:, lit]
        seen = self._strip(side[lit], along_mm[lit], np.abs(height_mm), footprint_mm[lit])
        seen *= np.where(height_mm < 0.0, self._mirrored(rays[2][lit]), 1.0)
        for barrel_mm in self.barrels_mm:
            seen *= self._past_barrel(barrel_mm - origin_mm[:2], ahead, footprint_rad)
        light[lit] = seen
        return light

    def wall_distance(self, origin_mm: FloatArray, ahead: FloatArray) -> FloatArray:
        """Return how far (...) horizontal unit directions (2, ...) go to the face of a strip."""
        distance_mm: FloatArray = np.min(self._to_walls(origin_mm, ahead), axis=0)
        return distance_mm

    def _to_walls(self, origin_mm: FloatArray, ahead: FloatArray) -> FloatArray:
        """Return the distances (2, ...) to the upright and to the level wall that lies ahead."""
        width_mm, height_mm = self.surface_mm
        low, high = -STRIP_SETBACK_MM, STRIP_SETBACK_MM
        x_mm = np.where(ahead[0] > 0.0, width_mm + high, low)
        y_mm = np.where(ahead[1] > 0.0, height_mm + high, low)
        with np.errstate(divide="ignore"):
            return np.stack(
                [
                    np.abs(x_mm - origin_mm[0]) / np.abs(ahead[0]),
                    np.abs(y_mm - origin_mm[1]) / np.abs(ahead[1]),
                ]
            )

    def _wall(
        self, origin_mm: FloatArray, ahead: FloatArray
    ) -> tuple[FloatArray, NDArray[np.int_], FloatArray]:
        """Return the distance of the wall that horizontal rays hit, which, and where along it."""
        to_upright, to_level = self._to_walls(origin_mm, ahead)
        upright = to_upright < to_level
        distance_mm = np.where(upright, to_upright, to_level)
        side = np.where(upright, np.where(ahead[0] > 0.0, 1, 3), np.where(ahead[1] > 0.0, 2, 0))
        along_mm = np.where(
            upright, origin_mm[1] + distance_mm * ahead[1], origin_mm[0] + distance_mm * ahead[0]
        )
        return distance_mm, side, along_mm

    def _strip(
        self,
        side: NDArray[np.int_],
        along_mm: FloatArray,
        height_mm: FloatArray,
        footprint_mm: FloatArray,
    ) -> FloatArray:
        """Return the light of the strips at a place along the side and a height above z = 0."""
        light = np.zeros_like(along_mm)
        for number, table in enumerate(self.brightness):
            here = side == number
            place = (along_mm[here] + STRIP_SETBACK_MM) / TABLE_STEP_MM
            light[here] = np.interp(place, np.arange(len(table)), table, left=0.0, right=0.0)
        middle_mm = (self.top_mm + STRIP_BOTTOM_MM) / 2.0
        half_mm = (self.top_mm - STRIP_BOTTOM_MM) / 2.0
        off_middle_mm = np.abs(height_mm - middle_mm)
        rim = 1.0 - RIM_LOSS * np.square(off_middle_mm / half_mm)
        lit: FloatArray = light * rim * _inside(half_mm - off_middle_mm, footprint_mm)
        return lit

    def _mirrored(self, down: FloatArray) -> FloatArray:
        """Return the share of light that a ray of this z keeps when the screen reflects it."""
        grazing = (1.0 - np.abs(down)) ** 5
        return self.reflectance * (NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * grazing)

    def _past_barrel(
        self, offset_mm: FloatArray, ahead: FloatArray, footprint_rad: float | FloatArray
    ) -> FloatArray:
        """Return the share of light that passes a barrel standing at this offset (2,)."""
        distance_mm = float(np.hypot(*offset_mm))
        if distance_mm <= self.barrel_mm:
            return np.ones_like(ahead[0])
        beside_mm = np.abs(ahead[0] * offset_mm[1] - ahead[1] * offset_mm[0])
        before = ahead[0] * offset_mm[0] + ahead[1] * offset_mm[1] > 0.0
        hidden = _inside(self.barrel_mm / 2.0 - beside_mm, distance_mm * footprint_rad)
        passed: FloatArray = 1.0 - hidden * before
        return passed


def _inside(depth_mm: FloatArray, footprint_mm: float | FloatArray) -> FloatArray:
    """Return the share of a footprint that lies inside an edge passed by this depth."""
    share: FloatArray = np.clip(depth_mm / footprint_mm + 0.5, 0.0, 1.0)
    return share


def led_brightness(length_mm: float, rng: np.random.Generator) -> FloatArray:
    """Return the brightness table of a strip along a side of the surface, mean about 1."""
    whole_mm = length_mm + 2.0 * STRIP_SETBACK_MM
    count = max(1, int((whole_mm - 2.0 * CORNER_GAP_MM) / LED_PITCH_MM))
    # One LED more at each end stands for the light that the end of the diffuser throws back;
    # without it a strip would fade out, where the path-traced ones end sharply.
    count += 2
    places_mm = whole_mm / 2.0 + (np.arange(count) - (count - 1) / 2.0) * LED_PITCH_MM
    table_mm = np.arange(0.0, whole_mm, TABLE_STEP_MM)
    off_led = (table_mm[:, None] - places_mm) / LED_BLUR_MM
    spread = np.exp(-0.5 * np.square(off_led)) * LED_PITCH_MM / (LED_BLUR_MM * np.sqrt(2.0 * np.pi))
    brightness: FloatArray = spread @ (1.0 + LED_SPREAD * rng.standard_normal(count))
    brightness[(table_mm < CORNER_GAP_MM) | (table_mm > whole_mm - CORNER_GAP_MM)] = 0.0
    return brightness
