"""What the empty strip looks like in one camera: what its pictures are measured against."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from cornertouchd.compiling import compiled
from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray
from cornertouchd.vision.strip import Strip
from cornertouchd.vision.taps import StripTaps

DARKEST_SHARE = 0.24
"""Columns of a dead LED, darker than this share of the strip, tell nothing: the light that a finger
throws back, a tenth of the strip's, would look like a gap in its shadow (rendered pictures)."""

NEARLY_FULL = 0.9
"""A column above this share of full scale reaches it by noise, or by a tenth more exposure: then it
is as bright as the empty strip, near enough."""

SUNLIT_SHARE = 0.02
"""With more columns at full scale the sun shines in: .3 % in a good picture, 4 to 50 % in the sun
(rendered pictures)."""


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """The empty strip by column; all arrays are (width_px,), in grey levels.

    `black` is what a column shows without the LEDs, `light` what they add, `peak` its brightest
    pixel.  A column with no more than `least_light` is too dark to tell anything; that is infinite
    where something else than the strip is seen.  `clipped` columns are at full scale already, or
    nearly so; `sunlit` tells that many are.  `scale` makes light a share of the empty strip's.
    """

    black: FloatArray
    light: FloatArray
    peak: FloatArray
    least_light: FloatArray
    on_strip: BoolArray
    usable: BoolArray
    clipped: BoolArray
    scale: FloatArray
    sunlit: bool

    @classmethod
    def of(
        cls,
        black: FloatArray,
        light: FloatArray,
        peak: FloatArray,
        least_light: FloatArray,
        saturated_grey: float,
    ) -> Self:
        """Return the reference of a strip with this light; what follows from it is worked out."""
        return cls(
            black, light, peak, least_light, *_derived(light, peak, least_light, saturated_grey)
        )


@compiled("Tuple((b1[::1], b1[::1], b1[::1], f8[::1], b1))(f8[::1], f8[::1], f8[::1], f8)")
def _derived(
    light: FloatArray, peak: FloatArray, least_light: FloatArray, saturated_grey: float
) -> tuple[BoolArray, BoolArray, BoolArray, FloatArray, bool]:
    """Return which columns are on the strip, usable, clipped; their scale; if it is sunlit."""
    width = len(light)
    on_strip, usable = np.empty(width, np.bool_), np.empty(width, np.bool_)
    clipped, scale = np.empty(width, np.bool_), np.empty(width)
    useful = full = 0
    for column in range(width):
        on_strip[column] = least_light[column] < np.inf
        usable[column] = light[column] > least_light[column]
        clipped[column] = peak[column] >= NEARLY_FULL * saturated_grey
        scale[column] = 1.0 / max(light[column], 1.0)
        useful += int(usable[column])
        full += int(usable[column] & (peak[column] >= saturated_grey))
    return on_strip, usable, clipped, scale, full > SUNLIT_SHARE * useful


def make_reference(
    strip: Strip, taps: StripTaps, empty: FloatArray, settings: VisionSettings
) -> Reference:
    """Return what `empty`, the mean of empty pictures (rows_px, width_px), shows."""
    black = np.full(len(strip.visible), strip.dark_level)
    light = taps.light(empty) - black
    darkest = DARKEST_SHARE * float(np.median(light[strip.visible]))
    least_light = np.where(strip.visible, max(settings.smallest_reference, darkest), np.inf)
    return Reference.of(black, light, taps.peak(empty), least_light, settings.saturated_grey)
