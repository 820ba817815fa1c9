"""Predicted discs: each touch that is followed proposes to be still there."""

from dataclasses import dataclass, replace

import numpy as np

from cornertouchd.fusion.crossed import IntArray, Predictions
from cornertouchd.fusion.edge_rows import GATE_SIGMAS
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.fusion.predicted import (
    COST_OF_A_MISSED_SHADOW,
    FEWEST_CAMERAS_THAT_SHOW_IT,
    FITS,
    LARGEST_COST_OF_INNOVATION,
)
from cornertouchd.geometry import angles_and_distances
from cornertouchd.model import BoolArray, FloatArray
from oracle.candidates import Candidates
from oracle.cells import CellRows, rows_of_cells, shadows_at
from oracle.edge_rows import EdgeRows


def predicted_candidates(
    rows: EdgeRows, predictions: Predictions, limits: DiscLimits
) -> list[Candidates]:
    """Return those predicted discs that the shadows allow, each on its own."""
    proposed = (_proposed(rows, predictions, number, limits) for number in range(len(predictions)))
    return [candidate for candidate in proposed if candidate is not None]


@dataclass(frozen=True, slots=True)
class _Prior:
    disc: FloatArray
    variances: FloatArray


def _proposed(
    rows: EdgeRows, predictions: Predictions, number: int, limits: DiscLimits
) -> Candidates | None:
    prior = _Prior(
        predictions.discs[number],
        np.array(
            [
                predictions.position_variances_mm2[number],
                predictions.position_variances_mm2[number],
                predictions.radius_variances_mm2[number],
            ]
        ),
    )
    if not (
        np.all(np.isfinite(prior.disc))
        and np.all((prior.variances > 0.0) & np.isfinite(prior.variances))
    ):
        return None
    disc, spread_mm2 = prior.disc, prior.variances[0] + prior.variances[2]
    for _ in range(FITS):
        cell, beside = _cell_at(rows, disc, spread_mm2, limits)
        missed = beside & rows.in_view(disc[None, :2])[0]
        disc = _fitted(cell, beside, disc, spread_mm2, prior, limits)
        spread_mm2 = 0.0
    slack, sigma = cell.slacks(disc[None], limits.shape_sigma_mm)
    void = np.repeat(beside, 2)
    room = np.where(cell.valid, slack, slack + 2.0 * disc[2])[0]
    innovation = 0.5 * float(np.sum((disc - prior.disc) ** 2 / prior.variances))
    possible = (
        np.all((room >= -GATE_SIGMAS * sigma[0]) | void)
        and innovation <= LARGEST_COST_OF_INNOVATION
        and limits.smallest_radius_mm < disc[2] < limits.largest_radius_mm
        and limits.on_surface(disc[:2])
        and np.count_nonzero(~beside) >= FEWEST_CAMERAS_THAT_SHOW_IT
    )
    if not possible:
        return None
    cost = (
        predictions.costs[number] + innovation + COST_OF_A_MISSED_SHADOW * np.count_nonzero(missed)
    )
    valid = cell.valid & ~void
    return Candidates(
        discs=disc[None],
        rows=replace(cell, valid=valid),
        z=slack / sigma,
        tangent=(np.abs(slack) < GATE_SIGMAS * sigma) & valid,
        position_sigma_mm=np.zeros(1),
        own=np.array([cost]),
        prediction=np.array([number]),
    )


def _cell_at(
    rows: EdgeRows, disc: FloatArray, spread_mm2: float, limits: DiscLimits
) -> tuple[CellRows, BoolArray]:
    """Return the nearest shadow of each camera, and where the disc lies wholly beside it, (C,)."""
    angles, _ = angles_and_distances(disc[None, :2], rows.positions_mm)
    shadows = shadows_at(rows, rows.unwrap(angles))[0]
    for camera, shadow in enumerate(shadows):
        if shadow + 1 < rows.first_shadow[camera + 1]:
            behind, before = _slacks_of_centre(rows, disc, np.array([[shadow, 1], [shadow + 1, 0]]))
            shadows[camera] += behind < min(0.0, before)
    cell = rows_of_cells(rows, shadows[None])
    slack, sigma = cell.slacks(disc[None], limits.shape_sigma_mm)
    sigma = np.sqrt(sigma**2 + spread_mm2)
    beside = slack + 2.0 * disc[2] < -GATE_SIGMAS * sigma
    beside_shadow: BoolArray = np.any(beside.reshape(-1, 2), axis=1)
    return cell, beside_shadow


def _slacks_of_centre(rows: EdgeRows, disc: FloatArray, edges: IntArray) -> FloatArray:
    shadow, side = edges.T
    slacks: FloatArray = rows.normals[shadow, side] @ disc[:2] - rows.offsets_mm[shadow, side]
    return slacks


def _fitted(
    cell: CellRows,
    beside: BoolArray,
    disc: FloatArray,
    spread_mm2: float,
    prior: _Prior,
    limits: DiscLimits,
) -> FloatArray:
    """Return the disc that fits the prediction, the edges near it and those it protrudes over."""
    slack, sigma = cell.slacks(disc[None], limits.shape_sigma_mm)
    used = cell.valid & (slack < GATE_SIGMAS * np.sqrt(sigma**2 + spread_mm2))
    used &= ~np.repeat(beside, 2)
    weights = (used / sigma**2)[0]
    design = np.column_stack([cell.normals[0], np.full(len(weights), -1.0)])
    information = design.T @ (design * weights[:, None]) + np.diag(1.0 / prior.variances)
    moments = design.T @ (weights * cell.offsets_mm[0]) + prior.disc / prior.variances
    fitted: FloatArray = np.linalg.solve(information, moments)
    return fitted
