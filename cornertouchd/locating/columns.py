"""The other way round: place on the surface -> column of a picture, for any camera model."""

import numpy as np

from cornertouchd.geometry import wrap_angle
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import FloatArray

STEP_PX = 0.5
"""Columns tabulated to invert a model: interpolation is then exact to a thousandth of a column."""


def columns_of_places(model: CameraModel, width_px: int, places_mm: FloatArray) -> FloatArray:
    """Return in which column a camera sees places (P, 2), (P,), NaN where it has no line.

    A model that folds, as a polynomial may beyond the columns it was fitted to, counts as far from
    the picture's middle as its angles run one way.
    """
    columns = np.arange(0.0, width_px + STEP_PX, STEP_PX)
    angles = model.angles_rad(columns)
    known = np.isfinite(angles)
    if np.count_nonzero(known) < 2:
        return np.full(len(places_mm), np.nan)
    columns, angles = _one_way(columns[known], np.unwrap(angles[known]))
    away = places_mm - model.position_mm
    middle = float(np.median(angles))
    wanted = middle + wrap_angle(np.arctan2(away[:, 1], away[:, 0]) - middle)
    order = np.argsort(angles)
    seen: FloatArray = np.interp(wanted, angles[order], columns[order], left=np.nan, right=np.nan)
    return seen


def _one_way(columns: FloatArray, angles: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the part around the middle in which the angles only rise, or only fall."""
    steps = np.diff(angles)
    middle = len(steps) // 2
    folds = np.flatnonzero(~(steps * np.sign(steps[middle]) > 0.0))
    first = folds[folds < middle].max(initial=-1) + 1
    last = folds[folds > middle].min(initial=len(steps))
    return columns[first : last + 1], angles[first : last + 1]
