"""Cameras that see but a part of the surface: elsewhere they tell neither dark nor light."""

from math import atanh

import numpy as np
import pytest
from oracle.sight import (
    HALF_VIEW_RAD,
    NARROW_HALF_VIEW_RAD,
    SIDES,
    SURFACE_MM,
    Disc,
    bearings_of,
    random_discs,
    shadows,
)

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.explanation import MARGIN_SCALE
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.line_table import tabulate
from cornertouchd.model import SEES_EVERYTHING, DirectingLines, Shadow, Shadows

NARROW_SIDES = HALF_VIEW_RAD | dict.fromkeys(SIDES, NARROW_HALF_VIEW_RAD)
# C5 and C7 do not look there; at the others they do.
HIGH_UP: Disc = (60.0, 40.0, 6.0)
DISCS = [HIGH_UP, (150.0, 250.0, 6.0), (290.0, 300.0, 5.0)]


def cross(seen: list[DirectingLines], predictions: Predictions | None = None) -> Crossed:
    return make_crossing(CrossingSettings(), SURFACE_MM).cross(seen, predictions)


def places(crossed: Crossed) -> list[tuple[float, float]]:
    return sorted((contact.x_mm, contact.y_mm) for contact in crossed.contacts)


def expected(discs: list[Disc]) -> Predictions:
    count = len(discs)
    return Predictions(
        np.array(discs), np.full(count, 0.1), np.full(count, 0.1), np.full(count, 0.0)
    )


def seen_by(*cameras: str) -> list[DirectingLines]:
    return bearings_of(DISCS, cameras, half_views_rad=NARROW_SIDES)


def seeing_everything(seen: list[DirectingLines]) -> list[DirectingLines]:
    return [camera._replace(view_rad=SEES_EVERYTHING) for camera in seen]


def without_high_up(camera: DirectingLines) -> DirectingLines:
    bearing = np.arctan2(HIGH_UP[1] - camera.y_mm, HIGH_UP[0] - camera.x_mm)
    away = np.abs((camera.centre_rad - bearing + np.pi) % (2.0 * np.pi) - np.pi)
    return shadows(camera, [i for i in range(len(away)) if i != np.argmin(away)])


def margin_of_high_up(seen: list[DirectingLines]) -> float:
    crossed = cross(seen, expected(DISCS))
    contact = crossed.contacts[crossed.predictions.tolist().index(0)]
    return MARGIN_SCALE * atanh(contact.confidence)


@pytest.mark.parametrize("count", [5, 6, 8])
def test_three_fingers_are_found_whichever_cameras_do_not_look_there(count: int) -> None:
    cameras, rng = list(NARROW_SIDES)[:count], np.random.default_rng(count)
    for _ in range(40):
        discs = random_discs(3, rng, apart_mm=30.0)
        found = places(cross(bearings_of(discs, cameras, rng, NARROW_SIDES)))
        assert len(found) == 3
        assert np.array(found) == pytest.approx(np.array(sorted(discs))[:, :2], abs=1.0)


def test_no_camera_need_see_the_whole_surface() -> None:
    narrow = dict.fromkeys(HALF_VIEW_RAD, NARROW_HALF_VIEW_RAD)
    rng = np.random.default_rng(3)
    for _ in range(20):
        discs = [(x, y, 6.0) for x, y in rng.uniform((60, 60), (290, 340), (1, 2))]
        found = places(cross(bearings_of(discs, list(narrow), rng, narrow)))
        assert len(found) == 1
        assert found[0] == pytest.approx(discs[0][:2], abs=1.0)


def test_a_camera_that_sees_everything_shows_light_where_it_shows_no_shadow() -> None:
    seen = seen_by("C1", "C2", "C3", "C5", "C7")
    assert len(cross(seen).contacts) == 3
    assert len(cross(seeing_everything(seen)).contacts) == 2


def test_views_of_more_than_half_a_turn_end_as_well() -> None:
    left, right = (60.0, 200.0, 6.0), (280.0, 200.0, 6.0)
    corners = bearings_of([left, right], ("C1", "C2", "C3"))
    # cameras amid two sides, turned to the left, which see the light at the right finger or not
    for views_deg, found in (
        ({"C5": (80.0, 280.0), "C6": (80.0, 280.0)}, [left, right]),
        ({"C5": (40.0, 260.0), "C6": (100.0, 320.0)}, [left]),
    ):
        amid = [
            one._replace(view_rad=tuple(np.deg2rad(views_deg[one.camera]).tolist()))
            for one in bearings_of([left], ("C5", "C6"))
        ]
        places_mm = places(cross([*corners, *amid]))
        assert places_mm == [pytest.approx(disc[:2], abs=0.5) for disc in found]


def test_a_camera_that_does_not_look_at_a_touch_does_not_miss_it() -> None:
    looking = seen_by("C1", "C2", "C3", "C4")
    all_of_them = [*looking, *seen_by("C5", "C7")]
    assert margin_of_high_up(all_of_them) == pytest.approx(margin_of_high_up(looking), abs=0.1)
    assert margin_of_high_up(seeing_everything(all_of_them)) < margin_of_high_up(looking) - 10.0


def test_a_touch_that_one_camera_shows_is_not_continued() -> None:
    assert 0 in cross(seen_by("C1", "C2", "C5", "C7"), expected(DISCS)).predictions
    assert 0 not in cross(seen_by("C1", "C5", "C7"), expected(DISCS)).predictions


def test_one_of_four_cameras_that_look_may_be_wrong_but_not_one_of_three() -> None:
    """However many look elsewhere: without the third one, any two shadows cross."""
    c1, c2, c3, *others = seen_by("C1", "C2", "C3", "C5", "C7")
    three = [c1, c2, without_high_up(c3), *others]
    assert len(cross(three).contacts) == 2
    assert len(cross([*three, *seen_by("C4")]).contacts) == 3


@pytest.mark.parametrize("turn", [0.9, -0.9])
def test_a_camera_tells_its_view_even_upside_down(turn: float) -> None:
    table = tabulate("C1", AnglePolynomial((0.0, 0.0), (0.8, turn), 640), 640)
    lines = table.lay(Shadows.of([Shadow(100, 110, True, True, 1.0)]), 0.1)
    assert lines.view_rad == pytest.approx((0.8 - 0.9, 0.8 + 0.9))
    for angle, is_seen in ((-0.11, False), (-0.09, True), (1.69, True), (1.71, False)):
        assert table.sees(100.0 * np.cos(angle), 100.0 * np.sin(angle)) == is_seen
