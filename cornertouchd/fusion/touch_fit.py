"""Where a finger of any shape touches: a straight line through its sections, down to the surface.

Near the surface (below 4 mm), and in the mirror image as near, the section of whatever touches at
(x, y) has its middle at (x, y) + |z| (sx, sy) and half the width r0 + r1 |z|.  An edge is a tangent
to the section at the height at which its ray passes, which is linear in all six.
"""

import numpy as np

from cornertouchd.compiling import inlined
from cornertouchd.fusion.cholesky import factorise, solve
from cornertouchd.fusion.rays import (
    EYE_X,
    EYE_Y,
    INTO_X,
    INTO_Y,
    WEIGHT,
    height_over,
)
from cornertouchd.model import FloatArray

# Above this the shaft of a finger begins, and nothing is straight any more.
HIGHEST_MM = 4.0
# Less would fit whatever they are.
FEWEST_RAYS = 7
# Rays that are this many sigmas off count half: glare, the edge of another finger.
HALF_BELIEVED_SIGMAS = 2.0
PASSES = 4
# How well the touch and half its width are known from the section, and by how much a finger leans
# and widens for each millimetre.  They keep the fit regular.
POSITION_SIGMA_MM = 8.0
RADIUS_SIGMA_MM = 4.0
LEAN_SIGMA = 0.5
WIDENING_SIGMA = 0.75
UNKNOWNS = 6


@inlined
def fit_touch(
    rays: FloatArray,
    count: int,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    terms: FloatArray,
    information: FloatArray,
) -> tuple[int, float]:
    """Write x, y, sx, sy, r0, r1 into `terms`, and the Cholesky factor of their information.

    `x_mm`, `y_mm`, `radius_mm` are the section's; returns how many of the rays were used (with
    fewer than `FEWEST_RAYS` nothing is fitted), and the mean of their squared residuals, in sigmas,
    as far as they are believed.
    """
    row, terms[:] = np.empty(UNKNOWNS), 0.0
    terms[4] = radius_mm
    used, misfit = 0, 0.0
    for each in range(PASSES):
        _write_priors(information)
        moments = np.zeros(UNKNOWNS)
        moments[4] = radius_mm * information[4, 4]
        used, misfit = 0, 0.0
        for ray in range(count):
            height_mm = abs(height_over(rays, ray, x_mm + terms[0], y_mm + terms[1]))
            if not height_mm < HIGHEST_MM:
                continue
            into_x, into_y, weight = rays[ray, INTO_X], rays[ray, INTO_Y], rays[ray, WEIGHT]
            row[0], row[1], row[4] = into_x, into_y, -1.0
            row[2], row[3], row[5] = into_x * height_mm, into_y * height_mm, -height_mm
            offset_mm = into_x * (rays[ray, EYE_X] - x_mm) + into_y * (rays[ray, EYE_Y] - y_mm)
            off = -offset_mm
            for i in range(UNKNOWNS):
                off += row[i] * terms[i]
            off *= weight
            believed = 1.0
            if each > 0:
                believed = 1.0 / (1.0 + (off / HALF_BELIEVED_SIGMAS) ** 2)
            used += 1
            misfit += believed * off * off
            weight *= weight * believed
            for i in range(UNKNOWNS):
                weighted = weight * row[i]
                moments[i] += weighted * offset_mm
                for j in range(i + 1):
                    information[i, j] += weighted * row[j]
        if used < FEWEST_RAYS:
            return used, np.inf
        factorise(information)
        solve(information, moments)
        terms[:] = moments
    terms[0] += x_mm
    terms[1] += y_mm
    return used, misfit / used


@inlined
def _write_priors(information: FloatArray) -> None:
    information[:] = 0.0
    information[0, 0] = information[1, 1] = POSITION_SIGMA_MM**-2
    information[2, 2] = information[3, 3] = LEAN_SIGMA**-2
    information[4, 4] = RADIUS_SIGMA_MM**-2
    information[5, 5] = WIDENING_SIGMA**-2
