"""The paper's vanishing-point method, from reference points (section 6.1.2)."""

import numpy as np

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.error_map import map_from_line_sigmas
from cornertouchd.calibration.fitted import Fitted, distances_mm, line_sigma_mm
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.locating.vanishing_point import (
    FREEDOM,
    DegeneratePointsError,
    Projection,
    solve_projection,
)


def fit_vanishing_points(given: ReferenceTouches) -> Fitted:
    """Fit a projection to every camera (Wang et al. 2011, section 6.1.2)."""
    touches = given.touches
    models: list[Projection] = []
    residuals = []
    for camera, columns in zip(given.formats, touches.columns_px, strict=True):
        centres = np.where(touches.known, columns.mean(axis=1), np.nan)
        seen = np.isfinite(centres)
        try:
            models.append(solve_projection(touches.points_mm[seen], centres[seen]))
        except DegeneratePointsError as error:
            raise CalibrationError(f"camera {camera}: {error}") from None
        residuals.append(distances_mm(models[-1], touches.points_mm, centres))
    residuals_mm = np.array(residuals)
    sigmas_mm = np.array([line_sigma_mm(one, FREEDOM) for one in residuals])
    return Fitted(
        tuple(models),
        residuals_mm,
        np.zeros(residuals_mm.shape, bool),
        map_from_line_sigmas(given.surface_mm, models, sigmas_mm),
    )
