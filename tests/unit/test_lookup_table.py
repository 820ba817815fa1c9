"""The paper's lookup table: right at its points, straight between them, silent elsewhere."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.locating.line_table import tabulate
from cornertouchd.locating.lookup_table import LookupTable
from cornertouchd.model import Contact, DirectingLines, FloatArray, Shadow, Shadows

SURFACE_MM = (350.0, 400.0)
POSITIONS_MM = {"C1": (-6.0, -5.0), "C2": (355.0, -6.0), "C3": (356.0, 405.0), "C4": (-5.0, 406.0)}
YAWS_RAD = {"C1": 0.8, "C2": 2.35, "C3": 3.9, "C4": 5.5}
FOCAL_PX = 300.0


def columns_of(camera: str, points_mm: FloatArray) -> FloatArray:
    """Columns in which a pinhole camera sees points."""
    away = points_mm - POSITIONS_MM[camera]
    off = np.arctan2(away[..., 1], away[..., 0]) - YAWS_RAD[camera]
    return 320.0 + FOCAL_PX * np.tan((off + np.pi) % (2 * np.pi) - np.pi)


def far_points(camera: str) -> FloatArray:
    """Points 5 mm apart on the two sides that are not the camera's, clockwise."""
    width, height = SURFACE_MM
    x, y = np.arange(5.0, width, 5.0), np.arange(5.0, height, 5.0)
    right, left = np.c_[width - 0 * y, y], np.c_[0 * y, height - y]
    top, bottom = np.c_[x, 0 * x], np.c_[width - x, height + 0 * x]
    sides = {
        "C1": [right, bottom],
        "C2": [bottom, left],
        "C3": [left, top],
        "C4": [top, right],
    }
    return np.vstack(sides[camera])


def table(camera: str = "C1", unseen: slice = slice(0), flipped: bool = False) -> LookupTable:
    points = far_points(camera)
    columns = columns_of(camera, points)
    columns[unseen] = np.nan
    return LookupTable(
        POSITIONS_MM[camera],
        tuple((float(x), float(y)) for x, y in points),
        tuple((640.0 - columns if flipped else columns).tolist()),
    )


def angles_to(camera: str, points_mm: FloatArray) -> FloatArray:
    away = points_mm - POSITIONS_MM[camera]
    return np.arctan2(away[..., 1], away[..., 0])


@pytest.mark.parametrize("camera", POSITIONS_MM)
def test_the_line_of_a_reference_point_runs_through_it(camera: str) -> None:
    model = table(camera)
    off = model.angles_rad(np.array(model.columns_px)) - angles_to(camera, far_points(camera))
    assert np.sin(off) == pytest.approx(0.0, abs=1e-12)


def test_between_two_points_the_way_is_divided_as_the_columns_are() -> None:
    model = LookupTable((0.0, 0.0), ((100.0, 10.0), (100.0, 20.0), (100.0, 40.0)), (50, 60, 70))
    angles = model.angles_rad(np.array([52.5, 60.0, 67.0]))
    assert np.tan(angles) * 100.0 == pytest.approx([12.5, 20.0, 34.0])


@pytest.mark.parametrize("camera", POSITIONS_MM)
def test_angles_do_not_jump_along_the_table(camera: str) -> None:
    model = table(camera)
    columns = np.linspace(min(model.columns_px), max(model.columns_px), 500)
    assert (np.diff(model.angles_rad(columns)) > 0.0).all()
    assert np.ptp(model.angles_rad(columns)) < np.pi / 2


def test_a_camera_that_hangs_upside_down_has_the_same_lines() -> None:
    columns = np.linspace(5.0, 635.0, 300)
    upright, hanging = table(), table(flipped=True)
    assert hanging.angles_rad(640.0 - columns) == pytest.approx(
        upright.angles_rad(columns), nan_ok=True
    )
    assert hanging.slopes_rad_px(np.array([300.0])) < 0.0 < upright.slopes_rad_px(np.array([300.0]))


def test_there_is_no_line_outside_the_table() -> None:
    model = table()
    first, last = min(model.columns_px), max(model.columns_px)
    outside = np.array([-50.0, first - 0.01, last + 0.01, 1e6, np.nan])
    assert np.isnan(model.angles_rad(outside)).all()
    assert np.isnan(model.slopes_rad_px(outside)).all()
    assert np.isfinite(model.angles_rad(np.array([first, last]))).all()


def test_an_unseen_point_leaves_a_gap_up_to_its_neighbours() -> None:
    whole, gapped = table(), table(unseen=slice(40, 42))
    before, after = whole.columns_px[39], whole.columns_px[42]
    inside = np.linspace(before, after, 20)[1:-1]
    assert np.isnan(gapped.angles_rad(inside)).all()
    beside = np.array([whole.columns_px[38], before - 0.5, before, after, after + 0.5])
    assert gapped.angles_rad(beside) == pytest.approx(whole.angles_rad(beside))


def test_a_table_whose_points_are_all_unseen_has_no_line() -> None:
    model = table(unseen=slice(None))
    assert np.isnan(model.angles_rad(np.array([100.0, 300.0]))).all()
    assert np.isnan(model.slopes_rad_px(np.array([100.0, 300.0]))).all()


@given(st.floats(30.0, 610.0))
def test_slopes_are_the_derivatives_of_angles(column: float) -> None:
    model = table()
    a, b = model.angles_rad(np.array([column - 1e-4, column + 1e-4]))
    slope = model.slopes_rad_px(np.array([column]))[0]
    within = not any(abs(column - known) < 2e-4 for known in model.columns_px)
    if np.isfinite(a) and np.isfinite(b) and within:
        assert slope == pytest.approx((b - a) / 2e-4, rel=1e-4)


@given(
    st.lists(
        st.one_of(st.floats(-10.0, 650.0), st.sampled_from([np.nan, 100.0])),
        min_size=1,
        max_size=8,
    ),
    st.lists(st.floats(-100.0, 700.0), max_size=10),
)
def test_whatever_the_columns_are_answers_lie_between_seen_neighbours(
    known: list[float], asked: list[float]
) -> None:
    points = tuple((100.0, 10.0 * index) for index in range(len(known)))
    model = LookupTable((0.0, -50.0), points, tuple(known))
    heights = 100.0 * np.tan(model.angles_rad(np.array(asked))) - 50.0
    for column, height in zip(asked, heights.tolist(), strict=True):
        between = [
            index
            for index, (a, b) in enumerate(pairwise(known))
            if min(a, b) <= column <= max(a, b)
        ]
        if np.isfinite(height):
            assert any(10.0 * i - 1e-6 <= height <= 10.0 * i + 10.0 + 1e-6 for i in between)


def laid(shadows: Iterable[Shadow], model: CameraModel) -> DirectingLines:
    return tabulate("C1", model, 640).lay(Shadows.of(shadows), 0.1)


def test_an_edge_beyond_the_table_is_not_valid_and_bounds_nothing() -> None:
    model = table()
    last = max(model.columns_px)
    beyond = Shadow(last - 10.0, last + 30.0, True, True, 1.0)
    lines = laid((beyond,), model)
    assert (lines.first_valid.tolist(), lines.last_valid.tolist()) == ([True], [False])
    assert lines.first_rad == pytest.approx(model.angles_rad(np.array([last - 10.0])))
    assert lines.last_rad == pytest.approx(model.angles_rad(np.array([last])), abs=0.003)
    assert np.isfinite(lines.centre_rad).all()
    assert (lines.sigma_rad > 0.0).all()


def test_a_shadow_without_a_line_is_left_out() -> None:
    model = table(unseen=slice(40, 50))
    inside = Shadow(model.columns_px[39] + 0.5, model.columns_px[50] - 0.5, True, True, 1.0)
    seen = Shadow(100.0, 120.0, True, True, 1.0)
    lines = laid((seen, inside), model)
    assert lines.first_rad == pytest.approx(model.angles_rad(np.array([100.0])))
    assert len(laid((inside,), model).sigma_rad) == 0


def test_a_shadow_across_a_gap_keeps_both_its_edges() -> None:
    model = table(unseen=slice(40, 42))
    left, right = model.columns_px[38], model.columns_px[43]
    lines = laid((Shadow(left, right, True, True, 1.0),), model)
    assert (lines.first_valid & lines.last_valid).all()
    mean_slope = (lines.last_rad - lines.first_rad) / (right - left)
    assert lines.sigma_rad == pytest.approx(0.1 * mean_slope)


def contacts_of(
    place_mm: tuple[float, float], models: dict[str, LookupTable], crossing: str
) -> tuple[Contact, ...]:
    """Contacts of a finger of 10 mm."""
    lines = []
    for camera, model in models.items():
        away = np.array(place_mm) - POSITIONS_MM[camera]
        half = np.arcsin(5.0 / np.hypot(*away))
        turn = np.array([[np.cos(half), -np.sin(half)], [np.sin(half), np.cos(half)]])
        edges = np.stack([away @ turn, away @ turn.T]) + POSITIONS_MM[camera]
        left, right = columns_of(camera, edges).tolist()
        shadow = Shadow(left, right, True, True, 1.0)
        lines.append(tabulate(camera, model, 640).lay(Shadows.of([shadow]), 0.1))
    settings = CrossingSettings.model_validate({"method": crossing})
    return make_crossing(settings, SURFACE_MM).cross(lines).contacts


@pytest.mark.parametrize("crossing", ["default", "paper"])
@pytest.mark.parametrize("place", [(175.0, 200.0), (80.0, 300.0), (320.0, 60.0)])
def test_a_finger_is_found_where_it_is(crossing: str, place: tuple[float, float]) -> None:
    (contact,) = contacts_of(place, {camera: table(camera) for camera in POSITIONS_MM}, crossing)
    assert (contact.x_mm, contact.y_mm) == pytest.approx(place, abs=0.1)


@pytest.mark.parametrize("crossing", ["default", "paper"])
@given(gap=st.integers(0, 148), length=st.integers(1, 60))
def test_a_gap_costs_at_most_the_line_of_its_camera(crossing: str, gap: int, length: int) -> None:
    models = {camera: table(camera) for camera in POSITIONS_MM}
    models["C1"] = table(unseen=slice(gap, gap + length))
    (contact,) = contacts_of((150.0, 220.0), models, crossing)
    assert (contact.x_mm, contact.y_mm) == pytest.approx((150.0, 220.0), abs=0.3)
    assert np.isfinite([contact.diameter_mm, contact.sigma_mm, contact.confidence]).all()
