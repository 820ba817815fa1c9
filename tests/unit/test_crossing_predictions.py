"""What a crossing makes of touches that are expected: `Predictions` in, `Crossed` out."""

import numpy as np
import pytest
from oracle.sight import CORNERS, SURFACE_MM, Disc, bearings_of, one_camera, random_discs

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.costs import COST_OF_A_DISC, COST_OF_A_NEW_DISC
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.model import DirectingLines

# Before C1, C2 and C3 stand others; only C4 sees it.
HIDDEN = (120.0, 200.0, 4.5)
BEFORE_IT = [(87.5, 147.5, 9.0), (168.0, 158.0, 9.0), (168.0, 242.0, 9.0)]


def expected(
    discs: list[Disc], sigma_mm: float = 0.3, cost: float = 0.0, radius_sigma_mm: float = 0.4
) -> Predictions:
    count = len(discs)
    return Predictions(
        np.array(discs).reshape(-1, 3),
        np.full(count, sigma_mm**2),
        np.full(count, radius_sigma_mm**2),
        np.full(count, cost),
    )


def cross(seen: list[DirectingLines], predictions: Predictions | None = None) -> Crossed:
    return make_crossing(CrossingSettings(), SURFACE_MM).cross(seen, predictions)


def places(crossed: Crossed) -> dict[int, tuple[float, float]]:
    """Return where each prediction was continued."""
    return {
        int(number): (contact.x_mm, contact.y_mm)
        for number, contact in zip(crossed.predictions, crossed.contacts, strict=True)
    }


def test_a_contact_tells_which_prediction_it_continues() -> None:
    discs = random_discs(5, np.random.default_rng(1))
    moved = [(x + 0.4, y - 0.3, radius) for x, y, radius in discs]
    crossed = cross(bearings_of(discs), expected(moved))
    assert sorted(crossed.predictions) == [0, 1, 2, 3, 4]
    for number, place in places(crossed).items():
        assert place == pytest.approx(discs[number][:2], abs=0.4)


def test_what_was_not_expected_is_found_all_the_same() -> None:
    old, new = (90.0, 150.0, 6.0), (240.0, 260.0, 6.0)
    crossed = cross(bearings_of([old, new]), expected([old]))
    assert sorted(crossed.predictions) == [-1, 0]
    assert places(crossed)[-1] == pytest.approx(new[:2], abs=0.1)


def test_a_touch_behind_others_in_three_cameras_stays_where_it_is() -> None:
    seen = bearings_of([HIDDEN, *BEFORE_IT])
    crossed = cross(seen, expected([HIDDEN, *BEFORE_IT]))
    assert places(crossed).keys() == {0, 1, 2, 3}
    assert places(crossed)[0] == pytest.approx(HIDDEN[:2], abs=0.5)


def test_a_lifted_finger_is_not_believed_in() -> None:
    stays, lifted = (90.0, 150.0, 6.0), (240.0, 260.0, 6.0)
    crossed = cross(bearings_of([stays]), expected([stays, lifted]))
    assert crossed.predictions.tolist() == [0]


def test_a_finger_lifted_from_behind_others_is_not_believed_in() -> None:
    crossed = cross(bearings_of(BEFORE_IT), expected([HIDDEN, *BEFORE_IT]))
    assert sorted(crossed.predictions) == [1, 2, 3]


@pytest.mark.parametrize("blind", range(4))
def test_a_camera_that_loses_its_shadow_does_not_lose_the_touch(blind: int) -> None:
    discs = [(90.0, 150.0, 6.0), (240.0, 260.0, 6.0)]
    seen = bearings_of(discs)
    seen[blind] = one_camera(discs[1:], [*CORNERS][blind])
    crossed = cross(seen, expected(discs))
    assert places(crossed).keys() == {0, 1}
    assert places(crossed)[0] == pytest.approx(discs[0][:2], abs=0.3)


def test_two_cameras_of_three_are_enough_for_a_touch_that_is_expected() -> None:
    discs = [(90.0, 150.0, 6.0), (240.0, 260.0, 6.0)]
    seen = [*bearings_of(discs, ("C1", "C2")), one_camera(discs[1:], "C3")]
    assert places(cross(seen, expected(discs))).keys() == {0, 1}


def test_a_touch_far_from_where_it_should_be_is_another_one() -> None:
    finger = (120.0, 200.0, 6.0)
    elsewhere = (123.0, 200.0, 6.0)
    crossed = cross(bearings_of([finger]), expected([elsewhere], sigma_mm=0.3))
    assert crossed.predictions.tolist() == [-1]


def test_a_quick_finger_is_found_far_from_where_it_should_be_if_that_is_uncertain() -> None:
    finger = (120.0, 200.0, 6.0)
    crossed = cross(bearings_of([finger]), expected([(126.0, 195.0, 6.0)], sigma_mm=5.0))
    assert places(crossed)[0] == pytest.approx(finger[:2], abs=0.1)


def test_support_is_the_same_however_much_a_touch_costs() -> None:
    """What the shadows say for a contact does not depend on what was believed before."""
    finger = (120.0, 200.0, 6.0)
    (new,) = cross(bearings_of([finger]), expected([])).supports
    for cost in (0.0, 3.0, 6.0):
        (old,) = cross(bearings_of([finger]), expected([finger], cost=cost)).supports
        assert old == pytest.approx(new, abs=0.1)
    assert new > 30.0


def test_a_hidden_touch_has_little_support() -> None:
    crossed = cross(bearings_of([HIDDEN, *BEFORE_IT]), expected([HIDDEN, *BEFORE_IT], sigma_mm=0.2))
    support = dict(zip(crossed.predictions.tolist(), crossed.supports, strict=True))
    assert support[0] < min(support[1], support[2], support[3])


def test_something_new_is_dearer_where_touches_are_followed() -> None:
    seen = bearings_of([(120.0, 200.0, 6.0)])
    (alone,), (followed,) = cross(seen).contacts, cross(seen, expected([])).contacts
    assert (alone.x_mm, alone.y_mm) == (followed.x_mm, followed.y_mm)
    assert COST_OF_A_NEW_DISC > COST_OF_A_DISC
    assert followed.confidence < alone.confidence


def test_one_touch_is_not_continued_twice() -> None:
    finger = (120.0, 200.0, 6.0)
    crossed = cross(bearings_of([finger]), expected([finger, (121.0, 200.5, 6.0)]))
    assert len(crossed.contacts) == 1
    assert crossed.predictions[0] in {0, 1}


def test_a_thin_pen_is_followed() -> None:
    pen, finger = (120.0, 200.0, 2.0), (250.0, 90.0, 6.0)
    method = make_crossing(CrossingSettings(smallest_radius_mm=1.5), SURFACE_MM)
    crossed = method.cross(bearings_of([pen, finger]), expected([pen, finger]))
    assert sorted(crossed.predictions) == [0, 1]


@pytest.mark.parametrize("seed", range(6))
def test_a_finger_that_lands_among_many_that_are_sure_is_found_at_once(seed: int) -> None:
    discs = random_discs(9, np.random.default_rng(seed), apart_mm=30.0)
    seen = bearings_of(discs)
    crossed = cross(seen, expected(discs[1:]))
    assert sorted(crossed.predictions) == [-1, *range(8)]
    (new,) = (
        contact
        for contact, number in zip(crossed.contacts, crossed.predictions, strict=True)
        if number < 0
    )
    assert np.hypot(new.x_mm - discs[0][0], new.y_mm - discs[0][1]) < 0.5


def test_a_finger_that_lands_right_beside_one_that_is_sure_is_found_at_once() -> None:
    discs = [(150.0, 180.0, 5.0), (162.0, 180.0, 5.0), (260.0, 300.0, 6.0)]
    crossed = cross(bearings_of(discs), expected([discs[0], discs[2]]))
    assert sorted(crossed.predictions) == [-1, 0, 1]
