"""What touches that are followed leave of the shadows: all that anything new could explain."""

from collections.abc import Sequence

import numpy as np

from cornertouchd.fusion.costs import COST_OF_A_DARK_PIECE
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import NO_SHADOW
from cornertouchd.fusion.pool import COST_OF_AN_EDGE, FINGER_RADII_MM
from cornertouchd.fusion.remaining import DEAREST_TOUCH, LEAST_SAVING, NEAR_SHARE
from cornertouchd.model import FloatArray
from oracle.candidates import Candidates, edge_costs
from oracle.edge_rows import EdgeRows
from oracle.selection import pieces_covered, shadows_of_pieces


def cells_worth_searching(
    cells: IntArray,
    rows: EdgeRows,
    predicted: Sequence[Candidates],
    edge_sigma_px: float,
) -> IntArray:
    """Return those cells (T, C) where something new may save enough beside what is predicted."""
    remaining = _remaining_costs(rows, predicted, edge_sigma_px)
    savings = np.where(cells == NO_SHADOW, 0.0, remaining[cells]).sum(axis=1)
    worth: IntArray = cells[savings >= LEAST_SAVING]
    return worth


def _remaining_costs(
    rows: EdgeRows, predicted: Sequence[Candidates], edge_sigma_px: float
) -> FloatArray:
    left = np.where(rows.valid.ravel(), COST_OF_AN_EDGE, 0.0)
    shadow = shadows_of_pieces(rows, edge_sigma_px)
    dark = np.full(len(shadow), True)
    for candidates in predicted:
        if candidates.own[0] < DEAREST_TOUCH and _is_one_finger(candidates, predicted):
            np.minimum.at(left, candidates.rows.edges[0], edge_costs(candidates)[0])
            dark &= ~pieces_covered(candidates.discs, rows, edge_sigma_px)[0]
    pieces = np.bincount(shadow, weights=dark, minlength=len(rows.sigma_rad))
    costs: FloatArray = left.reshape(-1, 2).sum(axis=1) + COST_OF_A_DARK_PIECE * pieces
    return costs


def _is_one_finger(candidates: Candidates, predicted: Sequence[Candidates]) -> bool:
    x, y, radius = candidates.discs[0]
    others = np.array([other.discs[0] for other in predicted if other is not candidates])
    apart_mm = np.hypot(*(others.reshape(-1, 3)[:, :2] - (x, y)).T)
    near = apart_mm <= NEAR_SHARE * (radius + others.reshape(-1, 3)[:, 2])
    return bool(radius <= FINGER_RADII_MM[1] and not near.any())
