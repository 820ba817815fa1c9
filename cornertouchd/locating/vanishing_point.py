"""The paper's vanishing-point method (Wang et al. 2011, sections 6.1 and 6.1.2).

On the surface a camera is a 2x3 projection: s (u, 1) = P (x, y, 1).  Its null vector is the
projection centre C; the directing line of column u runs through C towards the vanishing point
H^-1 (u, 1), H being P's first two columns.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cornertouchd.geometry import wrap_angle
from cornertouchd.model import FloatArray

FREEDOM = 5
"""Degrees of freedom of P; every reference point gives one equation."""

DEGENERATE = 3e-3
"""Second-smallest singular value (normalised, per point) under which the points do not fix P."""


class DegeneratePointsError(Exception):
    """The reference points lie so that they do not determine the projection."""


@dataclass(frozen=True)
class Projection:
    """A camera as a 2x3 projection matrix; `towards_mm` is a place that it sees."""

    matrix: tuple[tuple[float, float, float], tuple[float, float, float]]
    towards_mm: tuple[float, float]

    @cached_property
    def _inverse(self) -> FloatArray:
        inverse: FloatArray = np.linalg.inv(np.array(self.matrix)[:, :2])
        return inverse

    @cached_property
    def position_mm(self) -> tuple[float, float]:
        """The projection centre C' = -H^-1 p3."""
        x, y = -self._inverse @ np.array(self.matrix)[:, 2]
        return float(x), float(y)

    def vanishing_points(self, columns_px: FloatArray) -> FloatArray:
        """Return the vanishing points H^-1 (u, 1), directions on the surface, (..., 2)."""
        h = self._inverse
        return np.stack([h[0, 0] * columns_px + h[0, 1], h[1, 0] * columns_px + h[1, 1]], axis=-1)

    def angles_rad(self, columns_px: FloatArray) -> FloatArray:
        """Return the angles of the directing lines, pointing into the view, without a jump."""
        centre = np.array(self.position_mm)
        view = np.array(self.towards_mm) - centre
        directions = self.vanishing_points(columns_px)
        directions = directions * np.where(directions @ view < 0, -1.0, 1.0)[..., None]
        middle = np.arctan2(view[1], view[0])
        angles = np.arctan2(directions[..., 1], directions[..., 0])
        turned: FloatArray = middle + wrap_angle(angles - middle)
        return turned

    def slopes_rad_px(self, columns_px: FloatArray) -> FloatArray:
        """Return how fast the angle changes with the column, radians per pixel."""
        h = self._inverse
        d = self.vanishing_points(columns_px)
        slopes: FloatArray = (d[..., 0] * h[1, 0] - d[..., 1] * h[0, 0]) / np.sum(d * d, axis=-1)
        return slopes


def solve_projection(points_mm: FloatArray, columns_px: FloatArray) -> Projection:
    """Return the projection that maps the points to the columns, by singular value decomposition.

    `points_mm` is (N, 2), `columns_px` (N,), N >= 5.  Coordinates are normalised first, else the
    products with u dominate.  Raises `DegeneratePointsError` when the points do not fix it: points
    and camera on one conic, as when all points lie on the two sides next to the camera.
    """
    if len(points_mm) < FREEDOM:
        raise DegeneratePointsError(
            f"{len(points_mm)} reference points are seen, {FREEDOM} are needed"
        )
    centre, spread = points_mm.mean(axis=0), points_mm.std()
    middle, extent = columns_px.mean(), columns_px.std()
    if spread == 0.0 or extent == 0.0:
        raise DegeneratePointsError("all reference points lie at one place: spread them out")
    x = np.column_stack([(points_mm - centre) / spread, np.ones(len(points_mm))])
    u = ((columns_px - middle) / extent)[:, None]
    _, singular, vectors = np.linalg.svd(np.hstack([x, -u * x]) / np.sqrt(len(x)))
    if singular[4] < DEGENERATE:
        raise DegeneratePointsError(
            "the reference points and the camera lie on one conic "
            f"(singular value {singular[4]:.1e} under {DEGENERATE:.0e}): add points in the interior"
        )
    from_normalised = np.array([[extent, middle], [0.0, 1.0]])
    to_normalised = np.array(
        [[1 / spread, 0, -centre[0] / spread], [0, 1 / spread, -centre[1] / spread], [0, 0, 1]]
    )
    p = from_normalised @ vectors[-1].reshape(2, 3) @ to_normalised
    p /= np.linalg.norm(p[1, :2])
    rows = tuple(tuple(float(v) for v in row) for row in p)
    return Projection(rows, (float(centre[0]), float(centre[1])))  # type: ignore[arg-type]
