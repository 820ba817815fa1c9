"""The directing lines of one camera as a table, one angle a column: any method, one speed.

Between two columns the angle runs straight; a lens bends it there by less than 1e-6 rad.
"""

from dataclasses import dataclass

import numpy as np

from cornertouchd.compiling import compiled, inlined
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import BoolArray, DirectingLines, FloatArray, Shadows


@dataclass(frozen=True, slots=True, eq=False)
class LineTable:
    """The lines of a camera at (x_mm, y_mm): `angles_rad` (width_px + 1,) at columns 0, 1, 2, ...

    NaN where the method that calibrated the camera has no line.
    """

    camera: str
    x_mm: float
    y_mm: float
    angles_rad: FloatArray

    def lay(self, shadows: Shadows, edge_sigma_px: float) -> DirectingLines:
        """Lay shadows on the surface.

        Where there is no line for an edge, the edge is not valid and the shadow reaches as far as
        there are lines.  A shadow without any line is left out.
        """
        angles, valid, slopes = _lay(shadows.edges_px, shadows.valid, self.angles_rad)
        return DirectingLines(
            self.camera,
            self.x_mm,
            self.y_mm,
            first_rad=angles[0],
            centre_rad=angles[1],
            last_rad=angles[2],
            first_valid=valid[0],
            last_valid=valid[1],
            sigma_rad=slopes * edge_sigma_px,
        )


def tabulate(camera: str, model: CameraModel, width_px: int) -> LineTable:
    """Return the table of a calibrated camera."""
    angles = model.angles_rad(np.arange(width_px + 1, dtype=np.float64))
    return LineTable(camera, *model.position_mm, np.ascontiguousarray(angles))


@inlined
def _angle(table: FloatArray, column: float) -> float:
    below = min(max(int(column), 0), len(table) - 1)
    if column == below:  # the next one may have no line
        return float(table[below])
    below = min(below, len(table) - 2)
    return float(table[below] + (column - below) * (table[below + 1] - table[below]))


@compiled("Tuple((f8[:,::1], b1[:,::1], f8[::1]))(f8[:,::1], b1[:,::1], f8[::1])")
def _lay(
    edges_px: FloatArray, edge_valid: BoolArray, table: FloatArray
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Return first, centre and last angle (3, K), which of the ends are valid (2, K), slopes (K,).

    Ordered by first angle; a camera that hangs upside down counts its columns against the angle.
    """
    count = 0
    angles = np.empty((3, len(edges_px)))
    valid = np.empty((2, len(edges_px)), np.bool_)
    slopes = np.empty(len(edges_px))
    for shadow in range(len(edges_px)):
        left, right = edges_px[shadow, 0], edges_px[shadow, 1]
        left_valid, right_valid = edge_valid[shadow, 0], edge_valid[shadow, 1]
        if np.isnan(_angle(table, left)):
            left_valid = False
            left = np.ceil(left)
            while left < right and np.isnan(_angle(table, left)):
                left += 1.0
        if np.isnan(_angle(table, right)):
            right_valid = False
            right = np.floor(right)
            while right > left and np.isnan(_angle(table, right)):
                right -= 1.0
        if left >= right:
            continue
        centre = 0.5 * (left + right)
        first, last = _angle(table, left), _angle(table, right)
        slope = _angle(table, centre + 0.5) - _angle(table, centre - 0.5)
        if np.isnan(slope):  # the middle of a shadow lies in a gap of the model
            slope = (last - first) / (right - left)
        if first > last:
            first, last = last, first
            left_valid, right_valid = right_valid, left_valid
        place = count
        while place > 0 and angles[0, place - 1] > first:
            angles[:, place], slopes[place] = angles[:, place - 1], slopes[place - 1]
            valid[:, place] = valid[:, place - 1]
            place -= 1
        angles[0, place], angles[1, place], angles[2, place] = first, _angle(table, centre), last
        valid[0, place], valid[1, place] = left_valid, right_valid
        slopes[place] = abs(slope)
        count += 1
    return angles[:, :count].copy(), valid[:, :count].copy(), slopes[:count].copy()
