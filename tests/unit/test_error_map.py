"""The expected error is the one that comes: checked against rigs whose truth is known."""

import numpy as np
import pytest
from oracle.nearest_point import nearest_point_to_lines

from cornertouchd.calibration.error_map import ErrorMap, map_from_covariance, map_from_line_sigmas
from cornertouchd.calibration.joint_fit import StartingPoint, fit_jointly
from cornertouchd.calibration.touch_columns import EDGE_SIGMA_PX, SHAPE_SIGMA_MM, TouchColumns
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import FloatArray

SURFACE_MM = (350.0, 400.0)
WIDTH_PX = 640
CORNERS = np.array([[0.0, 0.0], [350.0, 0.0], [350.0, 400.0], [0.0, 400.0]])
YAWS = np.deg2rad([45.0, 135.0, 225.0, 315.0])
TAPS = np.stack(np.meshgrid(np.linspace(40, 310, 4), np.linspace(50, 350, 4)), -1).reshape(-1, 2)


class TrueRig:
    """Cameras near their corners whose angles are polynomials of degree 5."""

    def __init__(self, seed: int, place_sigma_mm: float) -> None:
        self._rng = np.random.default_rng(seed)
        self.positions = CORNERS + self._rng.normal(0, place_sigma_mm, (4, 2))
        self.yaws = YAWS + self._rng.normal(0, np.deg2rad(2.0), 4)
        self.bend = self._rng.uniform(0.05, 0.15, 4)

    def columns(self, points: FloatArray) -> FloatArray:
        """Middles of shadows with the noise that the fit assumes, as edges, (4, points, 2)."""
        away = points[None] - self.positions[:, None]
        angles = np.arctan2(away[..., 1], away[..., 0]) - self.yaws[:, None]
        angles = (angles + np.pi) % (2 * np.pi) - np.pi
        w = np.linspace(-1.1, 1.1, 4001)
        seen = np.empty(angles.shape)
        for camera in range(4):
            bent = np.deg2rad(48.0) * w + self.bend[camera] * w**3
            seen[camera] = np.interp(angles[camera], bent, (w + 1) * WIDTH_PX / 2)
        px_mm = 320 / np.deg2rad(48.0) / np.linalg.norm(away, axis=-1)
        seen += self._rng.normal(0, 1, seen.shape) * np.hypot(EDGE_SIGMA_PX, SHAPE_SIGMA_MM * px_mm)
        return np.stack([seen - 4.0, seen + 4.0], axis=-1)

    def scribble(self, count: int) -> FloatArray:
        return self._rng.uniform([10, 10], [340, 390], (count, 2))

    def tapped(self, sigma_mm: float) -> FloatArray:
        return TAPS + self._rng.normal(0, sigma_mm, TAPS.shape)


def calibrated(rig: TrueRig, tap_sigma_mm: float, *, taps: bool) -> tuple[ErrorMap, FloatArray]:
    """Return the map, and the errors of fresh touches."""
    known = TAPS if taps else TAPS[:0]
    at = np.vstack([rig.tapped(tap_sigma_mm), rig.scribble(60)])
    at = at if taps else at[len(TAPS) :]
    nowhere = np.full((len(at) - len(known), 2), np.nan)
    touches = TouchColumns(rig.columns(at), np.vstack([known, nowhere]), np.full(len(at), np.nan))
    start = StartingPoint(
        CORNERS,
        15.0 if taps else 4.0,
        np.column_stack([YAWS, np.full(4, np.deg2rad(50.0))]),
        np.full(4, float(WIDTH_PX)),
    )
    fit = fit_jointly(touches, start, tap_sigma_mm)
    models = [
        AnglePolynomial((float(x), float(y)), tuple(a), WIDTH_PX)
        for (x, y), a in zip(fit.positions_mm, fit.coefficients_rad.tolist(), strict=True)
    ]
    expected = map_from_covariance(
        SURFACE_MM, models, fit.covariance, (SHAPE_SIGMA_MM, EDGE_SIGMA_PX)
    )
    fresh = rig.scribble(200)
    columns = rig.columns(fresh).mean(axis=2)
    angles = np.stack([model.angles_rad(u) for model, u in zip(models, columns, strict=True)])
    located = [nearest_point_to_lines(fit.positions_mm, angles[:, k]) for k in range(len(fresh))]
    return expected, np.linalg.norm(np.array(located) - fresh, axis=1)


@pytest.mark.parametrize(("taps", "tap_sigma_mm"), [(True, 0.5), (True, 1.5), (False, 0.5)])
def test_the_map_tells_the_error_that_comes(taps: bool, tap_sigma_mm: float) -> None:
    ratios = []
    for seed in range(3):
        rig = TrueRig(seed, 2.0 if taps else 4.0)
        expected, errors = calibrated(rig, tap_sigma_mm, taps=taps)
        ratios.append(np.mean(errors**2) / expected.rms_mm**2)
    assert 0.5 < np.sqrt(np.mean(ratios)) < 1.5


def test_without_taps_the_error_is_that_of_the_mounting() -> None:
    expected, _ = calibrated(TrueRig(1, 4.0), 0.5, taps=False)
    assert 3.0 < expected.rms_mm < 8.0


def test_better_lines_make_smaller_errors() -> None:
    models = [
        AnglePolynomial((float(x), float(y)), (float(yaw), 0.8), WIDTH_PX)
        for (x, y), yaw in zip(CORNERS, YAWS, strict=True)
    ]
    fine = map_from_line_sigmas(SURFACE_MM, models, np.full(4, 0.1))
    coarse = map_from_line_sigmas(SURFACE_MM, models, np.full(4, 0.3))
    assert coarse.errors_mm == pytest.approx(3 * fine.errors_mm)
    assert 0.1 < fine.rms_mm < 0.25


def test_a_place_that_one_camera_sees_cannot_be_located() -> None:
    models = [
        AnglePolynomial((0.0, 0.0), (0.8, 0.8), 640),
        AnglePolynomial((350.0, 0.0), (2.3, 0.8), 640),
    ]
    sigmas = np.full((2, 169), 0.2)
    sigmas[1, :80] = np.nan
    expected = map_from_line_sigmas(SURFACE_MM, models, sigmas)
    assert np.isnan(expected.errors_mm.ravel()[:80]).all()
    assert np.isfinite(expected.errors_mm.ravel()[80:]).all()
    assert np.isfinite(expected.rms_mm)
