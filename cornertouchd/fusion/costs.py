"""What each disc of the pool costs and explains, and which of them cannot be there together.

A disc costs something to believe in; an edge costs little when a chosen disc touches it and a fixed
price when none does; so does each piece of shadow that no chosen disc darkens.  The costs are
negative log likelihoods.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.bits import WordArray, count_common, empty_sets, put_in
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import (
    FIRST,
    LAST,
    NO_SHADOW,
    SIGMA,
    EdgeRows,
    row_of_three,
    squared_distance,
)
from cornertouchd.fusion.pool import (
    COST_OF_AN_EDGE,
    FINGER_RADII_MM,
    SIZE_SIGMA_MM,
    Pool,
    cost_of_edge,
)
from cornertouchd.model import FloatArray

# Found by Monte-Carlo over 1..20 contacts on both sizes of frame; changing any of them by half
# moves F1 by less than 1 %.
COST_OF_A_DISC = 5.0
# Among touches that are followed, something new is less likely than one of them.
COST_OF_A_NEW_DISC = 7.0
COST_OF_A_DARK_PIECE = 0.7
LARGEST_COST_OF_SIZE = 3.0
PIECE_PX = 1.5
# A piece counts as covered when its middle is this near to the disc's outline.
PIECE_TOLERANCE_PX = 0.75
# A shadow as wide as a picture has about 430 pieces.
MOST_PIECES_PER_SHADOW = 512
# Fingers are squeezed flat where they touch each other.
SMALLEST_SHARE_OF_RADII = 0.85
# Candidates as near as this are fits of one contact to different edges.
SAME_CONTACT_MM = 2.5


class Costs(NamedTuple):
    """What each of K discs costs and explains.

    `own` (K,) is what it costs itself.  Row k of `edges` (K, M) names the edges of its cell and row
    k of `edge_costs` (K, M) what they cost with it; of `edge_count` edges the last stands for those
    of cameras that do not show it.  `savings` (K,) is what each disc saves alone and `by_saving`
    (K,) their numbers, what saves most first.

    Row k of the following is a set: `covers` holds the pieces of shadow that a disc darkens, of
    `piece_count` in all, `conflicts` the discs that cannot be there as well and `same` those that
    are the same contact.
    """

    own: FloatArray
    edges: IntArray
    edge_costs: FloatArray
    edge_count: int
    covers: WordArray
    piece_count: int
    conflicts: WordArray
    same: WordArray
    savings: FloatArray
    by_saving: IntArray


@borrowing
def price_new_discs(pool: Pool, first: int, end: int, cost: float) -> None:
    """Say what discs cost that continue no prediction; `cost` is that of a finger."""
    for disc in range(first, end):
        radius = pool.discs[disc, 2]
        excess = max(FINGER_RADII_MM[0] - radius, 0.0) + max(radius - FINGER_RADII_MM[1], 0.0)
        size = 0.5 * (excess / SIZE_SIGMA_MM) ** 2
        pool.own[disc] = cost + min(size, LARGEST_COST_OF_SIZE)
        pool.prediction[disc] = -1


@inlined
def costs_of(pool: Pool, count: int, rows: EdgeRows, edge_sigma_px: float) -> Costs:
    """Weigh the first `count` discs.  `edge_sigma_px` tells how wide a pixel is in `rows`."""
    cameras = len(rows.eyes)
    no_edge = len(rows.valid)
    first_piece = first_pieces(rows, edge_sigma_px)
    piece_count = first_piece[len(first_piece) - 1]
    costs = Costs(
        pool.own[:count].copy(),
        np.full((count, 2 * cameras), no_edge, np.intp),
        np.empty((count, 2 * cameras)),
        no_edge + 1,
        empty_sets(count, piece_count),
        piece_count,
        empty_sets(count, count),
        empty_sets(count, count),
        np.empty(count),
        np.empty(count, np.intp),
    )
    untouched = np.full(no_edge + 1, COST_OF_AN_EDGE)
    untouched[no_edge] = 0.0
    for disc in range(count):
        for row in range(2 * cameras):
            costs.edge_costs[disc, row] = cost_of_edge(pool.misfits[disc, row])
            shadow = pool.shadows[disc, row // 2]
            if shadow != NO_SHADOW:
                costs.edges[disc, row] = 2 * shadow + row % 2
        for camera in range(cameras):
            cover(costs.covers, pool.discs, disc, rows, camera, first_piece, edge_sigma_px)
        pieces = count_common(costs.covers, disc, costs.covers, disc)
        saved = saved_by_edges(costs.edges, costs.edge_costs, disc, untouched)
        costs.savings[disc] = saved + COST_OF_A_DARK_PIECE * pieces - costs.own[disc]
    _mark_conflicts(costs.conflicts, costs.same, pool.discs, count)
    _order_by_saving(costs.savings, costs.by_saving)
    return costs


@borrowing
def saved_by_edges(edges: IntArray, edge_costs: FloatArray, disc: int, left: FloatArray) -> float:
    """Return how much less a disc lets the edges of its cell cost than what is `left` to pay."""
    saved = 0.0
    for row in range(edges.shape[1]):
        saved += max(left[edges[disc, row]] - edge_costs[disc, row], 0.0)
    return saved


@borrowing
def _order_by_saving(savings: FloatArray, order: IntArray) -> None:
    """Write the numbers of the discs, what saves most first; quick for some hundreds."""
    for disc in range(len(order)):
        order[disc] = disc
    gap = 1
    while 3 * gap < len(order):
        gap = 3 * gap + 1
    while gap > 0:
        for end in range(gap, len(order)):
            moved, place = order[end], end
            while place >= gap and savings[order[place - gap]] < savings[moved]:
                order[place] = order[place - gap]
                place -= gap
            order[place] = moved
        gap //= 3


@borrowing
def _mark_conflicts(conflicts: WordArray, same: WordArray, discs: FloatArray, count: int) -> None:
    for disc in range(count):
        for other in range(disc + 1):
            dx, dy = discs[disc, 0] - discs[other, 0], discs[disc, 1] - discs[other, 1]
            radii = SMALLEST_SHARE_OF_RADII * (discs[disc, 2] + discs[other, 2])
            if dx * dx + dy * dy < radii * radii:
                put_in(conflicts, disc, other)
                put_in(conflicts, other, disc)
            if dx * dx + dy * dy < SAME_CONTACT_MM**2:
                put_in(same, disc, other)
                put_in(same, other, disc)


@inlined
def first_pieces(rows: EdgeRows, edge_sigma_px: float) -> IntArray:
    """Cut the shadows into pieces of `PIECE_PX`; number those before each shadow, (S + 1,).

    A shadow without a valid edge fills all that its camera can see of some place: it says that
    something is there, but it has no pieces, because they would be no measure of how much.
    """
    first_piece = np.zeros(len(rows.shadows) + 1, np.intp)
    for shadow in range(len(rows.shadows)):
        pieces = 0
        if rows.valid[2 * shadow] or rows.valid[2 * shadow + 1]:
            width = rows.shadows[shadow, LAST] - rows.shadows[shadow, FIRST]
            width_px = width / (rows.shadows[shadow, SIGMA] / edge_sigma_px)
            pieces = int(min(max(width_px / PIECE_PX - 1.0, 1.0), MOST_PIECES_PER_SHADOW))
        first_piece[shadow + 1] = first_piece[shadow] + pieces
    return first_piece


@borrowing
def cover(
    covers: WordArray,
    discs: FloatArray,
    disc: int,
    rows: EdgeRows,
    camera: int,
    first_piece: IntArray,
    edge_sigma_px: float,
) -> None:
    """Mark the pieces of a camera's shadows that a disc darkens."""
    x, y, radius = row_of_three(discs, disc)
    forward = rows.eyes[camera, 2]
    angle = np.arctan2(y - rows.eyes[camera, 1], x - rows.eyes[camera, 0])
    angle = forward + (angle - forward + np.pi) % (2.0 * np.pi) - np.pi
    distance = np.sqrt(squared_distance(rows.eyes, camera, x, y))
    half_angle = np.arcsin(radius / distance) if distance > radius else np.pi
    shadows = rows.shadows
    for shadow in range(rows.first_shadow[camera], rows.first_shadow[camera + 1]):
        pieces = first_piece[shadow + 1] - first_piece[shadow]
        first, last = shadows[shadow, FIRST], shadows[shadow, LAST]
        reach = half_angle + PIECE_TOLERANCE_PX * shadows[shadow, SIGMA] / edge_sigma_px
        if pieces == 0 or angle + reach < first or angle - reach > last:
            continue
        # the middles of the pieces are (number + 0.5) widths behind the first bound
        width = (last - first) / pieces
        low = np.ceil(max((angle - reach - first) / width - 0.5, 0.0))
        high = np.floor(min((angle + reach - first) / width - 0.5, pieces - 1.0))
        for number in range(int(low), int(high) + 1):
            put_in(covers, disc, first_piece[shadow] + number)
