import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle.nearest_point import nearest_point_to_lines

from cornertouchd.geometry import (
    angles_and_distances,
    distances_to_lines,
    half_angles_of_discs,
    line_crossings,
    nearest_points_to_lines,
    normals,
    unit_vectors,
    wrap_angle,
)

angles = st.floats(-10.0, 10.0)
coordinates = st.floats(-3000.0, 3000.0)
points = st.tuples(coordinates, coordinates).map(np.array)


@given(angles)
def test_the_normal_is_the_direction_turned_from_x_towards_y(angle: float) -> None:
    direction, normal = unit_vectors(np.array(angle)), normals(np.array(angle))
    turned = unit_vectors(np.array(angle + np.pi / 2.0))
    np.testing.assert_allclose(normal, turned, atol=1e-12)
    assert np.hypot(*direction) == pytest.approx(1.0)


def test_a_point_on_the_side_of_the_normal_is_at_a_positive_distance() -> None:
    along_x = np.array([0.0])
    distances = distances_to_lines(np.array([[7.0, 3.0], [-2.0, -5.0]]), np.zeros((1, 2)), along_x)
    np.testing.assert_allclose(distances, [[3.0], [-5.0]])


@given(points, points, angles)
def test_the_distance_to_a_line_does_not_depend_on_where_on_it_the_origin_is(
    point: np.ndarray, origin: np.ndarray, angle: float
) -> None:
    further = origin + 500.0 * unit_vectors(np.array(angle))
    lines = np.stack([origin, further])
    first, second = distances_to_lines(point[None], lines, np.array([angle, angle]))[0]
    assert first == pytest.approx(second, abs=1e-8)


@given(points, st.lists(angles, min_size=2, max_size=6))
def test_lines_through_one_point_have_it_as_their_nearest_point(
    point: np.ndarray, directions: list[float]
) -> None:
    line_angles = np.array([*directions, directions[0] + 1.0])
    origins = point - 400.0 * unit_vectors(line_angles)
    np.testing.assert_allclose(nearest_point_to_lines(origins, line_angles), point, atol=1e-6)


@given(st.lists(st.lists(angles | st.just(np.nan), min_size=4, max_size=4), max_size=6))
def test_many_points_are_those_found_one_by_one(sets: list[list[float]]) -> None:
    origins = np.array([[0.0, 0.0], [350.0, 3.0], [352.0, 400.0], [-4.0, 404.0]])
    line_angles = np.array(sets).reshape(-1, 4).T
    located = nearest_points_to_lines(origins, line_angles)
    assert located.shape == (len(sets), 2)
    for point, own in zip(located, line_angles.T, strict=True):
        seen = np.isfinite(own)
        doubled = unit_vectors(2 * own[seen])  # a line and its opposite are the same
        crossing = np.ptp(doubled, axis=0).max() if seen.any() else 0.0
        if crossing > 1e-3:
            np.testing.assert_allclose(
                point, nearest_point_to_lines(origins[seen], own[seen]), rtol=1e-4, atol=1e-4
            )
        elif crossing == 0:
            assert np.isnan(point).all()


def test_a_heavier_line_pulls_the_nearest_point() -> None:
    origins = np.array([[0.0, 0.0], [0.0, 2.0], [5.0, 0.0]])
    line_angles = np.array([0.0, 0.0, np.pi / 2.0])
    even = nearest_point_to_lines(origins, line_angles)
    uneven = nearest_point_to_lines(origins, line_angles, np.array([3.0, 1.0, 1.0]))
    np.testing.assert_allclose(even, [5.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(uneven, [5.0, 0.5], atol=1e-12)


def test_parallel_lines_have_no_nearest_point() -> None:
    with pytest.raises(np.linalg.LinAlgError, match="parallel"):
        nearest_point_to_lines(np.array([[0.0, 0.0], [0.0, 1.0]]), np.array([0.3, 0.3]))


@given(st.floats(-50.0, 50.0))
def test_wrapping_keeps_the_direction_and_stays_within_a_turn(angle: float) -> None:
    wrapped = wrap_angle(np.array([angle]))
    assert -np.pi <= wrapped[0] <= np.pi
    np.testing.assert_allclose(unit_vectors(wrapped), unit_vectors(np.array([angle])), atol=1e-9)


@given(points, angles, st.floats(0.1, 3000.0))
def test_a_point_seen_at_an_angle_and_a_distance_lies_there(
    origin: np.ndarray, angle: float, distance: float
) -> None:
    point = origin + distance * unit_vectors(np.array(angle))
    seen_at, how_far = angles_and_distances(point[None], origin[None])
    assert how_far[0, 0] == pytest.approx(distance, abs=1e-8)
    np.testing.assert_allclose(
        unit_vectors(seen_at[0, 0]), unit_vectors(np.array(angle)), atol=1e-7 / distance + 1e-12
    )


@given(st.floats(0.5, 40.0), st.floats(1.001, 100.0), angles)
def test_the_tangents_of_a_disc_pass_its_centre_at_its_radius(
    radius: float, times_farther: float, angle: float
) -> None:
    distance = radius * times_farther
    centre = distance * unit_vectors(np.array([angle]))
    half_angle = half_angles_of_discs(np.array(radius), np.array(distance))
    tangents = np.array([angle - half_angle, angle + half_angle])
    passes = distances_to_lines(centre, np.zeros((2, 2)), tangents)
    np.testing.assert_allclose(passes, [[radius, -radius]], rtol=1e-6)


def test_a_disc_around_the_eye_fills_the_view() -> None:
    half_angles = half_angles_of_discs(np.array([[5.0], [5.0]]), np.array([[5.0], [0.0]]))
    np.testing.assert_array_equal(half_angles, np.pi)


@given(points, points, angles, st.floats(0.01, 3.13))
def test_lines_cross_in_a_point_of_both(
    first: np.ndarray, second: np.ndarray, angle: float, between: float
) -> None:
    origins = np.stack([first, second])
    line_angles = np.array([angle, angle + between])
    n = normals(line_angles)
    h = np.sum(n * origins, axis=1)
    crossing, sine = line_crossings(n[:1], h[:1], n[1:], h[1:])
    assert sine[0] == pytest.approx(np.sin(between), abs=1e-9)
    away = np.max(np.abs(crossing)) + 1.0
    distances = distances_to_lines(crossing, origins, line_angles)
    np.testing.assert_allclose(distances, 0.0, atol=1e-9 * away / abs(sine[0]))


def test_parallel_lines_cross_nowhere() -> None:
    n = normals(np.array([0.5]))
    crossing, sine = line_crossings(n, np.array([1.0]), n, np.array([2.0]))
    assert sine[0] == 0.0
    assert np.all(np.isnan(crossing))
