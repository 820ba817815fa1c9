"""The waist of a shadow: what is left of the light where a finger and its mirror image meet.

It is kept in the columns around shadows, on the rows where the surface may be.
"""

from math import nan

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import borrowing
from cornertouchd.model import FloatArray, Picture
from cornertouchd.vision.strip import Strip
from cornertouchd.vision.strip_now import BLACK, CHANGED, FULL
from cornertouchd.vision.taps import Runs

WAIST_ABOVE_PX = 3
"""The waist lies on the surface line or below: the camera looks down at it.  Rows above it are kept
for the blur."""

WAIST_BESIDE_PX = 3

Columns = NDArray[np.int32]
Light = NDArray[np.float32]


def waist_rows(strip: Strip, count: int) -> tuple[Columns, Columns]:
    """Return the first and the last row at which light is looked at, (width_px,) each."""
    if strip.upside_down:
        first, last = np.floor(strip.top_px), np.floor(strip.surface_px) + WAIST_ABOVE_PX
    else:
        first, last = np.floor(strip.surface_px) - WAIST_ABOVE_PX, np.floor(strip.bottom_px)
    first = np.clip(first, 0, count - 1)
    return first.astype(np.int32), np.clip(last, first, count - 1).astype(np.int32)


def inverse_of_waist(lit: FloatArray, first: Columns, last: Columns, least: float) -> Light:
    """Return 1 over the light from `first` to `last` row, (rows, width_px), NaN where untold."""
    rows = first + np.arange(int(np.max(last - first)) + 1)[:, None]
    light = lit[np.minimum(rows, len(lit) - 1), np.arange(lit.shape[1])]
    inverse = np.full(light.shape, nan)
    np.divide(1.0, light, out=inverse, where=(light >= least) & (rows <= last))
    return inverse.astype(np.float32)


@borrowing
def keep_columns(edges_px: FloatArray, depth: FloatArray, widest_px: int, light_at: Columns) -> int:
    """Give numbers to the columns around shadows that may be fingers; return how many there are."""
    count = beyond = 0
    for number in range(len(depth)):
        left, right = edges_px[number, 0], edges_px[number, 1]
        if depth[number] > 0.0 and right - left <= widest_px:
            first = max(int(left) - WAIST_BESIDE_PX, beyond)
            beyond = max(min(int(right) + WAIST_BESIDE_PX + 1, len(light_at)), beyond)
            for column in range(first, beyond):
                light_at[column] = count
                count += 1
    return count


@borrowing
def write_light(
    picture: Picture,
    light_at: Columns,
    waist: Light,
    runs: Runs,
    strip: Light,
    exposure: np.float32,
    light: Light,
) -> None:
    """Write what is left of the light in the kept columns, (waist rows, kept columns).

    `runs` are those of the first rows of the waist; `strip` is (3, width_px).
    """
    for number in range(len(runs)):
        stop, end, top = runs[number, 0], runs[number, 1], runs[number, 2]
        while stop < end:
            start = stop
            while stop < end and light_at[stop] >= 0:
                stop += 1
            if stop > start:
                _write_light_of_run(
                    picture,
                    np.uint64(start),
                    np.uint64(stop - start),
                    np.uint64(top),
                    waist,
                    strip,
                    exposure,
                    np.uint64(light_at[start]),
                    light,
                )
            stop += 1


@borrowing
def _write_light_of_run(
    picture: Picture,
    start: np.uint64,
    count: np.uint64,
    top: np.uint64,
    waist: Light,
    strip: Light,
    exposure: np.float32,
    kept: np.uint64,
    light: Light,
) -> None:
    """Write what is left of the light in so many columns from `start` on, which are kept together.

    Their waists begin in row `top`.  Unsigned numbers are no indices that count from the end: to
    tell would keep a processor from taking several pixels at once.
    """
    for step in range(np.uint64(len(light))):
        row = top + step
        if row >= np.uint64(len(picture)):
            for beside in range(count):
                light[step, kept + beside] = np.float32(nan)
            continue
        for beside in range(count):  # without branches, so that several go at once
            column = start + beside
            grey = np.float32(picture[row, column])
            now = strip[CHANGED, column] * exposure
            share = (grey - strip[BLACK, column]) * now * waist[step, column]
            told = grey < strip[FULL, column]
            light[step, kept + beside] = share if told else np.float32(nan)
