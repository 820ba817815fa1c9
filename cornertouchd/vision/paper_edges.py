"""The paper's own finder (Wang et al. 2011, section 5): mask, line, gradient, edges, merging.

Selected by `vision.edges = "paper"`; the reference that the default is measured against.
"""

import numpy as np

from cornertouchd.config import PaperVisionSettings
from cornertouchd.model import BoolArray, FloatArray, Picture, Shadow, Shadows
from cornertouchd.vision.strip import Strip

HALF_SHADED_PX = 2
"""Columns this near to the camera in the far corner are half shaded by it: an edge that stays."""


def strip_mask(strip: Strip, rows_px: int) -> BoolArray:
    """Return the binary mask of the strip (not its mirror image), (rows_px, width_px).  Eq. 1."""
    rows = np.arange(rows_px)[:, None] + 0.5
    near = np.ones(2 * HALF_SHADED_PX + 1)
    clear = np.convolve(~strip.visible, near, mode="same") < 0.5
    mask: BoolArray = (rows > strip.top_px) & (rows < strip.surface_px) & clear
    return mask


def strip_line(mask: BoolArray) -> np.ndarray:
    """Return the strip's centre row, the closest integer, -1 in columns without mask.  Eq. 2."""
    rows = np.arange(len(mask))
    count = mask.sum(axis=0)
    centre = np.rint((rows @ mask) / np.maximum(count, 1)).astype(np.intp)
    return np.where(count > 0, centre, -1)


class PaperFinder:
    """Finds shadows as the paper does: gradient extrema along the strip line of one picture."""

    def __init__(self, strip: Strip, rows_px: int, settings: PaperVisionSettings) -> None:
        self._mask = strip_mask(strip, rows_px)
        self._line = strip_line(self._mask)
        self._settings = settings

    def mean_values(self, picture: Picture) -> FloatArray:
        """Return the 3x3 mean along the strip line, (width_px,), NaN without mask.  Eq. 3."""
        rows_px, width = picture.shape
        line = np.clip(self._line, 1, rows_px - 2)
        columns = np.arange(width)
        total, count = np.zeros(width), np.zeros(width)
        for across in (-1, 0, 1):
            for along in (-1, 0, 1):
                u = np.clip(columns + along, 0, width - 1)
                inside = self._mask[line[u] + across, u]
                total += inside * picture[line[u] + across, u]
                count += inside
        seen = (count > 0) & (self._line >= 0)
        return np.where(seen, total / np.maximum(count, 1), np.nan)

    def find(self, picture: Picture) -> Shadows:
        """Return the shadows of a picture from left to right, edges at pixel centres.

        Both edges count as valid: the paper knows no others.
        """
        lefts, rights = find_edges(gradient(self.mean_values(picture)), self._settings.t1)
        pairs = merge_edges(lefts, rights, self._settings.t2_px, self._settings.t3_px)
        return Shadows.of(Shadow(a + 0.5, b + 0.5, True, True, 1.0) for a, b in pairs)


def gradient(mean_values: FloatArray) -> FloatArray:
    """Return twice the fall of brightness across each column, 0 where unknown.  Eq. 4."""
    slope = np.zeros_like(mean_values)
    slope[1:-1] = 2 * mean_values[:-2] - 2 * mean_values[2:]
    return np.nan_to_num(slope)


def find_edges(slope: FloatArray, t1: float) -> tuple[list[int], list[int]]:
    """Return columns of left edges (local maxima above t1) and right edges (minima below -t1)."""
    before, at, after = slope[:-2], slope[1:-1], slope[2:]
    lefts = np.flatnonzero((at > t1) & (at >= before) & (at > after)) + 1
    rights = np.flatnonzero((at < -t1) & (at <= before) & (at < after)) + 1
    return lefts.tolist(), rights.tolist()


def merge_edges(
    lefts: list[int], rights: list[int], t2_px: float, t3_px: float
) -> list[tuple[int, int]]:
    """Pair every left edge with the nearest right edge that makes T2 < width < T3.

    An edge belongs to one shadow at most; isolated edges are dropped (section 5, step 4).
    """
    pairs = []
    free_from = -1
    for left in lefts:
        if left <= free_from:
            continue
        fitting = [right for right in rights if t2_px < right - left < t3_px]
        if fitting:
            free_from = fitting[0]
            pairs.append((left, free_from))
    return pairs
