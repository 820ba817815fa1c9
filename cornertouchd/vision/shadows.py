"""Find shadows in a profile, their edges to a fraction of a column.

Gradient peaks are biased outwards on shadows narrower than four blur widths, so edges come from
the profile itself.  Wide shadows: crossings of the level half-way between bright and dark; a bright
gap splits them.  Narrow ones: two erf edges fitted to the brightness, which comes within 4 % of the
Cramer-Rao bound.
"""

from math import sqrt

import numpy as np
from scipy.special import erf

from cornertouchd.config import VisionSettings
from cornertouchd.model import BoolArray, FloatArray, Profile, Shadow, Shadows

NARROW_BLURS = 5.0
"""A shadow narrower than this many blur widths never gets fully dark: its edges overlap."""

FIT_STEPS = 3
"""Gauss-Newton steps of the erf pair; a fourth moves no edge by 0.001 px."""

LARGEST_STEP_PX = 0.7
"""A step is clipped to this: steeper ones come from neighbours inside the window."""

UNKNOWN_REACH_PX = 2.0
"""An edge this near to a column that tells nothing is not believed."""


def find_shadows(profile: Profile, settings: VisionSettings) -> Shadows:
    """Return the shadows of a profile from left to right."""
    columns = np.flatnonzero(profile.known)
    if len(columns) < 3:
        return Shadows.of(())
    first, last = int(columns[0]), int(columns[-1])
    brightness = profile.brightness[first : last + 1]
    shadows = []
    for start, stop in _runs(brightness < settings.shadow_below):
        missing = _missing_light_px(brightness, start, stop, settings.dark_share)
        if missing >= settings.smallest_shadow_px:
            shadows += _edges_of_run(brightness, start, stop, missing, settings)
    return Shadows.of(_shadow(profile, first, last, left, right) for left, right in shadows)


def _runs(below: BoolArray) -> list[tuple[int, int]]:
    """Return start and stop (exclusive) of every run of True."""
    steps = np.diff(below.astype(np.int8), prepend=0, append=0)
    return list(
        zip(np.flatnonzero(steps > 0).tolist(), np.flatnonzero(steps < 0).tolist(), strict=True)
    )


def _missing_light_px(brightness: FloatArray, start: int, stop: int, dark: float) -> float:
    """Return the width of a fully dark shadow that takes as much light, columns."""
    low, high = max(0, start - 2), min(len(brightness), stop + 2)
    return float(np.sum(1.0 - brightness[low:high]) / (1.0 - dark))


def _edges_of_run(
    brightness: FloatArray, start: int, stop: int, missing_px: float, settings: VisionSettings
) -> list[tuple[float, float]]:
    """Return (left, right) of the shadows in a run of dark columns.

    An edge beyond the profile is given as the profile's border.
    """
    edges = _level_crossings(brightness, start, stop, settings.edge_level)
    blur_px = sqrt(settings.edge_blur_px**2 + 1 / 12)  # a pixel's own width blurs too
    inside = start >= 2 and stop <= len(brightness) - 2
    if len(edges) <= 1 and inside and missing_px < NARROW_BLURS * blur_px:
        return [_erf_pair(brightness, (start, stop), missing_px, blur_px, settings.dark_share)]
    return edges


def _level_crossings(
    brightness: FloatArray, start: int, stop: int, level: float
) -> list[tuple[float, float]]:
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


def _erf_pair(
    brightness: FloatArray, run: tuple[int, int], width_px: float, blur_px: float, dark: float
) -> tuple[float, float]:
    """Fit two erf edges by Gauss-Newton, starting from centroid and missing light."""
    low, high = max(0, run[0] - 2), min(len(brightness), run[1] + 2)
    missing = 1.0 - brightness[low:high]
    # a glint beside the shadow would push the centroid out of it
    centre = np.clip(np.arange(low, high) @ missing / missing.sum(), run[0], run[1] - 1)
    edges = np.array([centre - width_px / 2, centre + width_px / 2])
    reach = 3 * blur_px + 1
    window = slice(max(0, int(edges[0] - reach)), min(len(brightness), int(edges[1] + reach) + 2))
    columns, seen = np.arange(window.start, window.stop), brightness[window]
    slope = np.array([[1.0], [-1.0]]) * (1 - dark) / (sqrt(2 * np.pi) * blur_px)
    for _ in range(FIT_STEPS):
        x = (columns - edges[:, None]) / (sqrt(2) * blur_px)
        model = 1 - (1 - dark) / 2 * (erf(x[0]) - erf(x[1]))
        weights = 1 / np.maximum(model, 0.05)  # shot noise: variance grows with the light
        jacobian = slope * np.exp(-x * x)
        normal = (jacobian * weights) @ jacobian.T
        normal[np.diag_indices(2)] *= 1.0001
        step = np.linalg.solve(normal, (jacobian * weights) @ (seen - model))
        edges += np.clip(step, -LARGEST_STEP_PX, LARGEST_STEP_PX)
    left, right = np.sort(np.clip(edges + 0.5, 0, len(brightness))).tolist()
    return left, right


def _shadow(profile: Profile, first: int, last: int, left: float, right: float) -> Shadow:
    """Make a shadow from edges counted from the first known column."""
    left_px, right_px = first + left, first + right
    inside = slice(min(int(left_px), last), max(int(right_px), int(left_px)) + 1)
    darkest = profile.brightness[inside].min()
    return Shadow(
        left_px,
        right_px,
        _edge_is_seen(profile, first, last, left_px),
        _edge_is_seen(profile, first, last, right_px),
        float(np.clip(1.0 - darkest, 0.0, 1.0)),
    )


def _edge_is_seen(profile: Profile, first: int, last: int, edge_px: float) -> bool:
    """Tell whether an edge lies inside the view and away from columns that tell nothing."""
    if not first + 1 < edge_px < last:
        return False
    near = slice(int(edge_px - UNKNOWN_REACH_PX), int(edge_px + UNKNOWN_REACH_PX) + 1)
    return bool(profile.known[near].all())
