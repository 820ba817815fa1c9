"""How much brighter than before the uncovered strip is: the exposure changes, touches are local.

That is the most frequent brightness, wherever it is: a palm, or the sun on one side, takes the
median along.
"""

import numpy as np

from cornertouchd.compiling import inlined, summing
from cornertouchd.model import BoolArray, FloatArray

GAIN_RANGE = (0.3, 3.0)
"""Exposure and LED current may change this much; what is darker altogether is a strip that is off
or covered, and brighter pictures are at full scale."""

DARKEST_UNCOVERED = 0.22
"""Columns under palms, arms and fingers have up to .15 of the light (rendered pictures); the strip
itself has more, unless its gain is out of range."""

STEPS = 50.0
BINS = 160
"""Brightness is counted in so many steps of the empty strip's, as wide as ripple and noise, up to
somewhat above the largest gain."""

SPREAD = 0.04
"""The uncovered strip is even to this share, two sigmas of ripple and noise (rendered pictures)."""

REACH = 0.1
"""Light this near to the most frequent belongs to it: their mean is the gain."""

FEWEST_COLUMNS = 20
"""Fewer columns of one brightness may be the blurred edges of shadows."""

KEPT_SHARE = 3
"""The gain is believed to have changed if another brightness is three times as frequent: blurred
edges, two columns each, stay below that with twenty fingers."""


@inlined
def _count_up_to(brightness: FloatArray, known: BoolArray) -> FloatArray:
    """Return how many known, uncovered columns lie in all bins below each bin, (BINS + 1,)."""
    counts = np.zeros(BINS + 1)
    for column in range(len(brightness)):
        value = brightness[column]
        if known[column] and DARKEST_UNCOVERED < value < BINS / STEPS:
            counts[int(value * STEPS) + 1] += 1.0
    for number in range(BINS):
        counts[number + 1] += counts[number]
    return counts


@inlined
def _columns_near(counts: FloatArray, number: int) -> float:
    """Return how many columns are about as bright as bin `number`."""
    reach = max(1, int(SPREAD * number))
    return float(counts[min(number + reach + 1, BINS)] - counts[max(number - reach, 0)])


@inlined
def _is_beyond_doubt(brightness: FloatArray, known: BoolArray, gain_before: float) -> bool:
    """Tell whether so many columns have the brightness expected that no other is to be sought.

    All that are uncovered, were they of one brightness, would not be three times as many.
    """
    number = int(gain_before * STEPS)
    reach = max(1, int(SPREAD * number))
    first, stop = float(max(number - reach, 0)), float(min(number + reach + 1, BINS))
    near = uncovered = 0
    for column in range(len(brightness)):  # without branches, so that several go at once
        value = brightness[column]
        counts = known[column] & (value > DARKEST_UNCOVERED) & (value < BINS / STEPS)
        uncovered += int(counts)
        near += int(counts & (value * STEPS >= first) & (value * STEPS < stop))
    return near >= FEWEST_COLUMNS and KEPT_SHARE * near >= uncovered


@summing
def _mean_near(brightness: FloatArray, known: BoolArray, level: float) -> float:
    """Return the mean of all known columns that are about as bright as `level`."""
    total, count = 0.0, 0
    for column in range(len(brightness)):  # without branches, so that several go at once
        value = brightness[column]
        near = known[column] & ((1.0 - REACH) * level < value) & (value < (1.0 + REACH) * level)
        total += value if near else 0.0
        count += int(near)
    return total / count if count else level


@inlined
def most_frequent_brightness(brightness: FloatArray, known: BoolArray, gain_before: float) -> float:
    """Return the most frequent brightness of known columns, all (width_px,).

    The brightness expected, `gain_before`, is kept while enough columns still have it.
    """
    level = gain_before
    if not _is_beyond_doubt(brightness, known, gain_before):
        counts = _count_up_to(brightness, known)
        best, most = 0, 0.0
        for number in range(BINS):
            near = _columns_near(counts, number)
            if near > most:
                best, most = number, near
        if _columns_near(counts, int(gain_before * STEPS)) < max(FEWEST_COLUMNS, most / KEPT_SHARE):
            if most < FEWEST_COLUMNS:
                return gain_before
            level = (best + 0.5) / STEPS
    for _ in range(3):
        mean = _mean_near(brightness, known, level)
        if mean == level:
            break
        level = mean
    return min(max(level, GAIN_RANGE[0]), GAIN_RANGE[1])
