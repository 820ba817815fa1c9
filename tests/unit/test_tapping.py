"""A tap is a finger held still, seen by enough cameras; nothing else is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.guiding.tapping import HOLD_S, TapDetector, TapState
from cornertouchd.model import FloatArray

CAMERAS = 4
STILL_PX = np.full(CAMERAS, 1.0)
UNSEEN = np.full((CAMERAS, 2), np.nan)


def finger(at_px: float = 100.0, unseen: tuple[int, ...] = ()) -> FloatArray:
    edges = np.tile([at_px - 8.0, at_px + 8.0], (CAMERAS, 1))
    edges[list(unseen)] = np.nan
    return edges


class Watched:
    """A detector, and the time that passes before it."""

    def __init__(self) -> None:
        self.detector = TapDetector(CAMERAS)
        self.now_s = 0.0
        self.taps: list[FloatArray] = []

    def see(self, edges: FloatArray, for_s: float = 0.01) -> None:
        until_s = self.now_s + for_s
        while self.now_s < until_s - 1e-9:
            tap = self.detector.update(self.now_s, edges, STILL_PX)
            if tap is not None:
                self.taps.append(tap)
            self.now_s += 0.01


def test_a_finger_held_still_is_one_tap() -> None:
    watched = Watched()
    watched.see(UNSEEN, 0.2)
    watched.see(finger(), 2.0)
    assert len(watched.taps) == 1
    assert watched.taps[0] == pytest.approx(finger())
    assert watched.detector.state is TapState.TAPPED
    watched.see(UNSEEN, 0.1)
    assert watched.detector.state is TapState.AWAY


def test_the_next_tap_needs_a_lift() -> None:
    watched = Watched()
    for place in (100.0, 200.0):
        watched.see(finger(place), 0.5)
        watched.see(UNSEEN, 0.1)
    assert [tap[0, 0] for tap in watched.taps] == [92.0, 192.0]


def test_a_second_finger_ends_what_was_held() -> None:
    watched = Watched()
    watched.see(finger(), HOLD_S / 2)
    watched.detector.disturb(watched.now_s)
    assert watched.detector.state is TapState.SEVERAL
    watched.see(finger(), HOLD_S / 2)
    assert watched.taps == []
    watched.see(finger(), HOLD_S)
    assert len(watched.taps) == 1


def test_two_quick_taps_are_none() -> None:
    watched = Watched()
    for _ in range(2):
        watched.see(finger(), HOLD_S / 2)
        watched.see(UNSEEN, 0.1)
    assert watched.taps == []
    assert watched.detector.state is TapState.TOO_SHORT


def test_a_moving_finger_is_no_tap_until_it_stands() -> None:
    watched = Watched()
    for step in range(100):
        watched.see(finger(100.0 + step))
    assert watched.taps == []
    watched.see(finger(200.0), 0.4)
    assert len(watched.taps) == 1
    assert watched.taps[0][0, 0] == pytest.approx(192.0, abs=1.0)


def test_tremor_within_the_bound_is_still() -> None:
    watched = Watched()
    rng = np.random.default_rng(1)
    for _ in range(40):
        watched.see(finger(100.0 + rng.uniform(-0.4, 0.4)))
    assert len(watched.taps) == 1
    assert watched.taps[0][0, 0] == pytest.approx(92.0, abs=0.3)


def test_three_cameras_suffice_and_the_fourth_stays_unknown() -> None:
    watched = Watched()
    watched.see(finger(unseen=(2,)), 0.5)
    (tap,) = watched.taps
    assert np.isnan(tap[2]).all()
    assert np.isfinite(tap[[0, 1, 3]]).all()


def test_two_cameras_are_too_few_of_four_but_enough_of_two() -> None:
    watched = Watched()
    watched.see(finger(unseen=(1, 2)), 1.0)
    assert watched.taps == []
    assert watched.detector.state is TapState.HIDDEN
    pair = TapDetector(2)
    taps = [pair.update(k / 100, finger()[:2], STILL_PX[:2]) for k in range(60)]
    assert sum(tap is not None for tap in taps) == 1


def test_a_camera_that_sees_it_now_and_then_does_not_count() -> None:
    watched = Watched()
    for step in range(40):
        watched.see(finger(unseen=(3,) if step % 2 else ()))
    (tap,) = watched.taps
    assert np.isnan(tap[3]).all()


def test_what_happened_in_a_pause_of_the_pictures_is_not_assumed() -> None:
    detector = TapDetector(CAMERAS)
    assert detector.update(0.0, finger(), STILL_PX) is None
    assert detector.update(1.0, finger(), STILL_PX) is None
    assert detector.held_share < 1.0


@given(
    st.lists(
        st.tuples(st.floats(0.001, 0.3), st.sampled_from([None, 100.0, 100.3, 130.0])),
        max_size=60,
    )
)
def test_never_two_taps_without_a_lift_and_never_before_the_time(
    steps: list[tuple[float, float | None]],
) -> None:
    detector = TapDetector(CAMERAS)
    now_s, down_s, tapped = 0.0, None, False
    for wait_s, place in steps:
        now_s += wait_s
        edges = UNSEEN if place is None else finger(place)
        tap = detector.update(now_s, edges, STILL_PX)
        if place is None:
            assert tap is None
            if detector.state in (TapState.AWAY, TapState.TOO_SHORT):
                down_s, tapped = None, False
            continue
        down_s = now_s if down_s is None else down_s
        if tap is not None:
            assert not tapped
            assert now_s - down_s >= HOLD_S - 1e-9
            tapped = True
        assert 0.0 <= detector.held_share <= 1.0
