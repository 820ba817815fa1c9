"""Ghosts are where three cameras' shadows cross and nothing touches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.fusion.ghosts import APART_MM, MOST_GHOSTS, find_ghosts
from cornertouchd.model import Contact, DirectingLines

WIDTH_MM, HEIGHT_MM = 350.0, 400.0
SURFACE_MM = (WIDTH_MM, HEIGHT_MM)
CORNERS = {
    "C1": (0.0, 0.0),
    "C2": (WIDTH_MM, 0.0),
    "C3": (WIDTH_MM, HEIGHT_MM),
    "C4": (0.0, HEIGHT_MM),
}
RADIUS_MM = 5.0
places = st.tuples(st.floats(20.0, WIDTH_MM - 20.0), st.floats(20.0, HEIGHT_MM - 20.0))


def lines_to(camera: str, *touched: tuple[float, float]) -> DirectingLines:
    x_mm, y_mm = CORNERS[camera]
    away = np.array(touched).reshape(-1, 2) - (x_mm, y_mm)
    centre = np.sort(np.arctan2(away[:, 1], away[:, 0]))
    order = np.argsort(np.arctan2(away[:, 1], away[:, 0]))
    half = np.arcsin(RADIUS_MM / np.hypot(away[:, 0], away[:, 1]))[order]
    some = np.ones(len(centre), np.bool_)
    return DirectingLines(
        camera, x_mm, y_mm, centre - half, centre, centre + half, some, some, half
    )


def seen(*touched: tuple[float, float]) -> list[DirectingLines]:
    return [lines_to(camera, *touched) for camera in CORNERS]


def contacts(*touched: tuple[float, float]) -> list[Contact]:
    return [Contact(x_mm, y_mm, 2 * RADIUS_MM, tuple(CORNERS), 1.0, 0.3) for x_mm, y_mm in touched]


def test_without_shadows_there_are_none():
    assert find_ghosts([], [], SURFACE_MM) == ()
    assert find_ghosts(seen(), [], SURFACE_MM) == ()


@given(places)
def test_a_place_that_was_not_believed_is_found_with_its_size(place):
    (ghost,) = find_ghosts(seen(place), [], SURFACE_MM)
    assert (ghost.x_mm, ghost.y_mm) == pytest.approx(place, abs=2.0)
    assert ghost.diameter_mm == pytest.approx(2 * RADIUS_MM, rel=0.3)
    assert ghost.confidence == 0.0
    assert len(ghost.cameras) >= 3


@given(places)
def test_a_contact_is_none(place):
    assert find_ghosts(seen(place), contacts(place), SURFACE_MM) == ()


def test_two_cameras_tell_nothing():
    assert find_ghosts(seen((100.0, 100.0))[:2], [], SURFACE_MM) == ()


@given(st.lists(places, min_size=1, max_size=8))
def test_each_lies_in_three_shadows_apart_from_contacts_and_other_ghosts(touched):
    found = contacts(*touched)
    ghosts = find_ghosts(seen(*touched), found, SURFACE_MM)
    assert len(ghosts) <= MOST_GHOSTS
    for number, ghost in enumerate(ghosts):
        assert 0.0 <= ghost.x_mm <= WIDTH_MM
        assert 0.0 <= ghost.y_mm <= HEIGHT_MM
        covering = 0
        for camera in seen(*touched):
            angle = np.arctan2(ghost.y_mm - camera.y_mm, ghost.x_mm - camera.x_mm)
            covering += bool(((camera.first_rad <= angle) & (angle <= camera.last_rad)).any())
        assert covering == len(ghost.cameras) >= 3
        for other in (*found, *ghosts[:number]):
            apart_mm = np.hypot(ghost.x_mm - other.x_mm, ghost.y_mm - other.y_mm)
            assert apart_mm >= APART_MM


def test_a_known_ghost_of_four_touches_is_found():
    """The last corner of a rectangle of touches, on which three cameras agree."""
    touched = [(100.0, 150.0), (240.0, 150.0), (100.0, 260.0)]
    ghost_at = (240.0, 260.0)
    cameras = [
        lines_to("C1", *touched, ghost_at),
        lines_to("C2", *touched, ghost_at),
        lines_to("C3", *touched, ghost_at),
        lines_to("C4", *touched),
    ]
    ghosts = find_ghosts(cameras, contacts(*touched), SURFACE_MM)
    nearest = min(ghosts, key=lambda one: abs(one.x_mm - 240.0) + abs(one.y_mm - 260.0))
    assert (nearest.x_mm, nearest.y_mm) == pytest.approx(ghost_at, abs=2.0)


def test_with_too_many_crossings_there_is_no_list():
    rng = np.random.default_rng(1)
    many = [tuple(place) for place in rng.uniform(20.0, 330.0, (20, 2)).tolist()]
    assert find_ghosts(seen(*many), contacts(*many), SURFACE_MM) == ()
