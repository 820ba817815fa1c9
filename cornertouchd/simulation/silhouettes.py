"""What fingers leave of the light that one camera sees: soft dark shapes, mirrored below.

The mirror is unfolded: a ray that the screen reflects goes straight on below z = 0, where it may
meet the mirror image of a finger.  So each finger is two capsules, and a ray passes both or none.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from cornertouchd.geometry import wrap_angle
from cornertouchd.model import PictureFormat
from cornertouchd.simulation.fingers import Capsules, Finger
from cornertouchd.simulation.flanks import Lamp, glow
from cornertouchd.simulation.noise import Light
from cornertouchd.simulation.optics import TABULATED_RAD, CornerCamera

# Share of the strip's light that seems to shine through a finger: its skin, lit from the other
# sides.  The path-traced pictures show 4 to 7 %.
SKIN_SHARE = 0.05

# Columns added to both sides of a shape: three standard deviations of blur, and the bend of
# upright edges by roll and lens within a band of 64 rows.
MARGIN_PX = 6.0

# Steps of the table of columns over angles, fine against MARGIN_PX.
ANGLE_STEPS = 641


# Light, in grey levels, that is not worth a shadow: below the noise of reading.
DARK = 0.1


@dataclass(frozen=True, slots=True)
class Patch:
    """The lit pixels that a finger may hide: rows and columns from first to last (exclusive)."""

    finger: int
    rows: slice
    columns: slice
    count: int


class Silhouettes:
    """The shapes of fingers in the pictures of one camera.  Immutable; any thread may use it."""

    def __init__(
        self,
        camera: CornerCamera,
        picture: PictureFormat,
        empty: Light,
        reach_mm: float,
        blur_px: float,
        lamps: Callable[[Finger], tuple[Lamp, ...]] | None = None,
        reflectance: float = 1.0,
    ) -> None:
        """Prepare for fingers before an empty picture that is lit up to `reach_mm` above z = 0.

        `lamps` tells what lights a finger up, beyond the share that all have; their mirror images
        are dimmer by `reflectance`.
        """
        self._camera = camera
        self._origin_mm = np.array([camera.x_mm, camera.y_mm, camera.height_mm])
        self._reach_mm = reach_mm
        self._lamps = lamps
        self._reflectances = np.array([[1.0], [reflectance]], np.float32)
        columns_px = np.arange(picture.width_px) + 0.5
        rows_px = np.arange(picture.rows_px) + 0.5 + picture.row_offset_px
        self._rays = camera.rays(*np.meshgrid(columns_px, rows_px)).astype(np.float32)
        lit = empty > DARK
        self._first_lit_row = np.where(lit.any(axis=0), np.argmax(lit, axis=0), picture.rows_px)
        self._last_lit_row = picture.rows_px - np.argmax(lit[::-1], axis=0)
        self._offsets_rad = np.linspace(-TABULATED_RAD, TABULATED_RAD, ANGLE_STEPS)
        self._columns_px = camera.columns_px(camera.yaw_rad + self._offsets_rad)
        # A pixel is a box, 1/12 px² of variance on top of the blur of the lens.
        self._blurs_per_rad = np.gradient(self._columns_px, self._offsets_rad) / np.sqrt(
            blur_px**2 + 1.0 / 12.0
        )

    def shade(self, light: Light, fingers: Sequence[Finger]) -> None:
        """Take from `light` (rows, columns), in place, what the fingers hide; add their glow."""
        if not fingers:
            return
        capsules = Capsules.seen_from(self._origin_mm, fingers)
        patches = self._patches(capsules)
        if not patches:
            return
        hidden, beside = self._hidden(capsules, patches)
        passed = 1.0 - np.float32(1.0 - SKIN_SHARE) * hidden
        passed_both: Light = passed[0] * passed[1]
        ends = accumulate((patch.count for patch in patches), initial=0)
        for patch, (start, end) in zip(patches, pairwise(ends), strict=True):
            shaded = light[patch.rows, patch.columns]
            shaded *= passed_both[start:end].reshape(shaded.shape)
            if self._lamps is not None:
                tip = capsules.tips[patch.finger]
                bright = glow(
                    self._lamps(fingers[patch.finger]),
                    float(np.arctan2(tip[1], tip[0])),
                    beside[:, start:end],
                )
                bright *= hidden[:, start:end] * self._reflectances
                shaded += np.max(bright, axis=0).reshape(shaded.shape)

    def _patches(self, capsules: Capsules) -> list[Patch]:
        """Return where each finger hides light, leaving out those out of view."""
        reach = (self._reach_mm - self._origin_mm[2]) / capsules.radii_mm
        rise = np.maximum(reach - capsules.tips[:, 2], 0.0) / capsules.axes[:, 2]
        ends = np.stack([capsules.tips, capsules.tips + capsules.axes * rise[:, None]])
        middles_rad = wrap_angle(np.arctan2(ends[..., 1], ends[..., 0]) - self._camera.yaw_rad)
        halves_rad = np.arcsin(1.0 / np.maximum(np.hypot(ends[..., 0], ends[..., 1]), 1.0))
        span_rad = np.stack(
            [np.min(middles_rad - halves_rad, axis=0), np.max(middles_rad + halves_rad, axis=0)]
        )
        span_px = np.interp(span_rad, self._offsets_rad, self._columns_px)
        width_px = self._rays.shape[2]
        first = np.clip(span_px[0] - MARGIN_PX, 0, width_px).astype(int)
        last = np.clip(span_px[1] + MARGIN_PX, 0, width_px).astype(int)
        patches = []
        for finger, (left, right) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
            if left < right:
                columns = slice(left, right)
                top = int(self._first_lit_row[columns].min())
                bottom = max(top, int(self._last_lit_row[columns].max()))
                count = (bottom - top) * (right - left)
                patches.append(Patch(finger, slice(top, bottom), columns, count))
        return patches

    def _hidden(self, capsules: Capsules, patches: Sequence[Patch]) -> tuple[Light, Light]:
        """Return how finger and mirror image cover the pixels of all patches, one after another.

        That is the share that each covers (2, N), and how far to the right of its axis it is met
        (2, N), in units of its radius, which is worked out if something lights fingers up.

        All in units of the finger's radius: m = axis x tip, and a ray of direction d, |d| = 1,
        passes the line of the axis at the distance |m·d| / |d x axis|; where it does so below the
        tip, the distance to the tip counts.
        """
        forms, constants = self._forms(capsules)
        seen, constant = self._along_rays(forms, constants, patches)
        along_axis, depth, moment = seen[0:2], seen[2:4], seen[4:6]
        tip_along_axis, blurs_per_rad = constant[0:2], constant[2]

        off_axis = 1.0 - along_axis * along_axis
        beyond_tip = np.minimum((depth * along_axis - tip_along_axis) / off_axis, 0.0)
        distance = np.sqrt(moment * moment / off_axis + beyond_tip * beyond_tip * off_axis)
        blurs = blurs_per_rad / np.maximum(depth, np.float32(1e-3))
        hidden = normal_share((1.0 + distance) * blurs) - normal_share((distance - 1.0) * blurs)
        if self._lamps is None:
            return hidden, moment
        beside = moment / np.sqrt(off_axis)
        beside[1] *= -1.0  # the axis of the mirror image points down
        return hidden, beside

    def _forms(self, capsules: Capsules) -> tuple[Light, Light]:
        """Return what is asked of each ray, (F, 6, 3) linear forms, and (F, 3) constants.

        The forms are the axis, the tip and their moment, each for the finger and for its image.
        """
        flip = np.array([1.0, 1.0, -1.0])
        axes = np.stack([capsules.axes, capsules.axes * flip], axis=1)
        tips = np.stack([capsules.tips, capsules.tips * flip], axis=1)
        tips[:, 1, 2] -= 2.0 * self._origin_mm[2] / capsules.radii_mm
        forms = np.concatenate([axes, tips, np.cross(axes, tips)], axis=1)
        middles_rad = np.arctan2(capsules.tips[:, 1], capsules.tips[:, 0]) - self._camera.yaw_rad
        blurs = np.interp(wrap_angle(middles_rad), self._offsets_rad, self._blurs_per_rad)
        constants = np.column_stack([np.sum(axes * tips, axis=2), blurs])
        return forms.astype(np.float32), constants.astype(np.float32)

    def _along_rays(
        self, forms: Light, constants: Light, patches: Sequence[Patch]
    ) -> tuple[Light, Light]:
        """Return the forms (6, N) and the constants (3, N) for the N pixels of all patches."""
        counts = [patch.count for patch in patches]
        seen = np.empty((6, sum(counts)), np.float32)
        ends = accumulate(counts, initial=0)
        for patch, (start, end) in zip(patches, pairwise(ends), strict=True):
            rays = self._rays[:, patch.rows, patch.columns].reshape(3, -1)
            np.matmul(forms[patch.finger], rays, out=seen[:, start:end])
        owners = [patch.finger for patch in patches]
        return seen, np.repeat(constants[owners].T, counts, axis=1)


def normal_share(deviations: Light) -> NDArray[np.float32]:
    """Return the normal distribution function, off by less than 4e-4.

    The tanh form (Hendrycks and Gimpel 2016): a tenth of the time of an exact one.
    """
    inner = np.float32(0.0356774) * deviations * deviations
    inner += np.float32(0.7978846)
    inner *= deviations
    share: NDArray[np.float32] = np.tanh(inner, out=inner)
    share += np.float32(1.0)
    share *= np.float32(0.5)
    return share
