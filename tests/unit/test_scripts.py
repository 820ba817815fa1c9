"""Scripts: what simulated fingers do is smooth, in bounds and the same every time."""

from itertools import pairwise
from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.simulation.scripts import (
    Script,
    crossing_paths,
    demo_script,
    drag,
    pinch,
    scribble,
    taps,
    together,
    two_hands,
)

SMALL_MM = (350.0, 400.0)
LARGE_MM = (2400.0, 1350.0)
STEP_S = 0.01

surfaces = st.tuples(st.floats(300.0, 3000.0), st.floats(300.0, 3000.0))
seeds = st.integers(0, 10_000)
times_s = st.floats(0.0, 100_000.0)


def places(script: Script, t_s: float) -> dict[int, tuple[float, float]]:
    timed = script(t_s)
    found = {each.key: (each.finger.x_mm, each.finger.y_mm) for each in timed}
    assert len(found) == len(timed), "two fingers share a key"
    return found


def fastest_mm_s(script: Script, from_s: float, steps: int) -> float:
    """The highest speed of any finger between two steps at both of which it is down."""
    instants = [places(script, from_s + step * STEP_S) for step in range(steps + 1)]
    return max(
        (
            hypot(after[key][0] - before[key][0], after[key][1] - before[key][1]) / STEP_S
            for before, after in pairwise(instants)
            for key in before.keys() & after.keys()
        ),
        default=0.0,
    )


def nearest_mm(script: Script, t_s: float) -> float:
    found = list(places(script, t_s).values())
    return min(
        (
            hypot(a[0] - b[0], a[1] - b[1])
            for number, a in enumerate(found)
            for b in found[number + 1 :]
        ),
        default=np.inf,
    )


@given(surfaces, st.integers(0, 20), seeds, times_s)
@settings(max_examples=60, deadline=None)
def test_fingers_of_the_show_stay_inside_and_apart(
    surface_mm: tuple[float, float], touches: int, seed: int, t_s: float
) -> None:
    script = demo_script(surface_mm, touches, seed)
    found = places(script, t_s)
    assert len(found) <= touches
    for x_mm, y_mm in found.values():
        assert 15.0 - 1e-6 <= x_mm <= surface_mm[0] - 15.0 + 1e-6
        assert 15.0 - 1e-6 <= y_mm <= surface_mm[1] - 15.0 + 1e-6
    assert nearest_mm(script, t_s) >= 30.0 - 1e-6


@given(surfaces, st.integers(1, 20), seeds, times_s)
@settings(max_examples=30, deadline=None)
def test_fingers_of_the_show_move_continuously(
    surface_mm: tuple[float, float], touches: int, seed: int, t_s: float
) -> None:
    assert fastest_mm_s(demo_script(surface_mm, touches, seed), t_s, 20) <= 400.5


def test_the_show_goes_on_moving_and_now_and_then_lifts_and_lands() -> None:
    script = demo_script(SMALL_MM, 5, seed=3)
    instants = [places(script, 0.1 * step) for step in range(600)]
    counts = [len(found) for found in instants]
    assert max(counts) == 5
    assert min(counts) < 5
    assert np.mean(counts) > 4.0
    assert 15 <= len(set().union(*instants)) <= 120, "a lifted finger lands as a new touch"
    assert fastest_mm_s(script, 10.0, 500) > 150.0


def test_a_finger_of_the_show_that_lifted_never_comes_back_under_its_old_key() -> None:
    script = demo_script(SMALL_MM, 4, seed=5)
    down: dict[int, list[int]] = {}
    for step in range(1200):
        for key in places(script, 0.05 * step):
            down.setdefault(key, []).append(step)
    for steps in down.values():
        assert steps == list(range(steps[0], steps[-1] + 1))


def test_the_show_depends_on_nothing_but_time_and_seed() -> None:
    one, same, other = (demo_script(LARGE_MM, 8, seed) for seed in (1, 1, 2))
    later = one(77.7)
    assert one(3.3) == same(3.3)
    assert one(77.7) == later
    assert one(3.3) != other(3.3)


@pytest.mark.parametrize("touches", [-1, 21])
def test_the_show_refuses_a_number_of_touches_that_it_cannot_show(touches: int) -> None:
    with pytest.raises(ValueError, match=f"touches is {touches}; give 0 to 20"):
        demo_script(SMALL_MM, touches)


def test_too_many_fingers_for_a_tiny_surface_stand_still_rather_than_fail() -> None:
    script = demo_script((100.0, 100.0), 20)
    assert fastest_mm_s(script, 1.0, 20) == 0.0
    assert all(0.0 < x < 100.0 and 0.0 < y < 100.0 for x, y in places(script, 1.0).values())


def test_taps_touch_place_after_place_with_pauses_between() -> None:
    script = taps([(10.0, 20.0), (30.0, 40.0)], hold_s=0.3, pause_s=0.2)
    assert places(script, -0.1) == {}
    assert places(script, 0.0) == places(script, 0.29) == {0: (10.0, 20.0)}
    assert places(script, 0.4) == {}
    assert places(script, 0.6) == {1: (30.0, 40.0)}
    assert places(script, 1.1) == {}


def test_a_drag_goes_straight_at_its_speed_and_lifts_at_the_end() -> None:
    script = drag((20.0, 20.0), (20.0, 120.0), speed_mm_s=100.0, lands_at_s=2.0)
    assert places(script, 1.99) == {}
    assert places(script, 2.0)[0] == (20.0, 20.0)
    assert places(script, 2.5)[0] == pytest.approx((20.0, 70.0))
    assert places(script, 3.01) == {}


@settings(deadline=None)
@given(
    first_gap_mm=st.floats(0.0, 500.0),
    last_gap_mm=st.floats(0.0, 500.0),
    angle_rad=st.floats(-pi, pi),
    share=st.floats(0.0, 1.0),
)
def test_a_pinch_keeps_its_middle_and_its_direction(
    first_gap_mm: float, last_gap_mm: float, angle_rad: float, share: float
) -> None:
    script = pinch((100.0, 90.0), first_gap_mm, last_gap_mm, 2.0, angle_rad)
    found = places(script, 2.0 * share)
    middle = np.mean([found[0], found[1]], axis=0)
    across = np.subtract(found[1], found[0])
    gap_mm = float(np.hypot(*across))
    low_mm, high_mm = sorted((first_gap_mm, last_gap_mm))
    assert middle == pytest.approx((100.0, 90.0))
    assert low_mm - 1e-6 <= gap_mm <= high_mm + 1e-6
    assert across == pytest.approx((gap_mm * cos(angle_rad), gap_mm * sin(angle_rad)), abs=1e-6)


def test_a_pinch_starts_and_ends_at_its_gaps_and_keeps_its_speed() -> None:
    script = pinch((100.0, 90.0), 20.0, 220.0, duration_s=1.0)
    assert nearest_mm(script, 0.0) == pytest.approx(20.0)
    assert nearest_mm(script, 1.0) == pytest.approx(220.0)
    assert places(script, 1.01) == {}
    assert fastest_mm_s(script, 0.0, 100) <= 150.0 + 1e-6


@given(surfaces, st.floats(5.0, 60.0), st.floats(50.0, 800.0))
@settings(max_examples=20, deadline=None)
def test_crossing_paths_come_as_near_as_they_say_and_no_nearer(
    surface_mm: tuple[float, float], miss_mm: float, speed_mm_s: float
) -> None:
    script = crossing_paths(surface_mm, miss_mm, speed_mm_s)
    whole_s = (hypot(*surface_mm) + miss_mm) / speed_mm_s
    gaps_mm = [nearest_mm(script, t_s) for t_s in np.linspace(0.0, whole_s, 800)]
    assert min(gaps_mm) >= miss_mm - 1e-6
    assert min(gaps_mm) <= miss_mm + 0.01 * hypot(*surface_mm)


@pytest.mark.parametrize("surface_mm", [SMALL_MM, LARGE_MM])
def test_two_hands_are_ten_fingers_that_stay_on_the_surface(
    surface_mm: tuple[float, float],
) -> None:
    script = two_hands(surface_mm, seed=4)
    for step in range(300):
        found = places(script, 0.2 * step)
        assert sorted(found) == list(range(10))
        assert all(14.9 <= x <= surface_mm[0] - 14.9 for x, _ in found.values())
        assert all(14.9 <= y <= surface_mm[1] - 14.9 for _, y in found.values())
    assert nearest_mm(script, 1.0) >= 20.0
    assert 50.0 < fastest_mm_s(script, 0.0, 1000) <= 200.5


def test_scripts_played_together_keep_their_fingers_apart_by_key() -> None:
    script = together(drag((0.0, 0.0), (9.0, 0.0)), two_hands(SMALL_MM), taps([(50.0, 60.0)]))
    assert len(places(script, 0.01)) == 12


def test_a_scribble_covers_the_surface_and_can_be_repeated() -> None:
    places_mm = scribble(LARGE_MM, 200, seed=9)
    assert places_mm.shape == (200, 2)
    assert np.array_equal(places_mm, scribble(LARGE_MM, 200, seed=9))
    assert not np.array_equal(places_mm, scribble(LARGE_MM, 200, seed=10))
    assert np.all(places_mm >= 10.0)
    assert np.all(places_mm <= np.array(LARGE_MM) - 10.0)
    quarters = {(x > LARGE_MM[0] / 2.0, y > LARGE_MM[1] / 2.0) for x, y in places_mm}
    assert len(quarters) == 4
