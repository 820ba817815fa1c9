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

from cornertouchd.compiling import inlined
from cornertouchd.fusion.cells import Wanted
from cornertouchd.fusion.edge_rows import NO_SHADOW, EdgeRows, row_of_three
from cornertouchd.fusion.pool import Pool, copy_disc
from cornertouchd.model import BoolArray

# Thinner than this is a pen.
SMALLEST_FINGER_RADIUS_MM = 3.3
# With three cameras two would be left, and any two shadows cross.
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


@inlined
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


@inlined
def keep_rescued(rows: EdgeRows, wanted: Wanted, pool: Pool, first: int, end: int) -> int:
    """Keep those discs from `first` on that touch enough of the wanted edges.

    Where two cameras are not believed, each must see the disc before the body of the other.
    Returns how many discs are in the pool then.
    """
    count = first
    for disc in range(first, end):
        if _explains_enough(pool, disc, wanted.edges) and _is_in_line(
            rows, wanted.believed, pool, disc
        ):
            copy_disc(pool, count, pool, disc)
            count += 1
    return count


@inlined
def _explains_enough(pool: Pool, disc: int, unexplained: BoolArray) -> bool:
    edges = cameras = 0
    for camera in range(pool.shadows.shape[1]):
        shadow = pool.shadows[disc, camera]
        if shadow != NO_SHADOW:
            first = pool.misfits[disc, 2 * camera] < np.inf and unexplained[2 * shadow]
            last = pool.misfits[disc, 2 * camera + 1] < np.inf and unexplained[2 * shadow + 1]
            edges += int(first) + int(last)
            cameras += int(first or last)
    return (
        edges >= FEWEST_EDGES
        and cameras >= FEWEST_CAMERAS_WITH_EDGES
        and pool.discs[disc, 2] <= LARGEST_RADIUS_MM
    )


@inlined
def _is_in_line(rows: EdgeRows, believed: BoolArray, pool: Pool, disc: int) -> bool:
    """Tell whether each of two disbelieved cameras sees the disc before the body of the other."""
    for a in range(len(believed)):
        for b in range(len(believed)):
            both = a != b and not (believed[a] or believed[b])
            if both and not _is_before_body(rows, pool, disc, a, b):
                return False
    return True


@inlined
def _is_before_body(rows: EdgeRows, pool: Pool, disc: int, eye: int, other: int) -> bool:
    x, y, radius = row_of_three(pool.discs, disc)
    eye_x, eye_y = rows.eyes[eye, 0], rows.eyes[eye, 1]
    dx, dy = x - eye_x, y - eye_y
    body_x, body_y = rows.eyes[other, 0] - eye_x, rows.eyes[other, 1] - eye_y
    beside = np.abs(np.arctan2(dx * body_y - dy * body_x, dx * body_x + dy * body_y))
    distance = np.hypot(dx, dy)
    half_angle = np.arcsin(radius / distance) if distance > radius else np.pi
    return bool(beside < half_angle + CAMERA_BODY_MM / np.hypot(body_x, body_y))
