"""What touches that are followed leave of the shadows: all that anything new could explain.

Most frame sets show nothing new, and to search all cells would take most of the time.  Whatever is
added in a cell saves at most what its shadows cost beside the touches.  It may also take the place
of touches, which it would have to do better than them: so only touches count that are as they
should be, and far from others.
"""

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.bits import empty_sets, fill, is_in, take_out
from cornertouchd.fusion.costs import COST_OF_A_DARK_PIECE, cover, first_pieces
from cornertouchd.fusion.edge_rows import NO_SHADOW, EdgeRows, row_of_three
from cornertouchd.fusion.pool import COST_OF_AN_EDGE, FINGER_RADII_MM, Pool, cost_of_edge
from cornertouchd.model import FloatArray

# Cells whose shadows cost less beside the touches are not searched: half of what something new
# costs.  All of it takes .7 of the time for twenty contacts, but of two fingers among 20 on
# 2400x1350 that come to touch each other and part, the share of frame sets that are right goes from
# .982, with all cells searched, to .949; with half of it, it is .974.
LEAST_SAVING = 3.5
# A touch that costs more itself may be another one than was expected: if all of them count, 15
# contacts on 350x400 get half as many ghosts more as with all cells searched; with 2, no more.
DEAREST_TOUCH = 2.0
# Fingers this near to each other, as a share of the sum of their radii, may be one, or others: with
# them left out the .974 is .984.
NEAR_SHARE = 1.3


@inlined
def remaining_costs(rows: EdgeRows, pool: Pool, count: int, edge_sigma_px: float) -> FloatArray:
    """Return what each shadow costs, (S,), beside the sure ones of `count` predicted discs."""
    edge_costs = np.where(rows.valid, COST_OF_AN_EDGE, 0.0)
    first_piece = first_pieces(rows, edge_sigma_px)
    piece_count = first_piece[len(first_piece) - 1]
    covers, dark = empty_sets(count, piece_count), empty_sets(1, piece_count)
    fill(dark, piece_count)
    for disc in range(count):
        if pool.own[disc] >= DEAREST_TOUCH or not _is_one_finger(pool.discs, disc, count):
            continue
        for camera in range(len(rows.eyes)):
            cover(covers, pool.discs, disc, rows, camera, first_piece, edge_sigma_px)
            shadow = pool.shadows[disc, camera]
            if shadow != NO_SHADOW:
                for side in range(2):
                    edge = 2 * shadow + side
                    cost = cost_of_edge(pool.misfits[disc, 2 * camera + side])
                    edge_costs[edge] = min(edge_costs[edge], cost)
        take_out(dark, covers, disc)
    remaining = np.empty(len(rows.shadows))
    for shadow in range(len(remaining)):
        pieces = 0
        for piece in range(first_piece[shadow], first_piece[shadow + 1]):
            pieces += int(is_in(dark, 0, piece))
        remaining[shadow] = COST_OF_A_DARK_PIECE * pieces
        remaining[shadow] += edge_costs[2 * shadow] + edge_costs[2 * shadow + 1]
    return remaining


@borrowing
def _is_one_finger(discs: FloatArray, disc: int, count: int) -> bool:
    """Tell whether a disc is no larger than a finger and none of the others is near."""
    x, y, radius = row_of_three(discs, disc)
    alone = radius <= FINGER_RADII_MM[1]
    for other in range(count):
        dx, dy = discs[other, 0] - x, discs[other, 1] - y
        near = NEAR_SHARE * (radius + discs[other, 2])
        alone &= (other == disc) | (dx * dx + dy * dy > near * near)
    return alone
