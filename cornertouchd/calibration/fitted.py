"""What every calibration method gives, and what they share."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import Model
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.calibration.touch_columns import SHAPE_SIGMA_MM
from cornertouchd.geometry import normals, unit_vectors
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import BoolArray, FloatArray

SMALLEST_SHARE_KEPT = 0.8
"""A person misses one tap in ten at worst; wrong reference points, or some in a wrong order, lose
half of them and more."""


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


def rms(values: FloatArray) -> float:
    """Return the RMS of what is not NaN, NaN if all is."""
    known = values[~np.isnan(values)]
    return float(np.sqrt(np.mean(known**2))) if known.size else float("nan")


def line_sigma_mm(residuals_mm: FloatArray, parameters: int) -> float:
    """Return by how much lines pass by new touches (RMS), from those that they were fitted to.

    Residuals are too small by the `parameters` of the fit that followed them; NaN are not counted.
    NaN if there are no more of them than parameters: lines through all of their points tell nothing
    about others.  Never less than what is left because a finger is not a disc.
    """
    count = int(np.count_nonzero(~np.isnan(residuals_mm)))
    if count <= parameters:
        return float("nan")
    return max(SHAPE_SIGMA_MM, rms(residuals_mm) * float(np.sqrt(count / (count - parameters))))
