"""The compiled crossing finds what the readable one of numpy finds, to the last micrometre."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle.crossing import OracleCrossing
from oracle.sight import (
    CORNERS,
    HALF_VIEW_RAD,
    NARROW_HALF_VIEW_RAD,
    SIDES,
    SURFACE_MM,
    bearings_of,
    random_discs,
    shadows,
)

from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.edge_crossing import EdgeCrossing
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.model import DirectingLines

PENS_TOO = DiscLimits(SURFACE_MM, 1.5, 35.0, 0.4)
FINGERS_ONLY = DiscLimits(SURFACE_MM, 3.3, 35.0, 0.4)


@st.composite
def scenes(draw: st.DrawFn) -> tuple[list[DirectingLines], np.random.Generator]:
    """Fingers and pens before two to eight cameras, some of whose shadows are damaged.

    Some cameras see but a part of the surface, and some of them another part than they say.

    All numbers are drawn by a generator, so that no two explanations cost just the same.
    """
    rng = np.random.default_rng(draw(st.integers(0, 10**9)))
    cameras = draw(st.lists(st.sampled_from([*CORNERS, *SIDES]), min_size=2, unique=True))
    discs = [
        (x, y, float(rng.uniform(1.4, 9.0)) if rng.random() < 0.4 else radius)
        for x, y, radius in random_discs(draw(st.integers(0, 9)), rng, apart_mm=12.0)
    ]
    narrow = draw(st.lists(st.sampled_from(cameras), max_size=4, unique=True))
    half_views_rad = HALF_VIEW_RAD | dict.fromkeys(narrow, NARROW_HALF_VIEW_RAD)
    seen = bearings_of(discs, cameras, rng if draw(st.booleans()) else None, half_views_rad)
    for number in draw(st.lists(st.integers(0, len(cameras) - 1), max_size=1)):
        first = rng.uniform(-4.0, 4.0)
        seen[number] = seen[number]._replace(view_rad=(first, first + rng.uniform(0.0, 6.5)))
    for number in draw(st.lists(st.integers(0, len(cameras) - 1), max_size=3)):
        damage = draw(st.sampled_from(["lost", "covered", "not a number", "no width"]))
        seen[number] = damaged(seen[number], damage, rng)
    return seen, rng


def damaged(camera: DirectingLines, damage: str, rng: np.random.Generator) -> DirectingLines:
    count = len(camera.first_rad)
    if count == 0:
        return camera
    one = rng.integers(count)
    first_valid, last_rad = camera.first_valid.copy(), camera.last_rad.copy()
    if damage == "lost":
        return shadows(camera, [shadow for shadow in range(count) if shadow != one])
    if damage == "covered":
        first_valid[one] = False
    else:
        last_rad[one] = np.nan if damage == "not a number" else camera.first_rad[one]
    return camera._replace(first_valid=first_valid, last_rad=last_rad)


def predictions_near(crossed: Crossed, rng: np.random.Generator) -> Predictions:
    """Expect most contacts near where they are, and one where there may be none."""
    discs = np.array(
        [(c.x_mm, c.y_mm, c.diameter_mm / 2.0) for c in crossed.contacts if rng.random() < 0.8]
        + [(*rng.uniform((0.0, 0.0), SURFACE_MM), 6.0)]
    )
    discs += rng.normal(0.0, 0.3, discs.shape)
    return Predictions(
        discs,
        rng.uniform(0.05, 9.0, len(discs)),
        rng.uniform(0.05, 0.3, len(discs)),
        rng.uniform(0.0, 6.0, len(discs)),
    )


def assert_same(
    seen: list[DirectingLines], limits: DiscLimits, predictions: Predictions | None = None
) -> Crossed:
    compiled = EdgeCrossing(limits, 0.1).cross(seen, predictions)
    readable = OracleCrossing(limits, 0.1).cross(seen, predictions)
    assert table(compiled) == pytest.approx(table(readable), abs=1e-6)
    assert cameras(compiled) == cameras(readable)
    return readable


def table(crossed: Crossed) -> np.ndarray:
    rows = [
        (c.x_mm, c.y_mm, c.diameter_mm, c.sigma_mm, c.confidence, support, own_edges, prediction)
        for c, support, own_edges, prediction in zip(
            crossed.contacts,
            crossed.supports,
            crossed.own_edges,
            crossed.predictions,
            strict=True,
        )
    ]
    return np.array(sorted(rows)).reshape(-1, 8)


def cameras(crossed: Crossed) -> list[tuple[str, ...]]:
    return [c.cameras for c in sorted(crossed.contacts, key=lambda c: (c.x_mm, c.y_mm))]


@settings(max_examples=40)
@given(scenes(), st.sampled_from([PENS_TOO, FINGERS_ONLY]))
def test_they_agree_whatever_is_seen(
    scene: tuple[list[DirectingLines], np.random.Generator], limits: DiscLimits
) -> None:
    seen, rng = scene
    found = assert_same(seen, limits)
    assert_same(seen, limits, predictions_near(found, rng))


@pytest.mark.parametrize("count", [12, 20])
def test_they_agree_about_crowds(count: int) -> None:
    rng = np.random.default_rng(count)
    for _ in range(4):
        seen = bearings_of(random_discs(count, rng, apart_mm=16.0), rng=rng)
        assert_same(seen, FINGERS_ONLY)


@pytest.mark.parametrize("count", [6, 12, 20])
def test_they_agree_about_what_is_new_among_touches_that_are_sure(count: int) -> None:
    rng = np.random.default_rng(count)
    for new in range(4):
        discs = random_discs(count, rng, apart_mm=16.0)
        known = np.array(discs[new:])
        known[:, :2] += rng.normal(0.0, 0.2, (len(known), 2))
        spread, costs = np.full(len(known), 0.1), rng.uniform(0.0, 0.5, len(known))
        seen = bearings_of(discs, rng=rng)
        assert_same(seen, FINGERS_ONLY, Predictions(known, spread, spread, costs))


@pytest.mark.parametrize("count", [3, 8])
def test_they_agree_about_cameras_that_see_a_part_of_the_surface(count: int) -> None:
    rng = np.random.default_rng(count)
    narrow = dict.fromkeys(HALF_VIEW_RAD, NARROW_HALF_VIEW_RAD)
    for _ in range(4):
        discs = random_discs(count, rng, apart_mm=16.0)
        seen = bearings_of(discs, list(HALF_VIEW_RAD), rng, narrow)
        found = assert_same(seen, FINGERS_ONLY)
        assert_same(seen, FINGERS_ONLY, predictions_near(found, rng))


def test_they_agree_about_a_camera_that_misses_a_shadow() -> None:
    discs = [(90.0, 150.0, 6.0), (240.3, 260.1, 5.5), (150.2, 330.7, 7.1)]
    for camera in range(4):
        seen = bearings_of(discs)
        seen[camera] = shadows(seen[camera], [0, 2])
        assert len(assert_same(seen, PENS_TOO).contacts) == 3


def test_they_agree_that_nothing_is_seen() -> None:
    assert not assert_same([], PENS_TOO).contacts
    assert not assert_same(bearings_of([]), PENS_TOO).contacts
    one = bearings_of([(90.0, 150.0, 6.0)], ("C2",))
    assert not assert_same(one, PENS_TOO).contacts


def test_predictions_that_are_no_numbers_are_left_out() -> None:
    seen = bearings_of([(90.0, 150.0, 6.0)])
    discs = np.array([(np.nan, 150.0, 6.0), (90.0, 150.0, 6.0), (90.0, 150.0, 6.0)])
    predictions = Predictions(discs, np.array([1.0, 0.0, np.inf]), np.full(3, 0.1), np.zeros(3))
    found = assert_same(seen, PENS_TOO, predictions)
    assert found.predictions.tolist() == [-1]
