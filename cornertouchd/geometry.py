"""Plane geometry on arrays; pure.  Millimetres and radians, angles from +x towards +y."""

import numpy as np

from cornertouchd.model import FloatArray


def unit_vectors(angles_rad: FloatArray) -> FloatArray:
    """Return the unit vectors (..., 2) that point along the angles (...)."""
    return np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=-1)


def normals(angles_rad: FloatArray) -> FloatArray:
    """Return the unit normals (..., 2): each direction turned by +90 degrees."""
    return np.stack([-np.sin(angles_rad), np.cos(angles_rad)], axis=-1)


def distances_to_lines(
    points_mm: FloatArray, origins_mm: FloatArray, angles_rad: FloatArray
) -> FloatArray:
    """Return the signed distance of each point to each line, (P, N).

    `points_mm` is (P, 2); `origins_mm` (N, 2) and `angles_rad` (N,) describe the lines.  Positive
    on the side to which the normal points.
    """
    n = normals(angles_rad)
    offsets: FloatArray = np.sum(n * origins_mm, axis=-1)
    return points_mm @ n.T - offsets


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


def wrap_angle(angles_rad: FloatArray) -> FloatArray:
    """Return the same angles within -pi..pi."""
    return (angles_rad + np.pi) % (2.0 * np.pi) - np.pi
