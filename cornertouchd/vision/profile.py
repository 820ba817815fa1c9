"""Brightness along the strip of one picture, measured against the empty strip."""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import compiled, inlined
from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Picture, Profile
from cornertouchd.vision.filling import fill_in
from cornertouchd.vision.gain import most_frequent_brightness
from cornertouchd.vision.reference import SUNLIT_SHARE, Reference, make_reference
from cornertouchd.vision.strip import Strip
from cornertouchd.vision.taps import Runs, horizon_taps, runs_of

ROUGH = 0.08
LARGEST_ROUGH_SHARE = 0.4
"""From one column to the next the strip changes by less than this share, but for the edges of
shadows: a quarter of the columns with twenty fingers on a large frame, three quarters of noise."""


class NoiseError(Exception):
    """A picture shows noise instead of the strip."""


class Measured(NamedTuple):
    """What a picture shows: its profile, and the grey levels (width_px,) that it comes from.

    `levels` (3, width_px) are the profile's brightness, the mean of a column's pixels, `light`,
    and the brightest, `peak`.  `gain` is how much brighter than the reference the uncovered strip
    is; `rough_share` of the columns differ much from the next.  `sunlit` tells whether sunlight is
    to be reckoned with, that of the reference or a new one.  A tuple, since it is made for every
    picture.
    """

    profile: Profile
    levels: FloatArray
    gain: float
    rough_share: float
    sunlit: bool

    @property
    def light(self) -> FloatArray:
        """The mean of the pixels of each column, (width_px,)."""
        light: FloatArray = self.levels[1]
        return light

    @property
    def peak(self) -> FloatArray:
        """The brightest pixel of each column, (width_px,)."""
        peak: FloatArray = self.levels[2]
        return peak

    def require_strip(self) -> None:
        """Raise `NoiseError` if this can be no strip, whatever stands before it."""
        if self.rough_share > LARGEST_ROUGH_SHARE:
            raise NoiseError(
                f"noise instead of the strip: {self.rough_share:.0%} of the columns differ much "
                f"from the next, {LARGEST_ROUGH_SHARE:.0%} are believed; if that stays so, "
                "calibrate anew"
            )


class ProfileSampler:
    """Samples profiles of one camera's pictures; knows its strip and its empty reference.

    The strip's rows are turned into a few rows and weights per column once; a picture then costs
    one pass over them.
    """

    def __init__(self, strip: Strip, empty: FloatArray, settings: VisionSettings) -> None:
        """Prepare for pictures of the size of `empty`, the mean of empty pictures (rows, W)."""
        self.taps = horizon_taps(strip, len(empty), settings.horizon_band)
        self._runs = runs_of(self.taps.first_rows)
        self.reference = make_reference(strip, self.taps, empty, settings)
        self._saturated_grey = settings.saturated_grey

    @property
    def known(self) -> BoolArray:
        """Columns in which the empty strip can be seen, (width_px,)."""
        return self.reference.usable

    def sample(self, picture: Picture) -> Profile:
        """Return the profile of a picture, in which 1 is the empty strip."""
        return self.measure(picture, self.reference).profile

    def measure(self, picture: Picture, reference: Reference, gain_before: float = 1.0) -> Measured:
        """Measure a picture against any reference; `gain_before` is the gain to be expected."""
        levels, known, gain, rough_share, is_full = _measure(
            np.ascontiguousarray(picture),
            self._runs,
            self.taps.weights,
            reference.black,
            reference.scale,
            reference.usable,
            reference.clipped,
            self._saturated_grey,
            gain_before,
        )
        return Measured(
            Profile(levels[0], known), levels, gain, rough_share, reference.sunlit or is_full
        )


def shows_strip(strip: Strip, empty: FloatArray, settings: VisionSettings) -> bool:
    """Tell whether at least half of the strip's columns are lit in mean empty pictures."""
    known = ProfileSampler(strip, empty, settings).known
    return 2 * int(np.count_nonzero(known)) >= int(np.count_nonzero(strip.visible))


@inlined
def _sum_taps(
    picture: Picture,
    runs: Runs,
    weights: FloatArray,
    light: FloatArray,
    peak: FloatArray,
) -> None:
    """Add up the weighted mean and the brightest pixel of the taps of each column."""
    for number in range(len(runs)):
        start, stop, row = runs[number, 0], runs[number, 1], runs[number, 2]
        lights, peaks = light[start:stop], peak[start:stop]
        for tap in range(len(weights)):
            greys, shares = picture[row + tap, start:stop], weights[tap, start:stop]
            for column in range(stop - start):
                grey = float(greys[column])
                counted = grey if shares[column] > 0.0 else 0.0
                lights[column] += shares[column] * grey
                peaks[column] = max(peaks[column], counted)


@inlined
def _rough_share(brightness: FloatArray, known: BoolArray) -> float:
    """Return which share of the known columns differs much from the next."""
    count = rough = 0
    for column in range(len(known) - 1):  # without branches, so that several go at once
        both = known[column] & known[column + 1]
        count += int(both)
        rough += int(both & (abs(brightness[column + 1] - brightness[column]) > ROUGH))
    return rough / count if count else 0.0


@compiled(
    "Tuple((f8[:,::1], b1[::1], f8, f8, b1))("
    "Array(u1, 2, 'C', readonly=True), i8[:,::1], f8[:,::1], "
    "f8[::1], f8[::1], b1[::1], b1[::1], f8, f8)"
)
def _measure(
    picture: Picture,
    runs: Runs,
    weights: FloatArray,
    black: FloatArray,
    scale: FloatArray,
    usable: BoolArray,
    clipped: BoolArray,
    saturated_grey: float,
    gain_before: float,
) -> tuple[FloatArray, BoolArray, float, float, bool]:
    """Return brightness, light and peak (3, width_px), known columns, gain and rough share.

    A column at full scale that is not so without a touch is not known: how bright it is cannot be
    told.  The last value tells whether so many are at full scale that the sun shines in.
    """
    width = len(black)
    levels, known = np.zeros((3, width)), np.empty(width, np.bool_)
    brightness, light, peak = levels[0], levels[1], levels[2]
    _sum_taps(picture, runs, weights, light, peak)
    useful = full = 0
    for column in range(width):
        brightness[column] = (light[column] - black[column]) * scale[column]
        is_full = peak[column] >= saturated_grey
        known[column] = usable[column] & ((not is_full) | clipped[column])
        useful += int(usable[column])
        full += int(usable[column] & is_full)
    gain = most_frequent_brightness(brightness, known, gain_before)
    for column in range(width):
        brightness[column] *= 1.0 / gain
    rough_share = _rough_share(brightness, known)
    fill_in(brightness, known)
    return levels, known, gain, rough_share, full > SUNLIT_SHARE * useful
