"""The joint fit recovers cameras whose place and lens are known."""

import numpy as np
import pytest
from hypothesis import given as whatever
from hypothesis import strategies as st
from oracle.nearest_point import nearest_point_to_lines

from cornertouchd.calibration.joint_fit import ROBUST, JointFit, StartingPoint, fit_jointly
from cornertouchd.calibration.touch_columns import TouchColumns
from cornertouchd.calibration.touch_residuals import TouchModel
from cornertouchd.model import FloatArray

WIDTH_PX = 640.0
POSITIONS = np.array([[-3.0, -5.0], [352.0, -4.0], [355.0, 402.0], [-2.0, 406.0]])
YAWS = np.deg2rad([45.8, 134.1, 226.0, 314.5])
START = StartingPoint(
    np.array([[0.0, 0.0], [350.0, 0.0], [350.0, 400.0], [0.0, 400.0]]),
    15.0,
    np.column_stack([np.deg2rad([45, 135, 225, 315]), np.full(4, np.deg2rad(50))]),
    np.full(4, WIDTH_PX),
)
TAPS = np.stack(np.meshgrid(np.linspace(40, 310, 4), np.linspace(50, 350, 4)), -1).reshape(-1, 2)
DIAMETER_MM = 8.0


def columns_of(points: FloatArray, noise_px: float, seed: int) -> FloatArray:
    """Edges of discs in barrel lenses (k1 = -.3), (4, points, 2)."""
    rng = np.random.default_rng(seed)
    result = np.empty((4, len(points), 2))
    for camera in range(4):
        away = points - POSITIONS[camera]
        distance = np.linalg.norm(away, axis=1)
        middle = np.arctan2(away[:, 1], away[:, 0]) - YAWS[camera]
        middle = (middle + np.pi) % (2 * np.pi) - np.pi
        half = np.arcsin(DIAMETER_MM / 2 / distance)
        t = np.tan(np.stack([middle - half, middle + half], axis=-1))
        result[camera] = 320 + 480 * (t - 0.3 * t**3 / (1 + 0.35 * t * t))
    return result + noise_px * rng.standard_normal(result.shape)


def touches(scribble: int = 60, noise_px: float = 0.05) -> TouchColumns:
    rng = np.random.default_rng(5)
    somewhere = rng.uniform([10, 10], [340, 390], (scribble, 2))
    seen = np.concatenate([columns_of(TAPS, noise_px, 1), columns_of(somewhere, noise_px, 2)], 1)
    nowhere = np.full((scribble, 2), np.nan)
    return TouchColumns(
        seen,
        np.vstack([TAPS, nowhere]),
        np.concatenate([np.full(len(TAPS), DIAMETER_MM), nowhere[:, 0]]),
    )


def errors_mm(fit: JointFit, inset_mm: float = 20.0) -> FloatArray:
    """How far fresh touches are located from where they were."""
    rng = np.random.default_rng(9)
    points = rng.uniform(inset_mm, [350 - inset_mm, 400 - inset_mm], (150, 2))
    w = (columns_of(points, 0.0, 3) - WIDTH_PX / 2) / (WIDTH_PX / 2)
    powers = w[..., None] ** np.arange(fit.coefficients_rad.shape[1])
    angles = np.einsum("cpek,ck->cpe", powers, fit.coefficients_rad).mean(axis=2)
    located = [nearest_point_to_lines(fit.positions_mm, angles[:, p]) for p in range(len(points))]
    return np.linalg.norm(np.array(located) - points, axis=1)


def test_cameras_are_recovered_from_taps_and_a_scribble() -> None:
    fit = fit_jointly(touches(), START, tap_sigma_mm=0.1)
    assert fit.positions_mm == pytest.approx(POSITIONS, abs=1.5)
    assert np.percentile(errors_mm(fit), 95) < 0.25


def test_taps_alone_will_do_where_they_were_tapped() -> None:
    fit = fit_jointly(touches(scribble=0), START, tap_sigma_mm=0.1)
    assert np.percentile(errors_mm(fit, inset_mm=50.0), 95) < 0.4


def test_a_scribble_makes_it_more_exact() -> None:
    alone = np.percentile(errors_mm(fit_jointly(touches(0), START, 0.5)), 95)
    together = np.percentile(errors_mm(fit_jointly(touches(150), START, 0.5)), 95)
    assert together < alone


def test_outliers_are_dropped_and_told() -> None:
    given = touches()
    wrong = [(0, 3), (2, 7), (1, 40)]
    for camera, point in wrong:
        given.columns_px[camera, point] += 25.0
    fit = fit_jointly(given, START, tap_sigma_mm=0.1)
    assert not any(fit.used[camera, point] for camera, point in wrong)
    assert fit.used.mean() > 0.97
    assert np.percentile(errors_mm(fit), 95) < 0.3


def test_a_touch_that_a_camera_did_not_see_leaves_a_gap() -> None:
    given = touches()
    given.columns_px[3, 10:20] = np.nan
    fit = fit_jointly(given, START, tap_sigma_mm=0.1)
    assert np.isnan(fit.residuals_mm[3, 10:20]).all()
    assert not fit.used[3, 10:20].any()
    assert np.percentile(errors_mm(fit), 95) < 0.25


@whatever(st.integers(0, 2**32 - 1), st.floats(0.05, 2.0), st.integers(0, 12))
def test_slopes_are_those_of_a_small_step(seed: int, tap_sigma_mm: float, unseen: int) -> None:
    """Wherever the cameras are and go; places that are not known move with all of them."""
    rng = np.random.default_rng(seed)
    given = touches(scribble=12)
    given.diameters_mm[rng.integers(0, 16, 4)] = np.nan
    given.columns_px[rng.integers(0, 4, unseen), rng.integers(0, 28, unseen)] = np.nan
    used = given.seen & (rng.random(given.seen.shape) < 0.9)
    used[:, used.sum(axis=0) < 2] = False
    px_rad = START.angles_rad[:, 1] / (WIDTH_PX / 2)
    model = TouchModel(given, START.widths_px, px_rad, 7, tap_sigma_mm)
    cameras = np.hstack([START.positions_mm, START.angles_rad, np.zeros((4, 6))])
    spread = np.array([4.0, 4.0, 0.05, 0.05, *[0.02] * 6])  # millimetres, radians
    cameras += rng.normal(0.0, spread, cameras.shape)
    step = 1e-5 * rng.normal(0.0, spread, cameras.shape)

    slopes = model.slopes(cameras, used)
    before, after = model.residuals(cameras - step, used), model.residuals(cameras + step, used)
    for slope, low, high in (
        (slopes.distances, before.distances, after.distances),
        (slopes.widths, before.widths, after.widths),
    ):
        parts = slope[used] * step
        largest = np.abs(np.nan_to_num(parts)).max()
        expected = ((high - low) / 2.0)[used]
        assert parts.sum(axis=(1, 2)) == pytest.approx(
            expected, rel=1e-4, abs=1e-5 * largest, nan_ok=True
        )


@whatever(st.floats(-1e3, 1e3))
def test_the_robust_loss_has_its_slope(sigmas: float) -> None:
    step = 1e-4 * max(1.0, abs(sigmas))
    low, high = (ROBUST.value(np.array([sigmas + by]))[0] for by in (-step, step))
    slope = ROBUST.slope(np.array([sigmas]))[0]
    assert slope == pytest.approx((high - low) / (2.0 * step), rel=1e-4)
