"""Sections: what is too large or too long for a finger, as an ellipse between all its shadows.

A palm is no disc, so the crossing makes two to five of it.  But one shadow of each camera holds
them all, and the edges of those touch one ellipse: that of a palm to 0.4 mm.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin
from typing import Self

import numpy as np

from cornertouchd.model import BoolArray, DirectingLines, FloatArray

FEWEST_EDGES = 6
"""Five would touch some ellipse whatever they are."""

MOST_FOREIGN_EDGES = 2
"""Edges that something else may cast, before or behind."""

LARGEST_MISFIT_MM = 1.5
"""RMS distance of the edges from the ellipse: palms reach 0.1 to 0.4, and an ellipse twice as long
as wide 0.6, because its outline is taken to first order."""

PRIOR_SIGMAS = np.array([60.0, 60.0, 40.0, 15.0, 15.0])
"""How far x, y, the mean radius and the two terms of the ellipse may be from a small disc at the
contact, in sigmas of the edges (1 mm).  They only keep the fit regular."""

START_RADIUS_MM = 15.0


@dataclass(frozen=True, slots=True)
class Section:
    """An ellipse at (x, y) with half axes `long_mm` >= `short_mm`, the long one at `turned_rad`."""

    x_mm: float
    y_mm: float
    long_mm: float
    short_mm: float
    turned_rad: float

    @classmethod
    def from_terms(
        cls, x_mm: float, y_mm: float, radius_mm: float, a_mm: float, b_mm: float
    ) -> Self:
        """Return the ellipse with tangents r + a cos 2t + b sin 2t away from the centre."""
        eccentric_mm = hypot(a_mm, b_mm)
        return cls(
            x_mm,
            y_mm,
            radius_mm + eccentric_mm,
            radius_mm - eccentric_mm,
            atan2(b_mm, a_mm) / 2.0,
        )

    @property
    def mean_diameter_mm(self) -> float:
        """Return the mean of all its widths."""
        return self.long_mm + self.short_mm

    def distance_mm(self, x_mm: float, y_mm: float) -> float:
        """Return how far a point lies beyond the outline, towards the centre; negative within."""
        dx_mm, dy_mm = x_mm - self.x_mm, y_mm - self.y_mm
        away_mm = hypot(dx_mm, dy_mm)
        angle_rad = atan2(dy_mm, dx_mm) - self.turned_rad
        outline_mm = (
            self.long_mm
            * self.short_mm
            / hypot(self.short_mm * cos(angle_rad), self.long_mm * sin(angle_rad))
        )
        return away_mm - outline_mm


def find_section(
    x_mm: float, y_mm: float, directing_lines: Sequence[DirectingLines]
) -> Section | None:
    """Return the ellipse that touches the edges of the shadows around a place, None if none does.

    Where something else stands before or behind it, a shadow reaches beyond it: then edges are left
    out one by one, while enough remain.
    """
    rows, offsets_mm = _rows_around(x_mm, y_mm, directing_lines)
    kept = np.ones(len(rows), np.bool_)
    fewest = max(FEWEST_EDGES, len(rows) - MOST_FOREIGN_EDGES)
    while np.count_nonzero(kept) >= fewest:
        terms = _fitted(x_mm, y_mm, rows, offsets_mm, kept)
        slacks_mm = rows @ terms - offsets_mm
        if _rms(slacks_mm[kept]) <= LARGEST_MISFIT_MM:
            section = Section.from_terms(*terms.tolist())
            return section if section.short_mm > 0.0 else None
        without = _without_one(x_mm, y_mm, rows, offsets_mm, kept)
        if without is None:
            return None
        kept[without] = False
    return None


def _rows_around(
    x_mm: float, y_mm: float, directing_lines: Sequence[DirectingLines]
) -> tuple[FloatArray, FloatArray]:
    """Return the equations of the valid edges (E, 5) of the shadows around a place, (E,)."""
    edges = [
        (side, edge_rad, camera.x_mm, camera.y_mm)
        for camera in directing_lines
        for shadow in [shadow_at(x_mm, y_mm, camera)]
        if shadow is not None
        for side, edge_rad, valid in (
            (1.0, camera.first_rad[shadow], camera.first_valid[shadow]),
            (-1.0, camera.last_rad[shadow], camera.last_valid[shadow]),
        )
        if valid
    ]
    side, angle, camera_x, camera_y = np.array(edges).reshape(-1, 4).T
    nx, ny = -side * np.sin(angle), side * np.cos(angle)
    rows = np.column_stack([nx, ny, -np.ones(len(nx)), np.cos(2 * angle), np.sin(2 * angle)])
    return rows, nx * camera_x + ny * camera_y


def shadow_at(x_mm: float, y_mm: float, camera: DirectingLines) -> int | None:
    """Return the number of the shadow in which a camera sees a place, None if it sees light."""
    angle_rad = atan2(y_mm - camera.y_mm, x_mm - camera.x_mm)
    ends = zip(camera.first_rad.tolist(), camera.last_rad.tolist(), strict=True)
    for shadow, (first_rad, last_rad) in enumerate(ends):
        if (angle_rad - first_rad) % (2.0 * pi) <= last_rad - first_rad:
            return shadow
    return None


def _fitted(
    x_mm: float, y_mm: float, rows: FloatArray, offsets_mm: FloatArray, kept: BoolArray
) -> FloatArray:
    """Return the ellipses (..., 5) fitted to the kept (..., E) edges."""
    expected = np.array([x_mm, y_mm, START_RADIUS_MM, 0.0, 0.0])
    weighted = kept[..., None] * rows
    information = rows.T @ weighted + np.diag(PRIOR_SIGMAS**-2)
    moments = kept @ (rows * offsets_mm[:, None]) + PRIOR_SIGMAS**-2 * expected
    terms: FloatArray = np.linalg.solve(information, moments[..., None])[..., 0]
    return terms


def _without_one(
    x_mm: float, y_mm: float, rows: FloatArray, offsets_mm: FloatArray, kept: BoolArray
) -> int | None:
    """Return the edge without which the others fit best, of those that lie beyond their fit."""
    edges = np.flatnonzero(kept)
    others = np.repeat(kept[None], len(edges), axis=0)
    others[np.arange(len(edges)), edges] = False
    slacks_mm = _fitted(x_mm, y_mm, rows, offsets_mm, others) @ rows.T - offsets_mm
    misfits = np.where(others, slacks_mm**2, 0.0).sum(axis=1)
    misfits[slacks_mm[np.arange(len(edges)), edges] <= 0.0] = np.inf
    best = int(np.argmin(misfits))
    return int(edges[best]) if np.isfinite(misfits[best]) else None


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
