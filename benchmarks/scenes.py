"""Scenes whose truth is known, and what cameras measure of them; benchmarks share this.

Cameras stand 10 mm outside the corners, see 95 degrees through a pinhole and measure edges with
0.1 px of noise.  Shadows that touch are merged, and cut at the border of the view.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from cornertouchd.model import DirectingLines, FloatArray

EDGE_SIGMA_PX = 0.1
# Light between two shadows that is narrower than this is lost in the blur.
SMALLEST_GAP_PX = 1.5
SMALLEST_SHADOW_PX = 0.6
VIEW_RAD = np.deg2rad(95.0)
CAMERA_OUTSIDE_MM = 10.0
SMALLEST_DISTANCE_MM = 20.0
MARGIN_MM = 6.0
RADII_MM = (4.0, 8.0)

# A hand: where its fingers point, thumb first, and how far their tips are from its middle.  Hands
# differ in size, and no finger is quite where it is in others.
FINGERS_DEG = (-75.0, -32.0, -8.0, 14.0, 38.0)
FINGERS_MM = (55.0, 70.0, 76.0, 72.0, 62.0)
FINGER_SIGMA_DEG, FINGER_SIGMA_MM = 4.0, 3.0
HAND_SIZES = (0.75, 1.05)
PALM_BEHIND_MM = 20.0
HAND_MARGIN_MM = 60.0
FINGERS_APART_MM, HANDS_APART_MM = 16.0, 25.0

# Two fingers side by side: distance of their middles as a share of the sum of their radii.
CLOSE_SHARES = (1.05, 2.0)
# Fingers in a row: the distance of neighbours as a share of their common diameter, and their size.
ROW_SHARES = (1.03, 1.2)
ROW_SLIM_MM = (4.5, 7.0)
# A rectangle as a share of that of the cameras: its corners on the surface, and not one finger.
RECTANGLE_SHARES = (0.2, 0.8)


@dataclass(frozen=True, slots=True)
class Rig:
    """A surface with cameras at corners, counted clockwise from the top-left one."""

    name: str
    surface_mm: tuple[float, float]
    found_within_mm: float
    width_px: int = 640
    corners: tuple[int, ...] = (0, 1, 2, 3)

    @property
    def focal_px(self) -> float:
        """Focal length of the pinhole."""
        return float(self.width_px / 2.0 / np.tan(VIEW_RAD / 2.0))

    def cameras(self) -> Iterator[tuple[str, float, float, float]]:
        """Yield name, x, y and the direction of view of each camera."""
        for number in self.corners:
            x, y = self.corner_mm(number)
            yield f"C{number + 1}", x, y, np.deg2rad(45.0 + 90.0 * number)

    def corner_mm(self, number: int) -> tuple[float, float]:
        """Return where a camera at this corner stands."""
        width, height = self.surface_mm
        near, right, bottom = (
            -CAMERA_OUTSIDE_MM,
            width + CAMERA_OUTSIDE_MM,
            height + CAMERA_OUTSIDE_MM,
        )
        return ((near, near), (right, near), (right, bottom), (near, bottom))[number]

    def with_cameras(self, count: int) -> "Rig":
        """Return the rig with its first cameras only."""
        return replace(self, corners=tuple(range(count)))


SMALL = Rig("350x400", (350.0, 400.0), 6.0)
LARGE = Rig("2400x1350", (2400.0, 1350.0), 10.0)
LARGE_1280 = Rig("2400x1350 at 1280 px", (2400.0, 1350.0), 10.0, 1280)

Scene = Callable[[Rig, int, np.random.Generator], FloatArray]
"""Draws so many discs (count, 3) as x, y, r."""


def random_discs(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return discs (count, 3) as x, y, r, no two of them too near."""
    return _filled_up(rig, np.empty((0, 3)), count, rng)


def _filled_up(rig: Rig, discs: FloatArray, count: int, rng: np.random.Generator) -> FloatArray:
    """Return the discs and so many more that there are `count`."""
    low, high = np.full(2, MARGIN_MM), np.asarray(rig.surface_mm) - MARGIN_MM
    while len(discs) < count:
        centre = rng.uniform(low, high)
        apart = np.hypot(*(discs[:, :2] - centre).T)
        if np.all(apart > SMALLEST_DISTANCE_MM):
            discs = np.vstack([discs, [*centre, rng.uniform(*RADII_MM)]])
    return discs


def hands(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return the fingers of hands that lie about, five each."""
    tips = np.empty((0, 2))
    while len(tips) < count:
        hand = _hand(rig, rng)
        if (
            _all_inside(rig, hand)
            and _smallest_distance(hand, hand) >= FINGERS_APART_MM
            and _smallest_distance(hand, tips) >= HANDS_APART_MM
        ):
            tips = np.vstack([tips, hand])
    return _with_radii(tips[:count], rng)


def _hand(rig: Rig, rng: np.random.Generator) -> FloatArray:
    """Return the tips (5, 2) of a left or right hand somewhere, turned somehow."""
    middle = rng.uniform(HAND_MARGIN_MM, np.asarray(rig.surface_mm) - HAND_MARGIN_MM)
    forward_rad, side = rng.uniform(0.0, 2.0 * np.pi), rng.choice([-1.0, 1.0])
    fingers_deg = np.array(FINGERS_DEG) + rng.normal(0.0, FINGER_SIGMA_DEG, 5)
    angles = forward_rad + side * np.deg2rad(fingers_deg)
    reach = np.array(FINGERS_MM) * rng.uniform(*HAND_SIZES) + rng.normal(0.0, FINGER_SIGMA_MM, 5)
    behind = PALM_BEHIND_MM * np.array([np.cos(forward_rad), np.sin(forward_rad)])
    tips: FloatArray = middle - behind + reach[:, None] * _directions(angles)
    return tips


def close_pairs(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return two discs side by side, and others anywhere else."""
    while True:
        first = np.array([*rng.uniform(MARGIN_MM, np.asarray(rig.surface_mm) - MARGIN_MM)])
        radii = rng.uniform(*RADII_MM, 2)
        apart_mm = rng.uniform(*CLOSE_SHARES) * radii.sum()
        second = first + apart_mm * _directions(rng.uniform(0.0, 2.0 * np.pi, 1))[0]
        pair = np.column_stack([np.stack([first, second]), radii])
        if _all_inside(rig, pair[:, :2]):
            return _filled_up(rig, pair[:count], count, rng)


def row(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return three discs in a row, hardly apart, and others anywhere else.

    Cameras in line with the row see one shadow; all others see it as wide as a palm.
    """
    while True:
        start = rng.uniform(MARGIN_MM, np.asarray(rig.surface_mm) - MARGIN_MM)
        radius = rng.uniform(*ROW_SLIM_MM)
        step = 2.0 * radius * rng.uniform(*ROW_SHARES)
        along = _directions(rng.uniform(0.0, 2.0 * np.pi, 1))[0]
        tips = start + step * np.arange(3)[:, None] * along
        if _all_inside(rig, tips):
            discs = np.column_stack([tips, np.full(3, radius)])
            return _filled_up(rig, discs[:count], count, rng)


def rectangle(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return discs at the corners of a rectangle whose diagonals run through the cameras.

    The middle of it lies in a shadow of every camera, behind a finger: a ghost that fits.
    """
    cameras = np.array([rig.corner_mm(number) for number in range(4)])
    middle = cameras.mean(axis=0)
    corners = middle + rng.uniform(*RECTANGLE_SHARES) * (cameras - middle)
    return _with_radii(corners[:count], rng)


def crossed_lines(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return two to four of F1..F4 of Fig. 2: where two lines of a camera cross two of another.

    To those two cameras a diagonal pair looks like all four; only the others refuse the ghosts.
    """
    chosen = rng.permutation(4)
    while True:
        places = fig_2_places(rig, rng)
        if _all_inside(rig, places) and _smallest_distance(places, places) > SMALLEST_DISTANCE_MM:
            break
    kept = (chosen[0], (chosen[0] + 2) % 4, (chosen[0] + 1) % 4, (chosen[0] + 3) % 4)
    return _with_radii(places[list(kept[:count])], rng)


def fig_2_places(rig: Rig, rng: np.random.Generator) -> FloatArray:
    """Return F1..F4 (4, 2) in order around, F1 and F3 anywhere; F2 and F4 may lie off the surface.

    F1 and F2, as F3 and F4, are on a line of one camera, F2 and F3, as F4 and F1, on one of the
    next camera.
    """
    number = rng.integers(4)
    one, next_one = (np.array(rig.corner_mm(corner)) for corner in (number, (number + 1) % 4))
    first, third = rng.uniform(MARGIN_MM, np.asarray(rig.surface_mm) - MARGIN_MM, (2, 2))
    second = _crossing(one, first, next_one, third)
    fourth = _crossing(one, third, next_one, first)
    return np.stack([first, second, third, fourth])


SCENES: dict[str, Scene] = {
    "random": random_discs,
    "hands": hands,
    "close": close_pairs,
    "row": row,
    "rectangle": rectangle,
    "lines": crossed_lines,
}


def _crossing(
    origin: FloatArray, through: FloatArray, other_origin: FloatArray, other_through: FloatArray
) -> FloatArray:
    """Return where the lines from two origins through two points cross."""
    directions = np.stack([through - origin, other_origin - other_through], axis=1)
    share, _ = np.linalg.solve(directions, other_origin - origin)
    place: FloatArray = origin + share * (through - origin)
    return place


def _with_radii(places_mm: FloatArray, rng: np.random.Generator) -> FloatArray:
    return np.column_stack([places_mm, rng.uniform(*RADII_MM, len(places_mm))])


def _directions(angles_rad: FloatArray) -> FloatArray:
    return np.column_stack([np.cos(angles_rad), np.sin(angles_rad)])


def _all_inside(rig: Rig, places_mm: FloatArray) -> bool:
    far = np.asarray(rig.surface_mm) - MARGIN_MM
    return bool(np.all((places_mm >= MARGIN_MM) & (places_mm <= far)))


def _smallest_distance(places_mm: FloatArray, others_mm: FloatArray) -> float:
    """Return how near a place is to another of the others, never to itself."""
    distances = np.hypot(*np.moveaxis(places_mm[:, None] - others_mm[None], -1, 0))
    return float(np.min(distances[distances > 0.0], initial=np.inf))


def observed(rig: Rig, discs: FloatArray, rng: np.random.Generator) -> list[DirectingLines]:
    """Return what the cameras of the rig measure of the discs."""
    return [
        _bearings(rig, *camera, shadows_px(rig, discs, camera[1:]), rng) for camera in rig.cameras()
    ]


def shadows_px(rig: Rig, discs: FloatArray, camera: tuple[float, float, float]) -> FloatArray:
    """Return the merged shadows (K, 2) in columns from the middle, not yet cut at the border.

    `camera` is its x, y and the direction of view.
    """
    x_mm, y_mm, forward_rad = camera
    away = discs[:, :2] - (x_mm, y_mm)
    distance = np.hypot(away[:, 0], away[:, 1])
    angle = np.arctan2(away[:, 1], away[:, 0]) - forward_rad
    angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    half = np.arcsin(np.minimum(discs[:, 2] / distance, 1.0))
    # tangents beyond 80 degrees are far outside the view; the tangent function must stay monotonic
    edges = np.clip(np.stack([angle - half, angle + half], axis=1), *np.deg2rad([-80.0, 80.0]))
    intervals = rig.focal_px * np.tan(edges[np.argsort(edges[:, 0])])
    merged: list[list[float]] = []
    for first, last in intervals:
        if merged and first - merged[-1][1] < SMALLEST_GAP_PX:
            merged[-1][1] = max(merged[-1][1], last)
        else:
            merged.append([first, last])
    return np.array(merged).reshape(-1, 2)


def _bearings(
    rig: Rig,
    camera: str,
    x_mm: float,
    y_mm: float,
    forward_rad: float,
    whole_px: FloatArray,
    rng: np.random.Generator,
) -> DirectingLines:
    border = rig.width_px / 2.0 - 1.0
    cut = np.clip(whole_px, -border, border)
    whole_px = whole_px[cut[:, 1] - cut[:, 0] > SMALLEST_SHADOW_PX]
    valid = np.abs(whole_px) < border
    noisy = whole_px + rng.normal(0.0, EDGE_SIGMA_PX, whole_px.shape)
    edges = np.where(valid, noisy, np.clip(whole_px, -border, border))
    angles = forward_rad + np.arctan(edges / rig.focal_px)
    middles = edges.mean(axis=1)
    rad_per_px = np.cos(np.arctan(middles / rig.focal_px)) ** 2 / rig.focal_px
    return DirectingLines(
        camera=camera,
        x_mm=x_mm,
        y_mm=y_mm,
        first_rad=np.ascontiguousarray(angles[:, 0]),
        centre_rad=forward_rad + np.arctan(middles / rig.focal_px),
        last_rad=np.ascontiguousarray(angles[:, 1]),
        first_valid=np.ascontiguousarray(valid[:, 0]),
        last_valid=np.ascontiguousarray(valid[:, 1]),
        sigma_rad=EDGE_SIGMA_PX * rad_per_px,
    )


def matched(
    points_mm: FloatArray, truth_mm: FloatArray, within_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Return which points (M,) are which true places (M,), each once and not farther than that."""
    distances = np.hypot(*np.moveaxis(points_mm[:, None] - truth_mm[None], -1, 0))
    rows, columns = linear_sum_assignment(np.where(distances < within_mm, distances, 1e3))
    found = distances[rows, columns] < within_mm
    return rows[found], columns[found]


@dataclass(frozen=True, slots=True)
class LongRig(Rig):
    """A rig with cameras in the middles of its sides as well, of the longer ones first.

    They do not see what lies beside their view, close to their own side.
    """

    amid_sides: int = 0

    def cameras(self) -> Iterator[tuple[str, float, float, float]]:
        """Yield name, x, y and the direction of view of each camera."""
        yield from Rig.cameras(self)
        width, height = self.surface_mm
        amid = (
            (width / 2.0, -CAMERA_OUTSIDE_MM, 90.0),
            (width / 2.0, height + CAMERA_OUTSIDE_MM, 270.0),
            (-CAMERA_OUTSIDE_MM, height / 2.0, 0.0),
            (width + CAMERA_OUTSIDE_MM, height / 2.0, 180.0),
        )
        for number, (x, y, forward_deg) in enumerate(amid[: self.amid_sides]):
            yield f"C{number + 5}", x, y, np.deg2rad(forward_deg)


def long_rig(rig: Rig, amid_sides: int) -> LongRig:
    """Return the rig with so many cameras more."""
    return LongRig(
        rig.name, rig.surface_mm, rig.found_within_mm, rig.width_px, rig.corners, amid_sides
    )


def observed_in_view(rig: Rig, discs: FloatArray, rng: np.random.Generator) -> list[DirectingLines]:
    """Return what the cameras of the rig measure of the discs, and where they look at all."""
    half_view_rad = float(np.arctan((rig.width_px / 2.0 - 1.0) / rig.focal_px))
    return [
        seen._replace(view_rad=(forward_rad - half_view_rad, forward_rad + half_view_rad))
        for seen, (*_, forward_rad) in zip(observed(rig, discs, rng), rig.cameras(), strict=True)
    ]
