"""Refinement: place each chosen contact as exactly as the edges that it owns allow.

A finger's section is rather an ellipse than a disc.  Its tangent in the direction of angle t lies
r + a cos 2t + b sin 2t from the centre, to first order, which keeps the equations linear.
"""

from dataclasses import dataclass

import numpy as np

from cornertouchd.fusion.candidates import LARGEST_POSITION_SIGMA_MM
from cornertouchd.fusion.crossed import Predictions
from cornertouchd.fusion.pool import FINGER_RADII_MM, SIZE_SIGMA_MM
from cornertouchd.fusion.refinement import (
    ELLIPSE_SIGMA_MM,
    OUTLINE_SIGMA_MM,
    RADIUS_SIGMA_OF_A_TOUCH_MM,
)
from cornertouchd.model import BoolArray, FloatArray
from oracle.candidates import Candidates

# How well x, y, r and the two terms of the ellipse are known beforehand, as 1 / sigma**2.  The
# prior of the position holds a contact that owns too few edges to be placed by them.
PRIOR_WEIGHTS = (
    np.array(
        [
            LARGEST_POSITION_SIGMA_MM,
            LARGEST_POSITION_SIGMA_MM,
            SIZE_SIGMA_MM,
            ELLIPSE_SIGMA_MM,
            ELLIPSE_SIGMA_MM,
        ]
    )
    ** -2.0
)


@dataclass(frozen=True, slots=True)
class RefinedDiscs:
    """N contacts: discs (N, 3) as x, y, r, sigma of the position (N,), edges owned (N, 2 C)."""

    discs: FloatArray
    sigma_mm: FloatArray
    owned: BoolArray


def refine(chosen: Candidates, edge_count: int, predictions: Predictions) -> RefinedDiscs:
    """Fit an ellipse to the edges that each chosen disc owns; `edge_count` is that of all rows."""
    owned = _owned_edges(chosen, edge_count)
    start, rows = chosen.discs, chosen.rows
    twice = 2.0 * np.arctan2(rows.normals[:, :, 1], rows.normals[:, :, 0])
    design = np.stack(
        [
            rows.normals[:, :, 0],
            rows.normals[:, :, 1],
            np.full(twice.shape, -1.0),
            -np.cos(twice),
            -np.sin(twice),
        ],
        axis=2,
    )
    _, sigma = rows.slacks(start, OUTLINE_SIGMA_MM)
    weighted = design * (owned / sigma**2)[:, :, None]
    expected, weights = _priors(chosen, predictions)
    information = np.einsum("nmi,nmj->nij", weighted, design) + weights[:, :, None] * np.eye(5)
    moments = np.einsum("nmi,nm->ni", weighted, rows.offsets_mm) + weights * expected
    covariance = np.linalg.inv(information)
    refined = np.einsum("nij,nj->ni", covariance, moments)
    sigma_mm = np.sqrt(np.max(covariance[:, (0, 1), (0, 1)], axis=1))
    return RefinedDiscs(discs=refined[:, :3], sigma_mm=sigma_mm, owned=owned)


def _owned_edges(chosen: Candidates, edge_count: int) -> BoolArray:
    """Give each edge to the disc that touches it best.

    Lending it to a second one that fits nearly as well spoils that one's place: RMSE of ten
    contacts .42 mm instead of .36.
    """
    misfit = np.where(chosen.tangent, np.abs(chosen.z), np.inf)
    least = np.full(edge_count, np.inf)
    np.minimum.at(least, chosen.rows.edges, misfit)
    owned: BoolArray = chosen.tangent & (misfit <= least[chosen.rows.edges])
    return owned


def _priors(chosen: Candidates, predictions: Predictions) -> tuple[FloatArray, FloatArray]:
    """Return what to expect of x, y, r and the two terms of the ellipse, and 1 / sigma**2."""
    expected = np.zeros((len(chosen), 5))
    expected[:, :2] = chosen.discs[:, :2]
    expected[:, 2] = np.clip(chosen.discs[:, 2], *FINGER_RADII_MM)
    weights = np.tile(PRIOR_WEIGHTS, (len(chosen), 1))
    known = np.flatnonzero(chosen.prediction >= 0)
    number = chosen.prediction[known]
    expected[known, :3] = predictions.discs[number]
    weights[known, :2] = 1.0 / predictions.position_variances_mm2[number, None]
    weights[known, 2] = RADIUS_SIGMA_OF_A_TOUCH_MM**-2
    return expected, weights
