"""Plane geometry on arrays; pure.  Millimetres and radians, angles from +x towards +y."""

import math

import numpy as np

from cornertouchd.model import FloatArray

# Directions computed in double precision differ by about 1e-16 when they are meant to be the same.
PARALLEL = 1e-12


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


def nearest_points_to_lines(origins_mm: FloatArray, angles_rad: FloatArray) -> FloatArray:
    """Return the points (P, 2) with the least summed squared distance to their lines.

    `origins_mm` is (N, 2): each of N cameras has a line in each of P sets of lines; `angles_rad`
    (N, P) is NaN where it has none.  NaN where fewer than two lines are known or all are parallel.
    Wang et al. 2011, eq. 8.
    """
    known = np.isfinite(angles_rad)
    n = np.where(known[..., None], normals(np.where(known, angles_rad, 0.0)), 0.0)
    offsets = np.sum(n * origins_mm[:, None, :], axis=-1)
    a = np.einsum("npi,npj->pij", n, n)
    solvable = a[:, 0, 0] * a[:, 1, 1] - a[:, 0, 1] ** 2 > PARALLEL
    a[~solvable] = np.eye(2)
    points = np.linalg.solve(a, np.einsum("npi,np->pi", n, offsets)[..., None])[..., 0]
    return np.where(solvable[:, None], points, np.nan)


def wrap_angle(angles_rad: FloatArray) -> FloatArray:
    """Return the same angles within -pi..pi."""
    return (angles_rad + np.pi) % (2.0 * np.pi) - np.pi


def angles_and_distances(
    points_mm: FloatArray, origins_mm: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the angle and the distance of each point as seen from each origin, (P, N) each.

    `points_mm` is (P, 2), `origins_mm` (N, 2); angles are within -pi..pi.
    """
    offsets = points_mm[:, None, :] - origins_mm[None, :, :]
    angles: FloatArray = np.arctan2(offsets[..., 1], offsets[..., 0])
    distances: FloatArray = np.hypot(offsets[..., 0], offsets[..., 1])
    return angles, distances


def half_angles_of_discs(radii_mm: FloatArray, distances_mm: FloatArray) -> FloatArray:
    """Return half the angle that each disc fills; pi for an eye inside the disc.

    The shapes of the radii and of the distances to the centres broadcast.
    """
    outside = distances_mm > radii_mm
    sines = np.divide(radii_mm, distances_mm, out=np.ones(outside.shape), where=outside)
    half_angles: FloatArray = np.where(outside, np.arcsin(sines), np.pi)
    return half_angles


def line_crossings(
    normals_a: FloatArray, offsets_a: FloatArray, normals_b: FloatArray, offsets_b: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where the lines n.p = h cross pairwise, (P, 2), and the determinants, (P,).

    `normals_a` and `normals_b` are (P, 2), the offsets (P,).  The determinant is the sine of the
    angle between the lines if the normals are of length 1; where it is 0, or nothing but rounding,
    the point is NaN.
    """
    determinants: FloatArray = normals_a[:, 0] * normals_b[:, 1] - normals_a[:, 1] * normals_b[:, 0]
    x = offsets_a * normals_b[:, 1] - offsets_b * normals_a[:, 1]
    y = normals_a[:, 0] * offsets_b - normals_b[:, 0] * offsets_a
    inverse = np.divide(
        1.0,
        determinants,
        out=np.full(determinants.shape, np.nan),
        where=np.abs(determinants) > PARALLEL,
    )
    return np.stack([x, y], axis=-1) * inverse[:, None], determinants


def is_in_view(
    x_mm: float, y_mm: float, eye_mm: tuple[float, float], view_rad: tuple[float, float]
) -> bool:
    """Tell whether a place lies between the first and the last angle that an eye sees."""
    first_rad, last_rad = view_rad
    if last_rad - first_rad >= 2.0 * math.pi:
        return True
    angle_rad = math.atan2(y_mm - eye_mm[1], x_mm - eye_mm[0])
    return (angle_rad - first_rad) % (2.0 * math.pi) <= last_rad - first_rad


def homography_between(points: FloatArray, images: FloatArray) -> FloatArray:
    """Return the projective map (3, 3) that takes four points (4, 2) to their images (4, 2).

    Raises `numpy.linalg.LinAlgError` if three of the points or of the images lie on a line.
    """
    rows = []
    for (x, y), (u, v) in zip(points.tolist(), images.tolist(), strict=True):
        rows.append([x, y, 1.0, 0.0, 0.0, 0.0, -u * x, -u * y])
        rows.append([0.0, 0.0, 0.0, x, y, 1.0, -v * x, -v * y])
    return np.append(np.linalg.solve(np.array(rows), images.ravel()), 1.0).reshape(3, 3)


def is_convex(corners: FloatArray) -> bool:
    """Tell whether the sides (N, 2) between corners, one after the other, turn one way only."""
    sides = np.roll(corners, -1, axis=0) - corners
    after = np.roll(sides, -1, axis=0)
    turns = sides[:, 0] * after[:, 1] - sides[:, 1] * after[:, 0]
    return bool(np.all(turns > 0.0) or np.all(turns < 0.0))
