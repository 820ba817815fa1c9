"""Boards held in front of the simulated cameras, as a person holds them who calibrates a rig."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, radians

import cv2
import numpy as np

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.model import BoolArray, FloatArray, Frame, Picture, PictureFormat
from cornertouchd.simulation.border import NORMAL_REFLECTANCE
from cornertouchd.simulation.noise import Light
from cornertouchd.simulation.optics import CornerCamera
from cornertouchd.simulation.rig import (
    ALL_SIDES_LIT,
    BLUR_MARGIN_PX,
    BLUR_PX,
    VIGNETTING_POWER,
    SimulatedRig,
)

# Paper and toner in grey levels above black.  The light of the strips comes from the sides and from
# below, so it fades upwards and is stronger on the right.
PAPER_LEVEL, TONER_LEVEL = 150.0, 14.0
FADES_OVER_MM = 400.0
LEFT_TO_RIGHT = 0.25

MARGIN_SQUARES = 0.3
"""White around the pattern; a printed page has about as much."""

TEXELS_A_SQUARE = 240
"""Texels are then an eighth of a millimetre on the default board, finer than any ray."""

RAYS_PER_PIXEL = 3
FRAME_RATE_HZ = 10.0

# How a board is held: its lower edge so far above the screen, leaning back or forwards, turned in
# its plane, and turned away from the side on which both cameras stand.
LOWER_EDGE = (0.05, 0.3)  # of the board's height
LEAN_RAD, ROLL_RAD, TURN_RAD = radians(35.0), radians(20.0), radians(30.0)
STEEPEST_RAD = radians(65.0)
SMALLEST_SHARE_SEEN = 0.5  # by both
MOST_TRIES = 500


@dataclass(frozen=True)
class BoardPose:
    """Where a board is held: `centre_mm` (3,) and `axes` (3, 3), both in (x, y, z towards user).

    The rows of `axes` are the pattern's right, its down, and away from who looks at it.
    """

    centre_mm: FloatArray
    axes: FloatArray

    def places_mm(self, plan: BoardPlan, on_board_mm: FloatArray) -> FloatArray:
        """Return where points (N, 2) of the pattern are, (N, 3)."""
        away = on_board_mm - np.array(plan.size_mm) / 2.0
        places: FloatArray = self.centre_mm + away @ self.axes[:2]
        return places

    @property
    def mirrored(self) -> "BoardPose":
        """The image of the board in the screen."""
        flip = np.array([1.0, 1.0, -1.0])
        return BoardPose(self.centre_mm * flip, self.axes * flip)


def board_poses(
    plan: BoardPlan,
    surface_mm: tuple[float, float],
    formats: Mapping[str, PictureFormat],
    cameras: Mapping[str, CornerCamera],
    count: int,
    seed: int,
) -> tuple[BoardPose, ...]:
    """Return poses that neighbouring cameras see together, one pair of them after another.

    Raises `ValueError` if the board is too large to be held anywhere.
    """
    rng = np.random.default_rng(np.random.SeedSequence([seed, 2]))
    names = list(cameras)
    pairs = [(name, names[(number + 1) % len(names)]) for number, name in enumerate(names)]
    poses: list[BoardPose] = []
    for number in range(count):
        a, b = pairs[number % len(pairs)]
        for _ in range(MOST_TRIES):
            pose = _held(plan, surface_mm, (cameras[a], cameras[b]), rng)
            seen = [_corners_seen(plan, pose, cameras[c], formats[c]) for c in (a, b)]
            if np.mean(seen[0] & seen[1]) >= SMALLEST_SHARE_SEEN:
                poses.append(pose)
                break
        else:
            raise ValueError(
                f"a board of {plan.size_mm[0]:g} x {plan.size_mm[1]:g} mm cannot be held so that "
                f"{a} and {b} see it over {surface_mm[0]:g} x {surface_mm[1]:g} mm; "
                "give a smaller one"
            )
    return tuple(poses)


def _held(
    plan: BoardPlan,
    surface_mm: tuple[float, float],
    pair: tuple[CornerCamera, CornerCamera],
    rng: np.random.Generator,
) -> BoardPose:
    """Return one pose that faces the side between the two cameras."""
    place = rng.uniform((0.1, 0.1), (0.9, 0.9)) * surface_mm
    between = np.array([(c.x_mm, c.y_mm) for c in pair]).mean(axis=0)
    towards = between - np.array(surface_mm) / 2.0
    facing = np.arctan2(towards[1], towards[0]) + rng.uniform(-TURN_RAD, TURN_RAD)
    lean, roll = rng.uniform(-1.0, 1.0, 2) * (LEAN_RAD, ROLL_RAD)
    # The board stands upright.  The cross product is turned round: x, y, z are left-handed.
    away = -np.array([np.cos(facing), np.sin(facing), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    right = np.cross(away, down)
    away, down = (
        np.cos(lean) * away + np.sin(lean) * down,
        np.cos(lean) * down - np.sin(lean) * away,
    )
    right, down = (
        np.cos(roll) * right + np.sin(roll) * down,
        np.cos(roll) * down - np.sin(roll) * right,
    )
    axes = np.stack([right, down, away])
    reach_mm = float(np.abs(axes[:2, 2]) @ plan.size_mm) / 2.0
    height_mm = reach_mm + rng.uniform(*LOWER_EDGE) * plan.size_mm[1]
    return BoardPose(np.array([*place, height_mm]), axes)


def _corners_seen(
    plan: BoardPlan, pose: BoardPose, camera: CornerCamera, picture: PictureFormat
) -> BoolArray:
    """Return which corners (N,) are in the picture; none if one is seen too obliquely."""
    from_camera = pose.places_mm(plan, plan.corners_mm) - _origin_mm(camera)
    distance = np.linalg.norm(from_camera, axis=1)
    if np.any(from_camera @ pose.axes[2] < np.cos(STEEPEST_RAD) * distance):
        return np.zeros(len(distance), bool)
    ahead = from_camera @ camera.axes()[2] > 0.1 * distance
    columns, rows = camera.project(np.where(ahead[:, None], from_camera, camera.axes()[2]).T)
    inside = (columns > 0) & (columns < picture.width_px) & (rows > 0)
    seen: BoolArray = ahead & inside & (rows < picture.height_px)
    return seen


def _origin_mm(camera: CornerCamera) -> FloatArray:
    return np.array([camera.x_mm, camera.y_mm, camera.height_mm])


class BoardShow:
    """Pictures of a board before a rig, as the cameras take them with all their rows.

    The glossy screen shows the board a second time, upside down.
    """

    def __init__(self, rig: SimulatedRig, plan: BoardPlan, reflectance: float = 0.93) -> None:
        self._rig = rig
        self._plan = plan
        self._reflectance = reflectance
        self._texture = _texture(plan)
        self._rays = {
            id_: _undistorted(camera, rig.formats[id_]) for id_, camera in rig.truth.cameras.items()
        }
        self._empty = {id_: rig.light(id_) for id_ in rig.formats}

    def frame_set(self, index: int, pose: BoardPose) -> tuple[Frame, ...]:
        """Return the frames of all cameras while the board is held so."""
        return tuple(
            Frame(
                id_,
                index,
                index / FRAME_RATE_HZ,
                ALL_SIDES_LIT,
                self.render(id_, index, pose),
            )
            for id_ in self._rig.formats
        )

    def render(self, camera_id: str, index: int, pose: BoardPose) -> Picture:
        """Return picture `index` of a camera, (height_px, width_px), while the board is so held."""
        return self._rig.expose(camera_id, index, self._light(camera_id, pose))

    def _light(self, camera_id: str, pose: BoardPose) -> Light:
        light = self._empty[camera_id].copy()
        self._paint(light, camera_id, pose.mirrored, self._reflectance)
        self._paint(light, camera_id, pose, None)
        return light

    def _paint(
        self, light: Light, camera_id: str, pose: BoardPose, reflected: float | None
    ) -> None:
        """Paint the board over `light`; `reflected` is the share of it that a mirror leaves."""
        camera = self._rig.truth.cameras[camera_id]
        patch = self._patch(camera_id, pose)
        seen_from_behind = (pose.centre_mm - _origin_mm(camera)) @ pose.axes[2] <= 0.0
        if seen_from_behind or patch is None:
            return
        fine = tuple(slice(s.start * RAYS_PER_PIXEL, s.stop * RAYS_PER_PIXEL) for s in patch)
        x, y = (axis[fine] for axis in self._rays[camera_id])
        lit, covered = self._paper(*self._where_on_texture(camera, pose, x, y))
        off_axis_cos = 1.0 / np.sqrt(1.0 + x * x + y * y)
        lit *= off_axis_cos**VIGNETTING_POWER
        if reflected is not None:
            up = camera.axes()[:, 2]
            sinking = np.abs(off_axis_cos * (up[0] * x + up[1] * y + up[2]))
            grazing = NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * (1.0 - sinking) ** 5
            lit *= reflected * grazing
        patch_light = light[patch]
        patch_light *= 1.0 - _pixels(covered)
        patch_light += _pixels(lit)

    def _paper(self, texture_x: Light, texture_y: Light) -> tuple[Light, Light]:
        """Return the light of the page at these texels, and 1 where there is paper."""
        paper: Light = np.asarray(
            cv2.remap(
                self._texture, texture_x, texture_y, cv2.INTER_LINEAR, borderValue=(0.0, 0.0)
            ),
            np.float32,
        )
        height, width = self._texture.shape[:2]
        above_mm = np.clip(1.0 - texture_y / height, 0.0, 1.0) * self._plan.size_mm[1]
        gradient = 1.0 + LEFT_TO_RIGHT * (texture_x / width - 0.5)
        return paper[..., 0] * np.exp(-above_mm / FADES_OVER_MM) * gradient, paper[..., 1]

    def _where_on_texture(
        self, camera: CornerCamera, pose: BoardPose, x: Light, y: Light
    ) -> tuple[Light, Light]:
        """Return where rays (x, y, 1) of the camera meet the board, in texels.

        Plane to plane: a homography, three sums a ray.
        """
        axes = pose.axes @ camera.axes().T
        centre = camera.axes() @ (pose.centre_mm - _origin_mm(camera))
        depth = float(axes[2] @ centre)
        texel_mm = self._plan.square_mm / TEXELS_A_SQUARE
        ahead = axes[2, 0] * x + axes[2, 1] * y + axes[2, 2]
        distance = np.divide(depth, ahead, out=np.full_like(ahead, -1.0), where=ahead > 1e-3)
        places = []
        for axis, size in zip(axes[:2], self._texture.shape[1::-1], strict=True):
            across = (axis[0] * x + axis[1] * y + axis[2]) * distance - float(axis @ centre)
            texels = across / texel_mm + (size - 1) / 2.0
            places.append(np.where(distance > 0.0, texels, -9.0).astype(np.float32))
        return places[0], places[1]

    def _patch(self, camera_id: str, pose: BoardPose) -> tuple[slice, slice] | None:
        """Return the rows and columns in which the board may be, with room for the blur."""
        camera, picture = self._rig.truth.cameras[camera_id], self._rig.formats[camera_id]
        margin = MARGIN_SQUARES * self._plan.square_mm
        width, height = self._plan.size_mm
        around = np.linspace(-margin, [width + margin, height + margin], 30)
        x, y = np.meshgrid(around[:, 0], around[:, 1])
        places = pose.places_mm(self._plan, np.stack([x.ravel(), y.ravel()], axis=1))
        seen = (places - _origin_mm(camera)) @ camera.axes().T
        seen = seen[seen[:, 2] > 0.05 * np.linalg.norm(seen, axis=1)]
        if not len(seen):
            return None
        columns, rows = camera.lens.pixels(*(seen[:, :2] / seen[:, 2:]).T)
        spans = []
        for places_px, size in (
            (rows - picture.row_offset_px, picture.rows_px),
            (columns, picture.width_px),
        ):
            first = max(0, int(places_px.min()) - 2 * BLUR_MARGIN_PX)
            last = min(size, ceil(places_px.max()) + 2 * BLUR_MARGIN_PX)
            if first >= last:
                return None
            spans.append(slice(first, last))
        return spans[0], spans[1]


def _pixels(rays: Light) -> Light:
    """Return the mean of the rays of each pixel, blurred by the lens."""
    rows, columns = (size // RAYS_PER_PIXEL for size in rays.shape)
    mean = rays.reshape(rows, RAYS_PER_PIXEL, columns, RAYS_PER_PIXEL).mean(axis=(1, 3))
    return np.asarray(cv2.GaussianBlur(mean, (0, 0), BLUR_PX), np.float32)


def _texture(plan: BoardPlan) -> Light:
    """Return the printed page (rows, columns, 2): how bright it is, and 1 where there is paper."""
    texels_a_mm = TEXELS_A_SQUARE / plan.square_mm
    margin = round(MARGIN_SQUARES * TEXELS_A_SQUARE)
    columns, rows = (count * TEXELS_A_SQUARE + 2 * margin for count in plan.squares)
    texture: Light = np.empty((rows, columns, 2), np.float32)
    texture[..., 0], texture[..., 1] = PAPER_LEVEL, 1.0
    for left, top, right, bottom in np.rint(plan.dark_mm() * texels_a_mm).astype(int) + margin:
        texture[top:bottom, left:right, 0] = TONER_LEVEL
    return texture


def _undistorted(camera: CornerCamera, picture: PictureFormat) -> tuple[Light, Light]:
    """Return where the rays of all pixels cross the plane one unit before the lens."""
    step_px = 1.0 / RAYS_PER_PIXEL
    columns = (np.arange(picture.width_px * RAYS_PER_PIXEL) + 0.5) * step_px
    rows = (np.arange(picture.rows_px * RAYS_PER_PIXEL) + 0.5) * step_px + picture.row_offset_px
    x, y = camera.lens.plane(*np.meshgrid(columns, rows, sparse=True))
    return x.astype(np.float32), y.astype(np.float32)
