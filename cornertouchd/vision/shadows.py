"""Find shadows in a profile, their edges to a fraction of a column.

Gradient peaks are biased outwards on shadows narrower than four blur widths, so edges come from
the profile itself.  Wide shadows: crossings of the level half-way between bright and dark; a bright
gap splits them.  Narrow ones: two erf edges fitted to the brightness, which comes within 4 % of the
Cramer-Rao bound.
"""

from math import erf, exp, pi, sqrt

import numpy as np

from cornertouchd.compiling import compiled, inlined
from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Profile, Shadows
from cornertouchd.vision.sunlight import NARROWEST_PX, edge_of_lit_flank, end_of_slope, is_glint

NARROW_BLURS = 5.0
"""A shadow narrower than this many blur widths never gets fully dark: its edges overlap."""

SHALLOW_SHARE = 0.7
"""A narrow shadow is as deep as its width and the blur make it, .87 of that if its middle falls
between two columns.  What is less deep is a stretch of strip that has become dimmer, unless the sun
lights a finger up."""

FIT_STEPS = 3
"""Gauss-Newton steps of the erf pair; a fourth moves no edge by 0.001 px."""

LARGEST_STEP_PX = 0.7
"""A step is clipped to this: steeper ones come from neighbours inside the window."""

UNKNOWN_REACH_PX = 2.0
"""An edge this near to a column that tells nothing is not believed."""

FEWEST_COLUMNS = 3
"""A view of fewer columns has no inside."""

HIDING_PX = 6
"""So many columns in a row that tell nothing may hide a finger: its shadow is 7.5 px wide at the
far end of a frame of 350 x 400 mm, and shows beside fewer."""

SHARE_OF_A_COVER = 0.9
"""One shadow without ends over more of the strip than this: no hand, but a lens that is covered."""


def find_shadows(
    profile: Profile,
    settings: VisionSettings,
    *,
    sunlit: bool = False,
    hiding: BoolArray | None = None,
) -> Shadows:
    """Return the shadows of a profile from left to right.

    `sunlit`: sunlight is to be reckoned with, which lights fingers up.  A shadow that fades away
    reaches to where it is bright again, without a valid edge there.  `hiding` (width_px,) are
    columns where a shadow would be, if they were known.  If there is a shadow at all, runs of such
    columns that are not known are given too, without a valid edge and of depth 0: the camera cannot
    contradict a touch there.
    """
    return Shadows(
        *_find(
            profile.brightness,
            profile.known,
            profile.known[:0] if hiding is None else hiding,
            sunlit,
            settings.shadow_below,
            settings.smallest_shadow_px,
            settings.edge_level,
            sqrt(settings.edge_blur_px**2 + 1 / 12),  # a pixel's own width blurs too
            settings.dark_share,
        )
    )


@inlined
def _missing_light(brightness: FloatArray, start: int, stop: int) -> tuple[float, float]:
    """Return how much light a run and its neighbours miss, and the centroid of that, columns.

    A glint beside the run cannot push the centroid out of it.
    """
    moment = missing = 0.0
    for column in range(max(0, start - 2), min(len(brightness), stop + 2)):
        missing += 1.0 - brightness[column]
        moment += column * (1.0 - brightness[column])
    return missing, min(max(moment / missing, float(start)), float(stop - 1))


@inlined
def _level_crossings(
    brightness: FloatArray, start: int, stop: int, level: float, edges: FloatArray, count: int
) -> int:
    """Write where the brightness falls below the level and rises again, from pair `count` on.

    An edge beyond the profile is given as the profile's border.  Returns how many pairs there are
    then.
    """
    low, high = max(0, start - 1), min(len(brightness), stop + 1)
    if brightness[low] < level:
        edges[count, 0] = low
    for column in range(low, high - 1):
        here, there = brightness[column], brightness[column + 1]
        if here >= level > there:
            edges[count, 0] = column + (level - here) / (there - here) + 0.5
        elif there >= level > here:
            edges[count, 1] = column + (level - here) / (there - here) + 0.5
            count += 1
    if brightness[high - 1] < level:
        edges[count, 1] = high
        count += 1
    return count


@inlined
def _fit_step(
    brightness: FloatArray,
    window: tuple[int, int],
    edges: tuple[float, float],
    blur: float,
    dark: float,
) -> tuple[float, float]:
    """Return how far the edges of an erf pair are off, by one Gauss-Newton step."""
    height = (1.0 - dark) / (sqrt(2.0 * pi) * blur)
    aa = ab = bb = a_off = b_off = 0.0
    for column in range(*window):
        xa = (column - edges[0]) / (sqrt(2.0) * blur)
        xb = (column - edges[1]) / (sqrt(2.0) * blur)
        model = 1.0 - (1.0 - dark) / 2.0 * (erf(xa) - erf(xb))
        weight = 1.0 / max(model, 0.05)  # shot noise: variance grows with the light
        a, b = height * exp(-xa * xa), -height * exp(-xb * xb)
        aa += weight * a * a
        ab += weight * a * b
        bb += weight * b * b
        a_off += weight * a * (brightness[column] - model)
        b_off += weight * b * (brightness[column] - model)
    aa, bb = 1.0001 * aa, 1.0001 * bb
    determinant = aa * bb - ab * ab
    if determinant <= 0.0:
        return 0.0, 0.0
    return (bb * a_off - ab * b_off) / determinant, (aa * b_off - ab * a_off) / determinant


@inlined
def _erf_pair(
    brightness: FloatArray, centre: float, width_px: float, blur: float, dark: float
) -> tuple[float, float]:
    """Fit two erf edges by Gauss-Newton, starting from centroid and missing light."""
    count = len(brightness)
    left, right = centre - width_px / 2.0, centre + width_px / 2.0
    reach = 3.0 * blur + 1.0
    window = max(0, int(left - reach)), min(count, int(right + reach) + 2)
    for _ in range(FIT_STEPS):
        step_left, step_right = _fit_step(brightness, window, (left, right), blur, dark)
        left += min(max(step_left, -LARGEST_STEP_PX), LARGEST_STEP_PX)
        right += min(max(step_right, -LARGEST_STEP_PX), LARGEST_STEP_PX)
    left = min(max(left + 0.5, 0.0), float(count))
    right = min(max(right + 0.5, 0.0), float(count))
    return min(left, right), max(left, right)


@inlined
def _edge_is_seen(known: BoolArray, edge: float) -> bool:
    """Tell whether an edge lies inside the view and away from columns that tell nothing."""
    if not UNKNOWN_REACH_PX <= edge < len(known) - UNKNOWN_REACH_PX:
        return False
    for column in range(int(edge - UNKNOWN_REACH_PX), int(edge + UNKNOWN_REACH_PX) + 1):
        if not known[column]:
            return False
    return True


@inlined
def _is_shallow(
    brightness: FloatArray, start: int, stop: int, missing_px: float, blur: float, dark: float
) -> bool:
    """Tell whether a run is far too shallow for a narrow shadow that takes as much light."""
    darkest = brightness[start]
    for column in range(start, stop):
        darkest = min(darkest, brightness[column])
    expected = (1.0 - dark) * erf(missing_px / (2.0 * sqrt(2.0) * blur))
    return bool(1.0 - darkest < SHALLOW_SHARE * expected)


@inlined
def _depth(brightness: FloatArray, left: float, right: float) -> float:
    """Return the share of light missing at the darkest place of a shadow."""
    last = len(brightness) - 1
    start = min(int(left), last)
    darkest = brightness[start]
    for column in range(start, min(int(right), last) + 1):
        darkest = min(darkest, brightness[column])
    return float(min(max(1.0 - darkest, 0.0), 1.0))


@inlined
def _edges_of_run(
    brightness: FloatArray,
    run: tuple[int, int],
    sunlit: bool,
    smallest_px: float,
    level: float,
    blur: float,
    dark: float,
    edges: FloatArray,
    count: int,
) -> int:
    """Write (left, right) of the shadows in a run of dark columns to `edges` from `count` on.

    Returns how many there are then.
    """
    start, stop = run
    missing, centre = _missing_light(brightness, start, stop)
    missing_px = missing / (1.0 - dark)  # the width of a fully dark shadow that takes as much
    if missing_px < smallest_px:
        return count
    total = _level_crossings(brightness, start, stop, level, edges, count)
    inside = start >= 2 and stop <= len(brightness) - 2
    if total <= count + 1 and inside and missing_px < NARROW_BLURS * blur:
        if not sunlit and _is_shallow(brightness, start, stop, missing_px, blur, dark):
            return count
        left, right = _erf_pair(brightness, centre, missing_px, blur, dark)
        edges[count, 0], edges[count, 1] = left, right
        return count + 1
    if sunlit and total > count:
        left, right = edges[count, 0], edges[total - 1, 1]  # what parts them may be a glint
        if right - left > NARROWEST_PX:
            left = edge_of_lit_flank(brightness, left, 1, level)
            right = edge_of_lit_flank(brightness, right, -1, level)
        edges[count, 0], edges[count, 1] = left, right
        return count + 1
    return total


@inlined
def _edges_in_view(
    brightness: FloatArray,
    sunlit: bool,
    below: float,
    smallest_px: float,
    level: float,
    blur: float,
    dark: float,
    edges: FloatArray,
) -> int:
    """Write left and right of all shadows, counted from the first column; return how many."""
    count, start = 0, -1
    for column in range(len(brightness) + 1):
        if column < len(brightness) and brightness[column] < below:
            start = column if start < 0 else start
        elif start >= 0:
            run = start, column
            count = _edges_of_run(
                brightness, run, sunlit, smallest_px, level, blur, dark, edges, count
            )
            start = -1
    return count


@inlined
def _may_hide(edges: FloatArray, count: int, start: int, stop: int) -> bool:
    """Tell whether a shadow could lie in a run of columns without being one of `edges`."""
    if stop - start < HIDING_PX:
        return False
    for number in range(count):
        if edges[number, 1] > start and edges[number, 0] < stop:
            return False
    return True


@inlined
def _add_hiding_places(
    known: BoolArray, hiding: BoolArray, edges: FloatArray, depth: FloatArray, count: int
) -> int:
    """Add the runs of columns that may hide a shadow, with depth 0; return how many there are."""
    hidden = 0
    for column in range(len(known)):  # without branches, so that several go at once
        hidden += int(hiding[column] & (not known[column]))
    if hidden < HIDING_PX:
        return count
    total = count
    start = 0
    for column in range(len(known)):
        if known[column] or not hiding[column]:
            if _may_hide(edges, total, start, column):
                edges[total, 0], edges[total, 1], depth[total] = start, column, 0.0
                total += 1
            start = column + 1
    return total


@inlined
def _sort(edges: FloatArray, valid: BoolArray, depth: FloatArray, count: int) -> None:
    """Put shadows in order, from left to right."""
    for number in range(1, count):
        left, right, how_deep = edges[number, 0], edges[number, 1], depth[number]
        left_told, right_told = valid[number, 0], valid[number, 1]
        place = number
        while place > 0 and edges[place - 1, 0] > left:
            for side in range(2):
                edges[place, side] = edges[place - 1, side]
                valid[place, side] = valid[place - 1, side]
            depth[place] = depth[place - 1]
            place -= 1
        edges[place, 0], edges[place, 1], depth[place] = left, right, how_deep
        valid[place, 0], valid[place, 1] = left_told, right_told


@inlined
def _tell(
    brightness: FloatArray,
    known: BoolArray,
    sunlit: bool,
    edges: FloatArray,
    valid: BoolArray,
    depth: float,
) -> None:
    """Tell which edges (2,) of a shadow are valid; those of a slope in the sun move to its ends."""
    left, right = edges[0], edges[1]
    told = depth > 0.0 and not (sunlit and is_glint(right - left, depth))
    valid[0] = told and _edge_is_seen(known, left)
    valid[1] = told and _edge_is_seen(known, right)
    if sunlit and depth > 0.0:
        edges[0], edges[1] = end_of_slope(brightness, left, -1), end_of_slope(brightness, right, 1)
        valid[0] &= edges[0] == left
        valid[1] &= edges[1] == right


@compiled(
    "Tuple((f8[:,::1], b1[:,::1], f8[::1]))(f8[::1], b1[::1], b1[::1], b1, f8, f8, f8, f8, f8)"
)
def _find(
    all_brightness: FloatArray,
    all_known: BoolArray,
    all_hiding: BoolArray,
    sunlit: bool,
    below: float,
    smallest_px: float,
    level: float,
    blur: float,
    dark: float,
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Return edges (K, 2), which of them are valid (K, 2), depth (K,), from left to right.

    What is not known at either end is no part of the view.  Shadows may hide where it is `hiding`
    and not known; that may be empty.
    """
    first, stop = 0, len(all_known)
    while first < stop and not all_known[first]:
        first += 1
    while stop > first and not all_known[stop - 1]:
        stop -= 1
    brightness, known, hiding = (
        all_brightness[first:stop],
        all_known[first:stop],
        all_hiding[first:stop],
    )
    edges, depth = np.empty((stop - first + 1, 2)), np.empty(stop - first + 1)
    count = 0
    if stop - first >= FEWEST_COLUMNS:
        count = _edges_in_view(brightness, sunlit, below, smallest_px, level, blur, dark, edges)
    for number in range(count):
        depth[number] = _depth(brightness, edges[number, 0], edges[number, 1])
    if count and len(all_hiding):
        count = _add_hiding_places(known, hiding, edges, depth, count)
    valid = np.empty((count, 2), np.bool_)
    for number in range(count):
        _tell(brightness, known, sunlit, edges[number], valid[number], depth[number])
    _sort(edges, valid, depth, count)
    return edges[:count] + first, valid, depth[:count].copy()


def is_cover(shadows: Shadows, on_strip: BoolArray) -> bool:
    """Tell whether one shadow without valid edges takes nearly all columns of the strip."""
    if len(shadows) != 1 or shadows.valid.any():
        return False
    left_px, right_px = shadows.edges_px[0]
    strip_px = int(np.count_nonzero(on_strip))
    return bool(right_px - left_px > SHARE_OF_A_COVER * strip_px and shadows.depth[0] > 0.0)
