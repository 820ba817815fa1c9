"""Cells: the places where one shadow of every camera overlaps, the only places to touch.

A cell is one shadow per camera, or none of a camera that does not look there.  Cutting polygons out
of each other would find them too; asking where a smallest disc comes to rest finds the same ones in
one pass over all pairs of edges, because a cell that holds such a disc lets it fall until it lies
on two edges, on a side of the surface or on a line of view.
"""

from dataclasses import dataclass

import numpy as np

from cornertouchd.fusion.cells import (
    DOWN,
    FEWEST_SHADOWS,
    MOST_CELLS_TIMES_TRIPLES,
    SMALLEST_SINE,
)
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import GATE_SIGMAS, NO_SHADOW
from cornertouchd.fusion.limits import ROUNDING_MM, SURFACE_MARGIN_MM, DiscLimits
from cornertouchd.geometry import angles_and_distances, line_crossings, normals
from cornertouchd.model import BoolArray, FloatArray
from oracle.edge_rows import EdgeRows


@dataclass(frozen=True, slots=True)
class CellRows:
    """The 2 C edge rows of each of N cells (or of the cells of N discs), cameras in order.

    `edges` (N, 2 C) are the numbers of the edges; `origins_mm` (C, 2) the cameras' positions.  The
    rows of a camera that shows no shadow are void: not valid and 0, so that they bound nothing.
    """

    edges: IntArray
    normals: FloatArray
    offsets_mm: FloatArray
    sigma_rad: FloatArray
    valid: BoolArray
    origins_mm: FloatArray

    @property
    def shown(self) -> BoolArray:
        """Tell which cameras show a shadow, (N, C)."""
        shown: BoolArray = np.any(self.normals[:, ::2] != 0.0, axis=2)
        return shown

    def take(self, index: IntArray | BoolArray) -> "CellRows":
        """Return the rows of the cells at `index`."""
        return CellRows(
            edges=self.edges[index],
            normals=self.normals[index],
            offsets_mm=self.offsets_mm[index],
            sigma_rad=self.sigma_rad[index],
            valid=self.valid[index],
            origins_mm=self.origins_mm,
        )

    def slacks(self, discs: FloatArray, shape_sigma_mm: float) -> tuple[FloatArray, FloatArray]:
        """Return the slack and its sigma in each row, (N, 2 C), for one disc (x, y, r) a cell."""
        x, y, radius = discs[:, :1], discs[:, 1:2], discs[:, 2:]
        across = self.normals[:, :, 0] * x + self.normals[:, :, 1] * y
        slack: FloatArray = across - self.offsets_mm - radius
        squared_distances = (x - self.origins_mm[:, 0]) ** 2 + (y - self.origins_mm[:, 1]) ** 2
        variance = self.sigma_rad**2 * np.repeat(squared_distances, 2, axis=1) + shape_sigma_mm**2
        sigma: FloatArray = np.sqrt(variance)
        return slack, sigma

    def contain(self, discs: FloatArray, slack: FloatArray, sigma: FloatArray) -> BoolArray:
        """Tell which discs (N, 3) lie in their cell, (N,)."""
        inside: BoolArray = np.all(self.contained(discs, slack, sigma), axis=1)
        return inside

    def contained(self, discs: FloatArray, slack: FloatArray, sigma: FloatArray) -> BoolArray:
        """Tell in which shadows of their cell the discs (N, 3) lie, (N, C).

        An edge that is not valid bounds nothing, but a disc wholly beyond it would not darken the
        shadow at all and does not belong to it.
        """
        room = np.where(self.valid, slack, slack + 2.0 * discs[:, 2:])
        bounded = room >= -GATE_SIGMAS * sigma
        inside: BoolArray = bounded[:, ::2] & bounded[:, 1::2]
        return inside


def rows_of_cells(rows: EdgeRows, cells: IntArray) -> CellRows:
    """Return the rows of cells (N, C), which name one shadow of every camera, or `NO_SHADOW`."""
    count, cameras = cells.shape
    shown = np.repeat(cells != NO_SHADOW, 2, axis=1)
    cells = np.where(cells == NO_SHADOW, rows.first_shadow[:-1], cells)
    normals_of_cells = rows.normals[cells].reshape(count, 2 * cameras, 2)
    return CellRows(
        edges=(2 * cells[:, :, None] + np.arange(2)).reshape(count, 2 * cameras),
        normals=np.where(shown[:, :, None], normals_of_cells, 0.0),
        offsets_mm=np.where(shown, rows.offsets_mm[cells].reshape(count, 2 * cameras), 0.0),
        sigma_rad=np.where(shown, np.repeat(rows.sigma_rad[cells], 2, axis=1), 1.0),
        valid=shown & rows.valid[cells].reshape(count, 2 * cameras),
        origins_mm=rows.positions_mm,
    )


def find_cells(rows: EdgeRows, limits: DiscLimits) -> IntArray:
    """Return all cells that hold a disc of the smallest radius, as shadow numbers (T, C).

    Each has shadows of two cameras at least.  When a frame set has more than the cap allows, those
    in which most discs rest are kept.
    """
    centres = _resting_discs(rows, limits)
    centres = centres[limits.on_surface(centres)]
    angles, _ = angles_and_distances(centres, rows.positions_mm)
    shadows = shadows_at(rows, rows.unwrap(angles))
    discs = np.insert(centres, 2, limits.smallest_radius_mm, axis=1)
    cell_rows = rows_of_cells(rows, shadows)
    dark = cell_rows.contained(discs, *cell_rows.slacks(discs, limits.shape_sigma_mm))
    cells = np.where(dark, shadows, NO_SHADOW)
    possible = np.all(dark | ~rows.in_view(centres), axis=1)
    possible &= np.count_nonzero(dark, axis=1) >= FEWEST_SHADOWS
    return _most_touched(cells[possible], rows)


def _resting_discs(rows: EdgeRows, limits: DiscLimits) -> FloatArray:
    """Return the centres (P, 2) of the smallest discs that lie on two edges, sides or views.

    On edges of different cameras: those of one camera cross where it stands.  At an edge that is
    not valid lies its centre; on a line of view too, from outside.
    """
    views_rad, eyes = _lines_of_view(rows, limits)
    outward = normals(views_rad) * np.array([[-1.0], [1.0]])
    view_offsets = np.einsum("vei,vi->ve", outward, eyes).ravel()
    sides_and_views = -1 - np.arange(4 + len(view_offsets))
    camera = np.concatenate([np.repeat(rows.camera_of_shadow, 2), sides_and_views])
    a, b = np.nonzero(camera[:, None] < camera[None, :])
    width_mm, height_mm = limits.surface_mm
    sides = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    inward = np.concatenate([rows.normals.reshape(-1, 2), sides, outward.reshape(-1, 2)])
    radii = np.where(rows.valid.ravel(), limits.smallest_radius_mm, ROUNDING_MM)
    side_offsets = np.array([0.0, 0.0, -width_mm, -height_mm]) - SURFACE_MARGIN_MM
    offsets = np.concatenate([rows.offsets_mm.ravel() + radii, side_offsets, view_offsets])
    points, sines = line_crossings(inward[a], offsets[a], inward[b], offsets[b])
    slopes = DOWN[0] * inward[:, 1] - DOWN[1] * inward[:, 0]
    rests = (slopes[a] * sines <= 0.0) & (slopes[b] * sines >= 0.0)
    return points[rests & (np.abs(sines) > SMALLEST_SINE)]


def _lines_of_view(rows: EdgeRows, limits: DiscLimits) -> tuple[FloatArray, FloatArray]:
    """Return the views (V, 2) of cameras that do not see all of the surface, and their eyes."""
    far_x, far_y = np.asarray(limits.surface_mm) + SURFACE_MARGIN_MM
    near = -SURFACE_MARGIN_MM
    corners = np.array([(near, near), (far_x, near), (far_x, far_y), (near, far_y)])
    along = np.linspace(0.0, 1.0, 101)[:, None, None]
    border = along * corners + (1.0 - along) * np.roll(corners, 1, axis=0)
    partial = ~np.all(rows.in_view(border.reshape(-1, 2)), axis=0)
    return rows.views_rad[partial], rows.positions_mm[partial]


def shadows_at(rows: EdgeRows, angles_rad: FloatArray) -> IntArray:
    """Return for each camera the shadow that begins before the angle, (P, C); else its first."""
    shadows = np.empty(angles_rad.shape, dtype=np.intp)
    for camera, (start, end) in enumerate(
        zip(rows.first_shadow[:-1], rows.first_shadow[1:], strict=True)
    ):
        begun = np.searchsorted(rows.bounds_rad[start:end, 0], angles_rad[:, camera], side="right")
        shadows[:, camera] = start + np.maximum(begun - 1, 0)
    return shadows


def _most_touched(shadows: IntArray, rows: EdgeRows) -> IntArray:
    """Return the different rows of `shadows` in ascending order, at most as many as the cap."""
    sizes = np.diff(rows.first_shadow) + 1
    strides = np.cumprod(np.concatenate([sizes[1:], [1]])[::-1])[::-1]
    keys = np.maximum(shadows - rows.first_shadow[:-1] + 1, 0) @ strides
    _, representatives, touched = np.unique(keys, return_index=True, return_counts=True)
    edge_count = 2 * len(rows.cameras)
    triples = edge_count * (edge_count - 1) * (edge_count - 2) // 6
    cap = MOST_CELLS_TIMES_TRIPLES // max(triples, 1)
    kept = np.sort(np.argsort(-touched, kind="stable")[:cap])
    cells: IntArray = shadows[representatives[kept]]
    return cells
