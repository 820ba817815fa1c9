"""Seeds of candidates: discs that touch two or three edges of a cell at once.

Three tangents fix a disc, and so do two when its size is guessed.  All of them are tried in every
cell, because any edge of the cell may belong to another contact, but for three that one finger is
known to touch; each set of edges that a disc touches at once is kept once.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.cells import DiscBounds, best_of
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import GATE_SIGMAS, NO_SHADOW, SIGMA, EdgeRows, row_of_three
from cornertouchd.fusion.pool import FINGER_RADII_MM, MOST_CANDIDATES, is_possible
from cornertouchd.model import BoolArray, FloatArray

# Below these, three tangents (as a determinant) or two (as a sine) do not fix a disc.
SMALLEST_DETERMINANT = 0.01
SMALLEST_SINE = 0.05
# The middle of the radii of fingers; and that of slim ones, for two side by side: a camera in line
# with them sees both as one that is hardly wider, and its two edges would make each too large for
# the other to have room.
GUESSED_RADII_MM = (6.0, 4.5)
# Sets of edges of which the cap on candidates chooses; only broken strips have more.
MOST_SEEDS = 4096
# Ways to choose three, and twice two, of the 16 edges of eight cameras.
MOST_SEEDS_OF_A_CELL = 784


class Seeds(NamedTuple):
    """Discs (., 3) with their cells (.,) and the edges that they touch, bits of a number (.,)."""

    discs: FloatArray
    cells: IntArray
    edges: IntArray


@inlined
def find_seeds(rows: EdgeRows, cells: IntArray, bounds: DiscBounds) -> tuple[Seeds, int]:
    """Return a disc for each set of edges that is touched at once: by cell, then by set."""
    seeds = Seeds(
        np.empty((MOST_SEEDS, 3)), np.empty(MOST_SEEDS, np.intp), np.empty(MOST_SEEDS, np.intp)
    )
    edge_count = 2 * len(rows.eyes)
    edges, valid = np.empty((edge_count, 6)), np.empty(edge_count, np.bool_)
    met_in = np.full(1 << edge_count, -1, np.intp)
    count = 0
    for cell in range(len(cells)):
        if count + MOST_SEEDS_OF_A_CELL <= MOST_SEEDS:
            _gather_edges(rows, cells, cell, edges, valid)
            end = _seed_by_threes(edges, valid, cell, bounds, seeds, count, met_in)
            for radius in GUESSED_RADII_MM:
                end = _seed_by_twos(edges, valid, cell, bounds, radius, seeds, end, met_in)
            _sort_by_edges(seeds, count, end)
            count = end
    return seeds, _keep_most_touching(seeds, count)


@borrowing
def _gather_edges(
    rows: EdgeRows, cells: IntArray, cell: int, edges: FloatArray, valid: BoolArray
) -> None:
    """Write line, squared sigma and eye of the cell's edges; none where there is no shadow."""
    for row in range(len(edges)):
        camera, shadow = row // 2, cells[cell, row // 2]
        valid[row] = False
        edges[row, 0] = edges[row, 1] = edges[row, 3] = edges[row, 4] = edges[row, 5] = 0.0
        edges[row, 2] = -np.inf
        if shadow != NO_SHADOW:
            edge = 2 * shadow + row % 2
            valid[row] = rows.valid[edge]
            edges[row, 0], edges[row, 1], edges[row, 2] = row_of_three(rows.lines, edge)
            edges[row, 3] = rows.shadows[shadow, SIGMA] ** 2
            edges[row, 4], edges[row, 5] = rows.eyes[camera, 0], rows.eyes[camera, 1]


@borrowing
def _seed_by_threes(
    edges: FloatArray,
    valid: BoolArray,
    cell: int,
    bounds: DiscBounds,
    seeds: Seeds,
    count: int,
    met_in: IntArray,
) -> int:
    """Add the discs that touch three edges; return how many seeds there are then."""
    discs, touched = seeds.discs, seeds.edges
    first_count = count
    for i in range(len(edges)):
        for j in range(i + 1, len(edges)):
            if not (valid[i] and valid[j]):
                continue
            # the first tangent's row is taken from the others, which leaves x and y
            ax, ay = edges[j, 0] - edges[i, 0], edges[j, 1] - edges[i, 1]
            ah = edges[j, 2] - edges[i, 2]
            for k in range(j + 1, len(edges)):
                bx, by = edges[k, 0] - edges[i, 0], edges[k, 1] - edges[i, 1]
                bh = edges[k, 2] - edges[i, 2]
                determinant = ax * by - ay * bx
                x = (ah * by - bh * ay) / determinant
                y = (ax * bh - bx * ah) / determinant
                radius = edges[i, 0] * x + edges[i, 1] * y - edges[i, 2]
                regular = valid[k] & (abs(determinant) > SMALLEST_DETERMINANT)
                three = (1 << i) | (1 << j) | (1 << k)
                if (regular & is_possible(bounds, x, y, radius)) and not _are_of_one_finger(
                    seeds, first_count, count, three
                ):
                    count = _add_seed(
                        edges,
                        valid,
                        cell,
                        bounds.shape_variance_mm2,
                        x,
                        y,
                        radius,
                        discs,
                        touched,
                        count,
                        met_in,
                    )
    seeds.cells[first_count:count] = cell
    return count


@borrowing
def _are_of_one_finger(seeds: Seeds, first: int, end: int, edges: int) -> bool:
    """Tell whether a known disc touches these; one larger than a finger may be several."""
    discs, touched, known = seeds.discs, seeds.edges, False
    for number in range(first, end):
        known |= (touched[number] & edges == edges) & (discs[number, 2] <= FINGER_RADII_MM[1])
    return known


@borrowing
def _seed_by_twos(
    edges: FloatArray,
    valid: BoolArray,
    cell: int,
    bounds: DiscBounds,
    radius: float,
    seeds: Seeds,
    count: int,
    met_in: IntArray,
) -> int:
    """Add the discs of a guessed size that touch two edges; return how many seeds there are."""
    discs, touched = seeds.discs, seeds.edges
    first_count = count
    for i in range(len(edges)):
        for j in range(i + 2 - i % 2, len(edges)):
            sine = edges[i, 0] * edges[j, 1] - edges[i, 1] * edges[j, 0]
            ah, bh = edges[i, 2] + radius, edges[j, 2] + radius
            x = (ah * edges[j, 1] - bh * edges[i, 1]) / sine
            y = (edges[i, 0] * bh - edges[j, 0] * ah) / sine
            regular = valid[i] & valid[j] & (abs(sine) > SMALLEST_SINE)
            if regular & is_possible(bounds, x, y, radius):
                count = _add_seed(
                    edges,
                    valid,
                    cell,
                    bounds.shape_variance_mm2,
                    x,
                    y,
                    radius,
                    discs,
                    touched,
                    count,
                    met_in,
                )
    seeds.cells[first_count:count] = cell
    return count


@borrowing
def _add_seed(
    edges: FloatArray,
    valid: BoolArray,
    cell: int,
    shape_variance_mm2: float,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    discs: FloatArray,
    touched: IntArray,
    count: int,
    met_in: IntArray,
) -> int:
    """Keep a disc if it lies in its cell and is the first that touches just these edges."""
    bits = 0
    for row in range(len(edges)):
        slack = edges[row, 0] * x_mm + edges[row, 1] * y_mm - edges[row, 2] - radius_mm
        dx, dy = x_mm - edges[row, 4], y_mm - edges[row, 5]
        gate = GATE_SIGMAS**2 * (edges[row, 3] * (dx * dx + dy * dy) + shape_variance_mm2)
        bits |= int(valid[row] & (slack * slack < gate)) << row
        room = slack + (0.0 if valid[row] else 2.0 * radius_mm)
        if (room < 0.0) & (room * room > gate):
            return count
    if met_in[bits] == cell:
        return count
    met_in[bits] = cell
    discs[count, 0], discs[count, 1], discs[count, 2] = x_mm, y_mm, radius_mm
    touched[count] = bits
    return count + 1


@borrowing
def _sort_by_edges(seeds: Seeds, first: int, end: int) -> None:
    discs, edges = seeds.discs, seeds.edges
    for number in range(first + 1, end):
        moved, place = edges[number], number
        x, y, radius = row_of_three(discs, number)
        while place > first and edges[place - 1] > moved:
            edges[place] = edges[place - 1]
            for column in range(3):
                discs[place, column] = discs[place - 1, column]
            place -= 1
        edges[place] = moved
        discs[place, 0], discs[place, 1], discs[place, 2] = x, y, radius


@inlined
def _keep_most_touching(seeds: Seeds, count: int) -> int:
    """Keep as many as the cap allows, those that touch most edges; of equal ones the first."""
    if count <= MOST_CANDIDATES:
        return count
    touched = np.zeros(count, np.intp)
    for number in range(count):
        rest = seeds.edges[number]
        while rest:
            touched[number] += rest & 1
            rest >>= 1
    kept = best_of(touched, MOST_CANDIDATES)
    for place in range(len(kept)):
        seeds.cells[place] = seeds.cells[kept[place]]
        seeds.edges[place] = seeds.edges[kept[place]]
        for column in range(3):
            seeds.discs[place, column] = seeds.discs[kept[place], column]
    return len(kept)
