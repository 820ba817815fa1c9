"""The pool: all discs of which the cheapest explanation is chosen, and what each touches."""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.cells import DiscBounds, is_in_shadow, is_on_surface
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import (
    GATE_SIGMAS,
    NO_SHADOW,
    EdgeRows,
    row_of_three,
    slack_of,
    variance_of,
)
from cornertouchd.model import FloatArray

# What an edge costs that no disc explains, in negative log likelihood: from 2.8 sigmas on it is as
# cheap to leave the edge alone.  Found together with the costs of selection.
COST_OF_AN_EDGE = 4.0
# A finger tip's section: discs between these radii are equally likely, those beside them less so
# with this standard deviation.  It decides only where edges leave the size open, as four do that
# opposite cameras see from the same side.  Changing any by half moves F1 by less than 1 %.
FINGER_RADII_MM = (3.5, 8.5)
SIZE_SIGMA_MM = 1.5
# Thinner than this is a pen.
SMALLEST_FINGER_RADIUS_MM = 3.3
# About 50 for ten contacts, 150 for twenty.
MOST_CANDIDATES = 600


class Pool(NamedTuple):
    """Room for discs and what each of them explains; how many there are is counted beside it.

    `discs` (., 3) are x, y, r.  `shadows` (., C) is the cell of each, NO_SHADOW in a camera that
    does not show the disc.  `misfits` (., 2 C) is how far beside the disc the edges of its cell
    pass, in sigmas, and infinite for those that it does not touch.  `own` (.,) is what the disc
    itself costs, and `prediction` (.,) the number of that which it continues, or -1.
    """

    discs: FloatArray
    shadows: IntArray
    misfits: FloatArray
    own: FloatArray
    prediction: IntArray


@inlined
def empty_pool(size: int, cameras: int) -> Pool:
    """Return room for so many discs."""
    return Pool(
        np.empty((size, 3)),
        np.empty((size, cameras), np.intp),
        np.empty((size, 2 * cameras)),
        np.empty(size),
        np.empty(size, np.intp),
    )


@borrowing
def copy_disc(pool: Pool, place: int, other: Pool, number: int) -> None:
    """Copy a disc of another pool, but not its price."""
    for column in range(3):
        pool.discs[place, column] = other.discs[number, column]
    for camera in range(pool.shadows.shape[1]):
        pool.shadows[place, camera] = other.shadows[number, camera]
    for row in range(pool.misfits.shape[1]):
        pool.misfits[place, row] = other.misfits[number, row]


@borrowing
def is_possible(bounds: DiscBounds, x_mm: float, y_mm: float, radius_mm: float) -> bool:
    """Tell whether a disc has a size and a place where something may touch."""
    return bounds.smallest_radius_mm < radius_mm < bounds.largest_radius_mm and is_on_surface(
        bounds, x_mm, y_mm
    )


@borrowing
def cost_of_edge(misfit: float) -> float:
    """Return what an edge costs with a disc that touches it so well."""
    return min(0.5 * misfit * misfit, COST_OF_AN_EDGE)


@borrowing
def write_misfits(pool: Pool, place: int, rows: EdgeRows, shape_variance_mm2: float) -> bool:
    """Find out which edges of its cell the disc touches, and whether it lies in the cell."""
    misfits, shadows, lines, valid = pool.misfits, pool.shadows, rows.lines, rows.valid
    x, y, radius = row_of_three(pool.discs, place)
    inside = True
    for camera in range(shadows.shape[1]):
        shadow = shadows[place, camera]
        misfits[place, 2 * camera] = misfits[place, 2 * camera + 1] = np.inf
        if shadow == NO_SHADOW:
            continue
        variance = variance_of(rows.eyes, rows.shadows, camera, shadow, x, y)
        variance += shape_variance_mm2
        inside &= is_in_shadow(lines, valid, shadow, x, y, radius, variance)
        for side in range(2):
            misfit = abs(slack_of(lines, 2 * shadow + side, x, y, radius)) / np.sqrt(variance)
            touched = (misfit < GATE_SIGMAS) & valid[2 * shadow + side]
            misfits[place, 2 * camera + side] = misfit if touched else np.inf
    return inside
