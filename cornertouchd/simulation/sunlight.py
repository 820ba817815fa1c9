"""Sunlight on the strips as one camera sees it, and the shadows that fingers throw there."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cornertouchd.model import FloatArray, PictureFormat
from cornertouchd.simulation.border import LedBorder
from cornertouchd.simulation.fingers import Capsules, Finger
from cornertouchd.simulation.flanks import Sun
from cornertouchd.simulation.noise import Light
from cornertouchd.simulation.optics import CornerCamera
from cornertouchd.simulation.silhouettes import DARK, normal_share

# The sun is a disc of half a degree: its edge, as a standard deviation.
SUN_SIGMA_RAD = 0.0023
# Blur of lens and pixel together, as for silhouettes.
BLUR_SIGMA_PX = 0.85
# Shafts that point at the sun throw the shadow of their tip only.
LEAST_ACROSS = 1e-4


def sunlit(border: LedBorder, sun: Sun, led_grey: float) -> LedBorder:
    """Return the border as it would be without LEDs: each face as bright as the sun makes it."""
    inwards = ((0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (1.0, 0.0))
    east, south, _ = sun.direction.tolist()
    facing = [max(0.0, x * east + y * south) for x, y in inwards]
    tables = tuple(
        np.where(table > 0.0, share * sun.grey / led_grey, 0.0)
        for table, share in zip(border.brightness, facing, strict=True)
    )
    return replace(border, brightness=tables)


class SunlitStrips:
    """The sun's light in the pictures of one camera.  Immutable; any thread may use it."""

    def __init__(
        self,
        camera: CornerCamera,
        picture: PictureFormat,
        border: LedBorder,
        sun: Sun,
        light: Light,
    ) -> None:
        """Prepare for fingers; `light` (rows, columns) is what the sun adds to an empty picture."""
        self._light = light
        self._sun = sun
        self._rows, self._columns = np.nonzero(light > DARK)
        rays = camera.rays(
            self._columns.astype(np.float64) + 0.5,
            self._rows.astype(np.float64) + 0.5 + picture.row_offset_px,
        )
        origin_mm = np.array([camera.x_mm, camera.y_mm])
        level = np.hypot(rays[0], rays[1])
        away_mm = border.wall_distance(origin_mm, rays[:2] / level)
        points_mm = np.vstack(
            [origin_mm[:, None] + away_mm * rays[:2] / level, np.zeros(len(level))]
        )
        # what the screen mirrors is a place of the strip as well
        points_mm[2] = np.abs(camera.height_mm + away_mm * rays[2] / level)
        self._points_mm = points_mm
        self._blurs_mm = BLUR_SIGMA_PX * away_mm / camera.lens.focal_px

    def add_to(self, light: Light, fingers: Sequence[Finger]) -> None:
        """Add to `light` (rows, columns), in place, what comes from strips in the sun."""
        light += self._light
        if fingers and len(self._rows):
            passed = np.prod(1.0 - self._shadows(fingers), axis=0)
            here = self._rows, self._columns
            light[here] -= (self._light[here] * (1.0 - passed)).astype(np.float32)

    def _shadows(self, fingers: Sequence[Finger]) -> FloatArray:
        """Return the share of the sun (F, N) that each finger takes from each lit pixel."""
        ahead = self._sun.direction
        capsules = Capsules.seen_from(np.zeros(3), fingers)
        shares = np.zeros((len(fingers), len(self._rows)))
        for number, (tip, axis, radius_mm) in enumerate(
            zip(capsules.tips, capsules.axes, capsules.radii_mm.tolist(), strict=True)
        ):
            to_tip = tip[:, None] * radius_mm - self._points_mm
            along = float(axis @ ahead)
            across = max(1.0 - along * along, LEAST_ACROSS)
            depth, moment = ahead @ to_tip, np.cross(ahead, axis) @ to_tip
            below = np.minimum((depth * along - axis @ to_tip) / across, 0.0)
            distance_mm = np.sqrt(moment**2 / across + below**2 * across)
            blur_mm = np.hypot(self._blurs_mm, SUN_SIGMA_RAD * np.maximum(depth, 0.0))
            inside = ((radius_mm - distance_mm) / blur_mm).astype(np.float32)
            shares[number] = np.where(depth > 0.0, normal_share(np.clip(inside, -6.0, 6.0)), 0.0)
        return shares
