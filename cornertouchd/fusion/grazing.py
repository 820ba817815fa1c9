"""Rays that graze two fingers: whose edge it is nobody can tell, so they count for less.

Where one finger stands before or behind another and reaches just as far, one edge is the outline
of both.  That each is no farther out is all that it tells.
"""

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.capsule_fit import (
    OFF,
    OUTSIDE,
    TIP_X,
    TIP_Y,
    mirror_up,
    write_misses,
)
from cornertouchd.fusion.rays import EDGE, EYE_X, EYE_Y, INTO_X, INTO_Y, RAY_ROWS, WEIGHT
from cornertouchd.model import FloatArray

# A ray that passes a finger so near may be its edge: the outlines of path-traced fingers
# stray by less from their capsules.
GRAZES_MM = 0.3
# The share of its weight that such a ray keeps: it is then known to a millimetre.
SHARED_WEIGHT = 0.1
# Near the surface no part of a finger is farther beside its tip, in radii.
WIDEST_REACH = 4.0


@inlined
def weaken_shared(
    rays: FloatArray,
    count: int,
    poses: FloatArray,
    contact: int,
    near: FloatArray,
    rows: FloatArray,
) -> int:
    """Take weight from a contact's rays that graze other contacts as well; count these rays.

    `poses` (N, 8) are the capsules of all, as by `write_pose`, NaN where there is none.  `near` and
    `rows` are room for as many rays and their misses.
    """
    is_shared = np.zeros(count, np.bool_)
    for other in range(len(poses)):
        if other == contact:
            continue
        few = _take_near(rays, count, poses[other], near)
        mirror_up(near, few, poses[other, TIP_X], poses[other, TIP_Y])
        write_misses(near, few, poses[other], rows)
        for number in range(few):
            if abs(rows[OFF, number]) < GRAZES_MM:
                is_shared[int(near[EDGE, number])] = True
    shared = 0
    for ray in range(count):
        if is_shared[ray]:
            rays[WEIGHT, ray] *= SHARED_WEIGHT
            shared += 1
    return shared


@borrowing
def _take_near(rays: FloatArray, count: int, pose: FloatArray, near: FloatArray) -> int:
    """Copy the rays that come so near to a capsule that a closer look is worth while; count them.

    In place of their edge they have their number.
    """
    x_mm, y_mm, reach_mm = pose[TIP_X], pose[TIP_Y], WIDEST_REACH * pose[OUTSIDE]
    few = 0
    for ray in range(count):
        dx, dy = x_mm - rays[EYE_X, ray], y_mm - rays[EYE_Y, ray]
        if abs(rays[INTO_X, ray] * dx + rays[INTO_Y, ray] * dy) < reach_mm:
            for row in range(RAY_ROWS):
                near[row, few] = rays[row, ray]
            near[EDGE, few] = ray
            few += 1
    return few
