"""The crossing of Wang, Liu and Zhang 2011, section 6.2.2, for their 3D reconstruction.

Of one shadow from each camera, pairs of cameras reconstruct a point each: C1C2, C1C4, and C2C3 or
C4C3.  If all of these converge within Th1, the contact is their mean.

A pair reconstructs by crossing its two directing lines: on the surface that leaves no reprojection
error.  Which pair links C3 the paper leaves open; here the one that crosses at the larger angle.
Other numbers of cameras are linked alike, each to its neighbours.
"""

from itertools import combinations

import numpy as np

from cornertouchd.fusion.paper_crossing import Groups, Located
from cornertouchd.geometry import line_crossings
from cornertouchd.model import FloatArray

# 0.6 degrees, as the crossing by least squares asks of two lines.
SMALLEST_SINE = 1e-2


def reconstruct_in_pairs(groups: Groups) -> Located:
    """Return the mean of the points that pairs of cameras reconstruct.

    NaN where a pair looks along one line.  The misfit is the largest distance between two of the
    points.
    """
    cameras = len(groups.cameras)
    links = [(a, a + 1) for a in range(cameras - 1)]
    crossings = [_cross(groups, a, b) for a, b in links]
    if cameras > 2:
        # the ring is closed at the first camera and opened where two others cross worst
        crossings.append(_cross(groups, 0, cameras - 1))
    points = np.stack([points for points, _ in crossings])
    sines = np.stack([sines for _, sines in crossings])
    if cameras > 2:
        points, sines = _opened(points, sines)
    points = np.where(sines[..., None] < SMALLEST_SINE, np.nan, points)
    apart = [np.hypot(*(a - b).T) for a, b in combinations(points, 2)]
    misfit_mm = np.max(apart, axis=0) if apart else np.zeros(points.shape[1])
    # Where two lines of sigma 1 cross, the point has a sigma of sqrt(2) / sine of their angle.
    variances = np.sum(2.0 / np.maximum(sines, SMALLEST_SINE) ** 2, axis=0)
    return Located(points.mean(axis=0), misfit_mm, np.sqrt(variances) / len(points))


def _cross(groups: Groups, a: int, b: int) -> tuple[FloatArray, FloatArray]:
    """Return where the lines of two cameras cross, (G, 2), and the sines of their angles."""
    points, sines = line_crossings(
        groups.normals[a], groups.offsets_mm[a], groups.normals[b], groups.offsets_mm[b]
    )
    return points, np.abs(sines)


def _opened(points: FloatArray, sines: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out, in each group, the worst of the links that are not the first camera's.

    `points` is (L, G, 2), `sines` (L, G); the first camera's links come first and last.
    """
    worst = 1 + np.argmin(sines[1:-1], axis=0)
    kept = np.arange(len(sines) - 1)[:, None]
    kept = kept + (kept >= worst)
    return np.take_along_axis(points, kept[..., None], 0), np.take_along_axis(sines, kept, 0)
