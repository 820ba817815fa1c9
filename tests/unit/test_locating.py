"""Column -> directing line, by both methods."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.locating.columns import columns_of_places
from cornertouchd.locating.line_table import tabulate
from cornertouchd.locating.vanishing_point import DegeneratePointsError, solve_projection
from cornertouchd.model import DirectingLines, FloatArray, Shadow, Shadows

GRID = np.stack(np.meshgrid(np.linspace(30, 320, 4), np.linspace(30, 370, 4)), axis=-1).reshape(
    -1, 2
)


def pinhole_columns(
    points_mm: FloatArray, position: tuple[float, float], yaw_rad: float
) -> FloatArray:
    """Columns in which a pinhole camera of 330 px focal length sees points of the surface."""
    away = points_mm - np.array(position)
    forward = away @ np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    right = away @ np.array([-np.sin(yaw_rad), np.cos(yaw_rad)])
    return 320 + 330 * right / forward


@given(x=st.floats(-15, 0), y=st.floats(-15, 0), yaw=st.floats(0.7, 0.9))
def test_a_pinhole_camera_is_recovered_exactly(x: float, y: float, yaw: float) -> None:
    model = solve_projection(GRID, pinhole_columns(GRID, (x, y), yaw))
    assert model.position_mm == pytest.approx((x, y), abs=1e-5)
    seen = pinhole_columns(GRID, (x, y), yaw)
    true = np.arctan2(GRID[:, 1] - y, GRID[:, 0] - x)
    assert model.angles_rad(seen) == pytest.approx(true, abs=1e-8)


@pytest.mark.parametrize(
    ("corner", "yaw"), [((-5, -5), 45), ((355, -4), 135), ((356, 405), 225), ((-4, 403), 315)]
)
def test_angles_point_into_the_surface_and_do_not_jump(
    corner: tuple[float, float], yaw: float
) -> None:
    model = solve_projection(GRID, pinhole_columns(GRID, corner, np.deg2rad(yaw)))
    angles = model.angles_rad(np.linspace(1, 639, 100))
    assert (np.abs(np.diff(angles)) < 0.1).all()
    off = np.rad2deg(angles[50]) - yaw
    assert (off + 180) % 360 - 180 == pytest.approx(0, abs=3)


def test_points_on_the_two_near_sides_are_refused_by_name() -> None:
    along = np.linspace(20, 330, 12)
    near = np.vstack([np.c_[along, 0 * along], np.c_[0 * along, along]])
    with pytest.raises(DegeneratePointsError, match="conic"):
        solve_projection(near, pinhole_columns(near, (-2.0, -2.0), np.pi / 4))


def test_too_few_points_are_refused() -> None:
    with pytest.raises(DegeneratePointsError, match="4 reference points are seen, 5"):
        solve_projection(GRID[:4], np.arange(4.0))


@given(st.floats(5, 635))
def test_slopes_are_the_derivatives_of_angles(column: float) -> None:
    projection = solve_projection(GRID, pinhole_columns(GRID, (-4.0, -6.0), 0.8))
    polynomial = AnglePolynomial((0, 0), (0.8, 0.9, 0.01, -0.1, 0.0, 0.02, 0.0, 0.02), 640)
    for model in (projection, polynomial):
        a, b = model.angles_rad(np.array([column - 0.01, column + 0.01]))
        slope = model.slopes_rad_px(np.array([column]))[0]
        assert slope == pytest.approx((b - a) / 0.02, rel=1e-4)


def laid(shadows: Iterable[Shadow], model: CameraModel) -> DirectingLines:
    return tabulate("C1", model, 640).lay(Shadows.of(shadows), 0.1)


def test_shadows_are_laid_on_the_surface_in_order_of_angle() -> None:
    shadows = (Shadow(100, 110, True, True, 1.0), Shadow(300, 320, True, False, 1.0))
    model = AnglePolynomial((1.0, 2.0), (0.8, 0.9), 640)
    directing_lines = laid(shadows, model)
    assert (directing_lines.x_mm, directing_lines.y_mm) == (1.0, 2.0)
    assert directing_lines.first_rad == pytest.approx(model.angles_rad(np.array([100.0, 300.0])))
    assert directing_lines.last_rad == pytest.approx(model.angles_rad(np.array([110.0, 320.0])))
    assert directing_lines.last_valid.tolist() == [True, False]
    assert directing_lines.sigma_rad == pytest.approx([0.1 * 0.9 / 320] * 2)


def test_a_camera_that_hangs_upside_down_sees_the_same() -> None:
    shadows = (Shadow(100, 110, True, True, 1.0), Shadow(300, 320, True, False, 1.0))
    directing_lines = laid(shadows, AnglePolynomial((0, 0), (0.8, -0.9), 640))
    assert (directing_lines.first_rad < directing_lines.last_rad).all()
    assert (np.diff(directing_lines.first_rad) > 0).all()
    assert directing_lines.first_valid.tolist() == [False, True]
    assert directing_lines.last_valid.tolist() == [True, True]


def test_no_shadows_make_empty_bearings() -> None:
    directing_lines = laid((), AnglePolynomial((0, 0), (0.8, 0.9), 640))
    assert len(directing_lines.first_rad) == len(directing_lines.sigma_rad) == 0


def test_a_place_is_found_in_the_part_of_a_polynomial_that_does_not_fold() -> None:
    """This one turns back 267 columns from the middle, beyond those that it was fitted to."""
    folds = AnglePolynomial((0.0, 0.0), (0.8, 0.8, 0.0, -0.8 / 3 / (267 / 320) ** 2), 640)
    columns = np.array([80.0, 200.0, 320.0, 450.0, 560.0])
    angles = folds.angles_rad(columns)
    places = 200.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    assert columns_of_places(folds, 640, places) == pytest.approx(columns, abs=0.01)
    beyond = folds.angles_rad(np.array([320.0 + 267.0])) + 0.01
    unseen = 200.0 * np.stack([np.cos(beyond), np.sin(beyond)], axis=1)
    assert np.isnan(columns_of_places(folds, 640, unseen)).all()
