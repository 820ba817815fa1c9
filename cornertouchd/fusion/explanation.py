"""From shadows to the discs that explain them most cheaply: the whole of it, compiled."""

import numpy as np

from cornertouchd.compiling import compiled, inlined
from cornertouchd.fusion.candidates import find_candidates
from cornertouchd.fusion.cells import DiscBounds, Wanted, find_cells
from cornertouchd.fusion.costs import (
    COST_OF_A_DISC,
    COST_OF_A_NEW_DISC,
    costs_of,
    price_new_discs,
)
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import EdgeRows, Sightings, edge_rows, row_of_three
from cornertouchd.fusion.pool import (
    COST_OF_AN_EDGE,
    MOST_CANDIDATES,
    SMALLEST_FINGER_RADIUS_MM,
    Pool,
    empty_pool,
)
from cornertouchd.fusion.predicted import COST_OF_A_MISSED_SHADOW, PredictedDiscs, add_predicted
from cornertouchd.fusion.refinement import RefinedDiscs, refine
from cornertouchd.fusion.rescue import (
    FEWEST_EDGES,
    cameras_to_believe,
    is_needed,
    keep_rescued,
)
from cornertouchd.fusion.selection import Explanation, cheapest_explanation
from cornertouchd.model import BoolArray, FloatArray

FIRST_EDGE = 3
"""The columns of what is counted of a contact that precede the edges which it owns."""

FINGERS, PENS, MISSED = 0, 1, 2
"""What is sought, the later ones only when the earlier ones leave edges unexplained."""


@inlined
def _search(
    rows: EdgeRows, wanted: Wanted, bounds: DiscBounds, pool: Pool, count: int, cost: float
) -> int:
    """Add discs at this price to the `count` of the pool; return how many there are then."""
    cells = find_cells(rows, wanted, bounds)
    end = find_candidates(rows, cells, wanted.believed, bounds, pool, count)
    if wanted.fewest:
        end = keep_rescued(rows, wanted, pool, count, end)
    price_new_discs(pool, count, end, cost)
    return end


@inlined
def _contacts(
    seeing: IntArray,
    kept: IntArray,
    first_of_camera: IntArray,
    bounds: DiscBounds,
    pool: Pool,
    explanation: Explanation,
    refined: RefinedDiscs,
) -> tuple[FloatArray, IntArray]:
    chosen = explanation.chosen
    measured = np.empty((len(chosen), 6))
    counted = np.full((len(chosen), FIRST_EDGE + 2 * len(first_of_camera)), -1, np.intp)
    for place in range(len(chosen)):
        x, y, radius = row_of_three(refined.discs, place)
        measured[place, 0] = min(max(x, 0.0), bounds.width_mm)
        measured[place, 1] = min(max(y, 0.0), bounds.height_mm)
        measured[place, 2] = radius
        measured[place, 3] = refined.sigma_mm[place]
        measured[place, 4] = explanation.margins[place]
        measured[place, 5] = pool.own[chosen[place]]
        counted[place, 0] = counted[place, 1] = 0
        counted[place, 2] = pool.prediction[chosen[place]]
        for row in range(refined.owned.shape[1]):
            if refined.owned[place, row]:
                counted[place, 0] += 1
                camera = seeing[row // 2]
                counted[place, 1] |= 1 << camera
                shadow = kept[pool.shadows[chosen[place], row // 2]]
                counted[place, FIRST_EDGE + 2 * camera + row % 2] = shadow - first_of_camera[camera]
    return measured, counted


@compiled(
    "Tuple((f8[:,::1], i8[:,::1]))(f8[:,::1], f8[:,::1], i8[::1], f8[::1], f8[::1], b1[::1],"
    " b1[::1], f8[::1], f8, f8, f8, f8, f8, f8, b1, f8[:,::1], f8[::1], f8[::1], f8[::1])"
)
def explain(
    positions_mm: FloatArray,
    views_rad: FloatArray,
    shadow_counts: IntArray,
    first_rad: FloatArray,
    last_rad: FloatArray,
    first_valid: BoolArray,
    last_valid: BoolArray,
    sigma_rad: FloatArray,
    width_mm: float,
    height_mm: float,
    smallest_radius_mm: float,
    largest_radius_mm: float,
    shape_sigma_mm: float,
    edge_sigma_px: float,
    is_followed: bool,
    predicted_discs: FloatArray,
    position_variances_mm2: FloatArray,
    radius_variances_mm2: FloatArray,
    costs_of_predicted: FloatArray,
) -> tuple[FloatArray, IntArray]:
    """Return N contacts as two tables, (N, 6) and (N, 3 + 2 C).

    The first holds x, y, r, the sigma of the position, the margin and the own cost; the second how
    many edges a contact owns, the cameras of which it owns one, as bits, the number of the
    prediction that it continues, or -1, and for first and last edge in each camera the shadow whose
    it owns, or -1.  The arguments are those of `Sightings`, `DiscLimits` and
    `Predictions`; `is_followed` tells whether touches are followed, though there may be none yet.
    """
    rows, seeing, kept = edge_rows(
        Sightings(
            positions_mm,
            views_rad,
            shadow_counts,
            first_rad,
            last_rad,
            first_valid,
            last_valid,
            sigma_rad,
        ),
        width_mm,
        height_mm,
    )
    if len(seeing) < 2:
        return np.empty((0, 6)), np.empty((0, FIRST_EDGE + 2 * len(shadow_counts)), np.intp)
    predicted = PredictedDiscs(
        predicted_discs, position_variances_mm2, radius_variances_mm2, costs_of_predicted
    )
    cost = COST_OF_A_NEW_DISC if is_followed else COST_OF_A_DISC
    shape_variance_mm2 = shape_sigma_mm**2
    everything = DiscBounds(
        width_mm, height_mm, smallest_radius_mm, largest_radius_mm, shape_variance_mm2
    )
    smallest_finger_mm = max(smallest_radius_mm, SMALLEST_FINGER_RADIUS_MM)
    fingers = DiscBounds(
        width_mm, height_mm, smallest_finger_mm, largest_radius_mm, shape_variance_mm2
    )
    pool = empty_pool(MOST_CANDIDATES, len(seeing))
    unexplained, count = rows.valid, 0
    for stage in (FINGERS, PENS, MISSED):
        if stage == PENS and smallest_radius_mm >= smallest_finger_mm:
            continue
        if stage == MISSED:
            camera_sets = cameras_to_believe(len(seeing))
            for number in range(len(camera_sets)):  # so that all rows are known to be contiguous
                wanted = Wanted(camera_sets[number], unexplained, FEWEST_EDGES)
                price = cost + COST_OF_A_MISSED_SHADOW
                count = _search(rows, wanted, everything, pool, count, price)
        else:
            wanted = Wanted(np.full(len(seeing), True), unexplained, 0)
            bounds = fingers if stage == FINGERS else everything
            # touches that are followed find room even when broken strips fill the pool
            count = add_predicted(rows, predicted, everything, pool, 0)
            count = _search(rows, wanted, bounds, pool, count, cost)
        costs = costs_of(pool, count, rows, edge_sigma_px)
        explanation = cheapest_explanation(costs)
        unexplained = rows.valid & (explanation.edge_costs[: len(rows.valid)] >= COST_OF_AN_EDGE)
        if not is_needed(rows, unexplained, len(explanation.chosen)):
            break
    refined = refine(pool, explanation.chosen, rows, predicted)
    first_of_camera = np.cumsum(shadow_counts) - shadow_counts
    return _contacts(seeing, kept, first_of_camera, everything, pool, explanation, refined)
