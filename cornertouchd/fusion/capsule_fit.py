"""Where a finger touches, if it is one: a round tip on a shaft that leans and widens a little.

The tip's centre is `radius - pressed` above (x, y); from there the axis rises along (sx, sy, 1).
A ray grazes the capsule, or its mirror image, when it passes the axis at the distance of the
radius.  What stands before or behind it can only widen its shadow: rays that pass outside lose
weight as their residuals grow (soft L1: rho(f) = 2 sqrt(1 + f**2) - 2), those that pass through
it do not (f**2).  The fit is a damped Gauss-Newton.
"""

from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, inlined
from cornertouchd.fusion.cholesky import factorise, solve
from cornertouchd.fusion.normal_equations import add_products, total
from cornertouchd.fusion.rays import (
    ALONG_X,
    ALONG_Y,
    ALONG_Z,
    EDGE,
    EYE_X,
    EYE_Y,
    EYE_Z,
    SLOPE,
    WEIGHT,
    fill_up,
    height_over,
)
from cornertouchd.model import FloatArray

# What is fitted: the place of the touch, the radius of the tip, how far the axis goes along the
# surface for each millimetre it rises, how far the tip is flattened, and by how much the radius
# grows for each millimetre along the shaft.
X, Y, RADIUS, LEAN_X, LEAN_Y, PRESSED, TAPER = range(7)
UNKNOWNS = 7
# Rows of the table of residuals: how each of the seven terms changes each ray's, the residual
# itself, what it costs, and what it counts for.
OFF, RHO, PULL, PRECISION = range(7, 11)
RESIDUAL_ROWS = 11
# Where the capsule is then: the tip's centre, the unit axis, the radius and the taper.
TIP_X, TIP_Y, TIP_Z, AXIS_X, AXIS_Y, AXIS_Z, OUTSIDE, WIDENING = range(8)
# What fingers are like, from path-traced ones; x, y and the radius are the section's.
PRESSED_MM, PRESSED_SIGMA_MM = 0.6, 0.3
TAPER_MEAN, TAPER_SIGMA = 0.03, 0.015
LEAN_SIGMA = 1.0
POSITION_SIGMA_MM = 8.0
RADIUS_SIGMA_MM = 2.0
# The tip itself is round.
SHAFT_BEGINS_MM = 2.0
# Closer than this a ray meets the axis itself, and there is no direction away from it.
ON_AXIS_MM = 1e-6
PARALLEL = 1e-9
STEPS = 6
# What a further step after one as small would change is below 4 um (path-traced pictures).
SETTLED_MM = 5e-2
LEAST_DAMPING, DAMPING, MORE_DAMPING = 1e-6, 1e-3, 10.0


class FitRoom(NamedTuple):
    """Where a fit writes down what it tries."""

    normal: FloatArray
    slope: FloatArray
    step: FloatArray
    tried: FloatArray
    tried_normal: FloatArray
    tried_slope: FloatArray
    pose: FloatArray


@inlined
def fit_room() -> FitRoom:
    """Return room for one fit after the other."""
    return FitRoom(
        np.empty((UNKNOWNS, UNKNOWNS)),
        np.empty(UNKNOWNS),
        np.empty(UNKNOWNS),
        np.empty(UNKNOWNS),
        np.empty((UNKNOWNS, UNKNOWNS)),
        np.empty(UNKNOWNS),
        np.empty(8),
    )


@borrowing
def fit_capsule(
    rays: FloatArray,
    count: int,
    expected: FloatArray,
    capsule: FloatArray,
    information: FloatArray,
    rows: FloatArray,
    room: FitRoom,
) -> float:
    """Improve the seven terms of `capsule`; write the Cholesky factor of their information.

    `expected` (7,) is what they are near to beforehand; `rows` (11, at least count) is written as
    by `total_cost`.  Returns the mean of rho over the rays.  Rays are turned up by `mirror_up`.
    """
    filled = fill_up(rays, count)
    mirror_up(rays, filled, capsule[X], capsule[Y])
    normal, slope, step, pose = room.normal, room.slope, room.step, room.pose
    tried, tried_normal, tried_slope = room.tried, room.tried_normal, room.tried_slope
    cost = total_cost(rays, filled, expected, capsule, pose, normal, slope, rows)
    damping = LEAST_DAMPING
    for _ in range(STEPS):
        for i in range(UNKNOWNS):
            step[i] = -slope[i]
            for j in range(i + 1):
                information[i, j] = normal[i, j]
            information[i, i] *= 1.0 + damping
        factorise(information)
        solve(information, step)
        for i in range(UNKNOWNS):
            tried[i] = capsule[i] + step[i]
        tried_cost = total_cost(
            rays, filled, expected, tried, pose, tried_normal, tried_slope, rows
        )
        if tried_cost <= cost:
            _copy(tried, tried_normal, tried_slope, capsule, normal, slope)
            cost, damping = tried_cost, LEAST_DAMPING
        else:
            damping = max(damping, DAMPING) * MORE_DAMPING
        largest = 0.0
        for i in range(UNKNOWNS):
            largest = max(largest, abs(step[i]))
        if largest < SETTLED_MM:
            break
    for i in range(UNKNOWNS):
        for j in range(i + 1):
            information[i, j] = normal[i, j]
    factorise(information)
    return cost / count


@borrowing
def _copy(
    tried: FloatArray,
    tried_normal: FloatArray,
    tried_slope: FloatArray,
    capsule: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> None:
    for i in range(UNKNOWNS):
        capsule[i], slope[i] = tried[i], tried_slope[i]
        for j in range(i + 1):
            normal[i, j] = tried_normal[i, j]


@borrowing
def total_cost(
    rays: FloatArray,
    count: int,
    expected: FloatArray,
    capsule: FloatArray,
    pose: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
    rows: FloatArray,
) -> float:
    """Return the sum of rho over all rays and of the squares of the priors, both in sigmas.

    Writes the `pose` of the capsule, half the gradient, the lower triangle of the normal matrix,
    and into `rows` (11, count) how each term changes each ray's distance, its residual in sigmas as
    `OFF`, and what it counts for.
    """
    normal[:], slope[:] = 0.0, 0.0
    cost = 0.0
    for i in range(UNKNOWNS):
        normal[i, i] = prior_weight(i)
        off = capsule[i] - expected[i]
        slope[i] = normal[i, i] * off
        cost += slope[i] * off
    write_pose(capsule, pose)
    write_misses(rays, count, pose, rows)
    for ray in range(count):  # without branches, so that several go at once
        weight = rays[WEIGHT, ray]
        off = weight * rows[OFF, ray]
        outside = max(off, 0.0)
        root = np.sqrt(1.0 + outside * outside)
        believed = weight / root
        rows[OFF, ray] = off
        rows[RHO, ray] = 2.0 * root - 2.0 if off > 0.0 else off * off
        rows[PULL, ray] = believed * off
        rows[PRECISION, ray] = believed * weight
    cost += total(rows[RHO], count)
    # the costs are summed up
    add_products(rows, count, rows[PRECISION], rows[PULL], rows[RHO], normal, slope)
    return cost


@borrowing
def prior_weight(term: int) -> float:
    """Return one over the variance with which a term is known beforehand."""
    if term <= Y:
        return float(POSITION_SIGMA_MM**-2)
    if term == RADIUS:
        return float(RADIUS_SIGMA_MM**-2)
    if term <= LEAN_Y:
        return float(LEAN_SIGMA**-2)
    return float(PRESSED_SIGMA_MM**-2 if term == PRESSED else TAPER_SIGMA**-2)


@borrowing
def write_pose(capsule: FloatArray, pose: FloatArray) -> None:
    """Write the tip's centre, the unit axis, the radius, and the taper."""
    shrink = 1.0 / np.sqrt(1.0 + capsule[LEAN_X] ** 2 + capsule[LEAN_Y] ** 2)
    pose[TIP_X], pose[TIP_Y] = capsule[X], capsule[Y]
    pose[TIP_Z] = capsule[RADIUS] - capsule[PRESSED]
    pose[AXIS_X], pose[AXIS_Y] = shrink * capsule[LEAN_X], shrink * capsule[LEAN_Y]
    pose[AXIS_Z] = shrink
    pose[OUTSIDE], pose[WIDENING] = capsule[RADIUS], capsule[TAPER]


@borrowing
def mirror_up(rays: FloatArray, count: int, x_mm: float, y_mm: float) -> None:
    """Turn rays that pass a place below the surface upside down: they see the mirror image.

    What they graze there, their own mirror image grazes of the finger itself.
    """
    for ray in range(count):  # without branches, so that several go at once
        up = -1.0 if height_over(rays, ray, x_mm, y_mm) < 0.0 else 1.0
        rays[EYE_Z, ray] *= up
        rays[ALONG_Z, ray] *= up
        rays[SLOPE, ray] *= up


@borrowing
def write_misses(rays: FloatArray, count: int, pose: FloatArray, rows: FloatArray) -> None:
    """Write by how much rays pass outside the capsule, in mm, and how each term changes that.

    The nearest points of the ray and the axis move along these lines without changing the distance
    to first order, so it changes with the axis alone; only the taper asks where along the shaft.
    """
    axis_x, axis_y, axis_z = pose[AXIS_X], pose[AXIS_Y], pose[AXIS_Z]
    centre_x, centre_y, centre_z = pose[TIP_X], pose[TIP_Y], pose[TIP_Z]
    radius, taper = pose[OUTSIDE], pose[WIDENING]
    for ray in range(count):  # without branches, so that several go at once
        dx, dy, dz = rays[ALONG_X, ray], rays[ALONG_Y, ray], rays[ALONG_Z, ray]
        # from the tip's centre to the camera
        wx, wy = rays[EYE_X, ray] - centre_x, rays[EYE_Y, ray] - centre_y
        wz = rays[EYE_Z, ray] - centre_z
        along = dx * axis_x + dy * axis_y + dz * axis_z
        ahead = dx * wx + dy * wy + dz * wz
        across = 1.0 / max(1.0 - along * along, PARALLEL)
        shaft = max((wx * axis_x + wy * axis_y + wz * axis_z - along * ahead) * across, 0.0)
        reach = shaft * along - ahead
        vx, vy = shaft * axis_x - reach * dx - wx, shaft * axis_y - reach * dy - wy
        vz = shaft * axis_z - reach * dz - wz
        distance = np.sqrt(vx * vx + vy * vy + vz * vz)
        nearer = 1.0 / max(distance, ON_AXIS_MM)
        # by the tip's centre, and by the axis
        tip_x, tip_y, tip_z = vx * nearer, vy * nearer, vz * nearer
        turn_x, turn_y, turn_z = shaft * tip_x, shaft * tip_y, shaft * tip_z
        widened = max(shaft - SHAFT_BEGINS_MM, 0.0)
        slower = taper * across if widened > 0.0 else 0.0
        lever = 2.0 * along * shaft - ahead
        tip_x -= slower * (along * dx - axis_x)
        tip_y -= slower * (along * dy - axis_y)
        tip_z -= slower * (along * dz - axis_z)
        turn_x -= slower * (wx + lever * dx)
        turn_y -= slower * (wy + lever * dy)
        turn_z -= slower * (wz + lever * dz)
        turned = turn_x * axis_x + turn_y * axis_y + turn_z * axis_z
        rows[X, ray], rows[Y, ray], rows[RADIUS, ray] = tip_x, tip_y, tip_z - 1.0
        rows[LEAN_X, ray] = axis_z * (turn_x - axis_x * turned)
        rows[LEAN_Y, ray] = axis_z * (turn_y - axis_y * turned)
        rows[PRESSED, ray], rows[TAPER, ray] = -tip_z, -widened
        rows[OFF, ray] = distance - radius - taper * widened


@borrowing
def worst_edge(rays: FloatArray, count: int, rows: FloatArray) -> int:
    """Return the number of the edge whose rays fit worst on average, by the `rows` of a fit."""
    worst, most, start = 0, -1.0, 0
    while start < count:
        end, off = start, 0.0
        while end < count and rays[EDGE, end] == rays[EDGE, start]:
            off += abs(rows[OFF, end])
            end += 1
        if off > most * (end - start):
            worst, most = int(rays[EDGE, start]), off / (end - start)
        start = end
    return worst
