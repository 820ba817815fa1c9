"""The point nearest to lines, one point at a time, as the paper's eq. 8 has it."""

import numpy as np

from cornertouchd.geometry import normals
from cornertouchd.model import FloatArray


def nearest_point_to_lines(
    origins_mm: FloatArray, angles_rad: FloatArray, weights: FloatArray | None = None
) -> FloatArray:
    """Return the point (2,) with the least summed squared distance to the lines.

    `origins_mm` is (N, 2), `angles_rad` (N,), N >= 2; `weights` (N,) multiply the squares.
    Raises `numpy.linalg.LinAlgError` if all lines are parallel.  Wang et al. 2011, eq. 8.
    """
    n = normals(angles_rad)
    offsets = np.sum(n * origins_mm, axis=-1)
    w = np.ones(len(offsets)) if weights is None else weights
    a = np.einsum("n,ni,nj->ij", w, n, n)
    if np.linalg.cond(a) > 1e12:
        raise np.linalg.LinAlgError("all lines are parallel")
    point: FloatArray = np.linalg.solve(a, np.einsum("n,ni,n->i", w, n, offsets))
    return point
