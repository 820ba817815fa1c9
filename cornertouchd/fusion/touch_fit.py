"""Where a finger of any shape touches: a straight line through its sections, down to the surface.

Near the surface (below 4 mm), and in the mirror image as near, the section of whatever touches at
(x, y) has its middle at (x, y) + |z| (sx, sy) and half the width r0 + r1 |z|.  An edge is a tangent
to the section at the height at which its ray passes, which is linear in all six.
"""

import numpy as np

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.cholesky import factorise, solve
from cornertouchd.fusion.normal_equations import add_products, total
from cornertouchd.fusion.rays import (
    EYE_X,
    EYE_Y,
    INTO_X,
    INTO_Y,
    WEIGHT,
    fill_up,
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
# What further passes after one as small would change is below 5 um (simulated crowds of sixteen).
SETTLED_MM = 2e-2
# How well the touch and half its width are known from the section, and by how much a finger leans
# and widens for each millimetre.  They keep the fit regular.
POSITION_SIGMA_MM = 8.0
RADIUS_SIGMA_MM = 4.0
LEAN_SIGMA = 0.5
WIDENING_SIGMA = 0.75
# Rows of the table of equations: how each of the six terms changes each ray's residual, and what it
# counts for.
UNKNOWNS = 6
PRECISION, PULL, MISFIT, USED, WEIGHTED = range(6, 11)


@borrowing
def fit_touch(
    rays: FloatArray,
    count: int,
    x_mm: float,
    y_mm: float,
    radius_mm: float,
    rows: FloatArray,
    terms: FloatArray,
    information: FloatArray,
    moments: FloatArray,
) -> tuple[int, float]:
    """Write x, y, sx, sy, r0, r1 into `terms`, and the Cholesky factor of their information.

    `x_mm`, `y_mm`, `radius_mm` are the section's; returns how many of the rays were used (with
    fewer than `FEWEST_RAYS` nothing is fitted), and the mean of their squared residuals, in sigmas,
    as far as they are believed.  `rows` (11, room) and `moments` (6,) are written.
    """
    terms[:] = 0.0
    terms[4] = radius_mm
    used, misfit = 0, 0.0
    filled = fill_up(rays, count)
    for each in range(PASSES):
        doubted = 0.0 if each == 0 else HALF_BELIEVED_SIGMAS**-2
        _write_rows(rays, filled, x_mm, y_mm, terms, doubted, rows)
        used = int(total(rows[USED], filled))
        misfit = total(rows[MISFIT], filled)
        if used < FEWEST_RAYS:
            return used, np.inf
        _write_priors(information)
        moments[:] = 0.0
        moments[4] = radius_mm * information[4, 4]
        add_products(
            rows, filled, rows[PRECISION], rows[PULL], rows[WEIGHTED], information, moments
        )
        factorise(information)
        solve(information, moments)
        moved_mm = max(abs(moments[0] - terms[0]), abs(moments[1] - terms[1]))
        for i in range(UNKNOWNS):
            terms[i] = moments[i]
        if each > 0 and moved_mm < SETTLED_MM:
            break
    terms[0] += x_mm
    terms[1] += y_mm
    return used, misfit / used


@borrowing
def _write_rows(
    rays: FloatArray,
    count: int,
    x_mm: float,
    y_mm: float,
    terms: FloatArray,
    doubted: float,
    rows: FloatArray,
) -> None:
    """Write the equation of each ray, (11, count), and how far it is believed.

    Residuals are doubted by their square in sigmas, times `doubted`.
    """
    x, y, lean_x, lean_y = terms[0], terms[1], terms[2], terms[3]
    radius, widening = terms[4], terms[5]
    for ray in range(count):  # without branches, so that several go at once
        height_mm = abs(height_over(rays, ray, x_mm + x, y_mm + y))
        is_used = 1.0 if height_mm < HIGHEST_MM and rays[WEIGHT, ray] > 0.0 else 0.0
        height_mm = height_mm if height_mm < HIGHEST_MM else 0.0
        into_x, into_y, weight = rays[INTO_X, ray], rays[INTO_Y, ray], rays[WEIGHT, ray]
        offset_mm = into_x * (rays[EYE_X, ray] - x_mm) + into_y * (rays[EYE_Y, ray] - y_mm)
        along_x, along_y = into_x * height_mm, into_y * height_mm
        off = into_x * x + into_y * y + along_x * lean_x + along_y * lean_y
        off = weight * (off - radius - height_mm * widening - offset_mm)
        believed = is_used / (1.0 + doubted * off * off)
        rows[0, ray], rows[1, ray], rows[2, ray], rows[3, ray] = into_x, into_y, along_x, along_y
        rows[4, ray], rows[5, ray] = -1.0, -height_mm
        rows[PRECISION, ray] = weight * weight * believed
        rows[PULL, ray] = weight * weight * believed * offset_mm
        rows[MISFIT, ray] = believed * off * off
        rows[USED, ray] = is_used


@borrowing
def _write_priors(information: FloatArray) -> None:
    information[:] = 0.0
    information[0, 0] = information[1, 1] = POSITION_SIGMA_MM**-2
    information[2, 2] = information[3, 3] = LEAN_SIGMA**-2
    information[4, 4] = RADIUS_SIGMA_MM**-2
    information[5, 5] = WIDENING_SIGMA**-2
