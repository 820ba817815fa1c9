"""Refinement: place each chosen contact as exactly as the edges that it owns allow.

A finger's section is rather an ellipse than a disc.  Its tangent in the direction of angle t lies
r + a cos 2t + b sin 2t from the centre, to first order, which keeps the equations linear.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.candidates import LARGEST_POSITION_SIGMA_MM
from cornertouchd.fusion.cholesky import factorise, solve, variance_of_term
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import EdgeRows, row_of_three, variance_of
from cornertouchd.fusion.pool import FINGER_RADII_MM, SIZE_SIGMA_MM, Pool
from cornertouchd.fusion.predicted import PredictedDiscs
from cornertouchd.model import BoolArray, FloatArray

# What fingers deviate from an ellipse, and how much of an ellipse they are.
OUTLINE_SIGMA_MM = 0.05
ELLIPSE_SIGMA_MM = 0.8
# A touch keeps its size from one picture to the next, or nearly so.
RADIUS_SIGMA_OF_A_TOUCH_MM = 0.3


class RefinedDiscs(NamedTuple):
    """N contacts: discs (N, 3) as x, y, r, sigma of the position (N,), edges owned (N, 2 C)."""

    discs: FloatArray
    sigma_mm: FloatArray
    owned: BoolArray


@inlined
def refine(pool: Pool, chosen: IntArray, rows: EdgeRows, predicted: PredictedDiscs) -> RefinedDiscs:
    """Fit an ellipse to the edges that each chosen disc owns."""
    refined = RefinedDiscs(
        np.empty((len(chosen), 3)), np.empty(len(chosen)), _owned_edges(pool, chosen, rows)
    )
    information, moments = np.empty((5, 5)), np.empty(5)
    row, known = np.empty(5), np.empty(5)
    for place in range(len(chosen)):
        _write_priors(pool, chosen[place], predicted, information, moments)
        x, y, _ = row_of_three(pool.discs, chosen[place])
        for number in range(refined.owned.shape[1]):
            if not refined.owned[place, number]:
                continue
            camera, shadow = number // 2, pool.shadows[chosen[place], number // 2]
            nx, ny, offset = row_of_three(rows.lines, 2 * shadow + number % 2)
            # for a unit normal, cos 2t and sin 2t
            row[0], row[1], row[2], row[3], row[4] = nx, ny, -1.0, ny * ny - nx * nx, -2.0 * nx * ny
            variance = variance_of(rows.eyes, rows.shadows, camera, shadow, x, y)
            weight = 1.0 / (variance + OUTLINE_SIGMA_MM**2)
            for i in range(5):
                moments[i] += weight * row[i] * offset
                for j in range(i + 1):
                    information[i, j] += weight * row[i] * row[j]
        factorise(information)
        refined.sigma_mm[place] = np.sqrt(
            max(variance_of_term(information, 0, known), variance_of_term(information, 1, known))
        )
        solve(information, moments)
        refined.discs[place, 0], refined.discs[place, 1] = moments[0], moments[1]
        refined.discs[place, 2] = moments[2]
    return refined


@inlined
def _owned_edges(pool: Pool, chosen: IntArray, rows: EdgeRows) -> BoolArray:
    """Give each edge to the disc that touches it best.

    Lending it to a second one that fits nearly as well spoils that one's place: RMSE of ten
    contacts .42 mm instead of .36.
    """
    least = np.full(len(rows.valid), np.inf)
    owned = np.empty((len(chosen), pool.misfits.shape[1]), np.bool_)
    for give in (False, True):
        for place in range(len(chosen)):
            disc = chosen[place]
            for row in range(owned.shape[1]):
                misfit = pool.misfits[disc, row]
                owned[place, row] = False
                if misfit == np.inf:
                    continue
                edge = 2 * pool.shadows[disc, row // 2] + row % 2
                if give:
                    owned[place, row] = misfit <= least[edge]
                else:
                    least[edge] = min(least[edge], misfit)
    return owned


@borrowing
def _write_priors(
    pool: Pool, disc: int, predicted: PredictedDiscs, information: FloatArray, moments: FloatArray
) -> None:
    """Write how well x, y, r and the two terms of the ellipse are known beforehand.

    The prior of the position holds a contact that owns too few edges to be placed by them.
    """
    x, y, radius = row_of_three(pool.discs, disc)
    position_weight, size_weight = LARGEST_POSITION_SIGMA_MM**-2, SIZE_SIGMA_MM**-2
    radius = min(max(radius, FINGER_RADII_MM[0]), FINGER_RADII_MM[1])
    number = pool.prediction[disc]
    if number >= 0:
        x, y, radius = row_of_three(predicted.discs, number)
        position_weight = 1.0 / predicted.position_variances_mm2[number]
        size_weight = RADIUS_SIGMA_OF_A_TOUCH_MM**-2
    information[:] = 0.0
    information[0, 0] = information[1, 1] = position_weight
    information[2, 2] = size_weight
    information[3, 3] = information[4, 4] = ELLIPSE_SIGMA_MM**-2
    moments[0], moments[1], moments[2] = (
        position_weight * x,
        position_weight * y,
        size_weight * radius,
    )
    moments[3] = moments[4] = 0.0
