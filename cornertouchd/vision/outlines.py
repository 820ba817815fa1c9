"""Trace the shadows' edges up and down the strip and its mirror image, and look at their waists.

A finger and its mirror image make an hourglass.  Its outline tells how the finger leans and where
it touches, the light at its waist whether it does.  Only pixels around the edges and beneath the
shadows are looked at.
"""

from math import ceil, isnan, nan

import numpy as np

from cornertouchd.compiling import borrowing, compiled
from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Outlines, Picture, Shadows
from cornertouchd.vision.darkness import MeanPicture, light_of_leds
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import Strip
from cornertouchd.vision.strip_now import BLACK, CHANGED, FULL, HEIGHT, SURFACE, StripNow
from cornertouchd.vision.taps import Runs, runs_of
from cornertouchd.vision.waist import (
    Columns,
    Light,
    inverse_of_waist,
    keep_columns,
    waist_rows,
    write_light,
)

LEVELS = (0.88, 0.76, 0.64, 0.52, 0.40, 0.28, 0.17)
"""Where edges are looked for, in heights of the strip above and below the surface line: between the
rim of the diffuser and the dark line."""

LEVELS_DOWN = np.array((*LEVELS, *(-level for level in reversed(LEVELS))))
"""From the top down; those below the surface line are met in the mirror image."""

WINDOW_PX = 3
"""From one level to the next nine of ten edges stray by less than a column from where they would go
on straight, 99 of 100 by less than 2.4 (path-traced pictures)."""

BRIGHT, DARK = 0.8, 0.3
REACH_PX = 4
"""An edge has the strip on one side and a finger on the other, so near."""

MOST_MISSES = 2
"""An edge that is missed twice in a row has ended: another finger, the far camera, a ring."""

KEPT_SLOPE = 0.5
"""The slope of an edge is averaged over the last two or three levels."""

FEW_EDGES = 12
"""With more edges in a picture every second level is looked at: levels share their errors, and what
six fingers gain by the others is not worth the time of so many."""

WIDEST_SHARE = 0.25
"""A shadow that fills more of the picture is a palm, an arm or a cloth; nobody asks whether it
hovers."""


class OutlineTracer:
    """Traces the shadows in one camera's pictures; knows its strip and its empty picture.

    The strip's rows are worked out once, and what follows from a reference when it changes.
    """

    def __init__(
        self, strip: Strip, empty: FloatArray, reference: Reference, settings: VisionSettings
    ) -> None:
        """Prepare for pictures of the size of `empty`, the mean of empty pictures (rows, W).

        `reference` is what `empty` shows at the horizon.
        """
        lit = np.where(strip.visible & reference.usable, empty - strip.dark_level, 0.0)
        self._settings = settings
        self._strip_now = StripNow(
            reference, strip.surface_px, level_height_px(strip), settings.saturated_grey
        )
        rows_px = level_rows(strip)
        self._start = _level_at_horizon(rows_px, strip)
        self._inverse = _inverse_of_levels(rows_px.T, lit, settings.smallest_reference)
        first, last = waist_rows(strip, len(empty))
        self._waist_first, self._waist_runs = first, runs_of(first)
        self._waist = inverse_of_waist(lit, first, last, settings.smallest_reference)
        if not strip.mirrored:
            self._waist = self._waist[:0]
        self._widest_px = ceil(WIDEST_SHARE * empty.shape[1])

    def trace(
        self,
        picture: Picture,
        shadows: Shadows,
        reference: Reference,
        gain: float,
        dark: MeanPicture | None = None,
    ) -> Outlines:
        """Return the outlines of the shadows of a picture (rows, width_px).

        `reference` is the strip as it is now, `gain` how much brighter the picture is than that;
        `dark` what pictures without LEDs show.  A matt screen mirrors nothing: no light is kept.
        """
        if dark is not None:
            full = self._settings.saturated_grey
            picture = light_of_leds(picture, dark, reference.black, full)
        by_column, in_rows = self._strip_now.of(reference)
        met, light, light_at = _trace(
            np.ascontiguousarray(picture),
            shadows.edges_px,
            shadows.valid,
            shadows.depth,
            by_column,
            in_rows,
            1.0 / gain,
            self._settings.edge_level,
            self._inverse,
            self._start,
            self._waist,
            self._waist_runs,
            self._widest_px,
        )
        return Outlines(met[0], met[1], light, light_at, self._waist_first)


def level_rows(strip: Strip) -> FloatArray:
    """Return the rows of the levels from the top down, (levels, width_px)."""
    levels = LEVELS_DOWN if strip.mirrored else LEVELS_DOWN[: len(LEVELS)]
    return np.ascontiguousarray(strip.surface_px - levels[:, None] * level_height_px(strip))


def level_height_px(strip: Strip) -> FloatArray:
    """Return the height of the strip that levels are shares of, (width_px,)."""
    return (strip.bottom_px - strip.top_px) / 2.0 if strip.mirrored else strip.height_px


def _level_at_horizon(rows_px: FloatArray, strip: Strip) -> int:
    """Return the level nearest to where the profile is taken."""
    off = np.abs(rows_px - strip.horizon_px)[:, strip.visible]
    return int(np.argmin(off.mean(axis=1)))


def _inverse_of_levels(rows_px: FloatArray, lit: FloatArray, least: float) -> Light:
    """Return 1 over the light on the levels, (width_px, levels), NaN where one tells nothing.

    Where it tells something, there is a row of pixels above it and one below.
    """
    row = rows_px - 0.5
    inside = (row >= 0.0) & (row < len(lit) - 1)
    first = np.where(inside, np.floor(row), 0.0).astype(np.int32)
    columns = np.arange(lit.shape[1])[:, None]
    light = lit[first, columns]
    light = light + (row - first) * (lit[first + 1, columns] - light)
    inverse = np.full(light.shape, nan)
    np.divide(1.0, light, out=inverse, where=inside & (light >= least))
    return inverse.astype(np.float32)


@borrowing
def _left_at(
    picture: Picture,
    column: int,
    level: int,
    inverse: Light,
    strip: FloatArray,
    exposure: float,
) -> float:
    """Return what is left of the light where a column meets a level, NaN where that is untold."""
    if not 0 <= column < len(inverse):
        return nan
    here_at, level_at = np.uint64(column), np.uint64(level)  # none counts from the end: no checks
    whole = inverse[here_at, level_at]
    if isnan(whole):
        return nan
    row = strip[here_at, SURFACE] - LEVELS_DOWN[level_at] * strip[here_at, HEIGHT] - 0.5
    whole_row = int(row)
    above = np.uint64(whole_row)
    here = float(picture[above, here_at])
    there = float(picture[above + np.uint64(1), here_at])
    if not max(here, there) < strip[here_at, FULL]:
        return nan
    grey = here + (row - whole_row) * (there - here)
    share = whole * (strip[here_at, CHANGED] * exposure)  # while the pixels are waited for
    return float((grey - strip[here_at, BLACK]) * share)


@borrowing
def _has_strip_outside_and_finger_inside(
    picture: Picture,
    outside: int,
    inwards: int,
    at_outside: float,
    at_inside: float,
    level: int,
    inverse: Light,
    strip: FloatArray,
    exposure: float,
) -> bool:
    """Tell whether light that falls inwards from a column on falls from the strip to a finger.

    What is left of it there and in the next column is known.
    """
    bright, dark = at_outside > BRIGHT, at_inside < DARK
    for beyond in range(1, REACH_PX):
        if bright:
            break
        column = outside - beyond * inwards
        bright = _left_at(picture, column, level, inverse, strip, exposure) > BRIGHT
    for beyond in range(1, REACH_PX if bright else 0):
        if dark:
            break
        column = outside + (beyond + 1) * inwards
        dark = _left_at(picture, column, level, inverse, strip, exposure) < DARK
    return bright and dark


@borrowing
def _meet(
    picture: Picture,
    middle: int,
    reach: int,
    inwards: int,
    edge_level: float,
    level: int,
    inverse: Light,
    strip: FloatArray,
    exposure: float,
) -> float:
    """Return at which column light falls inwards through the level of an edge, -1 if it does not.

    Columns `middle` and the next one are looked at first, then the pairs to either side, the left
    one before the right, up to `reach` away.  The first fall counts, if there is the strip outside
    of it and a finger inside.
    """
    first, last = middle, middle + 1
    at_first = _left_at(picture, first, level, inverse, strip, exposure)
    at_last = _left_at(picture, last, level, inverse, strip, exposure)
    left, here, there = first, at_first, at_last
    for step in range(2 * reach + 1):
        if step & 1:
            first -= 1
            left, there = first, at_first
            here = at_first = _left_at(picture, first, level, inverse, strip, exposure)
        elif step:
            left, here = last, at_last
            last += 1
            there = at_last = _left_at(picture, last, level, inverse, strip, exposure)
        outer, inner = (here, there) if inwards > 0 else (there, here)
        if outer >= edge_level > inner:
            outside = left if inwards > 0 else left + 1
            if not _has_strip_outside_and_finger_inside(
                picture, outside, inwards, outer, inner, level, inverse, strip, exposure
            ):
                break
            return float(left + 0.5 + (edge_level - here) / (there - here))
    return -1.0


@borrowing
def _strip_at(strip: FloatArray, column_px: float) -> tuple[float, float]:
    """Return the row of the surface line at a column, and the height of levels above it."""
    last = len(strip) - 1
    place = min(max(column_px - 0.5, 0.0), float(last))
    below = min(int(place), last - 1)
    share = place - below
    surface, height = strip[below, SURFACE], strip[below, HEIGHT]
    return (
        float(surface + share * (strip[below + 1, SURFACE] - surface)),
        float(height + share * (strip[below + 1, HEIGHT] - height)),
    )


@borrowing
def _follow_edge(
    picture: Picture,
    edge_px: float,
    inwards: int,
    edge_level: float,
    inverse: Light,
    start: int,
    stride: int,
    strip: FloatArray,
    exposure: float,
    columns: FloatArray,
    rows: FloatArray,
) -> None:
    """Write where an edge meets the levels, (L,) columns and rows, from the horizon outwards.

    Only every `stride`-th level is looked at.
    """
    for direction in (-stride, stride):
        level = start if direction < 0 else start + stride
        column, row, slope = edge_px, nan, 0.0
        surface = height = nan
        misses = 0
        while 0 <= level < len(columns) and misses < MOST_MISSES:
            expected = column
            if slope != 0.0:
                expected += slope * (surface - LEVELS_DOWN[level] * height - row)
            middle, reach = int(expected - 0.5), WINDOW_PX * (stride + misses)
            found = _meet(
                picture, middle, reach, inwards, edge_level, level, inverse, strip, exposure
            )
            if found >= 0.0:
                surface, height = _strip_at(strip, found)
                found_row = surface - LEVELS_DOWN[level] * height
                if not isnan(row):
                    latest = (found - column) / (found_row - row)
                    slope = KEPT_SLOPE * slope + (1.0 - KEPT_SLOPE) * latest
                columns[level], rows[level] = found, found_row
                column, row, misses = found, found_row, 0
            else:
                misses += 1
            level += direction


@compiled(
    "Tuple((f8[:,:,:,::1], f4[:,::1], i4[::1]))("
    "Array(u1, 2, 'C', readonly=True), f8[:,::1], b1[:,::1], f8[::1], "
    "f8[:,::1], f4[:,::1], f8, f8, f4[:,::1], i8, f4[:,::1], i8[:,::1], i8)"
)
def _trace(
    picture: Picture,
    edges_px: FloatArray,
    valid: BoolArray,
    depth: FloatArray,
    by_column: FloatArray,
    in_rows: Light,
    exposure: float,
    edge_level: float,
    inverse: Light,
    start: int,
    waist: Light,
    waist_runs: Runs,
    widest_px: int,
) -> tuple[FloatArray, Light, Columns]:
    """Return columns and rows of edges (2, K, 2, L), light (R, N) and where columns are in that.

    `by_column` and `in_rows` are those of `StripNow`; `exposure` is 1 over the gain.
    """
    count, width = len(depth), len(by_column)
    met = np.full((2, count, 2, inverse.shape[1]), nan)
    light_at = np.full(width, -1, np.int32)
    edges = 0
    for number in range(count):
        edges += int(valid[number, 0]) + int(valid[number, 1])
    stride = 1 if edges <= FEW_EDGES else 2
    for number in range(count):
        for side in range(2):
            if valid[number, side]:
                _follow_edge(
                    picture,
                    edges_px[number, side],
                    1 - 2 * side,
                    edge_level,
                    inverse,
                    start,
                    stride,
                    by_column,
                    exposure,
                    met[0, number, side],
                    met[1, number, side],
                )
    kept = 0
    if len(waist) > 0:
        kept = keep_columns(edges_px, depth, widest_px, light_at)
    light = np.empty((len(waist), kept), np.float32)
    if kept > 0:
        write_light(picture, light_at, waist, waist_runs, in_rows, np.float32(exposure), light)
    return met, light, light_at
