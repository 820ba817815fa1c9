"""Where a finger touches, if it is one: a round tip on a shaft that leans and widens a little.

The tip's centre is `radius - pressed` above (x, y); from there the axis rises along (sx, sy, 1).
A ray grazes the capsule, or its mirror image, when it passes the axis at the distance of the
radius.  What stands before or behind it can only widen its shadow: rays that pass outside lose
weight as their residuals grow (soft L1: rho(f) = 2 sqrt(1 + f**2) - 2), those that pass through
it do not (f**2).  The fit is a damped Gauss-Newton.
"""

import numpy as np

from cornertouchd.compiling import inlined
from cornertouchd.fusion.cholesky import factorise, solve
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
    height_over,
)
from cornertouchd.model import FloatArray

# What is fitted: the place of the touch, the radius of the tip, how far the axis goes along the
# surface for each millimetre it rises, how far the tip is flattened, and by how much the radius
# grows for each millimetre along the shaft.
X, Y, RADIUS, LEAN_X, LEAN_Y, PRESSED, TAPER = range(7)
UNKNOWNS = 7
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


@inlined
def fit_capsule(
    rays: FloatArray,
    count: int,
    expected: FloatArray,
    capsule: FloatArray,
    information: FloatArray,
    rows: FloatArray,
) -> float:
    """Improve the seven terms of `capsule`; write the Cholesky factor of their information.

    `expected` (7,) is what they are near to beforehand; `rows` (at least count, 8) is written as by
    `total_cost`.  Returns the mean of rho over the rays.  Rays are turned up by `mirror_up`.
    """
    mirror_up(rays, count, capsule[X], capsule[Y])
    normal, slope, step = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    tried = capsule.copy()
    cost = total_cost(rays, count, expected, capsule, normal, slope, rows)
    tried_normal, tried_slope = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS)
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
        tried_cost = total_cost(rays, count, expected, tried, tried_normal, tried_slope, rows)
        if tried_cost <= cost:
            capsule[:], normal[:], slope[:] = tried, tried_normal, tried_slope
            cost, damping = tried_cost, LEAST_DAMPING
        else:
            damping = max(damping, DAMPING) * MORE_DAMPING
        largest = 0.0
        for i in range(UNKNOWNS):
            largest = max(largest, abs(step[i]))
        if largest < SETTLED_MM:
            break
    information[:] = normal
    factorise(information)
    return cost / count


@inlined
def total_cost(
    rays: FloatArray,
    count: int,
    expected: FloatArray,
    capsule: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
    rows: FloatArray,
) -> float:
    """Return the sum of rho over all rays and of the squares of the priors, both in sigmas.

    Writes half the gradient, the lower triangle of the normal matrix, and into `rows` (count, 8)
    how each term changes each ray's distance, and its residual in sigmas.
    """
    normal[:], slope[:] = 0.0, 0.0
    cost, pose = 0.0, pose_of(capsule)
    for i in range(UNKNOWNS):
        normal[i, i] = prior_weight(i)
        off = capsule[i] - expected[i]
        slope[i] = normal[i, i] * off
        cost += slope[i] * off
    for ray in range(count):
        off = rays[ray, WEIGHT] * miss(rays, ray, pose, rows)
        rows[ray, UNKNOWNS] = off
        cost += 2.0 * np.sqrt(1.0 + off * off) - 2.0 if off > 0.0 else off * off
    for ray in range(count):
        weight, off = rays[ray, WEIGHT], rows[ray, UNKNOWNS]
        believed = weight / np.sqrt(1.0 + off * off) if off > 0.0 else weight
        pull = believed * off
        believed *= weight
        for i in range(UNKNOWNS):
            slope[i] += pull * rows[ray, i]
            weighted = believed * rows[ray, i]
            for j in range(i + 1):
                normal[i, j] += weighted * rows[ray, j]
    return cost


@inlined
def prior_weight(term: int) -> float:
    """Return one over the variance with which a term is known beforehand."""
    if term <= Y:
        return float(POSITION_SIGMA_MM**-2)
    if term == RADIUS:
        return float(RADIUS_SIGMA_MM**-2)
    if term <= LEAN_Y:
        return float(LEAN_SIGMA**-2)
    return float(PRESSED_SIGMA_MM**-2 if term == PRESSED else TAPER_SIGMA**-2)


@inlined
def pose_of(capsule: FloatArray) -> FloatArray:
    """Return the tip's centre, the unit axis, the radius, and the taper."""
    shrink = 1.0 / np.sqrt(1.0 + capsule[LEAN_X] ** 2 + capsule[LEAN_Y] ** 2)
    pose = np.empty(8)
    pose[TIP_X], pose[TIP_Y] = capsule[X], capsule[Y]
    pose[TIP_Z] = capsule[RADIUS] - capsule[PRESSED]
    pose[AXIS_X], pose[AXIS_Y] = shrink * capsule[LEAN_X], shrink * capsule[LEAN_Y]
    pose[AXIS_Z] = shrink
    pose[OUTSIDE], pose[WIDENING] = capsule[RADIUS], capsule[TAPER]
    return pose


@inlined
def mirror_up(rays: FloatArray, count: int, x_mm: float, y_mm: float) -> None:
    """Turn rays that pass a place below the surface upside down: they see the mirror image.

    What they graze there, their own mirror image grazes of the finger itself.
    """
    for ray in range(count):
        if height_over(rays, ray, x_mm, y_mm) < 0.0:
            rays[ray, EYE_Z], rays[ray, ALONG_Z] = -rays[ray, EYE_Z], -rays[ray, ALONG_Z]
            rays[ray, SLOPE] = -rays[ray, SLOPE]


@inlined
def miss(rays: FloatArray, ray: int, pose: FloatArray, rows: FloatArray) -> float:
    """Return by how much a ray passes outside the capsule, in mm; write how each term changes it.

    The nearest points of the ray and the axis move along these lines without changing the distance
    to first order, so it changes with the axis alone; only the taper asks where along the shaft.
    """
    axis_x, axis_y, axis_z = pose[AXIS_X], pose[AXIS_Y], pose[AXIS_Z]
    dx, dy, dz = rays[ray, ALONG_X], rays[ray, ALONG_Y], rays[ray, ALONG_Z]
    # from the tip's centre to the camera
    wx, wy = rays[ray, EYE_X] - pose[TIP_X], rays[ray, EYE_Y] - pose[TIP_Y]
    wz = rays[ray, EYE_Z] - pose[TIP_Z]
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
    if widened > 0.0:
        slower = pose[WIDENING] * across
        lever = 2.0 * along * shaft - ahead
        tip_x -= slower * (along * dx - axis_x)
        tip_y -= slower * (along * dy - axis_y)
        tip_z -= slower * (along * dz - axis_z)
        turn_x -= slower * (wx + lever * dx)
        turn_y -= slower * (wy + lever * dy)
        turn_z -= slower * (wz + lever * dz)
    turned = turn_x * axis_x + turn_y * axis_y + turn_z * axis_z
    rows[ray, X], rows[ray, Y], rows[ray, RADIUS] = tip_x, tip_y, tip_z - 1.0
    rows[ray, LEAN_X] = axis_z * (turn_x - axis_x * turned)
    rows[ray, LEAN_Y] = axis_z * (turn_y - axis_y * turned)
    rows[ray, PRESSED], rows[ray, TAPER] = -tip_z, -widened
    return float(distance - pose[OUTSIDE] - pose[WIDENING] * widened)


@inlined
def worst_edge(rays: FloatArray, count: int, rows: FloatArray) -> int:
    """Return the number of the edge whose rays fit worst on average, by the `rows` of a fit."""
    worst, most, start = 0, -1.0, 0
    while start < count:
        end, off = start, 0.0
        while end < count and rays[end, EDGE] == rays[start, EDGE]:
            off += abs(rows[end, UNKNOWNS])
            end += 1
        if off > most * (end - start):
            worst, most = int(rays[start, EDGE]), off / (end - start)
        start = end
    return worst
