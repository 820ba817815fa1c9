"""Brightness along the strip, from the rows that tell where a finger is.

A finger and its mirror image form an hourglass; a slanted finger is shifted from row to row.  Rays
in the rows of the horizon run at the height of the camera wherever the finger stands, so all
cameras cut it at the same height and their shadows agree; rows near the surface line would look
nearer to the touch, but at a different height for every distance.
"""

import numpy as np

from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Picture, Profile
from cornertouchd.vision.strip import Strip

HORIZON_SAMPLES = 5
"""Rows sampled across the horizon band; more change no edge by 0.01 px (rendered pictures)."""

GAIN_RANGE = (0.9, 1.1)
"""Exposure may differ this much from that of the empty pictures before it counts as light lost."""

DARKEST_SHARE = 0.24
"""Columns of a dead LED, darker than this share of the strip, tell nothing: the light that a finger
throws back, a tenth of the strip's, would look like a gap in its shadow (rendered pictures)."""


class ProfileSampler:
    """Samples the profile of one camera's pictures; knows its strip and its empty reference.

    The strip's rows are turned into a few rows and weights per column once; a picture then costs
    one gather.
    """

    def __init__(self, strip: Strip, empty: FloatArray, settings: VisionSettings) -> None:
        """Prepare for pictures of the size of `empty`, the mean of empty pictures (rows, W)."""
        rows_px, width = empty.shape
        self._indices, self._weights = _horizon_taps(strip, rows_px, settings.horizon_band)
        self._dark = strip.dark_level
        reference = self._sample(empty) - self._dark
        darkest = DARKEST_SHARE * float(np.median(reference[strip.visible]))
        self._known = strip.visible & (reference > max(settings.smallest_reference, darkest))
        self._scale = 1.0 / np.maximum(reference, 1.0)
        self._columns = np.arange(width)
        self._known_columns = np.flatnonzero(self._known)

    @property
    def known(self) -> BoolArray:
        """Columns in which the strip can be seen, (width_px,)."""
        return self._known

    def sample(self, picture: Picture) -> Profile:
        """Return the profile of a picture, in which 1 is the empty strip."""
        brightness = (self._sample(picture) - self._dark) * self._scale
        brightness /= self._gain(brightness)
        known = self._known_columns
        return Profile(np.interp(self._columns, known, brightness[known]), self._known)

    def _sample(self, picture: Picture | FloatArray) -> FloatArray:
        values: FloatArray = np.einsum("kw,kw->w", picture.take(self._indices), self._weights)
        return values

    def _gain(self, brightness: FloatArray) -> float:
        """Return how bright the uncovered strip is: the exposure drifts, touches are local."""
        seen = brightness[self._known_columns]
        uncovered = seen[seen > 0.8]
        if len(uncovered) < 20:
            return 1.0
        return float(np.clip(np.median(uncovered), *GAIN_RANGE))


def shows_strip(strip: Strip, empty: FloatArray, settings: VisionSettings) -> bool:
    """Tell whether at least half of the strip's columns are lit in mean empty pictures."""
    known = ProfileSampler(strip, empty, settings).known
    return 2 * int(np.count_nonzero(known)) >= int(np.count_nonzero(strip.visible))


def _horizon_taps(strip: Strip, rows_px: int, band: float) -> tuple[np.ndarray, FloatArray]:
    """Return flat pixel indices and weights, (taps, width_px), that average the horizon band."""
    width = len(strip.horizon_px)
    offsets = np.linspace(-band, band, HORIZON_SAMPLES)[:, None]
    rows = strip.horizon_px + offsets * strip.height_px - 0.5
    rows = np.clip(rows, 0, rows_px - 1.001)
    first = np.floor(rows.min(axis=0)).astype(np.intp)
    taps = int(np.max(np.floor(rows.max(axis=0)) - first)) + 2
    weights = np.zeros((taps, width))
    columns = np.arange(width)
    for row in rows:
        whole = np.floor(row).astype(np.intp)
        part = row - whole
        np.add.at(weights, (whole - first, columns), (1 - part) / HORIZON_SAMPLES)
        np.add.at(weights, (whole - first + 1, columns), part / HORIZON_SAMPLES)
    tap_rows = np.minimum(first + np.arange(taps)[:, None], rows_px - 1)
    return tap_rows * width + columns, weights
