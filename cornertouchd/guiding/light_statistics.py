"""The empty strip over time: the statistics of Wang et al. 2011 (section 5, Fig. 3), dark LEDs, T1.

Columns are looked at as the paper does: the 3x3 mean along the strip line (eq. 3).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from cornertouchd.config import PaperVisionSettings
from cornertouchd.model import BoolArray, FloatArray, Picture
from cornertouchd.vision.paper_edges import PaperFinder, gradient
from cornertouchd.vision.strip import Strip

DIM_SHARE = 0.75
"""LEDs of one batch, their ripple and the frame's corners leave .85 of the neighbourhood's light
(p5; simulated and path-traced rigs); a dim LED .3 to .7, a dead one .16."""

NEIGHBOURHOOD = 1 / 6
"""Share of the picture's width whose median is the usual light: three times a dead LED nearby."""

NARROWEST_DIM_PX = 3
END_PX = 10
"""Where the view ends the strip falls off within five columns, which are blurred: no dim LED, and
an edge that stays single, which merging drops."""

FINGER_SHARE = 0.89
"""The gradient (eq. 4) at a finger's edge over the strip's brightness there: 95 of 100 edges of
path-traced fingers, 4 to 14 mm wide, show more."""

DIM_PLACES = 10.0
"""Percentile of the brightness along the strip at which a finger has still to be found."""

SMALLEST_ROOM = 1.2
"""Fingers over strip, so that T1 keeps a tenth away from either."""


@dataclass(frozen=True, slots=True)
class DimRun:
    """Columns first_px to last_px where the LEDs give `share` of their neighbours' light."""

    first_px: int
    last_px: int
    share: float


@dataclass(frozen=True, slots=True)
class LightStatistics:
    """Brightness of a camera's empty strip; arrays are (width_px,), NaN where no strip is seen.

    `minimum`, `maximum`, `mean` and `noise_sigma` (standard deviation from picture to picture) are
    of the 3x3 mean.  `strip_gradient` is the largest gradient that the empty strip ever showed,
    `finger_gradient` what nearly all fingers will show.
    """

    camera: str
    pictures: int
    minimum: FloatArray
    maximum: FloatArray
    mean: FloatArray
    noise_sigma: FloatArray
    strip_gradient: float
    finger_gradient: float
    dim_runs: tuple[DimRun, ...]

    @property
    def signal_to_noise(self) -> float:
        """Median of mean over noise along the strip; infinite without noise."""
        seen = np.isfinite(self.mean)
        noise = float(np.median(self.noise_sigma[seen]))
        return float(np.median(self.mean[seen])) / noise if noise else float("inf")

    @property
    def suggested_t1(self) -> float | None:
        """T1 in the middle (geometric) between strip and fingers, None if they are not apart."""
        if self.finger_gradient < SMALLEST_ROOM * self.strip_gradient:
            return None
        return float(np.sqrt(max(self.strip_gradient, 1.0) * self.finger_gradient))


def measure_light_statistics(
    camera_id: str, pictures: Sequence[Picture] | Picture, strip: Strip
) -> LightStatistics:
    """Return the statistics of pictures of the empty surface, (N, rows, width_px), N >= 1.

    The paper watched for ten minutes; noise shows after a dozen pictures, drift needs minutes.
    """
    finder = PaperFinder(strip, len(pictures[0]), PaperVisionSettings())
    values = np.array([finder.mean_values(picture) for picture in pictures])
    mean = values.mean(axis=0)
    inner = _inner_columns(np.isfinite(mean))
    slopes = np.array([gradient(value) for value in values])[:, inner]
    return LightStatistics(
        camera_id,
        len(values),
        values.min(axis=0),
        values.max(axis=0),
        mean,
        values.std(axis=0),
        strip_gradient=float(np.abs(slopes).max(initial=0.0)),
        finger_gradient=FINGER_SHARE * float(np.percentile(mean[inner], DIM_PLACES)),
        dim_runs=_dim_runs(mean, inner),
    )


def _inner_columns(seen: BoolArray) -> BoolArray:
    """Return the columns that keep away from both ends of the view."""
    inner = seen.copy()
    columns = np.flatnonzero(seen)
    inner[: columns[0] + END_PX] = False
    inner[columns[-1] - END_PX + 1 :] = False
    return inner


def _dim_runs(mean: FloatArray, inner: BoolArray) -> tuple[DimRun, ...]:
    """Return where the strip is far darker than its neighbourhood."""
    columns = np.flatnonzero(inner)
    size = max(3, int(len(mean) * NEIGHBOURHOOD) | 1)
    shares = mean[columns] / np.maximum(median_filter(mean[columns], size, mode="reflect"), 1.0)
    dim = np.flatnonzero(shares < DIM_SHARE)
    runs = np.split(dim, np.flatnonzero(np.diff(columns[dim]) > 1) + 1)
    return tuple(
        DimRun(int(columns[run[0]]), int(columns[run[-1]]), float(shares[run].min()))
        for run in runs
        if len(run) >= NARROWEST_DIM_PX
    )
