"""The place where a finger touches comes out of its outlines, as exactly as is said."""

from dataclasses import replace

import numpy as np
import pytest
from grazed import (
    ALL_EDGES,
    CAMERA_MM,
    WIDTH_PX,
    CornerSight,
    Finger,
    corner_sight,
    outlines_of,
    own,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.fusion.touch_point import TouchPointFinder, TouchPoints
from cornertouchd.fusion.touch_table import CAPSULE, SECTION, SHAPE_FREE
from cornertouchd.model import Outlines

SIGHTS = [corner_sight(number) for number in range(4)]
FINDER = TouchPointFinder(SIGHTS)
SECTION_SIGMA = np.array([0.2])
LEANING = Finger(140.0, 170.0, 6.0, np.deg2rad(35.0), 2.0)


def found(
    finger: Finger,
    edges: tuple[tuple[int, int], ...] = ALL_EDGES,
    rng: np.random.Generator | None = None,
    sights: list[CornerSight] = SIGHTS,
) -> TouchPoints:
    seen = [outlines_of(sight, finger, rng) for sight in sights]
    finder = FINDER if sights is SIGHTS else TouchPointFinder(sights)
    return finder.find(np.array([finger.section()]), SECTION_SIGMA, own(edges), seen)


def error_mm(points: TouchPoints, finger: Finger) -> float:
    return float(np.hypot(points.x_mm[0] - finger.x_mm, points.y_mm[0] - finger.y_mm))


def sigmas_off(points: TouchPoints, finger: Finger) -> float:
    xx, xy, yy = points.covariances_mm2[0]
    off = np.array([points.x_mm[0] - finger.x_mm, points.y_mm[0] - finger.y_mm])
    return float(np.sqrt(off @ np.linalg.solve([[xx, xy], [xy, yy]], off)))


def fingers() -> st.SearchStrategy[Finger]:
    return st.builds(
        Finger,
        st.floats(25.0, 325.0),
        st.floats(25.0, 375.0),
        st.floats(4.5, 7.5),
        st.floats(0.0, np.deg2rad(50.0)),
        st.floats(-np.pi, np.pi),
        st.floats(0.3, 0.9),
        st.floats(0.01, 0.05),
    )


@settings(max_examples=60)
@given(fingers(), st.integers(0, 10**6), st.lists(st.sampled_from(ALL_EDGES), max_size=4))
def test_touch_and_lean_are_found_as_exactly_as_is_said(
    finger: Finger, seed: int, lost: list[tuple[int, int]]
) -> None:
    edges = tuple(edge for edge in ALL_EDGES if edge not in lost)
    points = found(finger, edges, np.random.default_rng(seed))
    assert sigmas_off(points, finger) < 4.5
    assert abs(points.lean_rad[0] - finger.lean_rad) < 4.0 * points.lean_sigma_rad[0] + 0.01


@settings(max_examples=40)
@given(fingers(), st.integers(0, 10**6))
def test_a_finger_that_all_cameras_see_is_found_to_a_quarter_of_a_millimetre(
    finger: Finger, seed: int
) -> None:
    points = found(finger, rng=np.random.default_rng(seed))
    assert points.methods[0] == CAPSULE
    assert error_mm(points, finger) < 0.25
    assert abs(points.lean_rad[0] - finger.lean_rad) < np.deg2rad(4.0)
    assert points.radii_mm[0] == pytest.approx(finger.radius_mm, abs=0.2)


def test_the_azimuth_is_where_the_finger_leans_to() -> None:
    points = found(LEANING)
    assert points.lean_rad[0] == pytest.approx(LEANING.lean_rad, abs=0.01)
    assert points.azimuth_rad[0] == pytest.approx(LEANING.azimuth_rad, abs=0.02)
    assert points.azimuth_sigma_rad[0] < 0.3
    upright = found(replace(LEANING, lean_rad=0.0), rng=np.random.default_rng(1))
    assert upright.azimuth_sigma_rad[0] > 0.3


def test_two_cameras_that_see_both_edges_are_enough() -> None:
    points = found(LEANING, ((0, 0), (0, 1), (1, 0), (1, 1)))
    assert error_mm(points, LEANING) < 0.2


@pytest.mark.parametrize(
    "edges",
    [(), ((0, 0), (0, 1)), ((0, 0), (1, 1)), ((2, 0), (2, 1))],
    ids=["none", "one camera", "two edges", "another camera"],
)
def test_too_few_edges_leave_the_section_with_the_sigma_of_an_unknown_lean(
    edges: tuple[tuple[int, int], ...],
) -> None:
    points = found(LEANING, edges)
    assert points.methods[0] == SECTION
    assert (points.x_mm[0], points.y_mm[0]) == LEANING.section()[:2]
    assert points.covariances_mm2[0, 0] > SECTION_SIGMA[0] ** 2 + (0.1 * CAMERA_MM) ** 2
    assert points.lean_sigma_rad[0] > 0.4


def test_fewer_edges_are_never_said_to_tell_more() -> None:
    sigmas = []
    for lost in range(6):
        points = found(LEANING, ALL_EDGES[lost:])
        sigmas.append(points.covariances_mm2[0, 0] + points.covariances_mm2[0, 2])
    assert sigmas[0] < sigmas[3] < sigmas[5]


def test_an_edge_of_another_finger_is_left_out() -> None:
    seen = [outlines_of(sight, LEANING) for sight in SIGHTS]
    other = outlines_of(SIGHTS[1], replace(LEANING, x_mm=144.0, y_mm=172.0))
    columns_px = seen[1].columns_px.copy()
    columns_px[0, 1] = other.columns_px[0, 1]
    seen[1] = replace(seen[1], columns_px=columns_px)
    points = FINDER.find(np.array([LEANING.section()]), SECTION_SIGMA, own(ALL_EDGES), seen)
    assert error_mm(points, LEANING) < 0.15


@pytest.mark.parametrize("radius_mm", [2.0, 4.0, 8.0])
def test_pens_and_discs_are_no_capsules_and_found_all_the_same(radius_mm: float) -> None:
    rod = Finger(200.0, 120.0, radius_mm, round_tip=False)
    points = found(rod, rng=np.random.default_rng(3))
    assert points.methods[0] != CAPSULE
    assert error_mm(points, rod) < 0.2


def test_a_finger_in_the_air_is_no_capsule() -> None:
    assert found(replace(LEANING, pressed_mm=-2.5)).methods[0] != CAPSULE


@pytest.mark.parametrize("changes", [{"upside_down": True}, {"shear": 0.03, "slant": -0.03}])
def test_cameras_may_hang_upside_down_or_roll(changes: dict[str, float]) -> None:
    points = found(LEANING, sights=[corner_sight(number, **changes) for number in range(4)])
    assert points.methods[0] == CAPSULE
    assert error_mm(points, LEANING) < 0.01
    assert points.lean_rad[0] == pytest.approx(LEANING.lean_rad, abs=0.01)


def test_cameras_may_differ_in_rows_and_one_may_be_missing() -> None:
    seen: list[Outlines | None] = [outlines_of(sight, LEANING) for sight in SIGHTS]
    direct = outlines_of(SIGHTS[0], LEANING)
    seen[0] = replace(
        direct, columns_px=direct.columns_px[..., :7], rows_px=direct.rows_px[..., :7]
    )
    seen[3] = None
    points = FINDER.find(np.array([LEANING.section()]), SECTION_SIGMA, own(ALL_EDGES), seen)
    assert error_mm(points, LEANING) < 0.1


def test_a_matt_screen_shows_the_touch_too() -> None:
    seen = [outlines_of(sight, LEANING) for sight in SIGHTS]
    direct = [
        replace(one, columns_px=one.columns_px[..., :7], rows_px=one.rows_px[..., :7])
        for one in seen
    ]
    points = FINDER.find(np.array([LEANING.section()]), SECTION_SIGMA, own(ALL_EDGES), direct)
    assert error_mm(points, LEANING) < 0.3


def test_contacts_do_not_disturb_each_other() -> None:
    other = Finger(80.0, 300.0, 5.0, 0.5, -1.0)
    seen = []
    for sight in SIGHTS:
        two = [outlines_of(sight, finger) for finger in (LEANING, other)]
        seen.append(
            replace(
                two[0],
                columns_px=np.concatenate([one.columns_px for one in two]),
                rows_px=np.concatenate([one.rows_px for one in two]),
            )
        )
    owned = np.concatenate([own(ALL_EDGES), own(ALL_EDGES) + 1])
    discs = np.array([LEANING.section(), other.section()])
    both = FINDER.find(discs, np.full(2, 0.2), owned, seen)
    alone = found(LEANING)
    assert both.x_mm[0] == alone.x_mm[0]
    assert np.hypot(both.x_mm[1] - other.x_mm, both.y_mm[1] - other.y_mm) < 0.05


@settings(max_examples=80)
@given(st.integers(0, 10**6))
def test_garbage_gives_the_section_or_numbers(seed: int) -> None:
    rng = np.random.default_rng(seed)
    seen: list[Outlines | None] = []
    for _ in SIGHTS:
        shape = (int(rng.integers(0, 3)), 2, int(rng.integers(0, 15)))
        columns = rng.choice([np.nan, np.inf, -1e9, 0.0, 640.0, 320.0, rng.uniform(0, 640)], shape)
        rows = rng.choice([np.nan, -np.inf, 1e300, 22.0, rng.uniform(0, 64)], shape)
        seen.append(
            Outlines(
                columns,
                rows,
                rng.choice([np.nan, np.inf, 0.5], (5, 4)).astype(np.float32),
                rng.integers(-1, 9, WIDTH_PX).astype(np.int32),
                rng.integers(-5, 50, WIDTH_PX).astype(np.int32),
            )
        )
    discs = np.array([(140.0, 170.0, 6.0), (-4.0, -4.0, 0.0), (1e6, -1e6, 1e3)])
    owned = rng.integers(-1, 5, (3, 4, 2))
    points = FINDER.find(discs, np.array([0.2, 0.0, 1e3]), owned, seen)
    for values in (points.x_mm, points.y_mm, points.lean_rad, points.azimuth_sigma_rad):
        assert np.isfinite(values).all()
    assert (points.covariances_mm2[:, (0, 2)] > 0.0).all()
    assert np.isfinite(points.covariances_mm2).all()


def test_a_camera_that_knows_no_angles_tells_nothing() -> None:
    blind = replace(SIGHTS[2], angles_rad=np.full(WIDTH_PX + 1, np.nan))
    dark = replace(SIGHTS[3], visible=np.zeros(WIDTH_PX, np.bool_))
    seen = [outlines_of(sight, LEANING) for sight in SIGHTS]
    finder = TouchPointFinder([SIGHTS[0], SIGHTS[1], blind, dark])
    points = finder.find(np.array([LEANING.section()]), SECTION_SIGMA, own(ALL_EDGES), seen)
    without = found(LEANING, ALL_EDGES[:4])
    assert points.x_mm[0] == without.x_mm[0]
    assert points.covariances_mm2[0, 0] == without.covariances_mm2[0, 0]


def test_nothing_touches() -> None:
    points = FINDER.find(np.empty((0, 3)), np.empty(0), np.empty((0, 4, 2), np.intp), [None] * 4)
    assert len(points.x_mm) == 0


def test_outlines_of_another_width_are_refused() -> None:
    seen = [outlines_of(sight, LEANING) for sight in SIGHTS]
    seen[1] = replace(seen[1], light_at=np.zeros(320, np.int32))
    with pytest.raises(ValueError, match="320 columns; its table has 640"):
        FINDER.find(np.array([LEANING.section()]), SECTION_SIGMA, own(ALL_EDGES), seen)


@pytest.mark.parametrize("seed", range(4))
def test_three_edges_find_a_finger(seed: int) -> None:
    edges = ((0, 0), (0, 1), (1, 0))
    points = found(LEANING, edges, np.random.default_rng(seed))
    assert points.methods[0] == CAPSULE
    assert error_mm(points, LEANING) < 0.4
    assert points.covariances_mm2[0, 0] > 3.0 * found(LEANING).covariances_mm2[0, 0]


def test_three_edges_find_a_rod() -> None:
    rod = Finger(200.0, 120.0, 4.0, round_tip=False)
    points = found(rod, ((0, 0), (0, 1), (1, 0)), np.random.default_rng(5))
    assert points.methods[0] in {SECTION, SHAPE_FREE}
    assert sigmas_off(points, rod) < 4.0


@pytest.mark.parametrize("edges", [ALL_EDGES[:3], ALL_EDGES[:4], ALL_EDGES[1:6]])
def test_rows_in_which_another_finger_stands_out_are_left_out(
    edges: tuple[tuple[int, int], ...],
) -> None:
    seen = [outlines_of(sight, LEANING) for sight in SIGHTS]
    columns_px = seen[0].columns_px.copy()
    columns_px[0, 1, 4:9] += np.array([1.0, 3.0, 5.0, 4.0, 2.0])
    seen[0] = replace(seen[0], columns_px=columns_px)
    points = FINDER.find(np.array([LEANING.section()]), SECTION_SIGMA, own(edges), seen)
    assert points.methods[0] == CAPSULE
    assert error_mm(points, LEANING) < 0.15


def test_palms_keep_their_section() -> None:
    palm = Finger(200.0, 120.0, 22.0, round_tip=False)
    assert found(palm).methods[0] == SECTION


def test_an_edge_that_two_fingers_share_tells_less() -> None:
    hidden, other = Finger(140.0, 170.0), Finger(183.2, 222.2, 7.8)
    edges = ((0, 0), (1, 0), (1, 1))
    sections = np.array([hidden.section(), other.section()])
    seen = []
    for sight in SIGHTS:
        first, second = outlines_of(sight, hidden), outlines_of(sight, other)
        seen.append(
            replace(
                first,
                columns_px=np.concatenate([first.columns_px, second.columns_px]),
                rows_px=np.concatenate([first.rows_px, second.rows_px]),
            )
        )
    owned = np.concatenate([own(edges), np.where(own(ALL_EDGES) == 0, 1, -1)])
    alone = FINDER.find(sections[:1], SECTION_SIGMA, owned[:1], seen)
    points = FINDER.find(sections, np.array([0.2, 0.2]), owned, seen)
    assert points.covariances_mm2[0, 0] > 1.1 * alone.covariances_mm2[0, 0]
    assert sigmas_off(points, hidden) < 3.0
