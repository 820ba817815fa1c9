"""How far off a touch is expected to be located, place by place over the surface."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.geometry import normals
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.locating.columns import columns_of_places
from cornertouchd.model import FloatArray

COLUMNS, ROWS = 13, 13
"""Places of the map along x and y: errors change smoothly, over a quarter of a side at least."""

INSET_SHARE = 0.02
"""The outermost places lie this share of a side inside the surface, where the last touches are."""

SEEN_BY = 2
"""A place is located by the lines of two cameras at least."""


@dataclass(frozen=True)
class ErrorMap:
    """Expected RMS error of a touch (rows, columns) at `x_mm` (columns,) and `y_mm` (rows,).

    NaN where fewer than two cameras have a directing line.
    """

    x_mm: FloatArray
    y_mm: FloatArray
    errors_mm: FloatArray

    @property
    def rms_mm(self) -> float:
        """RMS over the surface, of the places that can be located."""
        return float(np.sqrt(np.mean(self._located**2))) if self._located.size else np.nan

    @property
    def worst_mm(self) -> float:
        """The largest error of the map."""
        return float(self._located.max()) if self._located.size else np.nan

    @property
    def _located(self) -> FloatArray:
        return self.errors_mm[np.isfinite(self.errors_mm)]


def places_mm(surface_mm: tuple[float, float]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return x (columns,), y (rows,) and all places (rows * columns, 2) of a map."""
    axes = [
        np.linspace(INSET_SHARE * side, (1 - INSET_SHARE) * side, count)
        for side, count in zip(surface_mm, (COLUMNS, ROWS), strict=True)
    ]
    x, y = np.meshgrid(*axes)
    return axes[0], axes[1], np.stack([x.ravel(), y.ravel()], axis=1)


def map_from_line_sigmas(
    surface_mm: tuple[float, float], models: Sequence[CameraModel], sigmas_mm: FloatArray
) -> ErrorMap:
    """Return the errors to expect when directing lines pass by at these distances.

    `sigmas_mm` is (cameras,), the RMS distance of a camera's lines from what they point at, or
    (cameras, places) where it is known place by place; NaN where the camera has no line.
    """
    x_mm, y_mm, places = places_mm(surface_mm)
    sigmas = np.broadcast_to(sigmas_mm.reshape(len(models), -1), (len(models), len(places)))
    normal = np.stack([_normals(model, places) for model in models])
    errors = np.sqrt(np.trace(_position_covariance(normal, sigmas), axis1=1, axis2=2))
    return ErrorMap(x_mm, y_mm, errors.reshape(ROWS, COLUMNS))


def map_from_covariance(
    surface_mm: tuple[float, float],
    models: Sequence[AnglePolynomial],
    covariance: FloatArray,
    touch_sigma: tuple[float, float],
) -> ErrorMap:
    """Return the errors to expect of cameras that were fitted together.

    `covariance` is that of position and coefficients, camera after camera; errors that cameras have
    in common, as when all stand a millimetre too far left, are in it.  `touch_sigma` is how far the
    line of a single touch is off: by so many millimetres, and by so many columns.
    """
    x_mm, y_mm, places = places_mm(surface_mm)
    normal = np.stack([_normals(model, places) for model in models])
    away = np.stack([np.linalg.norm(places - model.position_mm, axis=1) for model in models])
    columns = np.stack([columns_of_places(model, model.width_px, places) for model in models])
    slopes = np.stack([model.slopes_rad_px(u) for model, u in zip(models, columns, strict=True)])
    sigmas = np.hypot(touch_sigma[0], touch_sigma[1] * away * slopes)
    noise = _position_covariance(normal, sigmas)
    sensitivity = []
    for camera, model in enumerate(models):
        pull = np.einsum("pij,pj->pi", noise, normal[camera]) / sigmas[camera, :, None] ** 2
        pull = np.where(np.isfinite(sigmas[camera, :, None]), pull, 0.0)
        w = np.nan_to_num(columns[camera] / (model.width_px / 2) - 1)
        turns = away[camera, :, None] * w[:, None] ** np.arange(len(model.coefficients_rad))
        moves = np.hstack([normal[camera], turns])  # of the line, away from the place
        sensitivity.append(pull[:, :, None] * moves[:, None, :])
    b = np.concatenate(sensitivity, axis=2)
    variances = np.trace(np.einsum("pik,kl,pjl->pij", b, covariance, b) + noise, axis1=1, axis2=2)
    return ErrorMap(x_mm, y_mm, np.sqrt(variances).reshape(ROWS, COLUMNS))


def _normals(model: CameraModel, places_mm: FloatArray) -> FloatArray:
    """Return the unit normals (places, 2) of the lines from the camera to each place."""
    away = places_mm - model.position_mm
    return normals(np.arctan2(away[:, 1], away[:, 0]))


def _position_covariance(normal: FloatArray, sigmas_mm: FloatArray) -> FloatArray:
    """Return the covariance (places, 2, 2) of crossings; NaN where fewer than two lines are known.

    `normal` is (cameras, places, 2), `sigmas_mm` (cameras, places), NaN where there is no line.
    """
    known = np.isfinite(sigmas_mm)
    weights = np.where(known, 1.0 / np.where(known, sigmas_mm, 1.0) ** 2, 0.0)
    a = np.einsum("cp,cpi,cpj->pij", weights, normal, normal)
    located = known.sum(axis=0) >= SEEN_BY
    a[~located] = np.eye(2)
    return np.where(located[:, None, None], np.linalg.inv(a), np.nan)
