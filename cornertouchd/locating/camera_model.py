"""What every locating method gives: for each column the directing line through it."""

from typing import Protocol

import numpy as np

from cornertouchd.model import DirectingLines, FloatArray, Shadow

SAMPLES = 65
"""Columns tried across a shadow where a model lacks the line of an edge; one a column or two."""


class CameraModel(Protocol):
    """Column -> directing line, for one camera in its place."""

    @property
    def position_mm(self) -> tuple[float, float]:
        """The projection centre on the surface, x and y."""
        ...

    def angles_rad(self, columns_px: FloatArray) -> FloatArray:
        """Return the angles of the directing lines of columns, NaN where the method has none."""
        ...

    def slopes_rad_px(self, columns_px: FloatArray) -> FloatArray:
        """Return how fast the angle changes with the column, radians per pixel."""
        ...


def lay_shadows(
    camera: str, shadows: tuple[Shadow, ...], model: CameraModel, edge_sigma_px: float
) -> DirectingLines:
    """Lay the shadows of one camera on the surface.

    Where the model has no line for an edge, the edge is not valid and the shadow reaches as far as
    the model's lines do.  A shadow without any line is left out.
    """
    columns = np.array([(s.left_px, s.right_px) for s in shadows]).reshape(-1, 2)
    valid = np.array([(s.left_valid, s.right_valid) for s in shadows], bool).reshape(-1, 2)
    angles = model.angles_rad(columns)
    if not np.isfinite(angles).all():
        valid &= np.isfinite(angles)
        columns = _within_lines(columns, model)
        known = columns[:, 0] < columns[:, 1]
        columns, valid = columns[known], valid[known]
        angles = model.angles_rad(columns)
    centres = columns.mean(axis=1)
    slopes = np.abs(model.slopes_rad_px(centres))
    if not np.isfinite(slopes).all():  # the middle of a shadow lies in a gap of the model
        mean_slopes = np.abs(np.diff(angles, axis=1) / np.diff(columns, axis=1))[:, 0]
        slopes = np.where(np.isfinite(slopes), slopes, mean_slopes)
    # a camera that hangs upside down counts its columns against the angle
    ends = np.argsort(angles, axis=1)
    angles = np.take_along_axis(angles, ends, axis=1)
    valid = np.take_along_axis(valid, ends, axis=1)
    order = np.argsort(angles[:, 0])
    angles, valid = angles[order], valid[order]
    x_mm, y_mm = model.position_mm
    return DirectingLines(
        camera,
        x_mm,
        y_mm,
        first_rad=angles[:, 0],
        centre_rad=model.angles_rad(centres)[order],
        last_rad=angles[:, 1],
        first_valid=valid[:, 0],
        last_valid=valid[:, 1],
        sigma_rad=(slopes * edge_sigma_px)[order],
    )


def _within_lines(columns_px: FloatArray, model: CameraModel) -> FloatArray:
    """Return the first and last column (K, 2) of each shadow that have a line, the same if none."""
    tried = np.linspace(columns_px[:, 0], columns_px[:, 1], SAMPLES, axis=1)
    has_line = np.isfinite(model.angles_rad(tried))
    first = np.argmax(has_line, axis=1)
    last = SAMPLES - 1 - np.argmax(has_line[:, ::-1], axis=1)
    last = np.where(has_line.any(axis=1), last, first)
    return np.take_along_axis(tried, np.stack([first, last], axis=1), axis=1)
