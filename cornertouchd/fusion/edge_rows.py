"""Shadow edges as linear equations: an edge is a tangent to the disc that casts it.

A line through a camera at P with unit normal n, pointing into the shadow, touches a disc (x, y, r)
when n.(x, y) - n.P - r = 0, which is linear in all three unknowns.  The left side is the slack of
the disc: positive when it lies deeper in the shadow, negative when it reaches into the light.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.limits import ROUNDING_MM, SURFACE_MARGIN_MM
from cornertouchd.model import BoolArray, FloatArray

# Ten fingers cast at most ten shadows in each camera.  Cameras that report more than this together
# are looking at broken strips: the widest shadows will do, so that the work stays bounded.
MOST_SHADOWS = 192
# A disc may reach this far into the light, a tangent may miss the disc by as much: 99.7 % of
# honest edges.  Anything from 2 to 4 gives the same contacts.
GATE_SIGMAS = 3.0
# Columns of a table of shadows.
FIRST, LAST, SIGMA, BEGINS = 0, 1, 2, 3
# In place of a shadow's number: the camera shows none, or is not believed.
NO_SHADOW = -1
# The last column of a table of views, and what stands there: the camera sees the whole surface; it
# sees what both lines of view have before them; or, in more than half a turn, what either has.
KIND = 4
SEES_ALL, NARROW, WIDE = 0.0, 1.0, 2.0


class Sightings(NamedTuple):
    """The shadows of all cameras one after the other, `counts` (C,) of each, as they were laid.

    `positions_mm` is (C, 2) and so is `views_rad`, the first and the last angle of each view; the
    others are (N,).
    """

    positions_mm: FloatArray
    views_rad: FloatArray
    counts: IntArray
    first_rad: FloatArray
    last_rad: FloatArray
    first_valid: BoolArray
    last_valid: BoolArray
    sigma_rad: FloatArray


class EdgeRows(NamedTuple):
    """The S shadows of those C cameras that have any, two edges each.

    Shadows are numbered through all cameras; camera c owns those from `first_shadow[c]` up to
    `first_shadow[c + 1]`, in ascending order of angle.  Edge e of shadow s has number 2 s + e, its
    row in `lines` (2 S, 3) is the inward normal and the offset n.P, and `valid` (2 S,) says whether
    it bounds anything.  `eyes` (C, 5) holds x, y
    and an angle amid the camera's shadows with its cosine and sine, around which angles are
    unwrapped.  `views` (C, 5) holds the normals of the first and of the last line of view, into
    the view, and its `KIND`.  `shadows` (S, 4) have the columns `FIRST`, `LAST`, `SIGMA` and
    `BEGINS`: the first angle once more, as a turn.

    Taking an array out of a tuple costs compiled functions more than a multiplication: those that
    run thousands of times are given the arrays that they need.
    """

    eyes: FloatArray
    views: FloatArray
    first_shadow: IntArray
    shadows: FloatArray
    lines: FloatArray
    valid: BoolArray


@inlined
def edge_rows(
    seen: Sightings, width_mm: float, height_mm: float
) -> tuple[EdgeRows, IntArray, IntArray]:
    """Collect the rows of all cameras that have a usable shadow; the others are left out.

    Also returns which cameras they are, by their numbers among all, and which shadow of `seen` each
    one is.  The surface is so large.
    """
    kept, counts = _usable_shadows(seen)
    cameras, shadows = 0, len(kept)
    for count in counts:
        cameras += count > 0
    rows = EdgeRows(
        np.empty((cameras, 5)),
        np.empty((cameras, 5)),
        np.zeros(cameras + 1, np.intp),
        np.empty((shadows, 4)),
        np.empty((2 * shadows, 3)),
        np.empty(2 * shadows, np.bool_),
    )
    seeing = np.empty(cameras, np.intp)
    camera = start = 0
    for number in range(len(counts)):
        if counts[number] == 0:
            continue
        end = start + counts[number]
        forward_rad = (seen.first_rad[kept[start]] + seen.last_rad[kept[end - 1]]) / 2.0
        seeing[camera] = number
        rows.first_shadow[camera + 1] = end
        rows.eyes[camera, 0] = seen.positions_mm[number, 0]
        rows.eyes[camera, 1] = seen.positions_mm[number, 1]
        rows.eyes[camera, 2] = forward_rad
        rows.eyes[camera, 3] = np.cos(forward_rad)
        rows.eyes[camera, 4] = np.sin(forward_rad)
        _write_view(rows, camera, seen.views_rad, number, width_mm, height_mm)
        for shadow in range(start, end):
            _write_shadow(rows, camera, shadow, seen, kept[shadow])
        camera, start = camera + 1, end
    return rows, seeing, kept


@borrowing
def _write_view(
    rows: EdgeRows,
    camera: int,
    views_rad: FloatArray,
    number: int,
    width_mm: float,
    height_mm: float,
) -> None:
    views = rows.views
    x, y, _ = row_of_three(rows.eyes, camera)
    first, last = views_rad[number, 0], views_rad[number, 1]
    views[camera, 0], views[camera, 1] = -np.sin(first), np.cos(first)
    views[camera, 2], views[camera, 3] = np.sin(last), -np.cos(last)
    views[camera, KIND] = NARROW if last - first <= np.pi else WIDE
    if _has_before_it(first, last, x, y, width_mm, height_mm):
        views[camera, KIND] = SEES_ALL


@borrowing
def _has_before_it(
    first: float, last: float, x_mm: float, y_mm: float, width_mm: float, height_mm: float
) -> bool:
    """Tell whether a view from a place holds the whole surface, with its margin."""
    if not (last - first < 2.0 * np.pi):  # in a full turn, an infinite one or no number
        return True
    margin = SURFACE_MARGIN_MM + ROUNDING_MM
    lowest, highest = np.inf, -np.inf
    for corner_x in (-margin, width_mm + margin):
        for corner_y in (-margin, height_mm + margin):
            angle = (np.arctan2(corner_y - y_mm, corner_x - x_mm) - first) % (2.0 * np.pi)
            lowest, highest = min(lowest, angle), max(highest, angle)
    # more than half a turn from corner to corner: the surface lies around the eye, or a gap of the
    # view on it
    return bool(highest < last - first and highest - lowest < np.pi)


@inlined
def _usable_shadows(seen: Sightings) -> tuple[IntArray, IntArray]:
    """Leave out shadows that are no interval of finite angles; keep the widest of each camera.

    Returns their numbers, in order of angle in each camera, and how many each camera has.
    """
    most = MOST_SHADOWS // max(len(seen.counts), 1)
    kept = np.empty(len(seen.first_rad), np.intp)
    counts = np.zeros(len(seen.counts), np.intp)
    start = count = 0
    for camera in range(len(seen.counts)):
        first_kept = count
        for shadow in range(start, start + seen.counts[camera]):
            if not _is_usable(seen, shadow):
                continue
            place = count
            while place > first_kept and seen.first_rad[kept[place - 1]] > seen.first_rad[shadow]:
                kept[place] = kept[place - 1]
                place -= 1
            kept[place] = shadow
            count += 1
        while count - first_kept > most:
            _leave_out_narrowest(seen, kept, first_kept, count)
            count -= 1
        counts[camera] = count - first_kept
        start += seen.counts[camera]
    return kept[:count], counts


@borrowing
def _is_usable(seen: Sightings, shadow: int) -> bool:
    first, last = seen.first_rad[shadow], seen.last_rad[shadow]
    return bool(
        np.isfinite(first)
        and np.isfinite(last)
        and first < last
        and last < first + 2.0 * np.pi
        and np.isfinite(seen.sigma_rad[shadow])
        and seen.sigma_rad[shadow] > 0.0
    )


@borrowing
def _leave_out_narrowest(seen: Sightings, kept: IntArray, start: int, end: int) -> None:
    """Close the gap that the narrowest leaves; of equal ones, the last."""
    narrowest = start
    for place in range(start, end):
        width = seen.last_rad[kept[place]] - seen.first_rad[kept[place]]
        if width <= seen.last_rad[kept[narrowest]] - seen.first_rad[kept[narrowest]]:
            narrowest = place
    for place in range(narrowest, end - 1):
        kept[place] = kept[place + 1]


@borrowing
def _write_shadow(rows: EdgeRows, camera: int, shadow: int, seen: Sightings, number: int) -> None:
    first, last = seen.first_rad[number], seen.last_rad[number]
    rows.shadows[shadow, FIRST], rows.shadows[shadow, LAST] = first, last
    rows.shadows[shadow, SIGMA] = seen.sigma_rad[number]
    rows.valid[2 * shadow] = seen.first_valid[number]
    rows.valid[2 * shadow + 1] = seen.last_valid[number]
    x, y, forward_rad = row_of_three(rows.eyes, camera)
    along_x, along_y = np.cos(first), np.sin(first)
    _write_line(rows.lines, 2 * shadow, -along_y, along_x, x, y)
    _write_line(rows.lines, 2 * shadow + 1, np.sin(last), -np.cos(last), x, y)
    whole_turns = np.floor((first - forward_rad + np.pi) / (2.0 * np.pi))
    rows.shadows[shadow, BEGINS] = 4.0 * whole_turns + _turn(rows.eyes, camera, along_x, along_y)


@borrowing
def _write_line(lines: FloatArray, edge: int, nx: float, ny: float, x: float, y: float) -> None:
    lines[edge, 0], lines[edge, 1], lines[edge, 2] = nx, ny, nx * x + ny * y


@borrowing
def _turn(eyes: FloatArray, camera: int, dx: float, dy: float) -> float:
    """Return -2..2 for a direction -180..180 degrees from forward: it grows with the angle.

    It takes a tenth of the time of an arctangent.
    """
    along = dx * eyes[camera, 3] + dy * eyes[camera, 4]
    across = dy * eyes[camera, 3] - dx * eyes[camera, 4]
    share = across / max(abs(along) + abs(across), 1e-300)
    return float(share if along >= 0.0 else np.copysign(2.0, across) - share)


@borrowing
def shadow_at(
    eyes: FloatArray,
    shadows: FloatArray,
    first_shadow: IntArray,
    camera: int,
    x_mm: float,
    y_mm: float,
) -> int:
    """Return the last shadow of the camera that begins before a place, else its first."""
    turn = _turn(eyes, camera, x_mm - eyes[camera, 0], y_mm - eyes[camera, 1])
    first = first_shadow[camera]
    begun = 0
    # asking all of them is quicker than a bisection, whose branches cannot be foreseen
    for shadow in range(first, first_shadow[camera + 1]):
        begun += int(shadows[shadow, BEGINS] <= turn)
    return int(first + max(begun - 1, 0))


@borrowing
def is_in_view(eyes: FloatArray, views: FloatArray, camera: int, x_mm: float, y_mm: float) -> bool:
    """Tell whether a camera looks at a place; on a line of view it does not."""
    if views[camera, KIND] == SEES_ALL:
        return True
    dx, dy = x_mm - eyes[camera, 0], y_mm - eyes[camera, 1]
    behind_first = views[camera, 0] * dx + views[camera, 1] * dy > ROUNDING_MM
    before_last = views[camera, 2] * dx + views[camera, 3] * dy > ROUNDING_MM
    if views[camera, KIND] == NARROW:
        return bool(behind_first & before_last)
    return bool(behind_first | before_last)


@borrowing
def squared_distance(eyes: FloatArray, camera: int, x_mm: float, y_mm: float) -> float:
    """Return that of a place from a camera."""
    dx, dy = x_mm - eyes[camera, 0], y_mm - eyes[camera, 1]
    return float(dx * dx + dy * dy)


@borrowing
def variance_of(
    eyes: FloatArray, shadows: FloatArray, camera: int, shadow: int, x_mm: float, y_mm: float
) -> float:
    """Return that of the edges of a shadow at a place, in mm**2."""
    return float(shadows[shadow, SIGMA] ** 2 * squared_distance(eyes, camera, x_mm, y_mm))


@borrowing
def slack_of(lines: FloatArray, edge: int, x_mm: float, y_mm: float, radius_mm: float) -> float:
    """Return the slack of a disc at an edge."""
    return float(lines[edge, 0] * x_mm + lines[edge, 1] * y_mm - lines[edge, 2] - radius_mm)


@borrowing
def row_of_three(table: FloatArray, row: int) -> tuple[float, float, float]:
    """Return the first three numbers of a row."""
    return table[row, 0], table[row, 1], table[row, 2]
