"""The directing lines of one camera as a table, one angle a column: any method, one speed.

Between two columns the angle runs straight; a lens bends it there by less than 1e-6 rad.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import compiled, inlined
from cornertouchd.geometry import is_in_view
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import BoolArray, DirectingLines, FloatArray, Shadows

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class LineTable:
    """The lines of a camera at (x_mm, y_mm): `angles_rad` (width_px + 1,) at columns 0, 1, 2, ...

    NaN where the method that calibrated the camera has no line.  `view_rad` are the smallest and
    the largest angle of its first and last line.
    """

    camera: str
    x_mm: float
    y_mm: float
    angles_rad: FloatArray
    view_rad: tuple[float, float]

    def lay(self, shadows: Shadows, edge_sigma_px: float) -> DirectingLines:
        """Lay shadows on the surface.

        Where there is no line for an edge, the edge is not valid and the shadow reaches as far as
        there are lines.  A shadow without any line is left out.
        """
        lines, valid, edges = _lay(shadows.edges_px, shadows.valid, self.angles_rad, edge_sigma_px)
        first, centre, last, sigma = lines
        first_valid, last_valid = valid
        return DirectingLines(
            self.camera,
            self.x_mm,
            self.y_mm,
            first,
            centre,
            last,
            first_valid,
            last_valid,
            sigma,
            self.view_rad,
            edges,
        )

    def sees(self, x_mm: float, y_mm: float) -> bool:
        """Tell whether a place is in view: between the lines of the first and the last column."""
        return is_in_view(x_mm, y_mm, (self.x_mm, self.y_mm), self.view_rad)


def tabulate(camera: str, model: CameraModel, width_px: int) -> LineTable:
    """Return the table of a calibrated camera."""
    angles = model.angles_rad(np.arange(width_px + 1, dtype=np.float64))
    return LineTable(camera, *model.position_mm, np.ascontiguousarray(angles), _view(angles))


def _view(angles_rad: FloatArray) -> tuple[float, float]:
    """Return the bounds of a table of angles; those of a camera upside down descend.

    A table without any line sees nothing.
    """
    lines = angles_rad[np.isfinite(angles_rad)]
    if not len(lines):
        return 0.0, 0.0
    first, last = sorted((float(lines[0]), float(lines[-1])))
    return first, last


@inlined
def _angle(table: FloatArray, column: float) -> float:
    below = min(max(int(column), 0), len(table) - 1)
    if column == below:  # the next one may have no line
        return float(table[below])
    below = min(below, len(table) - 2)
    return float(table[below] + (column - below) * (table[below + 1] - table[below]))


@compiled("Tuple((f8[:,:], b1[:,:], i8[:,:]))(f8[:,::1], b1[:,::1], f8[::1], f8)")
def _lay(
    edges_px: FloatArray, edge_valid: BoolArray, table: FloatArray, edge_sigma_px: float
) -> tuple[FloatArray, BoolArray, IntArray]:
    """Return first, centre and last angle and sigma (4, K), and which ends are valid (2, K).

    And which edges of the picture they are (2, K): a left one has twice the number of its shadow.
    Ordered by first angle; a camera that hangs upside down counts its columns against the angle.
    """
    lines = np.empty((4, len(edges_px)))
    valid = np.empty((2, len(edges_px)), np.bool_)
    edges = np.empty((2, len(edges_px)), np.intp)
    count = 0
    for shadow in range(len(edges_px)):
        left, right = edges_px[shadow, 0], edges_px[shadow, 1]
        left_valid, right_valid = edge_valid[shadow, 0], edge_valid[shadow, 1]
        if math.isnan(_angle(table, left)):
            left_valid = False
            left = math.ceil(left)
            while left < right and math.isnan(_angle(table, left)):
                left += 1.0
        if math.isnan(_angle(table, right)):
            right_valid = False
            right = math.floor(right)
            while right > left and math.isnan(_angle(table, right)):
                right -= 1.0
        if left >= right:
            continue
        centre = 0.5 * (left + right)
        first, last = _angle(table, left), _angle(table, right)
        slope = _angle(table, centre + 0.5) - _angle(table, centre - 0.5)
        if math.isnan(slope):  # the middle of a shadow lies in a gap of the model
            slope = (last - first) / (right - left)
        begins = 0
        if first > last:
            first, last = last, first
            left_valid, right_valid = right_valid, left_valid
            begins = 1
        place = count
        while place > 0 and lines[0, place - 1] > first:
            for row in range(4):
                lines[row, place] = lines[row, place - 1]
            valid[0, place], valid[1, place] = valid[0, place - 1], valid[1, place - 1]
            edges[0, place], edges[1, place] = edges[0, place - 1], edges[1, place - 1]
            place -= 1
        lines[0, place], lines[1, place] = first, _angle(table, centre)
        lines[2, place], lines[3, place] = last, abs(slope) * edge_sigma_px
        valid[0, place], valid[1, place] = left_valid, right_valid
        edges[0, place], edges[1, place] = 2 * shadow + begins, 2 * shadow + 1 - begins
        count += 1
    return lines[:, :count], valid[:, :count], edges[:, :count]
