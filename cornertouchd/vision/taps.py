"""The pixels that tell how bright the strip is at the height of the camera, column by column.

A finger and its mirror image form an hourglass; a slanted finger is shifted from row to row.  Rays
in the rows of the horizon run at the height of the camera wherever the finger stands, so all
cameras cut it at the same height and their shadows agree; rows near the surface line would look
nearer to the touch, but at a different height for every distance.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.model import FloatArray, Picture
from cornertouchd.vision.strip import Strip

HORIZON_SAMPLES = 5
"""Rows sampled across the horizon band; more change no edge by 0.01 px (rendered pictures)."""

Runs = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class StripTaps:
    """Rows and their weights: column u is the sum of weights[k, u] x picture[first_rows[u] + k, u].

    `first_rows` (width_px,), `weights` (taps, width_px); the weights of a column sum to 1.
    """

    first_rows: NDArray[np.int64]
    weights: FloatArray

    def light(self, picture: Picture | FloatArray) -> FloatArray:
        """Return the weighted mean of each column, (width_px,)."""
        light: FloatArray = np.einsum("kw,kw->w", self._taken(picture), self.weights)
        return light

    def peak(self, picture: Picture | FloatArray) -> FloatArray:
        """Return the brightest pixel of each column that counts, (width_px,)."""
        peak: FloatArray = np.where(self.weights > 0.0, self._taken(picture), 0.0).max(axis=0)
        return peak

    def _taken(self, picture: Picture | FloatArray) -> FloatArray:
        taps, width = self.weights.shape
        rows = self.first_rows + np.arange(taps)[:, None]
        taken: FloatArray = picture[rows, np.arange(width)].astype(np.float64)
        return taken


def runs_of(rows: NDArray[np.integer]) -> Runs:
    """Return the runs of columns that have the same row, (N, 3): first column, end and row.

    Columns that begin in one row are worked on together: a processor takes several pixels of one
    row at once, but not of several rows.
    """
    starts = np.flatnonzero(np.diff(rows, prepend=-1))
    stops = np.append(starts[1:], len(rows))
    return np.ascontiguousarray(np.stack([starts, stops, rows[starts]], axis=1), dtype=np.int64)


def horizon_taps(strip: Strip, rows_px: int, band: float) -> StripTaps:
    """Return taps that average the rows within `band` strip heights of the horizon."""
    width = len(strip.horizon_px)
    offsets = np.linspace(-band, band, HORIZON_SAMPLES)[:, None]
    rows = np.clip(strip.horizon_px + offsets * strip.height_px - 0.5, 0, rows_px - 1.001)
    whole = np.floor(rows).astype(np.int64)
    first = whole.min(axis=0)
    taps = int((whole.max(axis=0) - first).max()) + 2
    first = np.maximum(np.minimum(first, rows_px - taps), 0)
    weights = np.zeros((taps, width))
    columns = np.arange(width)
    for row, above in zip(rows, whole, strict=True):
        part = row - above
        np.add.at(weights, (above - first, columns), (1 - part) / HORIZON_SAMPLES)
        np.add.at(weights, (above - first + 1, columns), part / HORIZON_SAMPLES)
    return StripTaps(first, weights)
