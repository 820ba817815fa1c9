"""From shadows to the discs that explain them most cheaply: the whole of it, compiled."""

from math import tanh

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
from cornertouchd.fusion.remaining import LEAST_SAVING, remaining_costs
from cornertouchd.fusion.rescue import (
    FEWEST_EDGES,
    cameras_to_believe,
    is_needed,
    keep_rescued,
)
from cornertouchd.fusion.selection import LEAST_MARGIN, Explanation, cheapest_explanation
from cornertouchd.model import BoolArray, FloatArray

# Fitted to 10 000 contacts in crowded scenes (15 on 350x400, hands, three cameras): of those with
# margins about 0, 1, 3, 5, 7 and 10, the shares .59, .86, .84, .94, .99 and .99 were real.
MARGIN_SCALE = 3.6

OWN_EDGES, CAMERAS, PREDICTION = range(3)
"""Rows of what is counted of contacts."""

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
) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    chosen = explanation.chosen
    measured, supports = np.empty((len(chosen), 5)), np.empty(len(chosen))
    counted = np.zeros((3, len(chosen)), np.intp)
    edges = np.full((len(chosen), len(first_of_camera), 2), -1, np.intp)
    count = 0
    for place in range(len(chosen)):
        margin, prediction = explanation.margins[place], pool.prediction[chosen[place]]
        if margin < LEAST_MARGIN and prediction < 0:
            continue
        x, y, radius = row_of_three(refined.discs, place)
        measured[count, 0] = min(max(x, 0.0), bounds.width_mm)
        measured[count, 1] = min(max(y, 0.0), bounds.height_mm)
        measured[count, 2] = 2.0 * radius
        measured[count, 3] = tanh(margin / MARGIN_SCALE)
        measured[count, 4] = refined.sigma_mm[place]
        supports[count] = margin + pool.own[chosen[place]]
        counted[PREDICTION, count] = prediction
        for row in range(refined.owned.shape[1]):
            if refined.owned[place, row]:
                counted[OWN_EDGES, count] += 1
                camera = seeing[row // 2]
                counted[CAMERAS, count] |= 1 << camera
                shadow = kept[pool.shadows[chosen[place], row // 2]]
                edges[count, camera, row % 2] = shadow - first_of_camera[camera]
        count += 1
    return measured[:count], supports[:count], counted[:, :count], edges[:count]


@compiled(
    "Tuple((f8[:,::1], f8[::1], i8[:,:], i8[:,:,::1]))(f8[:,::1], i8[::1], f8[::1], f8[::1],"
    " b1[::1], b1[::1], f8[::1], f8, f8, f8, f8, f8, f8, b1, f8[:,::1], f8[::1], f8[::1], f8[::1])"
)
def explain(
    cameras: FloatArray,
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
) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    """Return N contacts: what is measured (N, 5), supports (N,), counted (3, N), edges (N, C, 2).

    Measured are x, y, the diameter, the confidence, and the sigma of the position.  Counted are how
    many edges a contact owns, the cameras of which it owns one, as bits, and the number of the
    prediction that it continues, or -1; supports and edges are those of `Crossed`.  `cameras` (C,
    4) holds x, y, and the first and the last angle of the view, the other arguments are those of
    `Sightings`, `DiscLimits` and `Predictions`; `is_followed` tells whether touches are followed,
    though there may be none yet.
    """
    rows, seeing, kept = edge_rows(
        Sightings(
            cameras[:, :2],
            cameras[:, 2:],
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
        return (
            np.empty((0, 5)),
            np.empty(0),
            np.empty((3, 0), np.intp),
            np.empty((0, len(shadow_counts), 2), np.intp),
        )
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
    nothing = np.zeros(len(rows.shadows))
    for stage in (FINGERS, PENS, MISSED):
        if stage == PENS and smallest_radius_mm >= smallest_finger_mm:
            continue
        if stage == MISSED:
            camera_sets = cameras_to_believe(len(seeing))
            for number in range(len(camera_sets)):  # so that all rows are known to be contiguous
                wanted = Wanted(camera_sets[number], unexplained, FEWEST_EDGES, nothing, 0.0)
                price = cost + COST_OF_A_MISSED_SHADOW
                count = _search(rows, wanted, everything, pool, count, price)
        else:
            bounds = fingers if stage == FINGERS else everything
            # touches that are followed find room even when broken strips fill the pool
            count = add_predicted(rows, predicted, everything, pool, 0)
            savings, least_saving = nothing, 0.0
            if stage == FINGERS and count > 0:
                savings = remaining_costs(rows, pool, count, edge_sigma_px)
                least_saving = LEAST_SAVING
            wanted = Wanted(np.full(len(seeing), True), unexplained, 0, savings, least_saving)
            count = _search(rows, wanted, bounds, pool, count, cost)
        costs = costs_of(pool, count, rows, edge_sigma_px)
        explanation = cheapest_explanation(costs)
        unexplained = rows.valid & (explanation.edge_costs[: len(rows.valid)] >= COST_OF_AN_EDGE)
        if not is_needed(rows, unexplained, len(explanation.chosen)):
            break
    refined = refine(pool, explanation.chosen, rows, predicted)
    first_of_camera = np.cumsum(shadow_counts) - shadow_counts
    return _contacts(seeing, kept, first_of_camera, everything, pool, explanation, refined)
