"""How one camera sees the lit strip: brightness, stray light, focus, place in the picture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.model import BoolArray, FloatArray
from cornertouchd.vision.paper_edges import strip_mask
from cornertouchd.vision.strip import Strip

FULL_SCALE = 255.0

DARK_SHARE = 0.1
"""A column darker than this share of the strip shows none; a dead LED leaves a sixth, from its
neighbours behind the diffuser."""

BLURS_CLEAR = 4.0
"""Beyond this many standard deviations a blurred edge is over."""

SMALLEST_CLEARANCE_PX = 3.0

EDGE_REACH_PX, EDGE_STEP_PX = 8.0, 0.25
EDGE_LEVELS, EDGE_WIDTH_SIGMAS = (0.2, 0.6), 1.095
"""Between these levels an edge blurred by a Gaussian rises within this many standard deviations.
Higher up the dimmer rim of the strip would look like blur."""


@dataclass(frozen=True, slots=True)
class StripLight:
    """What was measured of the strip.

    Shares are 0..1: `level_share` and `black_share` of full scale, `ambient_share` and
    `flicker_share` of the strip's brightness, the others of the columns.

    `level_share` is the strip's median brightness, each column taken at its brightest row.
    `ambient_share` is NaN where no row outside the strip and no dark picture tells.  `blur_px` is
    a standard deviation.  `rows_above_px` and `rows_below_px` lie between the border of the
    picture and the strip or its mirror image; `widest_dark_run` is its first and last column.
    """

    level_share: float
    black_share: float
    saturated_share: float
    ambient_share: float
    flicker_share: float
    blur_px: float
    rows_above_px: float
    rows_below_px: float
    visible_share: float
    dark_columns_share: float
    widest_dark_run: tuple[int, int]

    def factor_to(self, target_share: float) -> float:
        """Return how many times the light it takes for the strip to reach a share of full scale."""
        return (target_share - self.black_share) / (self.level_share - self.black_share)


def measure_strip_light(
    pictures: NDArray[np.uint8], mean: FloatArray, strip: Strip, dark_mean: FloatArray | None
) -> StripLight:
    """Measure pictures of the empty surface (N, rows, width_px), of which `mean` is the mean.

    `dark_mean` is the mean of pictures without any LED.
    """
    mask = strip_mask(strip, len(mean))
    columns = np.flatnonzero(mask.any(axis=0))
    peaks = np.where(mask, mean, 0.0).max(axis=0)[columns]
    level = float(np.median(peaks))
    blur_px = _blur_px(mean, strip, columns)
    clear_px = max(SMALLEST_CLEARANCE_PX, BLURS_CLEAR * np.nan_to_num(blur_px))
    bottom_px = strip.surface_px + strip.height_px * strip.mirrored
    strips = pictures[:, mask].mean(axis=1)
    dark_columns = (mean - strip.dark_level).max(axis=0) < DARK_SHARE * (level - strip.dark_level)
    return StripLight(
        level_share=level / FULL_SCALE,
        black_share=strip.dark_level / FULL_SCALE,
        saturated_share=float(np.mean(((pictures == FULL_SCALE) & mask).any(axis=1)[:, columns])),
        ambient_share=_ambient_share(mean, strip, clear_px, level, dark_mean),
        flicker_share=float(np.abs(strips / strips.mean() - 1.0).max()),
        blur_px=blur_px,
        rows_above_px=float(strip.top_px[columns].min()),
        rows_below_px=float(len(mean) - bottom_px[columns].max()),
        visible_share=float(np.mean(strip.visible)),
        dark_columns_share=float(np.mean(dark_columns)),
        widest_dark_run=_widest_run(dark_columns),
    )


def _ambient_share(
    mean: FloatArray, strip: Strip, clear_px: float, level: float, dark_mean: FloatArray | None
) -> float:
    """Return the brightest stray light (99 of 100 pixels are darker) over the strip's light."""
    shares = []
    rows = np.arange(len(mean))[:, None] + 0.5
    mirror_px = strip.surface_px + strip.height_px  # a dim mirror image is no stray light either
    outside = (rows < strip.top_px - clear_px) | (rows > mirror_px + clear_px)
    outside &= strip.visible
    if outside.any():
        stray = float(np.percentile(mean[outside], 99)) - strip.dark_level
        shares.append(stray / (level - strip.dark_level))
    if dark_mean is not None:
        inside = strip_mask(strip, len(mean))
        shares.append(float(np.percentile(dark_mean[inside], 99)) / level)
    return max(shares, default=float("nan"))


def _blur_px(mean: FloatArray, strip: Strip, columns: NDArray[np.intp]) -> float:
    """Return the blur of the strip's upper edge, NaN if it shows no edge.

    The edge's row differs from column to column, so that all columns together sample it finely.
    """
    rows = np.arange(len(mean))[:, None] + 0.5
    off_px = rows - strip.top_px[columns]
    lit = mean[:, columns] - strip.dark_level
    inside = (off_px > 0) & (off_px < strip.height_px[columns])
    share = lit / np.maximum(np.where(inside, lit, 0.0).max(axis=0), 1.0)
    near = (np.abs(off_px) < EDGE_REACH_PX) & (off_px < strip.height_px[columns] / 2)
    places = np.rint(off_px[near] / EDGE_STEP_PX).astype(np.intp)
    bins, counts = np.unique(places, return_counts=True)
    edge = np.bincount(places - bins[0], share[near])[bins - bins[0]] / counts
    rising = np.maximum.accumulate(edge)
    low, high = EDGE_LEVELS
    if not rising[0] < low < high < rising[-1]:
        return float("nan")
    first, last = np.interp(EDGE_LEVELS, rising, bins * EDGE_STEP_PX)
    return float(last - first) / EDGE_WIDTH_SIGMAS


def _widest_run(chosen: BoolArray) -> tuple[int, int]:
    """Return first and last column of the widest run of True, (0, -1) if there is none."""
    steps = np.diff(chosen.astype(np.int8), prepend=0, append=0)
    starts, stops = np.flatnonzero(steps > 0), np.flatnonzero(steps < 0)
    if not len(starts):
        return 0, -1
    widest = int(np.argmax(stops - starts))
    return int(starts[widest]), int(stops[widest]) - 1
