"""Where a touch on the surface lands in the picture of a display."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.wire.mapping import Corners, DisplayMapping

lengths_mm = st.floats(1.0, 5000.0)
places_mm = st.floats(-10_000.0, 10_000.0)
mappings = st.builds(
    DisplayMapping,
    places_mm,
    places_mm,
    lengths_mm,
    lengths_mm,
    st.sampled_from([0, 90, 180, 270]),
    st.booleans(),
)


def display(rotation_deg: int = 0, mirror: bool = False) -> DisplayMapping:
    return DisplayMapping(100.0, 50.0, 400.0, 200.0, rotation_deg, mirror)


# the rectangle's corners on the surface, clockwise from its top-left
CORNERS_MM = [(100.0, 50.0), (500.0, 50.0), (500.0, 250.0), (100.0, 250.0)]


@pytest.mark.parametrize(
    ("rotation_deg", "mirror", "corners"),
    [
        (0, False, [(0, 0), (1, 0), (1, 1), (0, 1)]),
        (90, False, [(0, 1), (0, 0), (1, 0), (1, 1)]),
        (180, False, [(1, 1), (0, 1), (0, 0), (1, 0)]),
        (270, False, [(1, 0), (1, 1), (0, 1), (0, 0)]),
        (0, True, [(1, 0), (0, 0), (0, 1), (1, 1)]),
        (90, True, [(1, 1), (1, 0), (0, 0), (0, 1)]),
        (180, True, [(0, 1), (1, 1), (1, 0), (0, 0)]),
        (270, True, [(0, 0), (0, 1), (1, 1), (1, 0)]),
    ],
)
def test_corners_of_the_rectangle_are_corners_of_the_picture(
    rotation_deg: int, mirror: bool, corners: list[tuple[float, float]]
) -> None:
    mapping = display(rotation_deg, mirror)
    assert [mapping.to_display(*corner) for corner in CORNERS_MM] == corners


def test_a_place_within_is_measured_in_widths_and_heights() -> None:
    assert display().to_display(200.0, 200.0) == (0.25, 0.75)
    assert display(90).to_display(200.0, 200.0) == (0.75, 0.75)


@settings(deadline=None)
@given(mappings, st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_every_place_lands_in_the_picture(mapping: DisplayMapping, x: float, y: float) -> None:
    assert all(0.0 <= value <= 1.0 for value in mapping.to_display(x, y))


@settings(deadline=None)
@given(mappings, st.floats(0.2, 0.8), st.floats(0.2, 0.8), st.floats(-1, 1), st.floats(-1, 1))
def test_velocity_is_how_fast_the_place_in_the_picture_moves(
    mapping: DisplayMapping, u: float, v: float, du_per_s: float, dv_per_s: float
) -> None:
    x_mm = mapping.left_mm + u * mapping.width_mm
    y_mm = mapping.top_mm + v * mapping.height_mm
    vx_mm_s, vy_mm_s = du_per_s * mapping.width_mm, dv_per_s * mapping.height_mm
    x, y = mapping.to_display(x_mm, y_mm)
    later = mapping.to_display(x_mm + 0.1 * vx_mm_s, y_mm + 0.1 * vy_mm_s)
    speed = mapping.velocity_to_display(vx_mm_s, vy_mm_s, x_mm, y_mm)
    assert later == pytest.approx((x + 0.1 * speed[0], y + 0.1 * speed[1]), abs=1e-6)


def test_a_fingertip_may_lie_two_millimetres_beside_the_picture() -> None:
    mapping = display()
    assert mapping.contains(98.0, 50.0)
    assert mapping.contains(502.0, 252.0)
    assert not mapping.contains(97.9, 50.0)
    assert not mapping.contains(502.1, 252.0)
    assert not mapping.contains(100.0, 47.9)
    assert not mapping.contains(100.0, 252.1)
    assert mapping.to_display(98.0, 252.0) == (0.0, 1.0)


def test_a_place_that_is_no_number_is_not_on_the_display() -> None:
    assert not display().contains(math.nan, 60.0)
    assert not display().contains(200.0, math.inf)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ((0.0, 0.0, 0.0, 1.0), "width_mm is 0.0, must be above 0 mm"),
        ((0.0, 0.0, 1.0, -5.0), "height_mm is -5.0, must be above 0 mm"),
        ((math.nan, 0.0, 1.0, 1.0), "left_mm is nan"),
        ((0.0, 0.0, 1.0, math.inf), "height_mm is inf"),
        ((0.0, 0.0, 1.0, 1.0, 45), "rotation_deg is 45; choose one of 0, 90, 180, 270"),
    ],
)
def test_an_impossible_rectangle_is_refused(values: tuple[float, ...], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DisplayMapping(*values)  # type: ignore[arg-type]


TRAPEZIUM = ((20.0, 10.0), (310.0, 25.0), (330.0, 190.0), (5.0, 180.0))


def quadrangle(corners_mm: Corners = TRAPEZIUM) -> DisplayMapping:
    return DisplayMapping(0.0, 0.0, 350.0, 200.0, corners_mm=corners_mm)


def test_the_corners_of_a_trapezium_are_those_of_its_picture() -> None:
    mapping = quadrangle()
    for corner, wanted in zip(TRAPEZIUM, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        assert mapping.to_display(*corner) == pytest.approx(wanted, abs=1e-9)
        assert mapping.contains(*corner)


def test_straight_lines_of_a_trapezium_cross_in_the_middle_of_its_picture() -> None:
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = TRAPEZIUM
    share = ((bx - ax) * (by - dy) - (by - ay) * (bx - dx)) / (
        (cx - ax) * (by - dy) - (cy - ay) * (bx - dx)
    )
    crossing = ax + share * (cx - ax), ay + share * (cy - ay)
    assert quadrangle().to_display(*crossing) == pytest.approx((0.5, 0.5))


@pytest.mark.parametrize("rotation_deg", [0, 90, 180, 270])
@pytest.mark.parametrize("mirror", [False, True])
def test_a_quadrangle_that_is_a_rectangle_is_mapped_as_one(rotation_deg: int, mirror: bool) -> None:
    rectangle = DisplayMapping(50.0, 20.0, 200.0, 100.0, rotation_deg, mirror)
    sides = (50.0, 250.0), (20.0, 120.0)
    by_place = {
        tuple(map(round, rectangle.to_display(x, y))): (x, y) for x in sides[0] for y in sides[1]
    }
    same = quadrangle(tuple(by_place[place] for place in ((0, 0), (1, 0), (1, 1), (0, 1))))
    assert same.picture_mm == pytest.approx(rectangle.picture_mm)
    for x_mm, y_mm in ((60.0, 30.0), (150.0, 119.0), (48.5, 70.0), (47.0, 70.0), (251.9, 18.1)):
        assert same.contains(x_mm, y_mm) == rectangle.contains(x_mm, y_mm)
        assert same.to_display(x_mm, y_mm) == pytest.approx(rectangle.to_display(x_mm, y_mm))
        assert same.velocity_to_display(3.0, -5.0, x_mm, y_mm) == pytest.approx(
            rectangle.velocity_to_display(3.0, -5.0, x_mm, y_mm)
        )


@given(st.floats(40.0, 290.0), st.floats(40.0, 170.0), st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))
def test_velocity_in_a_trapezium_is_how_fast_the_place_moves(
    x_mm: float, y_mm: float, vx_mm_s: float, vy_mm_s: float
) -> None:
    mapping, after_s = quadrangle(), 1e-4
    x, y = mapping.to_display(x_mm, y_mm)
    later = mapping.to_display(x_mm + after_s * vx_mm_s, y_mm + after_s * vy_mm_s)
    speed = mapping.velocity_to_display(vx_mm_s, vy_mm_s, x_mm, y_mm)
    moved = (later[0] - x) / after_s, (later[1] - y) / after_s
    assert speed == pytest.approx(moved, abs=1e-5)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_every_place_lands_in_the_picture_of_a_trapezium(x_mm: float, y_mm: float) -> None:
    assert all(0.0 <= value <= 1.0 for value in quadrangle().to_display(x_mm, y_mm))


@pytest.mark.parametrize(
    "corners_mm",
    [
        TRAPEZIUM[:3],
        (TRAPEZIUM[0], TRAPEZIUM[2], TRAPEZIUM[1], TRAPEZIUM[3]),
        (*TRAPEZIUM[:3], (160.0, 60.0)),
        (*TRAPEZIUM[:3], (math.nan, 100.0)),
        (TRAPEZIUM[0],) * 4,
    ],
)
def test_corners_of_no_picture_are_refused(corners_mm: Corners) -> None:
    with pytest.raises(ValueError, match="corners_mm"):
        quadrangle(corners_mm)
