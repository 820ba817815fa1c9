"""What every locating method gives: for each column the directing line through it."""

from typing import Protocol

from cornertouchd.model import FloatArray


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
