"""Shadows of a profile in numpy, step by step.  Slow and readable."""

from math import sqrt

import numpy as np
from scipy.special import erf

from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Profile, Shadow, Shadows
from cornertouchd.vision.shadows import (
    FEWEST_COLUMNS,
    FIT_STEPS,
    HIDING_PX,
    LARGEST_STEP_PX,
    NARROW_BLURS,
    SHALLOW_SHARE,
    UNKNOWN_REACH_PX,
)
from cornertouchd.vision.sunlight import (
    FARTHEST_PX,
    GLINT_DEPTH,
    GLINT_WIDTH_PX,
    INSIDE_PX,
    LIT_FLANK,
    NARROWEST_PX,
    OUTSIDE,
    SLOPE_PX,
)

Edges = list[tuple[float, float]]


def find_shadows(
    profile: Profile,
    settings: VisionSettings,
    *,
    sunlit: bool = False,
    hiding: BoolArray | None = None,
) -> Shadows:
    """Return the shadows of a profile from left to right."""
    columns = np.flatnonzero(profile.known)
    if not len(columns) or columns[-1] - columns[0] < FEWEST_COLUMNS - 1:
        return Shadows.of(())
    first, last = int(columns[0]), int(columns[-1])
    view = Profile(profile.brightness[first : last + 1], profile.known[first : last + 1])
    edges: Edges = []
    for start, stop in runs(view.brightness < settings.shadow_below):
        edges += edges_of_run(view.brightness, start, stop, settings, sunlit)
    shadows = [_shadow(view, left, right, sunlit) for left, right in edges]
    if hiding is not None and shadows:
        shadows += _hiding_places(hiding[first : last + 1] & ~view.known, edges)
    return Shadows.of(_moved(one, first) for one in sorted(shadows, key=lambda one: one.left_px))


def runs(chosen: BoolArray) -> list[tuple[int, int]]:
    """Return start and stop (exclusive) of every run of True."""
    steps = np.diff(chosen.astype(np.int8), prepend=0, append=0)
    return list(
        zip(np.flatnonzero(steps > 0).tolist(), np.flatnonzero(steps < 0).tolist(), strict=True)
    )


def edges_of_run(
    brightness: FloatArray, start: int, stop: int, settings: VisionSettings, sunlit: bool
) -> Edges:
    """Return (left, right) of the shadows in a run of dark columns."""
    near = slice(max(0, start - 2), min(len(brightness), stop + 2))
    missing_px = float(np.sum(1.0 - brightness[near]) / (1.0 - settings.dark_share))
    if missing_px < settings.smallest_shadow_px:
        return []
    edges = level_crossings(brightness, start, stop, settings.edge_level)
    blur_px = sqrt(settings.edge_blur_px**2 + 1 / 12)
    inside = start >= 2 and stop <= len(brightness) - 2
    if len(edges) <= 1 and inside and missing_px < NARROW_BLURS * blur_px:
        expected = (1 - settings.dark_share) * erf(missing_px / (2 * sqrt(2) * blur_px))
        if not sunlit and 1 - brightness[start:stop].min() < SHALLOW_SHARE * expected:
            return []
        return [erf_pair(brightness, (start, stop), missing_px, blur_px, settings.dark_share)]
    if sunlit and edges:
        left, right = edges[0][0], edges[-1][1]
        if right - left > NARROWEST_PX:
            left, right = (
                lit_flank(brightness, left, 1, settings.edge_level),
                lit_flank(brightness, right, -1, settings.edge_level),
            )
        return [(left, right)]
    return edges


def level_crossings(brightness: FloatArray, start: int, stop: int, level: float) -> Edges:
    """Return where the brightness falls below the level and rises above it again."""
    low, high = max(0, start - 1), min(len(brightness), stop + 1)
    piece = brightness[low:high]
    dark = piece < level
    falls = np.flatnonzero(~dark[:-1] & dark[1:])
    rises = np.flatnonzero(dark[:-1] & ~dark[1:])
    lefts = (_crossings(piece, falls, level) + low + 0.5).tolist()
    rights = (_crossings(piece, rises, level) + low + 0.5).tolist()
    if dark[0]:
        lefts.insert(0, float(low))
    if dark[-1]:
        rights.append(float(high))
    return list(zip(lefts, rights, strict=True))


def _crossings(values: FloatArray, before: np.ndarray, level: float) -> FloatArray:
    a, b = values[before], values[before + 1]
    crossings: FloatArray = before + (level - a) / (b - a)
    return crossings


def erf_pair(
    brightness: FloatArray, run: tuple[int, int], width_px: float, blur_px: float, dark: float
) -> tuple[float, float]:
    """Fit two erf edges by Gauss-Newton, starting from centroid and missing light."""
    low, high = max(0, run[0] - 2), min(len(brightness), run[1] + 2)
    missing = 1.0 - brightness[low:high]
    centre = np.clip(np.arange(low, high) @ missing / missing.sum(), run[0], run[1] - 1)
    edges = np.array([centre - width_px / 2, centre + width_px / 2])
    reach = 3 * blur_px + 1
    window = slice(max(0, int(edges[0] - reach)), min(len(brightness), int(edges[1] + reach) + 2))
    columns, seen = np.arange(window.start, window.stop), brightness[window]
    slope = np.array([[1.0], [-1.0]]) * (1 - dark) / (sqrt(2 * np.pi) * blur_px)
    for _ in range(FIT_STEPS):
        x = (columns - edges[:, None]) / (sqrt(2) * blur_px)
        model = 1 - (1 - dark) / 2 * (erf(x[0]) - erf(x[1]))
        weights = 1 / np.maximum(model, 0.05)
        jacobian = slope * np.exp(-x * x)
        normal = (jacobian * weights) @ jacobian.T
        normal[np.diag_indices(2)] *= 1.0001
        step = np.linalg.solve(normal, (jacobian * weights) @ (seen - model))
        edges += np.clip(step, -LARGEST_STEP_PX, LARGEST_STEP_PX)
    left, right = np.sort(np.clip(edges + 0.5, 0, len(brightness))).tolist()
    return left, right


def lit_flank(brightness: FloatArray, edge: float, inwards: int, level: float) -> float:
    """Return an edge anew, half-way between the strip and the sunlit flank beside it."""
    start = _first_bright(brightness, edge, inwards, level)
    if start is None:
        return edge
    outer = _falls_through(brightness, start, inwards, OUTSIDE)
    if outer is None:
        return edge
    place = outer - 0.5 + inwards * INSIDE_PX
    if not 0 <= place < len(brightness) - 1:
        return edge
    flank = float(np.interp(place, np.arange(len(brightness)), brightness))
    if not LIT_FLANK[0] < flank < LIT_FLANK[1]:
        return edge
    anew = _falls_through(brightness, start, inwards, (1 + flank) / 2)
    return edge if anew is None else anew


def _first_bright(brightness: FloatArray, edge: float, inwards: int, level: float) -> int | None:
    """Return the nearest bright column outside an edge, None if another shadow is nearer."""
    risen = False
    for step in range(FARTHEST_PX + 1):
        column = int(edge) - inwards * step
        if not 0 < column < len(brightness) - 1:
            return None
        if brightness[column] >= OUTSIDE:
            return column
        if risen and brightness[column] < level:
            return None
        risen = bool(brightness[column] >= level)
    return None


def _falls_through(brightness: FloatArray, column: int, inwards: int, level: float) -> float | None:
    for here in range(column, column + inwards * FARTHEST_PX, inwards):
        there = here + inwards
        if not 0 <= there < len(brightness):
            return None
        if brightness[here] >= level > brightness[there]:
            fall = brightness[here] - brightness[there]
            return float(here + inwards * (brightness[here] - level) / fall + 0.5)
    return None


def _shadow(view: Profile, left: float, right: float, sunlit: bool) -> Shadow:
    last = len(view.brightness) - 1
    start = min(int(left), last)
    darkest = view.brightness[start : max(int(right), start) + 1].min()
    depth = float(np.clip(1.0 - darkest, 0.0, 1.0))
    glint = sunlit and right - left < GLINT_WIDTH_PX and depth < GLINT_DEPTH
    told = depth > 0.0 and not glint
    left_told = told and _is_seen(view.known, left)
    right_told = told and _is_seen(view.known, right)
    if sunlit and depth > 0.0:
        bright = np.flatnonzero(view.brightness >= OUTSIDE) + 0.5
        begin = max(bright[bright < left], default=-0.5)
        end = min(bright[bright >= right], default=last + 1.5)
        if SLOPE_PX[0] < left - begin <= SLOPE_PX[1]:
            left, left_told = begin, False
        if SLOPE_PX[0] < end - right <= SLOPE_PX[1]:
            right, right_told = end, False
    return Shadow(float(left), float(right), left_told, right_told, depth)


def _is_seen(known: BoolArray, edge: float) -> bool:
    if not UNKNOWN_REACH_PX <= edge < len(known) - UNKNOWN_REACH_PX:
        return False
    return bool(known[int(edge - UNKNOWN_REACH_PX) : int(edge + UNKNOWN_REACH_PX) + 1].all())


def _hiding_places(unclear: BoolArray, edges: Edges) -> list[Shadow]:
    return [
        Shadow(float(start), float(stop), False, False, 0.0)
        for start, stop in runs(unclear)
        if stop - start >= HIDING_PX
        and not any(right > start and left < stop for left, right in edges)
    ]


def _moved(shadow: Shadow, columns: int) -> Shadow:
    return Shadow(
        columns + shadow.left_px,
        columns + shadow.right_px,
        shadow.left_valid,
        shadow.right_valid,
        shadow.depth,
    )
