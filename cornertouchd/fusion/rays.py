"""Rays: what the outlines of shadows say in space, one line of sight for each row of an edge.

A row of the strip looks a little up, one of its mirror image a little down.  The mirror is
unfolded: a ray that the screen reflects goes straight on below the surface, where it grazes the
mirror image of the finger.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import row_of_three
from cornertouchd.geometry import unit_vectors
from cornertouchd.model import BoolArray, FloatArray

# What outlines deviate from those of any smooth finger, and how exactly they are traced.
OUTLINE_SIGMA_MM = 0.12
TRACE_SIGMA_PX = 0.12
# An edge that was lost after two rows may have been another one's.
FEWEST_RAYS_OF_AN_EDGE = 3
# A ray that passes so far outside of a finger, in its sigmas, grazes another one.
FARTHEST_OUTSIDE = 2.5
# Other fingers widen no more of three or four edges.
MOST_WIDENED = 2
# Nearer to a camera than this the picture shows nothing but the finger.
NEAREST_MM = 1.0

# So many rays are added up at once: four in a register, four registers in turn.
TOGETHER = 16

# Columns of what is known of a camera's columns.
HORIZON, ROWS_PER_SLOPE, SHEAR, BOTTOM, VISIBLE = range(5)
# Rows of a table of rays: where they begin, their unit direction, the unit normal (level) that
# points into the shadow, by how much they rise for each millimetre along the surface, one over
# their standard deviation at the contact, and the number of their edge.  A processor takes the same
# of several rays at once.
EYE_X, EYE_Y, EYE_Z, ALONG_X, ALONG_Y, ALONG_Z, INTO_X, INTO_Y, SLOPE, WEIGHT, EDGE = range(11)
RAY_ROWS = 11


class SeesHeights(Protocol):
    """Which way the columns and rows of a camera look, as `HeightTable` has it."""

    @property
    def x_mm(self) -> float: ...  # noqa: D102
    @property
    def y_mm(self) -> float: ...  # noqa: D102
    @property
    def camera_mm(self) -> float: ...  # noqa: D102
    @property
    def horizon_px(self) -> FloatArray: ...  # noqa: D102
    @property
    def rows_per_slope_px(self) -> FloatArray: ...  # noqa: D102
    @property
    def shear(self) -> FloatArray: ...  # noqa: D102
    @property
    def angles_rad(self) -> FloatArray: ...  # noqa: D102
    @property
    def bottom_px(self) -> FloatArray: ...  # noqa: D102
    @property
    def visible(self) -> BoolArray: ...  # noqa: D102


class Views(NamedTuple):
    """What is known of C cameras: `eyes` (C, 3), and their columns one after the other.

    Camera c owns the columns from `first_column[c]` up to `first_column[c + 1]` of `by_column`
    (W, 5), with the columns `HORIZON` .. `VISIBLE`; in `directions` (W + C, 2) it has one more: the
    unit vectors, level, at columns 0, 1, 2, ...  Between two of them an interpolated one is as good
    as another unit vector, to 2e-6.
    """

    eyes: FloatArray
    first_column: IntArray
    by_column: FloatArray
    directions: FloatArray


class Traces(NamedTuple):
    """The outlines of C cameras one after the other.

    Camera c owns those from `first_outline[c]` up to `first_outline[c + 1]` of `columns_px` and
    `rows_px` (K, 2, L).
    """

    first_outline: IntArray
    columns_px: FloatArray
    rows_px: FloatArray


def views_of(cameras: Sequence[SeesHeights]) -> Views:
    """Put the tables of at least one camera one after the other."""
    return Views(
        np.array([(one.x_mm, one.y_mm, one.camera_mm) for one in cameras], np.float64),
        np.cumsum([0, *(len(one.horizon_px) for one in cameras)], dtype=np.intp),
        np.concatenate(
            [
                np.column_stack(
                    [one.horizon_px, one.rows_per_slope_px, one.shear, one.bottom_px, one.visible]
                )
                for one in cameras
            ]
        ).astype(np.float64),
        unit_vectors(np.concatenate([one.angles_rad for one in cameras]).astype(np.float64)),
    )


@inlined
def traces_of(
    columns_px: tuple[FloatArray, ...], rows_px: tuple[FloatArray, ...], cameras: int
) -> Traces:
    """Put the outlines of the first cameras one after the other."""
    first_outline, levels = np.zeros(cameras + 1, np.intp), 0
    for camera in range(cameras):
        first_outline[camera + 1] = first_outline[camera] + len(columns_px[camera])
        levels = max(levels, columns_px[camera].shape[2])
    size = (first_outline[cameras], 2, levels)
    traces = Traces(first_outline, np.empty(size), np.empty(size))
    for camera in range(cameras):
        _copy_outlines(columns_px[camera], first_outline[camera], traces.columns_px)
        _copy_outlines(rows_px[camera], first_outline[camera], traces.rows_px)
    return traces


@borrowing
def _copy_outlines(outlines: FloatArray, first: int, copies: FloatArray) -> None:
    """Copy (K, 2, L) to their place among others, which may have more levels."""
    for outline in range(len(outlines)):
        for edge in range(2):
            for level in range(copies.shape[2]):
                is_known = level < outlines.shape[2]
                copies[first + outline, edge, level] = (
                    outlines[outline, edge, level] if is_known else np.nan
                )


@borrowing
def write_rays(
    views: Views,
    traces: Traces,
    owned: IntArray,
    contact: int,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    rays: FloatArray,
) -> tuple[int, int, int]:
    """Write the rays of the edges that a contact owns; count them, the edges, and the cameras.

    `owned` (N, C, 2) is the number of the camera's outline whose left and right edge are the
    contact's, -1 for none; `rays` (`RAY_ROWS`, room) has room for all levels of 2 C edges.
    """
    eyes, first_column, by_column, directions = views
    columns_px, rows_px = traces.columns_px, traces.rows_px
    count = edges = cameras = 0
    for camera in range(len(eyes)):
        away_x, away_y = x_mm - eyes[camera, 0], y_mm - eyes[camera, 1]
        if not away_x * away_x + away_y * away_y > (radius_mm + NEAREST_MM) ** 2:
            continue
        before_camera = edges
        outlines = traces.first_outline[camera + 1] - traces.first_outline[camera]
        for edge in range(2):
            number = owned[contact, camera, edge]
            if number < 0 or number >= outlines:
                continue
            outline = traces.first_outline[camera] + number
            before_edge = count
            for level in range(columns_px.shape[2]):
                count += _write_sight(
                    eyes,
                    first_column,
                    by_column,
                    directions,
                    camera,
                    edge,
                    columns_px[outline, edge, level],
                    rows_px[outline, edge, level],
                    away_x,
                    away_y,
                    rays,
                    count,
                )
            if count - before_edge < FEWEST_RAYS_OF_AN_EDGE:
                count = before_edge
                continue
            rays[EDGE, before_edge:count] = edges
            edges += 1
        cameras += edges > before_camera
    _direct(rays, count, x_mm, y_mm)
    return count, edges, cameras


@borrowing
def without_edge(rays: FloatArray, count: int, edge: int) -> int:
    """Take the rays of an edge out of the first `count`; return how many are left."""
    kept = 0
    for ray in range(count):
        if rays[EDGE, ray] != edge:
            _move(rays, ray, kept)
            kept += 1
    return kept


@borrowing
def without_outer(rays: FloatArray, count: int, off: FloatArray) -> int:
    """Take the rays that pass far outside out of the first `count`; return how many are left.

    `off` is by how many sigmas each passes outside.  If more than `MOST_WIDENED` edges have such
    rays, the shape is another one, and all are left.
    """
    widened, latest = 0, -1.0
    for ray in range(count):
        if off[ray] >= FARTHEST_OUTSIDE and rays[EDGE, ray] != latest:
            widened, latest = widened + 1, rays[EDGE, ray]
    if widened > MOST_WIDENED:
        return count
    kept = 0
    for ray in range(count):
        if off[ray] < FARTHEST_OUTSIDE:
            _move(rays, ray, kept)
            kept += 1
    return kept


@borrowing
def every_second(rays: FloatArray, count: int) -> int:
    """Leave every second one of the first `count` rays out; return how many are left."""
    for row in range(RAY_ROWS):
        for kept in range(1, (count + 1) // 2):
            rays[row, kept] = rays[row, 2 * kept]
    return (count + 1) // 2


@borrowing
def fill_up(rays: FloatArray, count: int) -> int:
    """Write rays that weigh nothing behind the first `count`; return how many are there then.

    What is left over of `TOGETHER` rays takes a processor as long as all of them.
    """
    filled = int(min((count + TOGETHER - 1) // TOGETHER * TOGETHER, rays.shape[1]))
    for row in range(RAY_ROWS):
        for ray in range(count, filled):
            rays[row, ray] = rays[row, 0]
    rays[WEIGHT, count:filled] = 0.0
    return filled


@borrowing
def _move(rays: FloatArray, ray: int, place: int) -> None:
    for row in range(RAY_ROWS):
        rays[row, place] = rays[row, ray]


@borrowing
def _write_sight(
    eyes: FloatArray,
    first_column: IntArray,
    by_column: FloatArray,
    directions: FloatArray,
    camera: int,
    edge: int,
    column_px: float,
    row_px: float,
    away_x: float,
    away_y: float,
    rays: FloatArray,
    place: int,
) -> int:
    """Write what the camera's tables say of one place of an edge; return 1, or 0 if it is nothing.

    The eye, the slope, the level unit direction in place of the unit direction, and in place of the
    weight how far it turns for each column into the shadow.
    """
    width_px = first_column[camera + 1] - first_column[camera]
    if not 0.0 <= column_px <= width_px:
        return 0
    below, share = column_at(first_column, camera, column_px)
    horizon_px = between(by_column, below, share, HORIZON)
    below_horizon_px = row_px - horizon_px
    slope = -below_horizon_px / between(by_column, below, share, ROWS_PER_SLOPE)
    level_px = column_px - between(by_column, below, share, SHEAR) * below_horizon_px
    if not (between(by_column, below, share, VISIBLE) == 1.0 and 0.0 <= level_px <= width_px):
        return 0
    cos, sin, angle_per_px = direction_at(first_column, directions, camera, level_px)
    along_mm = away_x * cos + away_y * sin
    if not (along_mm > NEAREST_MM and np.isfinite(slope) and np.abs(angle_per_px) > 0.0):
        return 0  # it looks elsewhere, or nobody knows where
    rays[EYE_X, place], rays[EYE_Y, place], rays[EYE_Z, place] = row_of_three(eyes, camera)
    rays[ALONG_X, place], rays[ALONG_Y, place], rays[SLOPE, place] = cos, sin, slope
    rays[WEIGHT, place] = angle_per_px if edge == 0 else -angle_per_px
    return 1


@borrowing
def _direct(rays: FloatArray, count: int, x_mm: float, y_mm: float) -> None:
    """Turn what `_write_sight` wrote into rays."""
    for ray in range(count):  # without branches, so that several go at once
        cos, sin, slope = rays[ALONG_X, ray], rays[ALONG_Y, ray], rays[SLOPE, ray]
        turn_per_px = rays[WEIGHT, ray]
        # the left edge has the first angle, but for a camera that hangs upside down
        side = 1.0 if turn_per_px > 0.0 else -1.0
        shrink = 1.0 / np.sqrt(1.0 + slope * slope)
        along_mm = (x_mm - rays[EYE_X, ray]) * cos + (y_mm - rays[EYE_Y, ray]) * sin
        trace_mm = TRACE_SIGMA_PX * turn_per_px * along_mm
        rays[ALONG_X, ray], rays[ALONG_Y, ray] = cos * shrink, sin * shrink
        rays[ALONG_Z, ray] = slope * shrink
        rays[INTO_X, ray], rays[INTO_Y, ray] = -side * sin, side * cos
        rays[WEIGHT, ray] = 1.0 / np.sqrt(OUTLINE_SIGMA_MM**2 + trace_mm * trace_mm)


@borrowing
def height_over(rays: FloatArray, ray: int, x_mm: float, y_mm: float) -> float:
    """Return how high above the surface a ray passes a place; negative in the mirror image."""
    dx, dy = x_mm - rays[EYE_X, ray], y_mm - rays[EYE_Y, ray]
    # along the surface it runs at right angles to the normal
    along_mm = np.abs(rays[INTO_X, ray] * dy - rays[INTO_Y, ray] * dx)
    return float(rays[EYE_Z, ray] + rays[SLOPE, ray] * along_mm)


@borrowing
def column_at(first_column: IntArray, camera: int, column_px: float) -> tuple[int, float]:
    """Return the number of a column within the picture, and how far beyond its centre."""
    first, last = first_column[camera], first_column[camera + 1] - 1
    below = min(max(first + int(column_px - 0.5), first), last - 1)
    return below, min(max(column_px - 0.5 - (below - first), 0.0), 1.0)


@borrowing
def between(by_column: FloatArray, below: int, share: float, which: int) -> float:
    """Return what is known between the centres of a column and the next one."""
    low = by_column[below, which]
    return float(low + share * (by_column[below + 1, which] - low))


@borrowing
def direction_at(
    first_column: IntArray, directions: FloatArray, camera: int, column_px: float
) -> tuple[float, float, float]:
    """Return the unit vector of a column on the horizon, and how far it turns for each column.

    All are NaN where nobody knows.
    """
    first = first_column[camera]
    width_px = first_column[camera + 1] - first
    below = min(max(int(column_px), 0), width_px - 1)
    share = column_px - below
    place = first + camera + below
    x, y = directions[place, 0], directions[place, 1]
    dx, dy = directions[place + 1, 0] - x, directions[place + 1, 1] - y
    return x + share * dx, y + share * dy, x * dy - y * dx
