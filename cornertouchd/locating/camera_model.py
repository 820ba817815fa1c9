"""What every locating method gives: for each column the directing line through it."""

from typing import Protocol

import numpy as np

from cornertouchd.model import DirectingLines, FloatArray, Shadow


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
    """Lay the shadows of one camera on the surface."""
    columns = np.array([(s.left_px, s.right_px) for s in shadows]).reshape(-1, 2)
    valid = np.array([(s.left_valid, s.right_valid) for s in shadows], bool).reshape(-1, 2)
    centres = columns.mean(axis=1)
    angles = model.angles_rad(columns)
    slopes = np.abs(model.slopes_rad_px(centres))
    valid = valid & np.isfinite(angles)
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
