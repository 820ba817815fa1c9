"""Candidates: the discs that could stand in the cells and cast some of their edges.

Three tangents fix a disc, and so do two when its size is guessed.  All of them are tried in every
cell, because any edge of the cell may belong to another contact, but for three that one finger is
known to touch; each set of edges that a disc touches at once is kept once, and the disc is fitted
to all of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np

from cornertouchd.fusion.candidates import (
    LARGEST_POSITION_SIGMA_MM,
    LEAST_WEIGHT,
    NEGLIGIBLE_COST,
)
from cornertouchd.fusion.costs import LARGEST_COST_OF_SIZE
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import GATE_SIGMAS
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.fusion.pool import (
    COST_OF_AN_EDGE,
    FINGER_RADII_MM,
    MOST_CANDIDATES,
    SIZE_SIGMA_MM,
)
from cornertouchd.fusion.seeds import GUESSED_RADII_MM, SMALLEST_DETERMINANT, SMALLEST_SINE
from cornertouchd.geometry import line_crossings
from cornertouchd.model import BoolArray, FloatArray
from oracle.cells import CellRows, rows_of_cells
from oracle.edge_rows import EdgeRows


@dataclass(frozen=True, slots=True)
class Candidates:
    """K discs (K, 3) as x, y, r, with the rows of their cells.

    `tangent` (K, 2 C) marks the rows that a disc touches and `z` (K, 2 C) holds the slack in
    sigmas; `position_sigma_mm` is (K,).  `own` (K,) is what a disc itself costs, and `prediction`
    (K,) the number of that which it continues, or -1.
    """

    discs: FloatArray
    rows: CellRows
    z: FloatArray
    tangent: BoolArray
    position_sigma_mm: FloatArray
    own: FloatArray
    prediction: IntArray

    def __len__(self) -> int:
        return len(self.discs)

    def take(self, index: IntArray | BoolArray) -> "Candidates":
        """Return the candidates at `index`."""
        return Candidates(
            discs=self.discs[index],
            rows=self.rows.take(index),
            z=self.z[index],
            tangent=self.tangent[index],
            position_sigma_mm=self.position_sigma_mm[index],
            own=self.own[index],
            prediction=self.prediction[index],
        )


def joined(parts: Sequence[Candidates]) -> Candidates:
    """Return the candidates of all parts, of which there is at least one, in order."""
    rows = [part.rows for part in parts]
    return Candidates(
        discs=np.concatenate([part.discs for part in parts]),
        rows=CellRows(
            edges=np.concatenate([part.edges for part in rows]),
            normals=np.concatenate([part.normals for part in rows]),
            offsets_mm=np.concatenate([part.offsets_mm for part in rows]),
            sigma_rad=np.concatenate([part.sigma_rad for part in rows]),
            valid=np.concatenate([part.valid for part in rows]),
            origins_mm=rows[0].origins_mm,
        ),
        z=np.concatenate([part.z for part in parts]),
        tangent=np.concatenate([part.tangent for part in parts]),
        position_sigma_mm=np.concatenate([part.position_sigma_mm for part in parts]),
        own=np.concatenate([part.own for part in parts]),
        prediction=np.concatenate([part.prediction for part in parts]),
    )


def find_candidates(rows: EdgeRows, cells: IntArray, limits: DiscLimits) -> Candidates:
    """Return the discs that lie in the cells (T, C) and touch at least two of their edges."""
    cell_rows = rows_of_cells(rows, cells)
    discs, cell, fixed_by = _discs_from_tangents(cell_rows, limits)
    discs, cell, tangent = _one_per_set_of_edges(discs, cell, fixed_by, cell_rows, limits)
    candidates = _fitted(discs, cell_rows.take(cell), tangent, limits)
    in_the_light = np.any(rows.in_view(candidates.discs[:, :2]) & ~candidates.rows.shown, axis=1)
    plausible = _plausible(candidates, limits) & ~in_the_light
    return _without_dominated(candidates.take(plausible), cell[plausible])


def _cost_of_size(radii_mm: FloatArray) -> FloatArray:
    smallest, largest = FINGER_RADII_MM
    excess = np.maximum(smallest - radii_mm, 0.0) + np.maximum(radii_mm - largest, 0.0)
    cost: FloatArray = np.minimum(0.5 * (excess / SIZE_SIGMA_MM) ** 2, LARGEST_COST_OF_SIZE)
    return cost


def dearer(candidates: Candidates, cost: float) -> Candidates:
    """Return the candidates with this added to what each of them costs."""
    return replace(candidates, own=candidates.own + cost)


@cache
def _triples(edge_count: int) -> IntArray:
    return np.array(list(combinations(range(edge_count), 3)), dtype=np.intp).reshape(-1, 3)


@cache
def _pairs_across_cameras(edge_count: int) -> IntArray:
    pairs = [(a, b) for a, b in combinations(range(edge_count), 2) if a // 2 != b // 2]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def _discs_from_tangents(
    cells: CellRows, limits: DiscLimits
) -> tuple[FloatArray, IntArray, IntArray]:
    """Return the discs (V, 3) that three tangents, or two and a guessed size, fix; their cells.

    And the three tangents, bits of a number, or 0.
    """
    by_three, cells_of_three, three = _discs_touching_three(cells)
    by_two, cells_of_two = zip(
        *(_discs_touching_two(cells, radius_mm) for radius_mm in GUESSED_RADII_MM), strict=True
    )
    discs = np.concatenate([by_three, *by_two])
    cell = np.concatenate([cells_of_three, *cells_of_two])
    fixed_by = np.concatenate([three, np.zeros(len(discs) - len(three), np.intp)])
    possible = (
        (discs[:, 2] > limits.smallest_radius_mm)
        & (discs[:, 2] < limits.largest_radius_mm)
        & limits.on_surface(discs[:, :2])
    )
    return discs[possible], cell[possible], fixed_by[possible]


def _discs_touching_three(cells: CellRows) -> tuple[FloatArray, IntArray, IntArray]:
    """Take the first tangent's row from the other two, solve those for x and y, then it for r."""
    triples = _triples(cells.valid.shape[1])
    cell, triple = np.nonzero(np.all(cells.valid[:, triples], axis=2))
    edge = triples[triple].T
    n, h = cells.normals[cell, edge], cells.offsets_mm[cell, edge]
    centres, determinants = line_crossings(n[1] - n[0], h[1] - h[0], n[2] - n[0], h[2] - h[0])
    radii = np.einsum("vi,vi->v", n[0], centres) - h[0]
    regular = np.abs(determinants) > SMALLEST_DETERMINANT
    bits = np.sum(1 << edge, axis=0)
    return np.column_stack([centres, radii])[regular], cell[regular], bits[regular]


def _discs_touching_two(cells: CellRows, radius_mm: float) -> tuple[FloatArray, IntArray]:
    pairs = _pairs_across_cameras(cells.valid.shape[1])
    cell, pair = np.nonzero(np.all(cells.valid[:, pairs], axis=2))
    edge = pairs[pair].T
    n, h = cells.normals[cell, edge], cells.offsets_mm[cell, edge] + radius_mm
    centres, sines = line_crossings(n[0], h[0], n[1], h[1])
    regular = np.abs(sines) > SMALLEST_SINE
    return np.insert(centres, 2, radius_mm, axis=1)[regular], cell[regular]


def _one_per_set_of_edges(
    discs: FloatArray, cell: IntArray, fixed_by: IntArray, cells: CellRows, limits: DiscLimits
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Keep the discs inside their cells, the first of those that touch the same edges.

    Discs that are fixed by edges which an earlier one of a finger's size touches are left out.
    """
    rows = cells.take(cell)
    slack, sigma = rows.slacks(discs, limits.shape_sigma_mm)
    inside = rows.contain(discs, slack, sigma)
    tangent = (np.abs(slack) < GATE_SIGMAS * sigma) & rows.valid
    touched = _as_bits(tangent)
    sets_of_cell: dict[int, dict[int, int]] = {}
    for disc in np.flatnonzero(inside):
        known = sets_of_cell.setdefault(int(cell[disc]), {})
        three, edges = int(fixed_by[disc]), int(touched[disc])
        fingers = [other for other in known if discs[known[other], 2] <= FINGER_RADII_MM[1]]
        if not (three and any(other & three == three for other in fingers)):
            known.setdefault(edges, int(disc))
    kept = np.array(
        [known[edges] for _, known in sorted(sets_of_cell.items()) for edges in sorted(known)],
        np.intp,
    )
    if len(kept) > MOST_CANDIDATES:
        best = np.argsort(-np.count_nonzero(tangent[kept], axis=1), kind="stable")
        kept = kept[np.sort(best[:MOST_CANDIDATES])]
    return discs[kept], cell[kept], tangent[kept]


def _as_bits(marks: BoolArray) -> IntArray:
    """Return each row of marks (N, M) as one number."""
    return marks @ (1 << np.arange(marks.shape[1], dtype=np.intp))


def _fitted(
    discs: FloatArray, rows: CellRows, tangent: BoolArray, limits: DiscLimits
) -> Candidates:
    """Fit each disc to the edges that it touches, twice: the fit may gain or lose an edge."""
    design = np.concatenate([rows.normals, np.full((*rows.valid.shape, 1), -1.0)], axis=2)
    position_sigma_mm = np.empty(len(discs))
    for _ in range(2):
        _, sigma = rows.slacks(discs, limits.shape_sigma_mm)
        weights = tangent / sigma**2
        weighted = np.swapaxes(design * weights[:, :, None], 1, 2)
        information = weighted @ design
        moments = (weighted @ rows.offsets_mm[:, :, None])[:, :, 0]
        information[:, 2, 2] += SIZE_SIGMA_MM**-2
        moments[:, 2] += SIZE_SIGMA_MM**-2 * np.clip(discs[:, 2], *FINGER_RADII_MM)
        information[:, (0, 1), (0, 1)] += LEAST_WEIGHT
        covariance = np.linalg.inv(information)
        discs = np.einsum("nij,nj->ni", covariance, moments)
        slack, sigma = rows.slacks(discs, limits.shape_sigma_mm)
        tangent = (np.abs(slack) < GATE_SIGMAS * sigma) & rows.valid
        position_sigma_mm = np.sqrt(np.max(covariance[:, (0, 1), (0, 1)], axis=1))
    return Candidates(
        discs=discs,
        rows=rows,
        z=slack / sigma,
        tangent=tangent,
        position_sigma_mm=position_sigma_mm,
        own=_cost_of_size(discs[:, 2]),
        prediction=np.full(len(discs), -1),
    )


def _plausible(candidates: Candidates, limits: DiscLimits) -> BoolArray:
    discs = candidates.discs
    slack, sigma = candidates.rows.slacks(discs, limits.shape_sigma_mm)
    plausible: BoolArray = (
        candidates.rows.contain(discs, slack, sigma)
        & (discs[:, 2] > limits.smallest_radius_mm)
        & (discs[:, 2] < limits.largest_radius_mm)
        & limits.on_surface(discs[:, :2])
        & (np.count_nonzero(candidates.tangent, axis=1) >= 2)
        & (candidates.position_sigma_mm < LARGEST_POSITION_SIGMA_MM)
    )
    return plausible


def edge_costs(candidates: Candidates) -> FloatArray:
    """Return what the edges cost with each candidate, (K, 2 C): z**2 / 2 where it touches them."""
    cost = np.minimum(0.5 * candidates.z**2, COST_OF_AN_EDGE)
    return np.where(candidates.tangent, cost, COST_OF_AN_EDGE)


def _without_dominated(candidates: Candidates, cell: IntArray) -> Candidates:
    """Drop a disc if another of its cell touches all its edges, and no edge of them much worse.

    The fit counts: of two fingers side by side each touches its edges exactly, while a large disc
    over both touches all edges, and some of them badly.
    """
    cost = edge_costs(candidates)
    order = np.lexsort((cost.sum(axis=1), cell))
    cost, cell, tangent = cost[order], cell[order], candidates.tangent[order]
    edges = _as_bits(tangent)
    same_cell = cell[:, None] == cell[None, :]
    touches_no_more = (edges[:, None] & edges[None, :]) == edges[:, None]
    fits_no_better = _excess_cost(cost, tangent) < NEGLIGIBLE_COST
    is_dearer = np.tri(len(order), k=-1, dtype=np.bool_)
    dominated = np.any(same_cell & touches_no_more & fits_no_better & is_dearer, axis=1)
    return candidates.take(order[~dominated])


def _excess_cost(cost: FloatArray, tangent: BoolArray) -> FloatArray:
    """Return what the edges that disc i touches would cost more with disc j instead, (K, K)."""
    excess = np.zeros((len(cost), len(cost)))
    for edge in range(cost.shape[1]):
        more = np.maximum(cost[None, :, edge] - cost[:, None, edge], 0.0)
        excess += np.where(tangent[:, None, edge], more, 0.0)
    return excess
