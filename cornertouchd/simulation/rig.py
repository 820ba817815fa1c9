"""A simulated rig: corner cameras around a lit surface, their pictures, and the truth."""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import ceil, hypot, pi, radians
from types import MappingProxyType

import numpy as np

from cornertouchd.model import FloatArray, Frame, Picture, PictureFormat
from cornertouchd.simulation.border import STRIP_BOTTOM_MM, LedBorder, led_brightness
from cornertouchd.simulation.fingers import Finger, Section, section
from cornertouchd.simulation.flanks import Lamp, Sun, strip_lamps
from cornertouchd.simulation.noise import Light, SensorNoise, digitise
from cornertouchd.simulation.optics import CornerCamera, Lens
from cornertouchd.simulation.silhouettes import Silhouettes
from cornertouchd.simulation.sunlight import SunlitStrips, sunlit

ALL_SIDES_LIT = 15
MIN_CAMERAS, MAX_CAMERAS = 2, 8
MIN_SURFACE_MM = 100.0

# Mounting: nominal places, and the largest error drawn from the seed.  Cameras stand just outside
# the surface so that all of it is seen.
CAMERA_SETBACK_MM, PLACE_ERROR_MM = 4.0, 2.0
CAMERA_HEIGHT_MM, HEIGHT_ERROR_MM = 6.0, 0.3
YAW_ERROR_RAD = radians(2.0)
PITCH_ERROR_RAD = ROLL_ERROR_RAD = radians(0.5)
CENTRE_ERROR_PX = 4.0
# A fifth to eighth camera stands in the same corner, this far along the side: clear of the first.
SECOND_CAMERA_MM = 40.0

# From this diagonal on a rig has taller strips and bigger cameras; otherwise they would shrink to
# less than the pictures can show.
LARGE_DIAGONAL_MM = 1000.0
SMALL_STRIP_MM, LARGE_STRIP_MM = 12.6, 16.0
SMALL_BARREL_MM, LARGE_BARREL_MM = 5.5, 12.0

# Exposure and lens as in the path-traced pictures: 195 grey levels in the middle, a tenth less
# at the borders, a blur of .8 px; pixels differ by .5 %.
EXPOSURE = 195.0
VIGNETTING_POWER = 0.35
BLUR_PX = 0.8
PIXEL_SPREAD = 0.005

# Rays a pixel in each direction when the empty picture is made.  Nine instead of three change it
# by .3 grey levels RMS, below the noise of reading, and take nine times as long.
RAYS_PER_PIXEL = 3
# Rows of rays that are made together, so that they stay in the cache: that takes .6 of the time
# for a whole picture.
ROWS_AT_ONCE = 48
# Rows and columns around the picture that the blur needs: four standard deviations.
BLUR_MARGIN_PX = ceil(4.0 * BLUR_PX)


@dataclass(frozen=True, slots=True)
class RigTruth:
    """What no calibration knows: the cameras as they are, and where a finger really is."""

    cameras: Mapping[str, CornerCamera]

    def section(self, finger: Finger) -> Section | None:
        """Return the finger's cross-section at the mean height of the cameras."""
        heights_mm = [camera.height_mm for camera in self.cameras.values()]
        return section(finger, sum(heights_mm) / len(heights_mm))


class SimulatedRig:
    """Pictures of a rig that does not exist.  Immutable: any number of threads may render.

    The same settings and seed give the same pictures, in whatever order they are asked for.
    `reflectance` is the share of grazing light that the screen mirrors (0: a matt screen),
    `barrel` bends the picture as in `Lens` (0: a pinhole), `mounting_error` scales the errors of
    place and direction (0: mounted perfectly).  With `lit_flanks` strips light up fingers that are
    near them; `leds` is how bright each side shines (top, right, bottom, left); a `sun` shines on
    strips and fingers, which throw shadows on the strips, but neither on the screen nor on one
    another.  Raises `ValueError` for a rig that cannot be.
    """

    def __init__(
        self,
        surface_mm: tuple[float, float] = (350.0, 400.0),
        width_px: int = 640,
        height_px: int = 480,
        rows_px: int = 64,
        seed: int = 1,
        *,
        cameras: int = 4,
        field_rad: float = radians(97.0),
        barrel: float = 0.3,
        reflectance: float = 0.93,
        mounting_error: float = 1.0,
        noise: bool = True,
        lit_flanks: bool = False,
        leds: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0),
        sun: Sun | None = None,
    ) -> None:
        _check(surface_mm, (width_px, height_px, rows_px), cameras, reflectance)
        self.surface_mm = surface_mm
        rng = np.random.default_rng(np.random.SeedSequence([seed, 0]))
        large = hypot(*surface_mm) >= LARGE_DIAGONAL_MM
        top_mm = STRIP_BOTTOM_MM + (LARGE_STRIP_MM if large else SMALL_STRIP_MM)
        mounted = [
            _mount(
                number, surface_mm, mounting_error, field_rad, barrel, (width_px, height_px), rng
            )
            for number in range(cameras)
        ]
        border = LedBorder(
            surface_mm=surface_mm,
            top_mm=top_mm,
            brightness=tuple(
                share * led_brightness(surface_mm[side % 2], rng) for side, share in enumerate(leds)
            ),
            reflectance=reflectance,
            barrels_mm=np.array([(camera.x_mm, camera.y_mm) for camera in mounted]),
            barrel_mm=LARGE_BARREL_MM if large else SMALL_BARREL_MM,
        )
        self.truth = RigTruth(MappingProxyType({camera.id: camera for camera in mounted}))
        self.formats: dict[str, PictureFormat] = {
            camera.id: _cropped(camera, border, width_px, height_px, rows_px) for camera in mounted
        }
        self._numbers = {camera.id: number for number, camera in enumerate(mounted)}
        self._border = border
        self._rng = rng
        self._noise = SensorNoise(seed) if noise else None
        self._lit_flanks = lit_flanks
        self._sun = sun

    def light(self, camera_id: str, fingers: Sequence[Finger] = ()) -> Light:
        """Return the light (rows_px, width_px) that a camera gets, in grey levels above black."""
        light = self._empty[camera_id].copy()
        if camera_id in self._sunlit:
            self._sunlit[camera_id].add_to(light, fingers)
        self._silhouettes[camera_id].shade(light, fingers)
        return light

    @cached_property
    def _empty(self) -> Mapping[str, Light]:
        """What the cameras see of the empty surface; made when the first picture is asked for."""
        rng = copy.deepcopy(self._rng)  # two threads that both make it make the same
        return {
            id_: _empty_light(camera, self.formats[id_], self._border, rng)
            for id_, camera in self.truth.cameras.items()
        }

    @cached_property
    def _sunlit(self) -> Mapping[str, SunlitStrips]:
        """What the sun adds, if it shines; pixels differ as those of the empty pictures do."""
        if self._sun is None:
            return {}
        rng, border = copy.deepcopy(self._rng), sunlit(self._border, self._sun, EXPOSURE)
        return {
            id_: SunlitStrips(
                camera,
                self.formats[id_],
                border,
                self._sun,
                _empty_light(camera, self.formats[id_], border, rng),
            )
            for id_, camera in self.truth.cameras.items()
        }

    @cached_property
    def _silhouettes(self) -> Mapping[str, Silhouettes]:
        is_lit = self._lit_flanks or self._sun is not None
        return {
            id_: Silhouettes(
                camera,
                self.formats[id_],
                self._empty[id_],
                self._border.top_mm,
                BLUR_PX,
                self._lamps if is_lit else None,
                self._border.reflectance,
            )
            for id_, camera in self.truth.cameras.items()
        }

    def _lamps(self, finger: Finger) -> tuple[Lamp, ...]:
        """Return what lights a finger up."""
        lamps: tuple[Lamp, ...] = ()
        if self._lit_flanks:
            lamps += strip_lamps(finger, self.surface_mm, self._border.top_mm, EXPOSURE)
        if self._sun is not None:
            lamps += (self._sun.lamp,)
        return lamps

    def expose(self, camera_id: str, index: int, light: Light) -> Picture:
        """Return picture `index` of a camera when this light falls on it."""
        if self._noise is None:
            return digitise(light)
        return self._noise.expose(light, self._numbers[camera_id], index)

    def render(self, camera_id: str, index: int, fingers: Sequence[Finger]) -> Picture:
        """Return picture `index` of a camera, (rows_px, width_px), with these fingers in view."""
        return self.expose(camera_id, index, self.light(camera_id, fingers))

    def frame_set(
        self, index: int, captured_at_s: float, fingers: Sequence[Finger]
    ) -> tuple[Frame, ...]:
        """Return the frames of all cameras at one instant; `index` is their sequence number."""
        return tuple(
            Frame(id_, index, captured_at_s, ALL_SIDES_LIT, self.render(id_, index, fingers))
            for id_ in self.formats
        )


def _check(
    surface_mm: tuple[float, float], size_px: tuple[int, int, int], cameras: int, reflectance: float
) -> None:
    """Raise `ValueError`, naming value and bound, for a rig that cannot be."""
    if min(surface_mm) < MIN_SURFACE_MM:
        raise ValueError(
            f"surface_mm is {surface_mm[0]:g} x {surface_mm[1]:g}; "
            f"give sides of at least {MIN_SURFACE_MM:g}"
        )
    if not MIN_CAMERAS <= cameras <= MAX_CAMERAS:
        raise ValueError(f"cameras is {cameras}; give {MIN_CAMERAS} to {MAX_CAMERAS}")
    width_px, height_px, rows_px = size_px
    if min(size_px) < 1 or rows_px > height_px:
        raise ValueError(
            f"pictures are {width_px}x{height_px} px with a band of {rows_px} rows; "
            "give sizes above 0 and no more rows than the height"
        )
    if not 0.0 <= reflectance <= 1.0:
        raise ValueError(f"reflectance is {reflectance:g}; give 0 (matt) to 1")


def _mount(
    number: int,
    surface_mm: tuple[float, float],
    error: float,
    field_rad: float,
    barrel: float,
    size_px: tuple[int, int],
    rng: np.random.Generator,
) -> CornerCamera:
    """Return camera `number`, clockwise from the top-left corner, with errors drawn from rng."""
    corner, second = number % 4, number >= 4
    outwards = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)][corner])
    next_corner = np.array([(1, 0), (0, 1), (-1, 0), (0, -1)][corner])
    nominal_mm = np.array(surface_mm) * (outwards > 0) + CAMERA_SETBACK_MM * outwards
    nominal_mm = nominal_mm + SECOND_CAMERA_MM * second * next_corner

    def off(largest: float, count: int = 1) -> FloatArray:
        return error * rng.uniform(-largest, largest, count)

    x_mm, y_mm = (nominal_mm + off(PLACE_ERROR_MM, 2)).tolist()
    centre_px = np.array(size_px) / 2.0 + off(CENTRE_ERROR_PX, 2)
    return CornerCamera(
        id=f"C{number + 1}",
        x_mm=x_mm,
        y_mm=y_mm,
        height_mm=CAMERA_HEIGHT_MM + off(HEIGHT_ERROR_MM).item(),
        yaw_rad=pi / 4.0 + corner * pi / 2.0 + off(YAW_ERROR_RAD).item(),
        pitch_rad=off(PITCH_ERROR_RAD).item(),
        roll_rad=off(ROLL_ERROR_RAD).item(),
        lens=Lens.with_field(field_rad, size_px[0], (centre_px[0], centre_px[1]), barrel),
    )


def _cropped(
    camera: CornerCamera, border: LedBorder, width_px: int, height_px: int, rows_px: int
) -> PictureFormat:
    """Return the band of rows that has the far strips and their mirror image in its middle."""
    angles_rad = camera.yaw_rad + np.linspace(-pi / 4.2, pi / 4.2, 91)
    ahead = np.stack([np.cos(angles_rad), np.sin(angles_rad)])
    distance_mm = border.wall_distance(np.array([camera.x_mm, camera.y_mm]), ahead)
    rows = [
        camera.project(np.vstack([ahead, (z_mm - camera.height_mm) / distance_mm]))[1]
        for z_mm in (border.top_mm, -border.top_mm)
    ]
    middle_px = (np.min(rows[0]) + np.max(rows[1])) / 2.0
    offset_px = int(np.clip(round(middle_px - rows_px / 2.0), 0, height_px - rows_px))
    return PictureFormat(width_px, height_px, offset_px, rows_px)


def _empty_light(
    camera: CornerCamera, picture: PictureFormat, border: LedBorder, rng: np.random.Generator
) -> Light:
    """Return the light (rows, columns) of the empty rig, in grey levels above black."""
    step_px = 1.0 / RAYS_PER_PIXEL
    columns_px = np.arange(-BLUR_MARGIN_PX, picture.width_px + BLUR_MARGIN_PX, step_px)
    rows_px = np.arange(-BLUR_MARGIN_PX, picture.rows_px + BLUR_MARGIN_PX, step_px)
    columns_px += step_px / 2.0
    rows_px += step_px / 2.0 + picture.row_offset_px
    light = np.concatenate(
        [
            _border_light(camera, border, columns_px, some_px)
            for some_px in np.array_split(rows_px, ceil(len(rows_px) / ROWS_AT_ONCE))
        ]
    )
    pixels = _pixels(light)
    pixels *= 1.0 + PIXEL_SPREAD * rng.standard_normal(pixels.shape)
    light_px: Light = pixels.astype(np.float32)
    light_px.setflags(write=False)
    return light_px


def _border_light(
    camera: CornerCamera, border: LedBorder, columns_px: FloatArray, rows_px: FloatArray
) -> FloatArray:
    """Return the light (rows, columns) of rays in these columns and rows, not yet blurred."""
    rays = camera.rays(*np.meshgrid(columns_px, rows_px, sparse=True))
    origin_mm = np.array([camera.x_mm, camera.y_mm, camera.height_mm])
    light = border.light(origin_mm, rays, 1.0 / (RAYS_PER_PIXEL * camera.lens.focal_px))
    off_axis_cos = np.tensordot(camera.axes()[2], rays, axes=1)
    light *= EXPOSURE * off_axis_cos**VIGNETTING_POWER
    return light


def _pixels(light: FloatArray) -> FloatArray:
    """Return the mean of the blurred rays of each pixel, without those of the margin."""
    sigma = BLUR_PX * RAYS_PER_PIXEL
    reach = round(4.0 * sigma)
    blur = np.exp(-0.5 * np.square(np.arange(-reach, reach + 1) / sigma))
    weights = np.convolve(blur / blur.sum(), np.full(RAYS_PER_PIXEL, 1.0 / RAYS_PER_PIXEL))
    for _ in range(2):  # rows, then columns
        pixels = len(light) // RAYS_PER_PIXEL - 2 * BLUR_MARGIN_PX
        seen = np.zeros((pixels, light.shape[1]))
        for first, weight in enumerate(weights, BLUR_MARGIN_PX * RAYS_PER_PIXEL - reach):
            rays = light[first : first + pixels * RAYS_PER_PIXEL : RAYS_PER_PIXEL]
            seen += weight * rays
        light = np.ascontiguousarray(seen.T)
    return light
