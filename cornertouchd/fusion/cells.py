"""Cells: the places where one shadow of every camera overlaps, the only places to touch.

A cell is one shadow per camera, or none of a camera that does not look there.  Cutting polygons out
of each other would find them too; asking where a smallest disc comes to rest finds the same ones in
one pass over all pairs of edges, because a cell that holds such a disc lets it fall until it lies
on two edges, on a side of the surface or on a line of view.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import (
    GATE_SIGMAS,
    KIND,
    NO_SHADOW,
    SEES_ALL,
    EdgeRows,
    is_in_view,
    row_of_three,
    shadow_at,
    slack_of,
    variance_of,
)
from cornertouchd.fusion.limits import ROUNDING_MM, SURFACE_MARGIN_MM
from cornertouchd.model import BoolArray, FloatArray

# Lines closer to parallel cross nowhere on a surface.
SMALLEST_SINE = 1e-6
# Where discs fall: any direction that no side of a frame has.
DOWN = (0.94, 0.34)
SIDES = 4
# A column of the table of floors.
SAVING = 4
# One shadow says only in which direction something is.
FEWEST_SHADOWS = 2
# Ten contacts make about 16 cells, twenty about 65.  The rest of the work grows with the number of
# ways to choose three edges of a cell, so the cap is on the product.
MOST_CELLS_TIMES_TRIPLES = 512 * 56
# Different cells of which the cap chooses; only broken strips have more.
MOST_CELLS_MET = 4096


class DiscBounds(NamedTuple):
    """`DiscLimits` for compiled functions."""

    width_mm: float
    height_mm: float
    smallest_radius_mm: float
    largest_radius_mm: float
    shape_variance_mm2: float


class Wanted(NamedTuple):
    """Which cameras to believe, (C,), and edges (2 S,) of which a cell must have some.

    That is `fewest`, in two cameras at least; with 0, every cell will do.  What the shadows of a
    cell can save together, `savings` (S,) of each, must be no less than `least_saving`.
    """

    believed: BoolArray
    edges: BoolArray
    fewest: int
    savings: FloatArray
    least_saving: float


@borrowing
def is_on_surface(bounds: DiscBounds, x_mm: float, y_mm: float) -> bool:
    """Tell whether a place lies on the surface, or just beside it."""
    margin = SURFACE_MARGIN_MM + ROUNDING_MM
    return (
        (x_mm >= -margin)
        & (y_mm >= -margin)
        & (x_mm <= bounds.width_mm + margin)
        & (y_mm <= bounds.height_mm + margin)
    )


@borrowing
def is_in_shadow(
    lines: FloatArray,
    valid: BoolArray,
    shadow: int,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    variance_mm2: float,
) -> bool:
    """Tell whether a disc lies in a shadow, or protrudes no further than its edges are sure.

    An edge that is not valid bounds nothing, but a disc wholly beyond it would not darken the
    shadow at all and does not belong to it.
    """
    gate = GATE_SIGMAS**2 * variance_mm2
    inside = True
    for edge in range(2 * shadow, 2 * shadow + 2):
        beyond = 0.0 if valid[edge] else 2.0 * radius_mm
        room = slack_of(lines, edge, x_mm, y_mm, radius_mm) + beyond
        inside &= (room >= 0.0) | (room * room <= gate)
    return inside


@inlined
def find_cells(rows: EdgeRows, wanted: Wanted, bounds: DiscBounds) -> IntArray:
    """Return all cells that hold a disc of the smallest radius, as shadow numbers (T, C), in order.

    Each has shadows of two cameras at least.  When a frame set has more than the cap allows, those
    in which most discs rest are kept.
    """
    cameras, radius_mm = len(rows.eyes), bounds.smallest_radius_mm
    met = _CellsMet(
        np.full(_table_size(rows, wanted), -1, np.intp),
        np.empty((MOST_CELLS_MET, cameras), np.intp),
        np.empty(MOST_CELLS_MET, np.intp),
        np.empty(MOST_CELLS_MET, np.intp),
    )
    eyes, views, shadows, first_shadow = rows.eyes, rows.views, rows.shadows, rows.first_shadow
    lines, valid, believed = rows.lines, rows.valid, wanted.believed
    shape_variance_mm2 = bounds.shape_variance_mm2
    floors = _floors(rows, wanted, bounds)
    most_saved = _most_saved(wanted, first_shadow)
    count = 0
    cell = np.full(cameras, NO_SHADOW, np.intp)
    order = np.empty(cameras, np.intp)
    for a in range(cameras + 1):  # the last stands for the sides of the surface and of views
        for b in range(min(a + 1, cameras), cameras + 1):
            asked = _others_first(believed, a, b, order)
            if asked == 0:
                continue
            # what a pair of edges must save, if the other cameras save as much as they can
            least = wanted.least_saving - np.sum(most_saved) + most_saved[a] + most_saved[b]
            for i in range(2 * first_shadow[a], _end(first_shadow, a, len(floors))):
                ax, ay, ah, slope = floors[i, 0], floors[i, 1], floors[i, 2], floors[i, 3]
                saved = floors[i, SAVING]
                start, end = max(2 * first_shadow[b], i + 1), _end(first_shadow, b, len(floors))
                for j in range(start, end if saved + most_saved[b] >= least else start):
                    bx, by, bh = row_of_three(floors, j)
                    sine = ax * by - ay * bx
                    rests = (slope * sine <= 0.0) & (floors[j, 3] * sine >= 0.0)
                    rests &= saved + floors[j, SAVING] >= least
                    if not rests or abs(sine) <= SMALLEST_SINE:
                        continue
                    x, y = (ah * by - bh * ay) / sine, (ax * bh - bx * ah) / sine
                    inside = is_on_surface(bounds, x, y)
                    if not inside:
                        continue
                    shown = 0
                    for place in range(asked):
                        camera = order[place]
                        shadow = shadow_at(eyes, shadows, first_shadow, camera, x, y)
                        variance = shape_variance_mm2 + variance_of(
                            eyes, shadows, camera, shadow, x, y
                        )
                        if is_in_shadow(lines, valid, shadow, x, y, radius_mm, variance):
                            cell[camera] = shadow
                            shown += 1
                        # most see everything: to ask that here saves the call
                        elif views[camera, KIND] == SEES_ALL or is_in_view(
                            eyes, views, camera, x, y
                        ):
                            inside = False
                            break
                        else:
                            cell[camera] = NO_SHADOW
                    if inside and shown >= FEWEST_SHADOWS and _is_wanted(wanted, cell):
                        count = _meet(met, count, cell, first_shadow)
    return _most_touched(met, count, _cap(believed))


@inlined
def _floors(rows: EdgeRows, wanted: Wanted, bounds: DiscBounds) -> FloatArray:
    """Return the lines, (., 5), on which the centres of smallest discs come to rest.

    Normal and offset as in `EdgeRows`, how steeply the line runs `DOWN`, and what its shadow can
    save.  Behind the edges come the sides of the surface, then the lines of view of believed
    cameras that do not see all of it, on which discs lie from outside.  At an edge that is not
    valid lie their centres: nobody knows how far they reach beyond it.
    """
    edges, radius_mm, believed = len(rows.valid), bounds.smallest_radius_mm, wanted.believed
    floors = np.zeros((edges + SIDES + 2 * len(believed), 5))
    for edge in range(edges):
        nx, ny, offset = row_of_three(rows.lines, edge)
        offset += radius_mm if rows.valid[edge] else ROUNDING_MM
        _write_floor(floors, edge, nx, ny, offset)
        floors[edge, SAVING] = wanted.savings[edge // 2]
    _write_floor(floors, edges, 1.0, 0.0, -SURFACE_MARGIN_MM)
    _write_floor(floors, edges + 1, 0.0, 1.0, -SURFACE_MARGIN_MM)
    _write_floor(floors, edges + 2, -1.0, 0.0, -SURFACE_MARGIN_MM - bounds.width_mm)
    _write_floor(floors, edges + 3, 0.0, -1.0, -SURFACE_MARGIN_MM - bounds.height_mm)
    count = edges + SIDES
    for camera in range(len(believed)):
        if believed[camera] and rows.views[camera, KIND] != SEES_ALL:
            x, y, _ = row_of_three(rows.eyes, camera)
            for column in (0, 2):
                nx, ny = -rows.views[camera, column], -rows.views[camera, column + 1]
                _write_floor(floors, count, nx, ny, nx * x + ny * y)
                count += 1
    return floors[:count]


@borrowing
def _write_floor(floors: FloatArray, row: int, nx: float, ny: float, offset: float) -> None:
    floors[row, 0], floors[row, 1], floors[row, 2] = nx, ny, offset
    floors[row, 3] = DOWN[0] * ny - DOWN[1] * nx


@inlined
def _most_saved(wanted: Wanted, first_shadow: IntArray) -> FloatArray:
    """Return the most that a shadow of each camera can save, (C + 1,); the last stands for none."""
    most_saved = np.zeros(len(first_shadow))
    for camera in range(len(first_shadow) - 1):
        for shadow in range(first_shadow[camera], first_shadow[camera + 1]):
            if wanted.believed[camera]:
                most_saved[camera] = max(most_saved[camera], wanted.savings[shadow])
    return most_saved


@borrowing
def _end(first_shadow: IntArray, camera: int, floors: int) -> int:
    """Return the number of floors up to those of a camera, or all of them."""
    return int(2 * first_shadow[camera + 1] if camera < len(first_shadow) - 1 else floors)


@borrowing
def _others_first(believed: BoolArray, a: int, b: int, order: IntArray) -> int:
    """Write in which order to ask the cameras: a and b refuse least.  Return how many they are.

    None, if one of both is not believed.  What stands behind the last camera is always.
    """
    count, cameras = 0, len(believed)
    for camera in range(cameras):
        if believed[camera] and camera not in (a, b):
            order[count] = camera
            count += 1
    for camera in (a, b):
        if camera < cameras:
            if not believed[camera]:
                return 0
            order[count] = camera
            count += 1
    return count


@borrowing
def _is_wanted(wanted: Wanted, cell: IntArray) -> bool:
    saving = 0.0
    for shadow in cell:
        if shadow != NO_SHADOW:
            saving += wanted.savings[shadow]
    if saving < wanted.least_saving:
        return False
    if wanted.fewest == 0:
        return True
    edges = cameras = 0
    for shadow in cell:
        if shadow != NO_SHADOW:
            first, last = wanted.edges[2 * shadow], wanted.edges[2 * shadow + 1]
            edges += int(first) + int(last)
            cameras += int(first or last)
    return edges >= wanted.fewest and cameras >= 2


class _CellsMet(NamedTuple):
    """Different cells in the order in which they were met, and a hash table to find them.

    `table` holds their numbers, -1 where there is none; `cells` (M, C), `keys` and `touched` (M,).
    """

    table: IntArray
    cells: IntArray
    keys: IntArray
    touched: IntArray


@borrowing
def _table_size(rows: EdgeRows, wanted: Wanted) -> int:
    """Return a power of two, twice the number of possible cells."""
    possible = 1
    for camera in range(len(rows.eyes)):
        if wanted.believed[camera] and possible < MOST_CELLS_MET:
            possible *= (
                rows.first_shadow[camera + 1]
                - rows.first_shadow[camera]
                + int(rows.views[camera, KIND] != SEES_ALL)
            )
    size = 16
    while size < 2 * min(possible, MOST_CELLS_MET):
        size *= 2
    return size


@borrowing
def _meet(met: _CellsMet, count: int, cell: IntArray, first_shadow: IntArray) -> int:
    """Count a pair of edges for the cell; return how many cells are known then."""
    key = 0
    for camera in range(len(cell)):
        size = first_shadow[camera + 1] - first_shadow[camera]
        place = 0 if cell[camera] == NO_SHADOW else cell[camera] - first_shadow[camera] + 1
        key = key * (size + 1) + place
    last_slot = len(met.table) - 1
    slot = (key ^ (key >> 7)) & last_slot
    while met.table[slot] >= 0:
        number = met.table[slot]
        if met.keys[number] == key:
            met.touched[number] += 1
            return count
        slot = (slot + 1) & last_slot
    if count == MOST_CELLS_MET:
        return count
    met.table[slot] = count
    met.keys[count], met.touched[count] = key, 1
    for camera in range(len(cell)):
        met.cells[count, camera] = cell[camera]
    return count + 1


@borrowing
def _cap(believed: BoolArray) -> int:
    edges = 0
    for camera in range(len(believed)):
        edges += 2 * int(believed[camera])
    return MOST_CELLS_TIMES_TRIPLES // max(edges * (edges - 1) * (edges - 2) // 6, 1)


@inlined
def _most_touched(met: _CellsMet, count: int, cap: int) -> IntArray:
    """Return the most touched cells by ascending key; of equally touched ones those first."""
    order = sorted_by(met.keys, count)
    scores = np.empty(count, np.intp)
    for place in range(count):
        scores[place] = met.touched[order[place]]
    kept = best_of(scores, cap)
    cells = np.empty((len(kept), met.cells.shape[1]), np.intp)
    for place in range(len(kept)):
        for camera in range(cells.shape[1]):
            cells[place, camera] = met.cells[order[kept[place]], camera]
    return cells


@inlined
def sorted_by(keys: IntArray, count: int) -> IntArray:
    """Return the places of the first keys in ascending order; quick for some dozens."""
    order = np.empty(count, np.intp)
    for place in range(count):
        order[place] = place
    gap = 1
    while 3 * gap < count:
        gap = 3 * gap + 1
    while gap > 0:
        for end in range(gap, count):
            moved, place = order[end], end
            while place >= gap and keys[order[place - gap]] > keys[moved]:
                order[place] = order[place - gap]
                place -= gap
            order[place] = moved
        gap //= 3
    return order


@inlined
def best_of(scores: IntArray, most: int) -> IntArray:
    """Return the places of the `most` highest scores, in order; of equal scores the first."""
    highest = 0
    for score in scores:
        highest = max(highest, score)
    how_many = np.zeros(highest + 2, np.intp)
    for score in scores:
        how_many[score] += 1
    # from the highest down, as long as there is room for all of a score
    least, room = highest + 1, min(most, len(scores))
    kept = np.empty(room, np.intp)
    while least > 0 and how_many[least - 1] <= room:
        least -= 1
        room -= how_many[least]
    count = 0
    for place in range(len(scores)):
        if scores[place] >= least or (scores[place] == least - 1 and room > 0):
            room -= int(scores[place] < least)
            kept[count] = place
            count += 1
    return kept
