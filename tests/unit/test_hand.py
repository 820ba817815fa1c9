"""A simulated person does what a calibration asks for, about as exactly as a real one."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.guiding.coverage import ScribbleCoverage
from cornertouchd.guiding.tapping import HOLD_S
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.hand import (
    AIM_SIGMA_MM,
    SCRIBBLE_SPEED_MM_S,
    SIDE_MM,
    Hand,
    Person,
    place_on_rows,
)

SURFACE_MM = (350.0, 400.0)
PERIOD_S = 0.02
PLACE = (100.0, 250.0)

Touched = tuple[float, float, float]
"""Time, x and y."""


class Watched:
    """A person, and every touch of hers: when and where she touched, picture by picture."""

    def __init__(self, surface_mm: tuple[float, float] = SURFACE_MM, seed: int = 1) -> None:
        self.hand = Hand()
        self.person = Person(self.hand, surface_mm, seed)
        self.touches: dict[object, list[Touched]] = {}
        self.now_s = 50.0

    def look(self) -> None:
        self.now_s += PERIOD_S
        for timed in self.hand.fingers_at(self.now_s):
            seen = self.now_s, timed.finger.x_mm, timed.finger.y_mm
            self.touches.setdefault(timed.key, []).append(seen)

    def asks_for(self, target_mm: tuple[float, float] | None, for_s: float) -> None:
        for _ in range(round(for_s / PERIOD_S)):
            self.person.tap(target_mm, self.now_s)
            self.look()


def test_a_tap_is_held_long_enough_and_still() -> None:
    watched = Watched()
    watched.asks_for(PLACE, 1.0)
    ((first_s, *first), *_, (last_s, *last)) = next(iter(watched.touches.values()))
    assert len(watched.touches) == 1
    assert last_s - first_s > HOLD_S + 2 * PERIOD_S
    assert first == last
    assert watched.hand.fingers_at(watched.now_s) == ()


def test_what_was_not_accepted_is_tapped_again_at_the_same_place_with_a_new_aim() -> None:
    watched = Watched()
    watched.asks_for(PLACE, 5.0)
    assert len(watched.touches) >= 4
    aims = {touch[0][1:] for touch in watched.touches.values()}
    assert len(aims) == len(watched.touches)
    assert all(np.hypot(x - PLACE[0], y - PLACE[1]) < 6 * AIM_SIGMA_MM for x, y in aims)


def test_the_hand_is_lifted_on_the_way_to_the_next_place() -> None:
    watched = Watched()
    watched.asks_for(PLACE, 0.5)
    (touch,) = watched.touches.values()
    watched.asks_for((300.0, 50.0), 0.6)
    first, second = watched.touches.values()
    assert first == touch
    assert second[0][0] - first[-1][0] > 0.3
    assert second[0][1:] == pytest.approx((300.0, 50.0), abs=6 * AIM_SIGMA_MM)


def test_nothing_to_tap_lifts_the_hand() -> None:
    watched = Watched()
    watched.asks_for(PLACE, 0.5)
    assert watched.hand.fingers_at(watched.now_s)
    watched.asks_for(None, PERIOD_S)
    assert watched.hand.fingers_at(watched.now_s) == ()


def test_people_miss_by_as_much_as_is_said() -> None:
    off = []
    for seed in range(150):
        watched = Watched(seed=seed)
        watched.asks_for(PLACE, 0.5)
        ((_, x_mm, y_mm), *_) = next(iter(watched.touches.values()))
        off.append((x_mm - PLACE[0], y_mm - PLACE[1]))
    # Of 150 a mean strays by 8 % of sigma, a deviation by 6 %: four times that is no chance.
    assert np.abs(np.mean(off, axis=0)).max() < 0.33 * AIM_SIGMA_MM
    assert np.std(off, axis=0) == pytest.approx([AIM_SIGMA_MM] * 2, rel=0.25)


def test_the_same_person_is_the_same_again() -> None:
    both = []
    for _ in range(2):
        watched = Watched(seed=7)
        watched.asks_for(PLACE, 3.0)
        both.append(watched.touches)
    assert both[0] == both[1]


@pytest.mark.parametrize("surface_mm", [SURFACE_MM, (2400.0, 1350.0), (300.0, 1000.0)])
def test_rows_cover_the_surface(surface_mm: tuple[float, float]) -> None:
    watched = Watched(surface_mm)
    coverage = ScribbleCoverage(surface_mm)
    ten_rows_a_square = 10.0 * max(1.0, surface_mm[1] / surface_mm[0]) * surface_mm[0]
    for _ in range(round(ten_rows_a_square / SCRIBBLE_SPEED_MM_S / PERIOD_S)):
        watched.person.scribble(watched.now_s)
        watched.look()
    (touch,) = watched.touches.values()
    for _, x_mm, y_mm in touch:
        coverage.wants(np.array([x_mm, y_mm]))
    assert coverage.is_enough


@given(
    width_mm=st.floats(100.0, 5000.0), height_mm=st.floats(100.0, 5000.0),
    way_mm=st.floats(0.0, 1e6), step_mm=st.floats(0.0, 50.0),
)  # fmt: skip
def test_a_scribble_keeps_on_the_surface_and_jumps_only_to_the_next_row(
    width_mm: float, height_mm: float, way_mm: float, step_mm: float
) -> None:
    surface_mm = width_mm, height_mm
    (x, y), (next_x, next_y) = (
        place_on_rows(surface_mm, way) for way in (way_mm, way_mm + step_mm)
    )
    assert -1e-6 <= x - SIDE_MM <= width_mm - 2 * SIDE_MM + 1e-6
    assert -1e-6 <= y - SIDE_MM <= height_mm - 2 * SIDE_MM + 1e-6
    assert abs(next_x - x) <= step_mm + 1e-6
    assert abs(next_y - y) <= min(surface_mm) / 6


def test_a_finger_that_moves_is_one_touch_and_after_lifting_another() -> None:
    hand = Hand(Finger(0.0, 0.0, diameter_mm=7.0))
    hand.touch(1.0, 2.0)
    (first,) = hand.fingers_at(0.0)
    hand.touch(3.0, 4.0)
    (moved,) = hand.fingers_at(0.0)
    hand.lift()
    hand.touch(3.0, 4.0)
    (again,) = hand.fingers_at(0.0)
    assert first.key == moved.key != again.key
    assert moved.finger == again.finger == Finger(3.0, 4.0, diameter_mm=7.0)
    assert first.finger == Finger(1.0, 2.0, diameter_mm=7.0)


def test_a_camera_sees_the_finger_whole_while_another_thread_moves_it() -> None:
    hand = Hand()
    start = threading.Barrier(2)

    def move() -> None:
        start.wait()
        for place in range(20_000):
            hand.touch(float(place), float(place))
            if place % 3 == 0:
                hand.lift()

    mover = threading.Thread(target=move)
    mover.start()
    start.wait()
    seen = []
    while mover.is_alive():
        seen += hand.fingers_at(0.0)
    mover.join()
    assert all(timed.finger.x_mm == timed.finger.y_mm for timed in seen)
    places = [timed.finger.x_mm for timed in seen]
    assert places == sorted(places)
