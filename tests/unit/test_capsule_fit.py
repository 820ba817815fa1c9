"""The capsule's derivatives are those of its residuals, and its fit is that of scipy."""

import numpy as np
import pytest
from grazed import CAMERA_MM, CornerSight, Finger, corner_sight, outlines_of, own
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from cornertouchd.fusion import capsule_fit, rays
from cornertouchd.fusion.touch_point import TouchPointFinder
from cornertouchd.fusion.touch_table import CAPSULE
from cornertouchd.model import FloatArray, Outlines

SIGHTS = [corner_sight(number) for number in range(4)]
# With five or more, every second ray is left out.
EDGES = ((0, 0), (1, 1), (2, 0), (3, 1))


def miss(ray: FloatArray, capsule: FloatArray) -> tuple[float, FloatArray]:
    """Return the product's residual in mm, and its derivatives."""
    rows, pose = np.zeros((capsule_fit.RESIDUAL_ROWS, 1)), np.empty(8)
    capsule_fit.write_pose.py_func(capsule, pose)  # type: ignore[attr-defined]
    capsule_fit.write_misses.py_func(ray[:, None], 1, pose, rows)  # type: ignore[attr-defined]
    return float(rows[capsule_fit.OFF, 0]), rows[:7, 0]


def distances_mm(eyes: FloatArray, along: FloatArray, capsule: FloatArray) -> FloatArray:
    """Return how far outside the capsule rays (N, 3) pass, the long way."""
    x, y, radius, lean_x, lean_y, pressed, taper = capsule
    axis = np.array([lean_x, lean_y, 1.0]) / np.sqrt(1.0 + lean_x**2 + lean_y**2)
    tip = np.array([x, y, radius - pressed])
    across = np.cross(along, np.cross(along, axis))
    shaft = np.maximum(np.sum((eyes - tip) * across, axis=-1) / (across @ axis), 0.0)
    nearest = tip + shaft[..., None] * axis
    off = np.linalg.norm(np.cross(nearest - eyes, along), axis=-1)
    outside: FloatArray = off - radius - taper * np.maximum(shaft - 2.0, 0.0)
    return outside


@st.composite
def capsules(draw: st.DrawFn) -> FloatArray:
    low = [60.0, 60.0, 2.0, -1.2, -1.2, -1.0, -0.02]
    high = [290.0, 340.0, 9.0, 1.2, 1.2, 1.5, 0.08]
    return np.array([draw(st.floats(a, b)) for a, b in zip(low, high, strict=True)])


@given(capsules(), st.integers(0, 3), st.floats(-8.0, 8.0), st.floats(-0.06, 0.06))
def test_residuals_and_derivatives_are_right(
    capsule: FloatArray, camera: int, aside_mm: float, slope: float
) -> None:
    eye = np.array([SIGHTS[camera].x_mm, SIGHTS[camera].y_mm, CAMERA_MM])
    towards = capsule[:2] - eye[:2]
    towards = towards / np.linalg.norm(towards)
    aim = capsule[:2] + aside_mm * np.array([-towards[1], towards[0]]) - eye[:2]
    along = np.array([*aim / np.linalg.norm(aim), slope])
    along /= np.linalg.norm(along)
    ray = np.zeros(rays.RAY_ROWS)
    ray[rays.EYE_X : rays.EYE_Z + 1], ray[rays.ALONG_X : rays.ALONG_Z + 1] = eye, along
    off, derivatives = miss(ray, capsule)
    here = distances_mm(eye, along, capsule)
    assert off == pytest.approx(here, abs=1e-6)
    if off + capsule[2] < 0.2:
        return  # through the axis: there the distance has no derivative
    for term in range(7):
        step = np.zeros(7)
        step[term] = 1e-6
        up, down = (distances_mm(eye, along, capsule + sign * step) for sign in (1.0, -1.0))
        if abs(up - 2.0 * here + down) > 1e-9:
            continue  # the tip ends here, or the taper begins
        assert derivatives[term] == pytest.approx((up - down) / 2e-6, abs=2e-4)


def rays_of(
    sight: CornerSight, outlines: Outlines, edge: int
) -> list[tuple[FloatArray, FloatArray]]:
    """Return where the rays of an edge begin and their directions."""
    seen = []
    places = zip(outlines.columns_px[0, edge], outlines.rows_px[0, edge], strict=True)
    for column_px, row_px in places:
        angle = np.interp(column_px, np.arange(len(sight.angles_rad)), sight.angles_rad)
        steep = np.interp(column_px - 0.5, np.arange(640), sight.rows_per_slope_px)
        along = np.array([np.cos(angle), np.sin(angle), (sight.horizon_px[0] - row_px) / steep])
        seen.append((np.array([sight.x_mm, sight.y_mm, CAMERA_MM]), along / np.linalg.norm(along)))
    return seen


def fitted_by_scipy(
    seen: list[tuple[FloatArray, FloatArray]], section: tuple[float, float, float]
) -> FloatArray:
    """Fit the nearer of the capsule and its mirror image, with the product's priors.

    Rays outside of it are believed less the farther off they are (soft L1).
    """
    expected = np.array([*section, 0.0, 0.0, 0.6, 0.03])
    sigmas = np.array([8.0, 8.0, 2.0, 1.0, 1.0, 0.3, 0.015])
    up_down = np.array([1.0, 1.0, -1.0])
    eyes, along = (np.array(part) for part in zip(*seen, strict=True))
    away_mm = np.hypot(*(eyes[:, :2] - section[:2]).T)
    sigma_mm = np.hypot(0.12, 0.12 * away_mm / 330.0)

    def residuals(capsule: FloatArray) -> FloatArray:
        off = np.minimum(
            distances_mm(eyes, along, capsule),
            distances_mm(eyes * up_down, along * up_down, capsule),
        )
        off /= sigma_mm
        soft = np.where(off > 0.0, np.sqrt(2.0 * np.sqrt(1.0 + off**2) - 2.0), off)
        return np.array([*soft, *(capsule - expected) / sigmas])

    scale = [1.0, 1.0, 1.0, 0.2, 0.2, 0.3, 0.02]
    return np.asarray(least_squares(residuals, expected, x_scale=scale).x)


@settings(max_examples=30)
@given(
    st.floats(60.0, 290.0),
    st.floats(60.0, 340.0),
    st.floats(0.0, np.deg2rad(45.0)),
    st.floats(-np.pi, np.pi),
    st.integers(0, 10**6),
)
def test_it_is_the_fit_of_scipy(
    x_mm: float, y_mm: float, lean_rad: float, azimuth_rad: float, seed: int
) -> None:
    finger = Finger(x_mm, y_mm, 6.0, lean_rad, azimuth_rad)
    rng = np.random.default_rng(seed)
    outlines = [outlines_of(sight, finger, rng) for sight in SIGHTS]
    points = TouchPointFinder(SIGHTS).find(
        np.array([finger.section()]), np.array([0.2]), own(EDGES), outlines
    )
    seen = [
        ray for camera, edge in EDGES for ray in rays_of(SIGHTS[camera], outlines[camera], edge)
    ]
    capsule = fitted_by_scipy(seen, finger.section())
    assert points.methods[0] == CAPSULE
    assert (points.x_mm[0], points.y_mm[0]) == pytest.approx(capsule[:2], abs=0.03)
    assert np.tan(points.lean_rad[0]) == pytest.approx(np.hypot(*capsule[3:5]), abs=0.015)
