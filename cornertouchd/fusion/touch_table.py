"""The table of touch points: the section of every contact, improved by the edges that it owns."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cornertouchd.compiling import borrowing, compiled, inlined
from cornertouchd.fusion.capsule_fit import (
    LEAN_X,
    LEAN_Y,
    OFF,
    PRESSED,
    PRESSED_MM,
    PRESSED_SIGMA_MM,
    RADIUS,
    RESIDUAL_ROWS,
    TAPER,
    TAPER_MEAN,
    TAPER_SIGMA,
    UNKNOWNS,
    FitRoom,
    X,
    Y,
    fit_capsule,
    fit_room,
    worst_edge,
    write_pose,
)
from cornertouchd.fusion.cholesky import write_inverse_column
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import row_of_three
from cornertouchd.fusion.grazing import weaken_shared
from cornertouchd.fusion.hover import ROWS, KeptLight, gap_number, light_gap, light_of_touch
from cornertouchd.fusion.rays import (
    RAY_ROWS,
    TOGETHER,
    Views,
    every_second,
    traces_of,
    without_edge,
    without_outer,
    write_rays,
)
from cornertouchd.fusion.touch_fit import FEWEST_RAYS, fit_touch
from cornertouchd.model import FloatArray

SECTION, SHAPE_FREE, CAPSULE = range(3)
"""How a touch point was found."""

# Where the section of a finger lies beside its touch, in each direction, for each millimetre of the
# camera's height: .87 mm RMS on the small rig of the path-traced pictures, whose cameras stand 6 mm
# high.  A touch that is farther away, in its sigmas, is not believed.
SHIFT_SHARE = 0.105
FARTHEST_SIGMAS = 8.0
# Lean of fingers, as a slope, that nobody knows; and by how much that of the tip alone is off.
UNKNOWN_LEAN_SIGMA, TIP_LEAN_SIGMA = 0.5, 0.35
UNKNOWN_AZIMUTH_SIGMA_RAD = np.pi / np.sqrt(3.0)
# Two edges leave everything open.  Three fit whatever they are, and of four that do not, none can
# be told to be another finger's: measured errors are two to three times what the fit expects.
FEWEST_EDGES, FEWEST_CHECKED, UNCHECKED = 3, 4, 6.0
# Neighbouring rays of an edge share their errors: with so many edges every second one will do.
MANY_EDGES = 5
# Fingers that nothing else hides cost less than this (95 of 100).
SMOOTH_COST = 0.5
# A capsule is believed if its rays fit it as well as those of fingers do and nothing about it is
# strange for a finger: discs and pens want no round tip, what hovers wants one above the surface.
LARGEST_COST, LARGEST_STRANGENESS = 1.0, 3.0
SMALLEST_RADIUS_MM, LARGEST_RADIUS_MM = 2.5, 13.0
# Errors that rays of an edge share, and that all edges share: rays tell less than if each stood for
# itself.  With these, 95 % of the capsules in path-traced pictures lie within 1.8 sigmas.
RAYS_IN_ONE = 2.0
CALIBRATION_SIGMA_MM = 0.04

# Compiled code takes the outlines of so many cameras; those that a rig lacks have none.
MOST_CAMERAS = 8

# Columns of the table of touch points.
AT_X, AT_Y, XX, XY, YY, AT_RADIUS = range(6)
LEAN, AZIMUTH, LEAN_SIGMA, AZIMUTH_SIGMA = range(6, 10)
METHOD, GAP, GAP_CAMERAS = range(10, 13)
COLUMNS = 13


class Room(NamedTuple):
    """Where the rays of one contact and its fits are written."""

    rays: FloatArray
    near: FloatArray
    rows: FloatArray
    touch: FloatArray
    touch_information: FloatArray
    moments: FloatArray
    capsule: FloatArray
    capsule_information: FloatArray
    expected: FloatArray
    fit: FitRoom
    column: FloatArray
    light: FloatArray


@inlined
def _room_for(most_rays: int) -> Room:
    return Room(
        np.empty((RAY_ROWS, most_rays)),
        np.empty((RAY_ROWS, most_rays)),
        np.empty((RESIDUAL_ROWS, most_rays)),
        np.empty(6),
        np.empty((6, 6)),
        np.empty(6),
        np.empty(UNKNOWNS),
        np.empty((UNKNOWNS, UNKNOWNS)),
        np.empty(UNKNOWNS),
        fit_room(),
        np.empty(UNKNOWNS),
        np.empty(ROWS),
    )


@borrowing
def _write_section(
    points: FloatArray,
    contact: int,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    sigma_mm: float,
    camera_mm: float,
) -> None:
    """Write what is known of a contact without its rows."""
    points[contact, :] = 0.0
    points[contact, AT_X], points[contact, AT_Y] = x_mm, y_mm
    points[contact, AT_RADIUS] = radius_mm
    points[contact, XX] = points[contact, YY] = sigma_mm**2 + (SHIFT_SHARE * camera_mm) ** 2
    points[contact, LEAN_SIGMA] = UNKNOWN_LEAN_SIGMA
    points[contact, AZIMUTH_SIGMA] = UNKNOWN_AZIMUTH_SIGMA_RAD
    points[contact, METHOD] = SECTION


@borrowing
def _fit(points: FloatArray, contact: int, room: Room, count: int, edges: int, cameras: int) -> int:
    """Improve the section by its rays, as far as they tell; return the number of their edges."""
    x, y = points[contact, AT_X], points[contact, AT_Y]
    radius = points[contact, AT_RADIUS]
    if cameras < 2 or edges < FEWEST_EDGES or not radius < LARGEST_RADIUS_MM:
        return 0  # palms have no tip
    touch, information = room.touch, room.touch_information
    used, misfit = fit_touch(
        room.rays, count, x, y, radius, room.rows, touch, information, room.moments
    )
    if used < FEWEST_RAYS:
        return 0
    variance_mm2 = points[contact, XX]
    doubt = RAYS_IN_ONE * max(misfit, 1.0) * (UNCHECKED if edges <= FEWEST_CHECKED else 1.0)
    if _is_near(touch[0] - x, touch[1] - y, variance_mm2):
        _write_place(points, contact, SHAPE_FREE, touch, information, doubt, room.column[:6])
    if edges >= MANY_EDGES:
        count = every_second(room.rays, count)
    cost = _fit_capsule(room, count, x, y, radius)
    if not cost < SMOOTH_COST and edges <= FEWEST_CHECKED:
        kept = without_outer(room.rays, count, room.rows[OFF])
        if FEWEST_RAYS <= kept < count:  # they graze what stands before or behind it
            count = kept
            cost = _fit_capsule(room, count, x, y, radius)
    if not cost < LARGEST_COST and edges > FEWEST_CHECKED:  # one edge may be another finger's
        count = without_edge(room.rays, count, worst_edge(room.rays, count, room.rows))
        cost = _fit_capsule(room, count, x, y, radius)
    if cost < LARGEST_COST and _is_finger(room.capsule, x, y, variance_mm2):
        points[contact, AT_RADIUS] = room.capsule[RADIUS]
        factor, doubt_of_capsule = room.capsule_information, RAYS_IN_ONE * max(cost, 1.0)
        if edges == FEWEST_EDGES:
            doubt_of_capsule *= UNCHECKED
        _write_place(points, contact, CAPSULE, room.capsule, factor, doubt_of_capsule, room.column)
        if points[contact, METHOD] == CAPSULE:
            _write_lean(
                points, contact, room.capsule, factor, LEAN_X, doubt_of_capsule, room.column
            )
    if points[contact, METHOD] == SHAPE_FREE:
        _write_lean(points, contact, touch, information, 2, doubt, room.column[:6])
    return edges


@borrowing
def _is_near(dx_mm: float, dy_mm: float, variance_mm2: float) -> bool:
    return bool(dx_mm * dx_mm + dy_mm * dy_mm < FARTHEST_SIGMAS**2 * variance_mm2)


@borrowing
def _fit_capsule(room: Room, count: int, x_mm: float, y_mm: float, radius_mm: float) -> float:
    """Fit one, beginning where the touch was found; return what its rays cost on average."""
    capsule, expected = room.capsule, room.expected
    expected[X], expected[Y], expected[RADIUS] = x_mm, y_mm, radius_mm
    expected[LEAN_X] = expected[LEAN_Y] = 0.0
    expected[PRESSED], expected[TAPER] = PRESSED_MM, TAPER_MEAN
    capsule[RADIUS], capsule[PRESSED], capsule[TAPER] = radius_mm, PRESSED_MM, TAPER_MEAN
    capsule[X], capsule[Y] = room.touch[0], room.touch[1]
    capsule[LEAN_X], capsule[LEAN_Y] = room.touch[2], room.touch[3]
    return fit_capsule(
        room.rays, count, expected, capsule, room.capsule_information, room.rows, room.fit
    )


@borrowing
def _is_finger(capsule: FloatArray, x_mm: float, y_mm: float, variance_mm2: float) -> bool:
    """Whether a capsule is as fingers are: not flat as a disc or thin as a pen, nor in the air."""
    return bool(
        abs(capsule[PRESSED] - PRESSED_MM) < LARGEST_STRANGENESS * PRESSED_SIGMA_MM
        and abs(capsule[TAPER] - TAPER_MEAN) < LARGEST_STRANGENESS * TAPER_SIGMA
        and SMALLEST_RADIUS_MM < capsule[RADIUS] < LARGEST_RADIUS_MM
        and _is_near(capsule[X] - x_mm, capsule[Y] - y_mm, variance_mm2)
    )


@borrowing
def _write_place(
    points: FloatArray,
    contact: int,
    method: int,
    terms: FloatArray,
    factor: FloatArray,
    doubt: float,
    column: FloatArray,
) -> None:
    """Write where a touch is, and its covariance times `doubt`.

    Nothing is written if what is there tells as much.  `column` is room for as many terms.
    """
    write_inverse_column(factor, 0, column)
    xx, xy = doubt * column[0] + CALIBRATION_SIGMA_MM**2, doubt * column[1]
    write_inverse_column(factor, 1, column)
    yy = doubt * column[1] + CALIBRATION_SIGMA_MM**2
    if not xx + yy < points[contact, XX] + points[contact, YY]:
        return
    points[contact, XX], points[contact, XY], points[contact, YY] = xx, xy, yy
    points[contact, AT_X], points[contact, AT_Y] = terms[0], terms[1]
    points[contact, METHOD] = method


@borrowing
def _write_lean(
    points: FloatArray,
    contact: int,
    terms: FloatArray,
    factor: FloatArray,
    lean: int,
    doubt: float,
    column: FloatArray,
) -> None:
    """Write how a touch leans (from term number `lean` on), its covariance times `doubt`.

    `column` is room for as many terms.
    """
    extra = TIP_LEAN_SIGMA**2 if points[contact, METHOD] == SHAPE_FREE else 0.0
    write_inverse_column(factor, lean, column)
    xx, xy = doubt * column[lean] + extra, doubt * column[lean + 1]
    write_inverse_column(factor, lean + 1, column)
    yy = doubt * column[lean + 1] + extra
    _write_angles(points, contact, terms[lean], terms[lean + 1], xx, xy, yy)


@borrowing
def _write_angles(
    points: FloatArray, contact: int, x: float, y: float, xx: float, xy: float, yy: float
) -> None:
    """Turn a slope with its covariance into angles and theirs."""
    slope = np.hypot(x, y)
    cos, sin = (x / slope, y / slope) if slope > 0.0 else (1.0, 0.0)
    along = xx * cos * cos + 2.0 * xy * cos * sin + yy * sin * sin
    across = xx * sin * sin - 2.0 * xy * cos * sin + yy * cos * cos
    points[contact, LEAN], points[contact, AZIMUTH] = np.arctan(slope), np.arctan2(sin, cos)
    points[contact, LEAN_SIGMA] = np.sqrt(max(along, 0.0)) / (1.0 + slope * slope)
    points[contact, AZIMUTH_SIGMA] = min(
        np.sqrt(max(across, 0.0)) / max(slope, 1e-9), UNKNOWN_AZIMUTH_SIGMA_RAD
    )


@borrowing
def _add_gap(
    points: FloatArray,
    contact: int,
    views: Views,
    kept: KeptLight,
    camera: int,
    light: FloatArray,
) -> None:
    """Add the light that a camera sees below a contact; `light` is room for that on all rows."""
    x, y, radius = points[contact, AT_X], points[contact, AT_Y], points[contact, AT_RADIUS]
    brightest, pixels_per_mm = light_gap(views, kept, camera, x, y, radius, light)
    if np.isfinite(brightest):
        points[contact, GAP] += brightest / light_of_touch(pixels_per_mm, radius)
        points[contact, GAP_CAMERAS] += 1.0


@compiled(
    "f8[:,::1](f8[:,::1], i8[::1], f8[:,::1], f8[:,::1],"
    f" UniTuple(f8[:,:,::1], {MOST_CAMERAS}), UniTuple(f8[:,:,::1], {MOST_CAMERAS}),"
    f" UniTuple(f4[:,::1], {MOST_CAMERAS}), UniTuple(i4[::1], {MOST_CAMERAS}),"
    f" UniTuple(i4[::1], {MOST_CAMERAS}), f8[:,::1], i8[:,:,::1])"
)
def touch_points(
    eyes: FloatArray,
    first_column: IntArray,
    by_column: FloatArray,
    directions: FloatArray,
    columns_px: tuple[FloatArray, ...],
    rows_px: tuple[FloatArray, ...],
    light: tuple[NDArray[np.float32], ...],
    light_at: tuple[NDArray[np.int32], ...],
    light_row_px: tuple[NDArray[np.int32], ...],
    sections: FloatArray,
    owned: IntArray,
) -> FloatArray:
    """Return the table of N touch points, (N, 13), with the columns `AT_X` .. `GAP_CAMERAS`.

    Those with few edges are looked at twice: rays that graze the capsules of others tell less.

    The first arguments are those of `Views`, then come those of `Outlines`, one array a camera (any
    beyond the number of `eyes` are left alone); the last are those of `TouchPointFinder.table`.
    """
    views = Views(eyes, first_column, by_column, directions)
    traces = traces_of(columns_px, rows_px, len(eyes))
    room = _room_for(2 * len(eyes) * traces.columns_px.shape[2] + TOGETHER)
    points, poses = np.empty((len(sections), COLUMNS)), np.full((len(sections), 8), np.nan)
    edges = np.full(len(sections), FEWEST_EDGES)
    camera_mm = float(np.mean(eyes[:, 2]))
    for again in range(2 if len(sections) > 1 else 1):
        for contact in range(len(sections)):
            if edges[contact] < FEWEST_EDGES or edges[contact] > MANY_EDGES:
                continue  # it would change nothing, or hardly anything
            x, y, radius = row_of_three(sections, contact)
            count, seen, cameras = write_rays(
                views, traces, owned, contact, x, y, radius, room.rays
            )
            if again and not weaken_shared(room.rays, count, poses, contact, room.near, room.rows):
                continue
            _write_section(points, contact, x, y, radius, sections[contact, 3], camera_mm)
            edges[contact] = _fit(points, contact, room, count, seen, cameras)
            if again == 0 and points[contact, METHOD] == CAPSULE:
                write_pose(room.capsule, poses[contact])
    for camera in range(len(eyes)):
        kept = KeptLight(light[camera], light_at[camera], light_row_px[camera])
        for contact in range(len(sections)):
            _add_gap(points, contact, views, kept, camera, room.light)
    for contact in range(len(sections)):
        points[contact, GAP] = gap_number(
            points[contact, GAP], int(points[contact, GAP_CAMERAS]), points[contact, AT_RADIUS]
        )
    return points
