"""Rays that graze two fingers: whose edge it is nobody can tell, so they count for less.

Where one finger stands before or behind another and reaches just as far, one edge is the outline
of both.  That each is no farther out is all that it tells.
"""

import numpy as np

from cornertouchd.compiling import inlined
from cornertouchd.fusion.capsule_fit import OUTSIDE, TIP_X, TIP_Y, mirror_up, miss
from cornertouchd.fusion.rays import EYE_X, EYE_Y, INTO_X, INTO_Y, RAY_COLUMNS, WEIGHT
from cornertouchd.model import FloatArray

# A ray that passes a finger so near may be its edge: the outlines of path-traced fingers
# stray by less from their capsules.
GRAZES_MM = 0.3
# The share of its weight that such a ray keeps: it is then known to a millimetre.
SHARED_WEIGHT = 0.1
# Near the surface no part of a finger is farther beside its tip, in radii.
WIDEST_REACH = 4.0


@inlined
def weaken_shared(rays: FloatArray, count: int, poses: FloatArray, contact: int) -> int:
    """Take weight from a contact's rays that graze other contacts as well; count these rays.

    `poses` (N, 8) are the capsules of all, as by `pose_of`, NaN where there is none.
    """
    ray, row = np.empty((1, RAY_COLUMNS)), np.empty((1, 8))
    shared = 0
    for number in range(count):
        for other in range(len(poses)):
            if other == contact or not _may_graze(rays, number, poses[other]):
                continue
            for column in range(RAY_COLUMNS):
                ray[0, column] = rays[number, column]
            mirror_up(ray, 1, poses[other, TIP_X], poses[other, TIP_Y])
            if abs(miss(ray, 0, poses[other], row)) < GRAZES_MM:
                rays[number, WEIGHT] *= SHARED_WEIGHT
                shared += 1
                break
    return shared


@inlined
def _may_graze(rays: FloatArray, ray: int, pose: FloatArray) -> bool:
    """Whether a ray comes so near to a capsule that a closer look is worth while."""
    dx, dy = pose[TIP_X] - rays[ray, EYE_X], pose[TIP_Y] - rays[ray, EYE_Y]
    beside_mm = rays[ray, INTO_X] * dx + rays[ray, INTO_Y] * dy
    return bool(abs(beside_mm) < WIDEST_REACH * pose[OUTSIDE])
