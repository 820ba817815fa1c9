"""Candidates: the discs that could stand in the cells and cast some of their edges.

Each seed is fitted to all the edges that it touches.
"""

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.cells import DiscBounds
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import (
    GATE_SIGMAS,
    KIND,
    NO_SHADOW,
    SEES_ALL,
    EdgeRows,
    is_in_view,
    row_of_three,
    variance_of,
)
from cornertouchd.fusion.pool import (
    COST_OF_AN_EDGE,
    FINGER_RADII_MM,
    SIZE_SIGMA_MM,
    Pool,
    copy_disc,
    cost_of_edge,
    empty_pool,
    is_possible,
    write_misfits,
)
from cornertouchd.fusion.seeds import MOST_SEEDS_OF_A_CELL, find_seeds
from cornertouchd.model import BoolArray, FloatArray

# A disc that is known no better than this is a guess along a line.
LARGEST_POSITION_SIGMA_MM = 6.0
# Discs whose fits differ by less are the same disc.  Ten times more loses one pair of touching
# fingers in fifty.
NEGLIGIBLE_COST = 0.1
# Two parallel tangents leave a direction open; far below what any edge weighs.
LEAST_WEIGHT = 1e-6


@inlined
def find_candidates(
    rows: EdgeRows,
    cells: IntArray,
    believed: BoolArray,
    bounds: DiscBounds,
    pool: Pool,
    count: int,
) -> int:
    """Add the discs that lie in the cells (T, C) and touch two of their edges at least.

    `believed` (C,) are the cameras that would show them.  `count` discs are in the pool; returns
    how many are then.
    """
    cameras = cells.shape[1]
    seeds, seed_count = find_seeds(rows, cells, bounds)
    fits = empty_pool(MOST_SEEDS_OF_A_CELL, cameras)
    order, costs = np.empty(MOST_SEEDS_OF_A_CELL, np.intp), np.empty(MOST_SEEDS_OF_A_CELL)
    some_look_away = np.any(rows.views[:, KIND] != SEES_ALL)
    fitted = 0
    for number in range(seed_count):
        cell = seeds.cells[number]
        for camera in range(cameras):
            fits.shadows[fitted, camera] = cells[cell, camera]
        for column in range(3):
            fits.discs[fitted, column] = seeds.discs[number, column]
        if _fit(rows, bounds, seeds.edges[number], fits, fitted):
            is_lit = some_look_away and _is_in_the_light(rows, believed, fits, fitted)
            fitted += int(not is_lit)
        if number + 1 == seed_count or seeds.cells[number + 1] != cell:
            _order_by_cost(fits.misfits, fitted, order, costs)
            for place in range(fitted):
                if count < len(pool.own) and not _is_dominated(fits.misfits, order, place):
                    copy_disc(pool, count, fits, order[place])
                    count += 1
            fitted = 0
    return count


@borrowing
def _fit(rows: EdgeRows, bounds: DiscBounds, edges: int, fits: Pool, place: int) -> bool:
    """Fit a disc to the edges that it touches, twice: the fit may gain or lose an edge.

    Tells whether the disc is one that could be there.
    """
    for row in range(fits.misfits.shape[1]):
        fits.misfits[place, row] = 0.0 if (edges >> row) & 1 else np.inf
    inside, position_variance = False, 0.0
    for _ in range(2):
        position_variance = _move_to_edges(rows, bounds.shape_variance_mm2, fits, place)
        inside = write_misfits(fits, place, rows, bounds.shape_variance_mm2)
    touched = 0
    for row in range(fits.misfits.shape[1]):
        touched += int(fits.misfits[place, row] < GATE_SIGMAS)
    x, y, radius = row_of_three(fits.discs, place)
    return (
        inside
        and is_possible(bounds, x, y, radius)
        and touched >= 2
        and position_variance < LARGEST_POSITION_SIGMA_MM**2
    )


@borrowing
def _is_in_the_light(rows: EdgeRows, believed: BoolArray, fits: Pool, place: int) -> bool:
    """Tell whether a believed camera looks at a disc and shows none of it.

    Cells reach from where it does not look into where it does.
    """
    x, y, _ = row_of_three(fits.discs, place)
    lit = False
    for camera in range(len(believed)):
        if believed[camera] and fits.shadows[place, camera] == NO_SHADOW:
            lit |= is_in_view(rows.eyes, rows.views, camera, x, y)
    return lit


@borrowing
def _move_to_edges(rows: EdgeRows, shape_variance_mm2: float, fits: Pool, place: int) -> float:
    """Move a disc to where its edges want it; return the larger variance of x and y."""
    misfits, shadows, lines = fits.misfits, fits.shadows, rows.lines
    eyes, shadow_table = rows.eyes, rows.shadows
    x, y, radius = row_of_three(fits.discs, place)
    xx = yy = LEAST_WEIGHT
    xy = xr = yr = x_moment = y_moment = 0.0
    rr = SIZE_SIGMA_MM**-2
    r_moment = rr * min(max(radius, FINGER_RADII_MM[0]), FINGER_RADII_MM[1])
    for row in range(misfits.shape[1]):
        shadow = shadows[place, row // 2]
        if shadow == NO_SHADOW:
            continue
        variance = shape_variance_mm2 + variance_of(eyes, shadow_table, row // 2, shadow, x, y)
        weight = (1.0 if misfits[place, row] < np.inf else 0.0) / variance
        nx, ny, h = row_of_three(lines, 2 * shadow + row % 2)
        xx += weight * nx * nx
        xy += weight * nx * ny
        yy += weight * ny * ny
        xr -= weight * nx
        yr -= weight * ny
        rr += weight
        x_moment += weight * nx * h
        y_moment += weight * ny * h
        r_moment -= weight * h
    return solve_disc((xx, xy, xr, yy, yr, rr), (x_moment, y_moment, r_moment), fits.discs, place)


@borrowing
def solve_disc(
    information: tuple[float, float, float, float, float, float],
    moments: tuple[float, float, float],
    discs: FloatArray,
    place: int,
) -> float:
    """Solve the normal equations of x, y, r; write the disc, return the larger variance of x and y.

    `information` is the upper triangle of their symmetric matrix, row by row.
    """
    xx, xy, xr, yy, yr, rr = information
    x_moment, y_moment, r_moment = moments
    cxx, cxy, cxr = yy * rr - yr * yr, xr * yr - xy * rr, xy * yr - xr * yy
    cyy, cyr, crr = xx * rr - xr * xr, xy * xr - xx * yr, xx * yy - xy * xy
    determinant = xx * cxx + xy * cxy + xr * cxr
    discs[place, 0] = (cxx * x_moment + cxy * y_moment + cxr * r_moment) / determinant
    discs[place, 1] = (cxy * x_moment + cyy * y_moment + cyr * r_moment) / determinant
    discs[place, 2] = (cxr * x_moment + cyr * y_moment + crr * r_moment) / determinant
    return max(cxx, cyy) / determinant


@borrowing
def _order_by_cost(misfits: FloatArray, fitted: int, order: IntArray, costs: FloatArray) -> None:
    """Write the numbers of the discs of a cell, the cheapest first."""
    for number in range(fitted):
        costs[number] = 0.0
        for row in range(misfits.shape[1]):
            costs[number] += cost_of_edge(misfits[number, row])
        place = number
        while place > 0 and costs[order[place - 1]] > costs[number]:
            order[place] = order[place - 1]
            place -= 1
        order[place] = number


@borrowing
def _is_dominated(misfits: FloatArray, order: IntArray, place: int) -> bool:
    """Tell whether a cheaper disc touches all edges of this one, and no edge of them much worse.

    The fit counts: of two fingers side by side each touches its edges exactly, while a large disc
    over both touches all edges, and some of them badly.
    """
    disc = order[place]
    for cheaper in range(place):
        excess = 0.0
        for row in range(misfits.shape[1]):
            misfit, other = misfits[disc, row], misfits[order[cheaper], row]
            if misfit < GATE_SIGMAS:
                # an edge that the other does not touch is worse by far
                excess += max(cost_of_edge(other) - cost_of_edge(misfit), 0.0)
                excess += COST_OF_AN_EDGE * int(other == np.inf)
        if excess < NEGLIGIBLE_COST:
            return True
    return False
