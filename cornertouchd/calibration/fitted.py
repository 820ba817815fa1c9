"""What every calibration method gives, and what they share."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import Model
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.geometry import normals, unit_vectors
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import BoolArray, FloatArray


@dataclass(frozen=True)
class Fitted:
    """Camera models with what speaks for them; cameras in the order of the reference touches.

    `residuals_mm` (cameras, points) are distances of points from their directing lines, NaN where
    a camera saw nothing or the method has no line.  `dropped` (cameras, points) tells which
    sightings did not fit and were left out.
    """

    models: tuple[Model, ...]
    residuals_mm: FloatArray
    dropped: BoolArray
    expected: ErrorMap


def distances_mm(model: CameraModel, points_mm: FloatArray, columns_px: FloatArray) -> FloatArray:
    """Return how far each point (P, 2) is from the line of its column (P,); NaN where none is.

    A directing line begins at its camera: a point behind it is as far off as it is from the camera.
    """
    angles = np.full(len(points_mm), np.nan)
    seen = np.isfinite(columns_px)
    angles[seen] = model.angles_rad(columns_px[seen])
    away = points_mm - model.position_mm
    off: FloatArray = np.sum(normals(angles) * away, axis=1)
    behind = np.sum(unit_vectors(angles) * away, axis=1) < 0
    return np.where(behind, np.linalg.norm(away, axis=1), off)


def rms(residuals_mm: FloatArray) -> float:
    """Return the RMS of what is not NaN, 0 if all is."""
    return float(np.sqrt(np.nanmean(residuals_mm**2))) if np.isfinite(residuals_mm).any() else 0.0
