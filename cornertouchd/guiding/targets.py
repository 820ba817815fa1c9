"""Where to tap: places all over a surface, far from each other."""

from math import isqrt

import numpy as np

from cornertouchd.calibration.calibration import Method
from cornertouchd.model import FloatArray

TAPS: dict[Method, int] = {
    "auto": 16,
    "lookup-table": 225,
    "vanishing-point": 25,
    "reconstruction": 4,
}
"""How many reference points each method takes: the paper has 225 for its table; more than 25 make
its projection no better, for lenses are not pinholes; two would tie boards to the surface."""

INSET_MM = 25.0
"""A fingertip fits between a target and the frame, and is still seen with both edges."""

FRAME_INSET_MM = 5.0
"""Where a finger pressed against the frame has its middle."""

CLEAR_MM, CLEAR_SHARE = 30.0, 0.02
"""Targets keep so far from the diagonals, or this share of the diagonal: there each of two cameras
has the other one behind the finger, and the farther it is, the fewer columns lie between them."""

NEAR_CORNER_MM = 100.0
"""So near to a camera a finger is seen by it at least, and by the two on the other diagonal."""

VALIDATION_SHARES = ((0.5, 0.42), (0.18, 0.28), (0.78, 0.31), (0.82, 0.72), (0.22, 0.69))
"""About the centre and the quarters, off the diagonals: between the places tapped to calibrate."""

VALIDATION_NAMES = ("centre", "upper left", "upper right", "lower right", "lower left")


def targets_for(
    method: Method, surface_mm: tuple[float, float], count: int | None = None
) -> FloatArray:
    """Return the places to tap for a method, (count, 2); as many as it usually takes if None.

    The lookup table needs them along the frame, the others a grid, whose `count` is a square.
    """
    count = TAPS[method] if count is None else count
    if method == "lookup-table":
        return frame_targets(surface_mm, count)
    side = isqrt(count)
    return calibration_targets(surface_mm, side, side)


def calibration_targets(
    surface_mm: tuple[float, float], columns: int = 4, rows: int = 4, inset_mm: float = INSET_MM
) -> FloatArray:
    """Return a grid of places to tap (columns x rows, 2), row by row, in millimetres.

    Those that lie on a diagonal are moved a little beside it; all are whole millimetres, as they
    are told to whoever taps.
    """
    x_mm = np.linspace(inset_mm, surface_mm[0] - inset_mm, columns)
    y_mm = np.linspace(inset_mm, surface_mm[1] - inset_mm, rows)
    grid = np.stack([np.tile(x_mm, rows), np.repeat(y_mm, columns)], axis=1)
    clear = [_clear_of_diagonals(place, np.array(surface_mm)) for place in grid]
    return np.rint(clear).reshape(-1, 2)


def frame_targets(surface_mm: tuple[float, float], count: int) -> FloatArray:
    """Return places at equal distances along the frame (count, 2), clockwise from the top-left.

    In tenths of a millimetre, as they are told.
    """
    width, height = (side - 2 * FRAME_INSET_MM for side in surface_mm)
    way = (np.arange(count) + 0.5) / count * 2 * (width + height)
    ends = np.cumsum([0.0, width, height, width, height])
    x = np.interp(way, ends, [0.0, width, width, 0.0, 0.0])
    y = np.interp(way, ends, [0.0, 0.0, height, height, 0.0])
    return np.round(np.stack([x, y], axis=1) + FRAME_INSET_MM, 1)


def validation_targets(surface_mm: tuple[float, float]) -> FloatArray:
    """Return the places (5, 2) to check a calibration at; named by `VALIDATION_NAMES`."""
    return np.rint(np.array(VALIDATION_SHARES) * surface_mm)


def clear_of_diagonals_mm(surface_mm: FloatArray | tuple[float, float]) -> float:
    """Return how far from the diagonals targets are."""
    return max(CLEAR_MM, CLEAR_SHARE * float(np.linalg.norm(surface_mm)))


def _clear_of_diagonals(place_mm: FloatArray, surface_mm: FloatArray) -> FloatArray:
    """Return the place, turned clockwise about the centre if it lies on a diagonal.

    One in the centre, on both, is moved along the shorter side.
    """
    clear_mm = clear_of_diagonals_mm(surface_mm)
    centre = surface_mm / 2
    from_centre = place_mm - centre
    if np.linalg.norm(from_centre) < clear_mm:
        away_mm = clear_mm * np.linalg.norm(surface_mm) / surface_mm.max()
        beside: FloatArray = centre + np.where(np.arange(2) == np.argmin(surface_mm), away_mm, 0.0)
        return beside
    to_corner = np.copysign(centre, from_centre)
    if np.linalg.norm(to_corner - from_centre) < NEAR_CORNER_MM:
        return place_mm
    clockwise = np.array([-to_corner[1], to_corner[0]]) / np.linalg.norm(to_corner)
    beside_mm = float(from_centre @ clockwise)
    if abs(beside_mm) >= clear_mm:
        return place_mm
    moved: FloatArray = place_mm + (clear_mm - beside_mm) * clockwise
    return moved
