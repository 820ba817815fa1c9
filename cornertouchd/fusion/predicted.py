"""Predicted discs: each touch that is followed proposes to be still there, near where it should be.

Such a disc may stand where no cell's edges fix one: behind others in most cameras, where only what
is known from before keeps it apart from them, or in the light of a camera that lost its shadow.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.candidates import solve_disc
from cornertouchd.fusion.cells import DiscBounds
from cornertouchd.fusion.edge_rows import (
    GATE_SIGMAS,
    NO_SHADOW,
    EdgeRows,
    is_in_view,
    row_of_three,
    shadow_at,
    slack_of,
    variance_of,
)
from cornertouchd.fusion.pool import Pool, is_possible, write_misfits
from cornertouchd.model import FloatArray

# A finger that is not where it should be by nearly five sigmas is another one.
LARGEST_COST_OF_INNOVATION = 12.0
# Edges are sought around the prediction first, then around the fit to those that were found.
FITS = 3
# Fewer do not tell that the touch is there at all.
FEWEST_CAMERAS_THAT_SHOW_IT = 2
# Minus the logarithm of 1 in 400: how often a camera misses a shadow.  3 and 9 do as well.
COST_OF_A_MISSED_SHADOW = 6.0


class PredictedDiscs(NamedTuple):
    """`Predictions` for compiled functions."""

    discs: FloatArray
    position_variances_mm2: FloatArray
    radius_variances_mm2: FloatArray
    costs: FloatArray


@borrowing
def add_predicted(
    rows: EdgeRows, predicted: PredictedDiscs, bounds: DiscBounds, pool: Pool, count: int
) -> int:
    """Add those predicted discs that the shadows allow to the pool, which holds `count`.

    Returns how many are in it then.
    """
    for number in range(len(predicted.costs)):
        if count < len(pool.own) and _add_one(rows, predicted, number, bounds, pool, count):
            count += 1
    return count


@borrowing
def _add_one(
    rows: EdgeRows,
    predicted: PredictedDiscs,
    number: int,
    bounds: DiscBounds,
    pool: Pool,
    place: int,
) -> bool:
    position_variance = predicted.position_variances_mm2[number]
    radius_variance = predicted.radius_variances_mm2[number]
    expected_x, expected_y, expected_radius = row_of_three(predicted.discs, number)
    pool.discs[place, 0], pool.discs[place, 1] = expected_x, expected_y
    pool.discs[place, 2] = expected_radius
    if not (
        np.isfinite(expected_x + expected_y + expected_radius)
        and 0.0 < position_variance < np.inf
        and 0.0 < radius_variance < np.inf
    ):
        return False
    spread = position_variance + radius_variance
    shown = missed = 0
    for _ in range(FITS):
        shown, missed = _choose_shadows(rows, bounds, pool, place, spread)
        _move_to_edges(rows, predicted, number, bounds, pool, place, spread)
        spread = 0.0
    inside = write_misfits(pool, place, rows, bounds.shape_variance_mm2)
    x, y, radius = row_of_three(pool.discs, place)
    innovation = 0.5 * (
        ((x - expected_x) ** 2 + (y - expected_y) ** 2) / position_variance
        + (radius - expected_radius) ** 2 / radius_variance
    )
    pool.own[place] = predicted.costs[number] + innovation + COST_OF_A_MISSED_SHADOW * missed
    pool.prediction[place] = number
    return (
        inside
        and innovation <= LARGEST_COST_OF_INNOVATION
        and is_possible(bounds, x, y, radius)
        and shown >= FEWEST_CAMERAS_THAT_SHOW_IT
    )


@borrowing
def _choose_shadows(
    rows: EdgeRows, bounds: DiscBounds, pool: Pool, place: int, spread_mm2: float
) -> tuple[int, int]:
    """Choose each camera's nearest shadow, or none where the disc lies wholly beside it.

    `spread_mm2` is how uncertain the disc's own outline is.  Returns how many cameras show the disc
    and how many look at it and do not.
    """
    lines, first_shadow = rows.lines, rows.first_shadow
    x, y, radius = row_of_three(pool.discs, place)
    shown = missed = 0
    for camera in range(len(rows.eyes)):
        shadow = shadow_at(rows.eyes, rows.shadows, first_shadow, camera, x, y)
        behind = slack_of(lines, 2 * shadow + 1, x, y, 0.0)
        if shadow + 1 < first_shadow[camera + 1] and behind < min(
            0.0, slack_of(lines, 2 * shadow + 2, x, y, 0.0)
        ):
            shadow += 1
        variance = variance_of(rows.eyes, rows.shadows, camera, shadow, x, y)
        sigma = np.sqrt(variance + bounds.shape_variance_mm2 + spread_mm2)
        overlap = 2.0 * radius + min(
            slack_of(lines, 2 * shadow, x, y, radius),
            slack_of(lines, 2 * shadow + 1, x, y, radius),
        )
        is_beside = overlap < -GATE_SIGMAS * sigma
        pool.shadows[place, camera] = NO_SHADOW if is_beside else shadow
        shown += int(not is_beside)
        missed += int(is_beside and is_in_view(rows.eyes, rows.views, camera, x, y))
    return shown, missed


@borrowing
def _move_to_edges(
    rows: EdgeRows,
    predicted: PredictedDiscs,
    number: int,
    bounds: DiscBounds,
    pool: Pool,
    place: int,
    spread_mm2: float,
) -> None:
    """Fit the disc to the prediction, the edges near it and those that it protrudes over."""
    x, y, radius = row_of_three(pool.discs, place)
    xx = yy = 1.0 / predicted.position_variances_mm2[number]
    rr = 1.0 / predicted.radius_variances_mm2[number]
    x_moment, y_moment = xx * predicted.discs[number, 0], yy * predicted.discs[number, 1]
    r_moment = rr * predicted.discs[number, 2]
    xy = xr = yr = 0.0
    for camera in range(len(rows.eyes)):
        shadow = pool.shadows[place, camera]
        if shadow == NO_SHADOW:
            continue
        variance = variance_of(rows.eyes, rows.shadows, camera, shadow, x, y)
        variance += bounds.shape_variance_mm2
        weight = 1.0 / variance
        gate = GATE_SIGMAS * np.sqrt(variance + spread_mm2)
        for edge in range(2 * shadow, 2 * shadow + 2):
            if not rows.valid[edge] or slack_of(rows.lines, edge, x, y, radius) >= gate:
                continue
            nx, ny, h = row_of_three(rows.lines, edge)
            xx += weight * nx * nx
            xy += weight * nx * ny
            yy += weight * ny * ny
            xr -= weight * nx
            yr -= weight * ny
            rr += weight
            x_moment += weight * nx * h
            y_moment += weight * ny * h
            r_moment -= weight * h
    solve_disc((xx, xy, xr, yy, yr, rr), (x_moment, y_moment, r_moment), pool.discs, place)
