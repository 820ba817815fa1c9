"""Trace the shadows' edges up and down the strip and its mirror image, and look at their waists.

A finger and its mirror image make an hourglass.  Its outline tells how the finger leans and where
it touches, the light at its waist whether it does.  Only pixels around the edges and beneath the
shadows are looked at.
"""

from math import ceil, isnan, nan

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import compiled, inlined
from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Outlines, Picture, Shadows
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import Strip

LEVELS = (0.88, 0.76, 0.64, 0.52, 0.40, 0.28, 0.17)
"""Where edges are looked for, in heights of the strip above and below the surface line: between the
rim of the diffuser and the dark line."""

NEAR_PX, WINDOW_PX = 1, 3
"""From one level to the next nine of ten edges stray by less than a column from where they would go
on straight, 99 of 100 by less than 2.4 (path-traced pictures)."""

BRIGHT, DARK = 0.8, 0.3
REACH_PX = 4
"""An edge has the strip on one side and a finger on the other, so near."""

MOST_MISSES = 2
"""An edge that is missed twice in a row has ended: another finger, the far camera, a ring."""

KEPT_SLOPE = 0.5
"""The slope of an edge is averaged over the last two or three levels."""

WAIST_ABOVE_PX = 3
"""The waist lies on the surface line or below: the camera looks down at it.  Rows above it are kept
for the blur."""

WAIST_BESIDE_PX = 3

BLACK, NOW, FULL = 0, 1, 2
"""What is known of the strip in a column now: grey level without LEDs, how its light has changed
since the calibration (divided by, NaN where it tells nothing), grey level at full scale."""

WIDEST_SHARE = 0.25
"""A shadow that fills more of the picture is a palm, an arm or a cloth; nobody asks whether it
hovers."""

Columns = NDArray[np.int32]
Light = NDArray[np.float32]


class OutlineTracer:
    """Traces the shadows in one camera's pictures; knows its strip and its empty picture.

    The strip's rows are worked out once.  Keeps nothing from one picture to the next.
    """

    def __init__(
        self, strip: Strip, empty: FloatArray, reference: Reference, settings: VisionSettings
    ) -> None:
        """Prepare for pictures of the size of `empty`, the mean of empty pictures (rows, W).

        `reference` is what `empty` shows at the horizon.
        """
        lit = np.where(strip.visible & reference.usable, empty - strip.dark_level, 0.0)
        self._settings = settings
        self._calibrated = reference.light
        self._rows_px = level_rows(strip)
        self._start = _level_at_horizon(self._rows_px, strip)
        self._places, self._levels = _sampling(self._rows_px, lit, settings.smallest_reference)
        first, last = _waist_rows(strip, len(empty))
        self._waist_first = first
        self._waist = _inverse_of_waist(lit, first, last, settings.smallest_reference)
        self._waist_rows = self._waist.shape[1] if strip.mirrored else 0
        self._widest_px = ceil(WIDEST_SHARE * empty.shape[1])

    def trace(
        self, picture: Picture, shadows: Shadows, reference: Reference, gain: float
    ) -> Outlines:
        """Return the outlines of the shadows of a picture (rows, width_px).

        `reference` is the strip as it is now, `gain` how much brighter the picture is than that.
        On a matt screen there is no mirror image, and no light is kept.
        """
        columns, rows, light, light_at = _trace(
            np.ascontiguousarray(picture),
            shadows.edges_px,
            shadows.valid,
            shadows.depth,
            reference.black,
            reference.scale,
            reference.usable,
            reference.clipped,
            self._calibrated,
            1.0 / gain,
            self._settings.saturated_grey,
            self._settings.edge_level,
            self._rows_px,
            self._places,
            self._levels,
            self._start,
            self._waist,
            self._waist_first,
            self._waist_rows,
            self._widest_px,
        )
        return Outlines(columns, rows, light.T, light_at, self._waist_first)


def level_rows(strip: Strip) -> FloatArray:
    """Return the rows of the levels from the top down, (levels, width_px)."""
    direct = np.array(LEVELS)[:, None]
    if not strip.mirrored:
        return np.ascontiguousarray(strip.surface_px - direct * strip.height_px)
    height = (strip.bottom_px - strip.top_px) / 2.0
    levels = np.concatenate([direct, -direct[::-1]])
    return np.ascontiguousarray(strip.surface_px - levels * height)


def _level_at_horizon(rows_px: FloatArray, strip: Strip) -> int:
    """Return the level nearest to where the profile is taken."""
    off = np.abs(rows_px - strip.horizon_px)[:, strip.visible]
    return int(np.argmin(off.mean(axis=1)))


def _sampling(rows_px: FloatArray, lit: FloatArray, least: float) -> tuple[Columns, Light]:
    """Return how to sample the levels, column after column: edges run down few of them.

    There is the place of the pixel above the level (width_px, levels), in the pixels row after row;
    the share of the one below it, and 1 over the light of both (width_px, levels, 2), NaN where the
    level tells nothing.
    """
    row = rows_px - 0.5
    inside = (row >= 0.0) & (row < len(lit) - 1)
    first = np.where(inside, np.floor(row), 0.0).astype(np.int32)
    share = np.where(inside, row - first, 0.0)
    width = lit.shape[1]
    columns = np.arange(width, dtype=np.int32)
    light = lit[first, columns]
    light = light + share * (lit[first + 1, columns] - light)
    levels = np.full(light.shape, nan)
    np.divide(1.0, light, out=levels, where=inside & (light >= least))
    places = (first * width + columns).astype(np.int32)
    sampling = np.stack([share.T, levels.T], axis=2)
    return np.ascontiguousarray(places.T), np.ascontiguousarray(sampling, np.float32)


def _waist_rows(strip: Strip, count: int) -> tuple[Columns, Columns]:
    """Return the first and the last row at which light is looked at, (width_px,) each."""
    if strip.upside_down:
        first, last = np.floor(strip.top_px), np.floor(strip.surface_px) + WAIST_ABOVE_PX
    else:
        first, last = np.floor(strip.surface_px) - WAIST_ABOVE_PX, np.floor(strip.bottom_px)
    first = np.clip(first, 0, count - 1)
    return first.astype(np.int32), np.clip(last, first, count - 1).astype(np.int32)


def _inverse_of_waist(lit: FloatArray, first: Columns, last: Columns, least: float) -> Light:
    """Return 1 over the light from `first` to `last` row, (width_px, rows), NaN where untold."""
    rows = first[:, None] + np.arange(int(np.max(last - first)) + 1)
    light = lit[np.minimum(rows, len(lit) - 1), np.arange(lit.shape[1])[:, None]]
    inverse = np.full(light.shape, nan)
    np.divide(1.0, light, out=inverse, where=(light >= least) & (rows <= last[:, None]))
    return inverse.astype(np.float32)


@inlined
def _sample(
    pixels: Picture,
    first: int,
    count: int,
    level: int,
    places: Columns,
    levels: Light,
    strip: FloatArray,
    values: FloatArray,
) -> None:
    """Write what is left of the light on a level in `count` columns from `first` on, NaN untold."""
    width = len(strip)
    for column in range(first, first + count):
        left = nan
        if 0 <= column < width:
            place = places[column, level]
            share, inverse = levels[column, level, 0], levels[column, level, 1]
            here, there = float(pixels[place]), float(pixels[place + width])
            if max(here, there) < strip[column, FULL]:
                grey = here + share * (there - here)
                left = (grey - strip[column, BLACK]) * inverse * strip[column, NOW]
        values[column - first] = left


@inlined
def _meet(values: FloatArray, reach: int, inwards: int, level: float) -> float:
    """Return where light falls inwards through `level`, by number of value, -1 if it does not.

    The pair in the middle is looked at first, then those to either side, the left one before the
    right, up to `reach` away.  The first fall counts, if there is the strip outside of it and a
    finger inside.
    """
    middle = reach + REACH_PX
    for step in range(2 * reach + 1):
        away = (step + 1) >> 1
        left = middle - away if step & 1 else middle + away
        outside, inside = (left, left + 1) if inwards > 0 else (left + 1, left)
        if values[outside] >= level > values[inside]:
            bright = dark = False
            for beyond in range(REACH_PX):
                bright |= values[outside - beyond * inwards] > BRIGHT
                dark |= values[inside + beyond * inwards] < DARK
            if not (bright and dark):
                return -1.0
            return float(left + (level - values[left]) / (values[left + 1] - values[left]))
    return -1.0


@inlined
def _row_at(rows_px: FloatArray, level: int, column_px: float) -> float:
    """Return the row of a level at a column."""
    last = rows_px.shape[1] - 1
    place = min(max(column_px - 0.5, 0.0), float(last))
    below = min(int(place), last - 1)
    here, there = rows_px[level, below], rows_px[level, below + 1]
    return float(here + (place - below) * (there - here))


@inlined
def _follow_edge(
    pixels: Picture,
    edge_px: float,
    inwards: int,
    edge_level: float,
    rows_px: FloatArray,
    start: int,
    places: Columns,
    levels: Light,
    strip: FloatArray,
    values: FloatArray,
    columns: FloatArray,
    rows: FloatArray,
) -> None:
    """Write where an edge meets the levels, (L,) columns and rows, from the horizon outwards."""
    for direction in (-1, 1):
        level = start if direction < 0 else start + 1
        column, row, slope = edge_px, nan, 0.0
        misses = 0
        while 0 <= level < len(columns) and misses < MOST_MISSES:
            expected = column
            if slope != 0.0:
                expected += slope * (_row_at(rows_px, level, column) - row)
            for reach in (NEAR_PX, WINDOW_PX * (1 + misses)):
                first = int(expected - 0.5) - reach - REACH_PX
                _sample(
                    pixels,
                    first,
                    2 * (reach + REACH_PX) + 2,
                    level,
                    places,
                    levels,
                    strip,
                    values,
                )
                met = _meet(values, reach, inwards, edge_level)
                if met >= 0.0:
                    break
            if met >= 0.0:
                found = first + met + 0.5
                found_row = _row_at(rows_px, level, found)
                if not isnan(row):
                    latest = (found - column) / (found_row - row)
                    slope = KEPT_SLOPE * slope + (1.0 - KEPT_SLOPE) * latest
                columns[level], rows[level] = found, found_row
                column, row, misses = found, found_row, 0
            else:
                misses += 1
            level += direction


@inlined
def _keep_columns(
    edges_px: FloatArray, depth: FloatArray, width: int, widest_px: int, light_at: Columns
) -> int:
    """Give numbers to the columns around shadows that may be fingers; return how many there are."""
    for number in range(len(depth)):
        left, right = edges_px[number, 0], edges_px[number, 1]
        if depth[number] > 0.0 and right - left <= widest_px:
            first = max(int(left) - WAIST_BESIDE_PX, 0)
            for column in range(first, min(int(right) + WAIST_BESIDE_PX + 1, width)):
                light_at[column] = 0
    count = 0
    for column in range(width):
        if light_at[column] == 0:
            light_at[column] = count
            count += 1
    return count


@inlined
def _light_of_columns(
    picture: Picture,
    light_at: Columns,
    count: int,
    waist: Light,
    waist_first: Columns,
    waist_rows: int,
    strip: FloatArray,
) -> Light:
    """Return what is left of the light in the kept columns, (count, waist_rows)."""
    light = np.full((count, waist_rows), nan, np.float32)
    for column in range(len(light_at)):
        if light_at[column] >= 0:
            here = light[light_at[column]]
            first = waist_first[column]
            below, share, limit = strip[column]
            for step in range(min(waist_rows, picture.shape[0] - first)):
                grey = float(picture[first + step, column])
                left = (grey - below) * share * waist[column, step]
                here[step] = left if grey < limit else nan
    return light


@compiled(
    "Tuple((f8[:,:,::1], f8[:,:,::1], f4[:,::1], i4[::1]))("
    "Array(u1, 2, 'C', readonly=True), f8[:,::1], b1[:,::1], f8[::1], "
    "f8[::1], f8[::1], b1[::1], b1[::1], f8[::1], f8, f8, f8, "
    "f8[:,::1], i4[:,::1], f4[:,:,::1], i8, f4[:,::1], i4[::1], i8, i8)"
)
def _trace(
    picture: Picture,
    edges_px: FloatArray,
    valid: BoolArray,
    depth: FloatArray,
    black: FloatArray,
    scale: FloatArray,
    usable: BoolArray,
    clipped: BoolArray,
    calibrated: FloatArray,
    exposure: float,
    saturated_grey: float,
    edge_level: float,
    rows_px: FloatArray,
    places: Columns,
    levels: Light,
    start: int,
    waist: Light,
    waist_first: Columns,
    waist_rows: int,
    widest_px: int,
) -> tuple[FloatArray, FloatArray, Light, Columns]:
    """Return columns and rows of the edges (K, 2, L), the light (N, R) and where columns are in it.

    `exposure` is 1 over the gain.  A column that changed since the calibration did so in all rows.
    """
    count, width = len(depth), len(black)
    pixels = picture.ravel()
    columns = np.full((count, 2, len(rows_px)), nan)
    rows = np.full((count, 2, len(rows_px)), nan)
    light_at = np.full(width, -1, np.int32)
    if count == 0:
        return columns, rows, np.empty((0, waist_rows), np.float32), light_at
    strip = np.empty((width, 3))
    for column in range(width):
        strip[column, BLACK] = black[column]
        changed = calibrated[column] * scale[column] * exposure
        strip[column, NOW] = changed if usable[column] else nan
        strip[column, FULL] = np.inf if clipped[column] else saturated_grey
    values = np.empty(2 * (MOST_MISSES * WINDOW_PX + REACH_PX) + 2)
    for number in range(count):
        for side in range(2):
            if valid[number, side]:
                _follow_edge(
                    pixels,
                    edges_px[number, side],
                    1 - 2 * side,
                    edge_level,
                    rows_px,
                    start,
                    places,
                    levels,
                    strip,
                    values,
                    columns[number, side],
                    rows[number, side],
                )
    kept = 0
    if waist_rows > 0:
        kept = _keep_columns(edges_px, depth, width, widest_px, light_at)
    light = _light_of_columns(picture, light_at, kept, waist, waist_first, waist_rows, strip)
    return columns, rows, light, light_at
