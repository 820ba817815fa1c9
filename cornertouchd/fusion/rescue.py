"""Rescue: what fingers that all cameras show leave unexplained.

Pens are sought only then: discs as thin fit into many a gap between fingers, and make a scene in
two hundred of fifteen fingers worse.

Then contacts that a camera fails to show.  A camera misses a shadow when its strip is soiled there
or a picture is torn.  Two cameras miss one when they look at each other past a thin contact, each
with the other's body for a background.  Such a contact lies in the light of those cameras and so in
no cell; what the other cameras saw of it stays unexplained.  So cameras are disbelieved: each one
in turn, and each pair along its line.
"""

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.cells import Wanted
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import NO_SHADOW, EdgeRows, is_in_view, row_of_three
from cornertouchd.fusion.pool import Pool, copy_disc
from cornertouchd.model import BoolArray, FloatArray

# Of those that look at a place: with three cameras two would be left, and any two shadows cross.
FEWEST_CAMERAS = 4
# Two whole shadows.  Three edges would find a tenth more of the missed contacts, but with a
# calibration error of 1 mm it makes twice as many ghosts as it finds contacts.
FEWEST_EDGES = 4
FEWEST_CAMERAS_WITH_EDGES = 2
# More shadows (ten contacts in eight cameras cast so many) or contacts are a broken strip.
MOST_SHADOWS = 80
MOST_CONTACTS = 30
# A large disc touches too many edges by chance.
LARGEST_RADIUS_MM = 10.0
# What a camera's body hides of the strip to either side of its pinhole, generously.
CAMERA_BODY_MM = 15.0


@borrowing
def is_needed(rows: EdgeRows, unexplained: BoolArray, contacts: int) -> bool:
    """Tell whether a rescue has a chance: `unexplained` (2 S,) marks edges."""
    edges = 0
    for edge in range(len(unexplained)):
        edges += int(unexplained[edge])
    return edges >= FEWEST_EDGES and len(rows.shadows) <= MOST_SHADOWS and contacts <= MOST_CONTACTS


@inlined
def cameras_to_believe(cameras: int) -> BoolArray:
    """Return which cameras to believe, (., C): all but one or two; none with too few of them."""
    sets = cameras * (cameras + 1) // 2 if cameras >= FEWEST_CAMERAS else 0
    believed = np.full((sets, cameras), True)
    a = b = 0
    for row in range(sets):
        believed[row, a] = believed[row, b] = False
        b += 1
        if b == cameras:
            a += 1
            b = a
    return believed


@borrowing
def keep_rescued(rows: EdgeRows, wanted: Wanted, pool: Pool, first: int, end: int) -> int:
    """Keep those discs from `first` on that touch enough of the wanted edges.

    Where a camera does not look, it misses nothing: it need not be disbelieved.  Where two cameras
    are not believed, each must see the disc before the body of the other.
    Returns how many discs are in the pool then.
    """
    count = first
    for disc in range(first, end):
        x, y, radius = row_of_three(pool.discs, disc)
        if (
            radius <= LARGEST_RADIUS_MM
            and _is_missed(rows, wanted.believed, pool, disc)
            and _explains_enough(pool.shadows, pool.misfits, disc, wanted.edges)
            and _is_in_line(rows.eyes, wanted.believed, x, y, radius)
        ):
            copy_disc(pool, count, pool, disc)
            count += 1
    return count


@borrowing
def _is_missed(rows: EdgeRows, believed: BoolArray, pool: Pool, disc: int) -> bool:
    """Tell whether all disbelieved cameras look at a disc, and enough cameras with them."""
    x, y, _ = row_of_three(pool.discs, disc)
    looking = 0
    for camera in range(len(believed)):
        if believed[camera]:
            looking += int(pool.shadows[disc, camera] != NO_SHADOW)
        elif is_in_view(rows.eyes, rows.views, camera, x, y):
            looking += 1
        else:
            return False
    return looking >= FEWEST_CAMERAS


@borrowing
def _explains_enough(
    shadows: IntArray, misfits: FloatArray, disc: int, unexplained: BoolArray
) -> bool:
    edges = cameras = 0
    for camera in range(shadows.shape[1]):
        shadow = shadows[disc, camera]
        if shadow != NO_SHADOW:
            first = misfits[disc, 2 * camera] < np.inf and unexplained[2 * shadow]
            last = misfits[disc, 2 * camera + 1] < np.inf and unexplained[2 * shadow + 1]
            edges += int(first) + int(last)
            cameras += int(first or last)
    return edges >= FEWEST_EDGES and cameras >= FEWEST_CAMERAS_WITH_EDGES


@borrowing
def _is_in_line(
    eyes: FloatArray, believed: BoolArray, x_mm: float, y_mm: float, radius_mm: float
) -> bool:
    """Tell whether each of two disbelieved cameras sees a disc before the body of the other."""
    for a in range(len(believed)):
        for b in range(len(believed)):
            if a == b or believed[a] or believed[b]:
                continue
            dx, dy = x_mm - eyes[a, 0], y_mm - eyes[a, 1]
            body_x, body_y = eyes[b, 0] - eyes[a, 0], eyes[b, 1] - eyes[a, 1]
            beside = np.abs(np.arctan2(dx * body_y - dy * body_x, dx * body_x + dy * body_y))
            distance, apart = np.hypot(dx, dy), np.hypot(body_x, body_y)
            half_angle = np.arcsin(radius_mm / distance) if distance > radius_mm else np.pi
            if beside >= half_angle + CAMERA_BODY_MM / apart:
                return False
    return True
