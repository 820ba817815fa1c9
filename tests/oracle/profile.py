"""Profiles in numpy: how bright the uncovered strip is, and what is known.  Slow and readable."""

import numpy as np

from cornertouchd.model import BoolArray, FloatArray, Picture, Profile
from cornertouchd.vision.gain import (
    BINS,
    DARKEST_UNCOVERED,
    FEWEST_COLUMNS,
    GAIN_RANGE,
    KEPT_SHARE,
    REACH,
    SPREAD,
    STEPS,
)
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.taps import StripTaps


def measure_profile(
    picture: Picture,
    taps: StripTaps,
    reference: Reference,
    saturated_grey: float,
    gain_before: float = 1.0,
) -> tuple[Profile, float]:
    """Return the profile of a picture, and its gain."""
    brightness = (taps.light(picture) - reference.black) * reference.scale
    unclear = (taps.peak(picture) >= saturated_grey) & ~reference.clipped
    known = reference.usable & ~unclear
    gain = most_frequent(brightness[known], gain_before)
    columns = np.flatnonzero(known)
    if not len(columns):
        return Profile(np.zeros(len(known)), known), gain
    every = np.arange(len(known))
    return Profile(np.interp(every, columns, brightness[columns] / gain), known), gain


def most_frequent(seen: FloatArray, gain_before: float) -> float:
    """Return the most frequent brightness of known columns; the one before while it is frequent."""
    uncovered = seen[(seen > DARKEST_UNCOVERED) & (seen < BINS / STEPS)]
    counts = np.bincount((uncovered * STEPS).astype(int), minlength=BINS)[:BINS]
    near = np.array([_window(counts, number).sum() for number in range(BINS)])
    level = gain_before
    if near[int(gain_before * STEPS)] < max(FEWEST_COLUMNS, near.max() / KEPT_SHARE):
        if near.max() < FEWEST_COLUMNS:
            return gain_before
        level = (int(np.argmax(near)) + 0.5) / STEPS
    for _ in range(3):
        close = _close_to(seen, level)
        level = float(seen[close].mean()) if close.any() else level
    return float(np.clip(level, *GAIN_RANGE))


def _window(counts: np.ndarray, number: int) -> np.ndarray:
    reach = max(1, int(SPREAD * number))
    return counts[max(number - reach, 0) : number + reach + 1]


def _close_to(seen: FloatArray, level: float) -> BoolArray:
    close: BoolArray = (seen > (1 - REACH) * level) & (seen < (1 + REACH) * level)
    return close
