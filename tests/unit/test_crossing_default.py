"""Scenes are discs on a small surface, seen without noise unless a test says otherwise."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle.sight import (
    CORNERS,
    SIDES,
    SURFACE_MM,
    Disc,
    bearings_of,
    one_camera,
    random_discs,
    shadows,
)
from scipy.optimize import linear_sum_assignment

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.edge_crossing import EdgeCrossing
from cornertouchd.geometry import wrap_angle
from cornertouchd.model import Contact, DirectingLines


def crossing(**settings: float) -> Callable[[Sequence[DirectingLines]], tuple[Contact, ...]]:
    method = make_crossing(CrossingSettings.model_validate(settings), SURFACE_MM)
    return lambda directing_lines: method.cross(directing_lines).contacts


def found(contacts: Sequence[Contact]) -> list[tuple[float, float]]:
    return sorted((contact.x_mm, contact.y_mm) for contact in contacts)


def assert_found(
    contacts: Sequence[Contact], discs: Sequence[Disc], within_mm: float
) -> list[float]:
    """Return how far each contact is from its disc."""
    assert len(contacts) == len(discs), (contacts, discs)
    places = np.array([(contact.x_mm, contact.y_mm) for contact in contacts]).reshape(-1, 2)
    expected = np.array(discs).reshape(-1, 3)[:, :2]
    distances_mm = np.hypot(*np.moveaxis(places[:, None] - expected[None], -1, 0))
    errors_mm = distances_mm[linear_sum_assignment(distances_mm)]
    assert errors_mm.max(initial=0.0) < within_mm
    return [float(error_mm) for error_mm in errors_mm]


def test_the_settings_choose_the_method() -> None:
    assert isinstance(make_crossing(CrossingSettings(), SURFACE_MM), EdgeCrossing)


@given(st.floats(5.0, 345.0), st.floats(5.0, 395.0), st.floats(3.8, 9.0))
def test_one_finger_is_found_where_it_is(x_mm: float, y_mm: float, radius_mm: float) -> None:
    (contact,) = crossing()(bearings_of([(x_mm, y_mm, radius_mm)]))
    assert (contact.x_mm, contact.y_mm) == pytest.approx((x_mm, y_mm), abs=0.02)
    assert contact.diameter_mm == pytest.approx(2.0 * radius_mm, abs=0.05)
    assert contact.confidence > 0.99
    assert contact.touching
    assert contact.kind == "finger"


def test_the_position_of_one_finger_is_as_good_as_its_sigma_says() -> None:
    rng = np.random.default_rng(3)
    errors_in_sigmas = []
    for disc in random_discs(60, rng, apart_mm=5.0):
        (contact,) = crossing()(bearings_of([disc], rng=rng))
        error_mm = np.hypot(contact.x_mm - disc[0], contact.y_mm - disc[1])
        assert error_mm < 0.25
        errors_in_sigmas.append(error_mm / contact.sigma_mm)
    assert 0.3 < np.sqrt(np.mean(np.square(errors_in_sigmas))) < 2.0


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_few_fingers_are_all_found_and_nothing_else(count: int) -> None:
    rng = np.random.default_rng(count)
    errors_mm: list[float] = []
    for _ in range(25):
        discs = random_discs(count, rng)
        contacts = crossing()(bearings_of(discs, rng=rng))
        errors_mm += assert_found(contacts, discs, within_mm=3.0)
    assert np.sqrt(np.mean(np.square(errors_mm))) < 0.2


def test_ten_fingers_are_nearly_always_found() -> None:
    rng = np.random.default_rng(10)
    exact = 0
    for _ in range(25):
        discs = random_discs(10, rng)
        contacts = crossing()(bearings_of(discs, rng=rng))
        nearest = [
            min((np.hypot(c.x_mm - x, c.y_mm - y) for c in contacts), default=99.0)
            for x, y, _ in discs
        ]
        exact += len(contacts) == 10 and max(nearest) < 6.0
    assert exact >= 22


def test_fingers_behind_each_other_make_no_ghosts() -> None:
    """The places F1..F4 of the paper's Fig. 2: each camera sees two merged pairs, or nearly so."""
    corners = [(100.0, 120.0), (250.0, 120.0), (100.0, 280.0), (250.0, 280.0)]
    for missing in range(4):
        discs = [(x, y, 6.0) for n, (x, y) in enumerate(corners) if n != missing]
        assert_found(crossing()(bearings_of(discs)), discs, within_mm=1.0)


def test_merged_shadows_are_taken_apart() -> None:
    pair = [(170.0, 200.0, 5.0), (190.0, 214.0, 5.0)]
    directing_lines = bearings_of(pair)
    assert min(len(camera.first_rad) for camera in directing_lines) == 1
    assert_found(crossing()(directing_lines), pair, within_mm=0.5)


@pytest.mark.parametrize("turned_deg", range(0, 180, 20))
def test_two_fingers_side_by_side_are_not_taken_for_one_large_one(turned_deg: float) -> None:
    dx, dy = 7.0 * np.cos(np.deg2rad(turned_deg)), 7.0 * np.sin(np.deg2rad(turned_deg))
    for x, y in [(110.0, 130.0), (272.0, 267.0), (175.0, 330.0)]:
        pair = [(x - dx, y - dy, 5.9), (x + dx, y + dy, 4.7)]
        assert_found(crossing()(bearings_of(pair)), pair, within_mm=2.0)


@pytest.mark.parametrize(
    "pair",
    [
        [(201.9, 232.0, 5.2), (190.1, 233.4, 5.9)],
        [(138.6, 167.6, 5.0), (137.0, 179.5, 4.0)],
        [(189.6, 229.9, 5.4), (185.2, 242.0, 6.5)],
        [(213.7, 60.6, 5.7), (204.7, 68.6, 5.0)],
    ],
)
def test_a_large_disc_that_covers_more_does_not_stand_in_the_way_of_two(pair: list[Disc]) -> None:
    assert_found(crossing()(bearings_of(pair)), pair, within_mm=2.0)


@pytest.mark.parametrize(
    "pair",
    [
        [(191.6, 343.5, 5.3), (195.2, 353.4, 5.3)],
        [(175.5, 188.8, 4.8), (165.1, 191.0, 4.8)],
    ],
)
def test_two_places_that_are_as_likely_do_not_deny_each_other(pair: list[Disc]) -> None:
    contacts = crossing()(bearings_of(pair))
    assert 1 <= len(contacts) <= 2
    middle = np.mean([disc[:2] for disc in pair], axis=0)
    for one in contacts:
        assert np.hypot(one.x_mm - middle[0], one.y_mm - middle[1]) < 6.0


def test_a_contact_names_the_cameras_whose_shadows_it_casts() -> None:
    hidden_from_c1 = (200.0, 200.0, 4.0)
    before_it = (100.0, 100.0, 8.0)
    contacts = crossing()(bearings_of([hidden_from_c1, before_it]))
    cameras = {round(contact.x_mm): contact.cameras for contact in contacts}
    assert cameras == {200: ("C2", "C3", "C4"), 100: ("C1", "C2", "C3", "C4")}


@pytest.mark.parametrize(
    "cameras", [("C1", "C2"), ("C1", "C2", "C3"), ("C4", "C2", "C1", "C3"), ("C5", "C7", "C3")]
)
def test_any_two_or_more_cameras_will_do(cameras: tuple[str, ...]) -> None:
    disc = (120.0, 230.0, 6.0)
    (contact,) = crossing()(bearings_of([disc], cameras))
    assert (contact.x_mm, contact.y_mm) == pytest.approx(disc[:2], abs=0.05)
    assert contact.cameras == cameras


def test_eight_cameras_find_five_fingers() -> None:
    discs = random_discs(5, np.random.default_rng(8))
    assert_found(crossing()(bearings_of(discs, [*CORNERS, *SIDES])), discs, within_mm=0.2)


def test_cameras_without_shadows_are_as_if_they_were_absent() -> None:
    disc = (120.0, 230.0, 6.0)
    seeing = bearings_of([disc], ("C1", "C2", "C4"))
    blind = bearings_of([], ("C3",))
    assert crossing()([*seeing, *blind]) == crossing()(seeing)


def test_less_than_two_seeing_cameras_find_nothing() -> None:
    assert crossing()([]) == ()
    assert crossing()(bearings_of([])) == ()
    assert crossing()(bearings_of([(120.0, 230.0, 6.0)], ("C2",))) == ()


def test_a_contact_that_one_camera_misses_is_found_all_the_same() -> None:
    discs = [(90.0, 150.0, 6.0), (240.0, 260.0, 6.0)]
    for camera in range(4):
        directing_lines = bearings_of(discs)
        directing_lines[camera] = shadows(directing_lines[camera], [0])
        assert_found(crossing()(directing_lines), discs, within_mm=0.3)


def test_a_contact_between_two_cameras_that_hide_it_from_each_other_is_found() -> None:
    on_the_diagonal = (230.0, 262.0, 3.8)
    elsewhere = (60.0, 300.0, 6.0)
    directing_lines = bearings_of([on_the_diagonal, elsewhere])
    for camera in ("C1", "C3"):
        directing_lines[list(CORNERS).index(camera)] = one_camera([elsewhere], camera)
    contacts = crossing()(directing_lines)
    assert_found(contacts, [on_the_diagonal, elsewhere], within_mm=0.5)


def test_what_two_cameras_show_and_two_others_do_not_is_no_contact() -> None:
    finger, phantom = (90.0, 150.0, 6.0), (300.0, 300.0, 6.0)
    directing_lines = [
        *bearings_of([finger], ("C1", "C2")),
        *bearings_of([finger, phantom], ("C3", "C4")),
    ]
    assert_found(crossing()(directing_lines), [finger], within_mm=0.1)


def test_a_finger_at_a_camera_covers_its_view_and_is_found() -> None:
    at_c1 = (1.0, 1.0, 14.0)
    far = (250.0, 300.0, 6.0)
    directing_lines = bearings_of([at_c1, far])
    assert not (directing_lines[0].first_valid | directing_lines[0].last_valid).any()
    assert_found(crossing()(directing_lines), [at_c1, far], within_mm=0.5)


def test_a_finger_reaches_beyond_an_edge_that_is_not_valid() -> None:
    """Columns are unknown from the middle of the finger on, where another camera stands."""
    discs = [(184.0, 206.0, 6.0), (300.0, 120.0, 6.0)]
    directing_lines = []
    for camera in CORNERS:
        seen = one_camera(discs, camera)
        cut = int(np.argmin(np.abs(seen.centre_rad - one_camera(discs[:1], camera).centre_rad)))
        last_rad, last_valid = seen.last_rad.copy(), seen.last_valid.copy()
        last_rad[cut], last_valid[cut] = seen.centre_rad[cut], False
        directing_lines.append(seen._replace(last_rad=last_rad, last_valid=last_valid))
    assert_found(crossing()(directing_lines), discs, within_mm=1.0)


def test_beyond_an_edge_that_is_not_valid_the_light_still_refuses_ghosts() -> None:
    finger, ghost = (120.0, 150.0, 6.0), (200.0, 320.0, 6.0)
    directing_lines = [one_camera([finger], "C1"), *bearings_of([finger, ghost], ("C2", "C3"))]
    assert directing_lines[0].last_rad[0] < one_camera([ghost], "C1").first_rad[0]
    directing_lines[0] = directing_lines[0]._replace(last_valid=np.array([False]))
    sure = [contact for contact in crossing()(directing_lines) if contact.confidence > 0.5]
    assert_found(sure, [finger], within_mm=0.3)


def test_four_edges_that_leave_the_size_open_still_make_a_contact() -> None:
    """In the middle of the surface opposite cameras may see only the same side of a finger."""
    disc = (177.0, 202.0, 5.0)
    valid = {"C1": (True, False), "C2": (True, False), "C3": (False, True), "C4": (False, True)}
    directing_lines = [
        one_camera([disc], camera)._replace(
            first_valid=np.array([first]),
            last_valid=np.array([last]),
        )
        for camera, (first, last) in valid.items()
    ]
    assert_found(crossing()(directing_lines), [disc], within_mm=2.0)


def test_contacts_at_the_border_are_on_the_surface() -> None:
    outside = (-1.0, 401.0, 6.0)
    (contact,) = crossing()(bearings_of([outside]))
    assert (contact.x_mm, contact.y_mm) == (0.0, 400.0)


def test_something_beside_the_surface_is_no_contact() -> None:
    assert crossing()(bearings_of([(-6.0, 200.0, 4.0)])) == ()


def test_the_settings_bound_the_size_of_contacts() -> None:
    pen, palm = (100.0, 250.0, 1.5), (200.0, 150.0, 30.0)
    assert crossing(smallest_radius_mm=3.3)(bearings_of([pen])) == ()
    (thin,) = crossing(smallest_radius_mm=1.2)(bearings_of([pen]))
    assert (thin.x_mm, thin.y_mm) == pytest.approx(pen[:2], abs=0.1)
    (wide,) = crossing()(bearings_of([palm]))
    assert wide.diameter_mm == pytest.approx(60.0, abs=0.5)
    assert all(c.diameter_mm < 55.0 for c in crossing(largest_radius_mm=25.0)(bearings_of([palm])))


def test_pens_are_found_among_fingers() -> None:
    pens = [(100.0, 250.0, 2.0), (250.0, 130.0, 2.6)]
    fingers = [(140.0, 120.0, 6.0), (230.0, 300.0, 7.0), (60.0, 330.0, 5.0)]
    contacts = crossing(smallest_radius_mm=1.5)(bearings_of([*pens, *fingers]))
    assert_found(contacts, [*pens, *fingers], within_mm=0.5)
    thin = [contact for contact in contacts if contact.diameter_mm < 6.0]
    assert len(thin) == 2


def test_looking_for_pens_changes_nothing_where_there_are_none() -> None:
    directing_lines = bearings_of(random_discs(10, np.random.default_rng(12)))
    fingers_only = crossing(smallest_radius_mm=3.3)(directing_lines)
    assert crossing(smallest_radius_mm=1.5)(directing_lines) == fingers_only


def test_an_ellipse_is_found_at_its_centre() -> None:
    """Rays of a camera far away touch an ellipse of half axes 7 and 5 where its support says."""
    centre, half_axes, turned_rad = np.array([140.0, 220.0]), (7.0, 5.0), 0.6
    directing_lines = []
    for camera, (x_mm, y_mm, _) in CORNERS.items():
        edges = _tangents_of_ellipse(centre - (x_mm, y_mm), half_axes, turned_rad)
        seen = one_camera([(140.0, 220.0, 6.0)], camera)
        wrapped = seen.centre_rad + (edges - seen.centre_rad + np.pi) % (2 * np.pi) - np.pi
        directing_lines.append(seen._replace(first_rad=wrapped[:1], last_rad=wrapped[1:]))
    (contact,) = crossing()(directing_lines)
    assert (contact.x_mm, contact.y_mm) == pytest.approx(tuple(centre), abs=0.1)
    assert contact.diameter_mm == pytest.approx(12.0, abs=0.4)


def _tangents_of_ellipse(
    centre: np.ndarray, half_axes: tuple[float, float], turned_rad: float
) -> np.ndarray:
    around = np.linspace(0.0, 2.0 * np.pi, 20_001)
    outline = np.stack([half_axes[0] * np.cos(around), half_axes[1] * np.sin(around)])
    c, s = np.cos(turned_rad), np.sin(turned_rad)
    x, y = np.array([[c, -s], [s, c]]) @ outline + centre[:, None]
    middle = np.arctan2(centre[1], centre[0])
    angles = middle + (np.arctan2(y, x) - middle + np.pi) % (2.0 * np.pi) - np.pi
    return np.array([angles.min(), angles.max()])


def test_angles_may_be_counted_from_any_turn() -> None:
    discs = random_discs(4, np.random.default_rng(4))
    directing_lines = bearings_of(discs)
    turned = [
        camera._replace(
            first_rad=camera.first_rad + turns * 2.0 * np.pi,
            centre_rad=camera.centre_rad + turns * 2.0 * np.pi,
            last_rad=camera.last_rad + turns * 2.0 * np.pi,
        )
        for camera, turns in zip(directing_lines, (1, -1, -2, 0), strict=True)
    ]
    assert np.allclose(found(crossing()(turned)), found(crossing()(directing_lines)))


def test_the_order_of_the_cameras_changes_only_their_order_in_a_contact() -> None:
    discs = random_discs(5, np.random.default_rng(5))
    directing_lines = bearings_of(discs)
    assert np.allclose(
        found(crossing()(directing_lines)),
        found(crossing()(directing_lines[::-1])),
        atol=1e-6,
    )


def test_the_same_bearings_give_the_same_contacts_bit_for_bit() -> None:
    directing_lines = bearings_of(random_discs(8, np.random.default_rng(6)))
    one = crossing()
    assert one(directing_lines) == one(directing_lines) == crossing()(directing_lines)


def test_a_doubtful_contact_has_less_confidence_than_a_clear_one() -> None:
    """Two cameras and two fingers: the crossings of the other pairing fit almost as well."""
    discs = [(120.0, 180.0, 6.0), (230.0, 182.0, 6.0)]
    doubtful = crossing()(bearings_of(discs, ("C1", "C2")))
    clear = crossing()(bearings_of(discs))
    assert max(c.confidence for c in doubtful) < min(c.confidence for c in clear)


def test_contacts_name_the_edges_that_are_theirs_alone() -> None:
    discs = [(90.0, 150.0, 6.0), (240.3, 260.1, 5.5), (150.2, 330.7, 7.1)]
    seen = bearings_of(discs)
    # one shadow is no interval: those behind it keep the numbers that they had
    seen[0] = seen[0]._replace(last_rad=np.append(seen[0].first_rad[:1], seen[0].last_rad[1:]))
    crossed = make_crossing(CrossingSettings(), SURFACE_MM).cross(seen)
    assert crossed.edges.shape == (3, 4, 2)
    assert crossed.own_edges.tolist() == np.count_nonzero(crossed.edges >= 0, axis=(1, 2)).tolist()
    for contact, edges in zip(crossed.contacts, crossed.edges, strict=True):
        for camera, (first, last) in zip(seen, edges.tolist(), strict=True):
            towards = np.arctan2(contact.y_mm - camera.y_mm, contact.x_mm - camera.x_mm)
            if first >= 0:
                assert 0.0 < wrap_angle(towards - camera.first_rad[first]) < 0.12
            if last >= 0:
                assert 0.0 < wrap_angle(camera.last_rad[last] - towards) < 0.12
