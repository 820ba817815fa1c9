"""What corner cameras see of a finger, row by row: outlines found with geometry of the tests' own.

The finger is a row of balls along its axis, and its mirror image another one.  A ray that rises by
`slope` grazes a ball where the cosine of its angle from the ball's bearing is known in closed form.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.geometry import wrap_angle
from cornertouchd.model import BoolArray, FloatArray, Outlines

SURFACE_MM = (350.0, 400.0)
WIDTH_PX = 640
FOCAL_PX = WIDTH_PX / 2.0 / np.tan(np.deg2rad(48.5))
HORIZON_PX = 22.0
STRIP_TOP_MM = 12.6
STRIP_BESIDE_MM = 3.0
CAMERA_MM = 6.0
CORNERS = ((-4.0, -4.0, 45.0), (354.0, -4.0, 135.0), (354.0, 404.0, 225.0), (-4.0, 404.0, 315.0))
LEVELS = np.array([0.88, 0.76, 0.64, 0.52, 0.40, 0.28, 0.17])
LEVELS = np.concatenate([LEVELS, -LEVELS[::-1]])


@dataclass(frozen=True)
class CornerSight:
    """A pinhole camera in a corner; it has all that is asked of a table of heights."""

    x_mm: float
    y_mm: float
    camera_mm: float
    horizon_px: FloatArray
    rows_per_slope_px: FloatArray
    strip_mm: FloatArray
    shear: FloatArray
    angles_rad: FloatArray
    bottom_px: FloatArray
    visible: BoolArray


@dataclass(frozen=True)
class Finger:
    """A finger with a flattened round tip at (x, y); not `round_tip`: a rod cut off flat."""

    x_mm: float
    y_mm: float
    radius_mm: float = 6.0
    lean_rad: float = 0.0
    azimuth_rad: float = 0.0
    pressed_mm: float = 0.6
    taper: float = 0.03
    round_tip: bool = True

    def balls(self) -> tuple[FloatArray, FloatArray]:
        """Return the centres (B, 3) and radii (B,) of the balls."""
        along_mm = np.linspace(0.0, 40.0, 401)
        level = np.sin(self.lean_rad)
        axis = np.array(
            [
                level * np.cos(self.azimuth_rad),
                level * np.sin(self.azimuth_rad),
                np.cos(self.lean_rad),
            ]
        )
        tip = np.array([self.x_mm, self.y_mm, self.radius_mm - self.pressed_mm])
        radii = self.radius_mm + self.taper * np.maximum(along_mm - 2.0, 0.0)
        return tip + along_mm[:, None] * axis, radii

    def section(self) -> tuple[float, float, float]:
        """Return about what a crossing at the height of the cameras makes of it."""
        shift = max(CAMERA_MM - self.radius_mm + self.pressed_mm, 0.3) * np.tan(self.lean_rad)
        x_mm = self.x_mm + shift * np.cos(self.azimuth_rad)
        y_mm = self.y_mm + shift * np.sin(self.azimuth_rad)
        return float(x_mm), float(y_mm), self.radius_mm


def corner_sight(
    number: int, *, upside_down: bool = False, shear: float = 0.0, slant: float = 0.0
) -> CornerSight:
    """Return camera 0..3; its horizon falls by `slant` rows a column."""
    x_mm, y_mm, forward_deg = CORNERS[number]
    turned = -1.0 if upside_down else 1.0
    across = (np.arange(WIDTH_PX + 1) - WIDTH_PX / 2.0) / FOCAL_PX
    angles = np.radians(forward_deg) + turned * np.arctan(across)
    middles = (angles[1:] + angles[:-1]) / 2.0
    cos, sin = np.cos(middles), np.sin(middles)
    far = np.array(SURFACE_MM) + STRIP_BESIDE_MM
    strip_mm = np.minimum(
        np.where(cos > 0.0, far[0] - x_mm, -STRIP_BESIDE_MM - x_mm) / cos,
        np.where(sin > 0.0, far[1] - y_mm, -STRIP_BESIDE_MM - y_mm) / sin,
    )
    rows_per_slope = turned * FOCAL_PX / np.cos(middles - np.deg2rad(forward_deg))
    horizon = HORIZON_PX + slant * (np.arange(WIDTH_PX) - WIDTH_PX / 2.0)
    return CornerSight(
        x_mm,
        y_mm,
        CAMERA_MM,
        horizon,
        rows_per_slope,
        strip_mm,
        np.full(WIDTH_PX, shear),
        angles,
        horizon + (CAMERA_MM + STRIP_TOP_MM) * rows_per_slope / strip_mm,
        np.ones(WIDTH_PX, np.bool_),
    )


def edge_angles(
    sight: CornerSight, finger: Finger, slopes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the first and the last angle (L,) at which rays of these slopes meet the finger.

    Relative to the middle of the picture; NaN where none does.
    """
    centres, radii = finger.balls()
    middle_rad = sight.angles_rad[WIDTH_PX // 2]
    first, last = np.full(len(slopes), np.nan), np.full(len(slopes), np.nan)
    for mirror in (1.0, -1.0):
        ball = centres * [1.0, 1.0, mirror] - [sight.x_mm, sight.y_mm, sight.camera_mm]
        away = np.hypot(ball[:, 0], ball[:, 1])
        bearing = wrap_angle(np.arctan2(ball[:, 1], ball[:, 0]) - middle_rad)
        if finger.round_tip:
            tangent = np.sqrt(np.sum(ball**2, axis=1) - radii**2)
            cosines = np.sqrt(1.0 + slopes**2)[:, None] * tangent - slopes[:, None] * ball[:, 2]
            half = np.arccos(np.where(cosines <= away, cosines / away, np.nan))
        else:
            half = np.broadcast_to(np.arcsin(radii[:1] / away[:1]), (len(slopes), 1))
            bearing = bearing[:1]
        known = np.isfinite(half)
        first = np.fmin(first, np.where(known, bearing - half, np.inf).min(axis=1))
        last = np.fmax(last, np.where(known, bearing + half, -np.inf).max(axis=1))
    return first, last


def outlines_of(
    sight: CornerSight, finger: Finger, rng: np.random.Generator | None = None
) -> Outlines:
    """Return the one outline of a finger, traced .1 px exactly if there is a generator."""
    columns = np.arange(WIDTH_PX + 1.0)
    middle_rad = sight.angles_rad[WIDTH_PX // 2]
    relative = sight.angles_rad - middle_rad
    if relative[0] > relative[-1]:
        columns, relative = columns[::-1], relative[::-1]
    strip_mm = float(np.interp(_bearing(sight, finger), relative[1:], np.sort(sight.strip_mm)))
    slopes = (LEVELS * STRIP_TOP_MM - CAMERA_MM) / strip_mm
    edges = np.array(edge_angles(sight, finger, slopes))
    level_px = np.interp(edges, relative, columns, left=np.nan, right=np.nan)
    found_px, rows_px = level_px.copy(), np.zeros_like(level_px)
    for _ in range(5):  # the horizon is that of the column where the edge is met
        place = np.clip(found_px - 0.5, 0.0, WIDTH_PX - 1.0)
        below_px = -slopes * np.interp(place, np.arange(WIDTH_PX), sight.rows_per_slope_px)
        rows_px = below_px + np.interp(place, np.arange(WIDTH_PX), sight.horizon_px)
        found_px = level_px + sight.shear[0] * below_px
    if rng is not None:
        found_px = found_px + rng.normal(0.0, 0.1, found_px.shape)
    order = np.argsort(np.nan_to_num(found_px).mean(axis=1))  # left and right
    return Outlines(
        found_px[None, order],
        np.where(np.isfinite(found_px), rows_px, np.nan)[None, order],
        np.empty((0, 0), np.float32),
        np.full(WIDTH_PX, -1, np.int32),
        np.zeros(WIDTH_PX, np.int32),
    )


def _bearing(sight: CornerSight, finger: Finger) -> float:
    angle = np.arctan2(finger.y_mm - sight.y_mm, finger.x_mm - sight.x_mm)
    return float(wrap_angle(angle - sight.angles_rad[WIDTH_PX // 2]))


def own(edges: Sequence[tuple[int, int]], cameras: int = 4) -> np.ndarray:
    """Return that a contact owns these edges (camera, 0 left or 1 right) of the only outline."""
    owned = np.full((1, cameras, 2), -1, np.intp)
    for camera, edge in edges:
        owned[0, camera, edge] = 0
    return owned


ALL_EDGES = tuple((camera, edge) for camera in range(4) for edge in range(2))
