"""What is reported of a finger: where it is, without jitter, lag or steps; ahead on request."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import Contact, FloatArray, Touch

PERIOD_S = 0.01
SURFACE_MM = (350.0, 400.0)
# as much in each direction as real pictures of a finger at rest have at most: 0.06 mm in all
NOISE_MM = 0.042
UNSMOOTHED = {"smoothing": False, "dead_band_mm": 0.0}


def told_of(
    path_mm: FloatArray, noise_mm: float = 0.0, period_s: float = PERIOD_S, **settings: Any
) -> list[Touch]:
    """Return the reports of a finger on a path (N, 2)."""
    tracker = Tracker(TrackingSettings(**settings), SURFACE_MM)
    measured = path_mm + np.random.default_rng(1).normal(0.0, noise_mm, path_mm.shape)
    reports = []
    for number, (x_mm, y_mm) in enumerate(measured.tolist()):
        contact = Contact(x_mm, y_mm, 12.0, ("C1", "C2", "C3", "C4"), 1.0, 0.08)
        told = Crossed.unsupported((contact,), np.array([12.0]))
        (touch,) = tracker.update(50.0 + number * period_s, told)
        reports.append(touch)
    return reports


def places(reports: list[Touch]) -> FloatArray:
    return np.array([(touch.x_mm, touch.y_mm) for touch in reports])


def speeds(reports: list[Touch]) -> FloatArray:
    return np.array([math.hypot(touch.vx_mm_s, touch.vy_mm_s) for touch in reports])


def resting(seconds: float) -> FloatArray:
    return np.full((round(seconds / PERIOD_S), 2), 100.0)


def stroke(speed_mm_s: float, seconds: float) -> FloatArray:
    """A straight path from (20, 30), at 30 degrees."""
    way = speed_mm_s * PERIOD_S * np.arange(round(seconds / PERIOD_S))
    return np.array([20.0, 30.0]) + way[:, None] * (math.cos(math.pi / 6), 0.5)


def steps(reports: list[Touch]) -> FloatArray:
    return np.hypot(*np.diff(places(reports), axis=0).T)


class TestAtRest:
    def test_the_first_report_is_the_measurement(self) -> None:
        path = stroke(800.0, 0.1) + 0.123
        assert places(told_of(path))[0] == pytest.approx(path[0], abs=0.0)

    def test_jitter_is_below_two_hundredths_of_a_millimetre(self) -> None:
        reported = places(told_of(resting(20.0), NOISE_MM))
        assert np.sqrt(np.mean(np.sum((reported - reported.mean(axis=0)) ** 2, axis=1))) < 0.02

    def test_hardly_any_report_moves_and_none_has_a_velocity_at_rest(self) -> None:
        reports = told_of(resting(20.0), 0.03)
        assert np.mean(steps(reports) > 0.0) < 0.01
        assert np.all(speeds(reports)[1:][steps(reports) == 0.0] == 0.0)

    def test_a_finger_that_stops_comes_to_rest_with_velocity_zero(self) -> None:
        moving = stroke(200.0, 0.5)
        path = np.vstack([moving, np.repeat(moving[-1:], 60, axis=0)])
        reports = told_of(path, 0.02)
        assert speeds(reports)[49] == pytest.approx(200.0, abs=20.0)
        assert np.all(speeds(reports)[-20:] == 0.0)
        assert places(reports)[-1] == pytest.approx(moving[-1], abs=0.05)

    def test_without_smoothing_and_dead_band_reports_are_the_measurements(self) -> None:
        path = resting(1.0) + np.random.default_rng(2).normal(0.0, 0.5, (100, 2))
        assert places(told_of(path, **UNSMOOTHED)) == pytest.approx(path, abs=0.35)
        assert np.all(steps(told_of(path, **UNSMOOTHED)) > 0.0)


class TestInMotion:
    @pytest.mark.parametrize("speed_mm_s", [50.0, 150.0, 500.0])
    def test_reports_lag_by_less_than_half_a_period(self, speed_mm_s: float) -> None:
        path = stroke(speed_mm_s, 0.6)
        behind_mm = (path - places(told_of(path, 0.02)))[20:] @ (math.cos(math.pi / 6), 0.5)
        assert np.mean(behind_mm) / speed_mm_s < 0.5 * PERIOD_S
        assert np.mean(behind_mm) < 0.12

    @pytest.mark.parametrize("speed_mm_s", [1.0, 2.0, 5.0])
    def test_a_slow_drag_has_no_stairs(self, speed_mm_s: float) -> None:
        reports = told_of(stroke(speed_mm_s, 5.0), 0.02)
        assert steps(reports).max() < 0.1
        assert np.mean(steps(reports)[50:] == 0.0) < 0.05

    def test_a_finger_that_starts_to_move_is_caught_up_with_without_a_jump(self) -> None:
        path = np.vstack([resting(0.5), 100.0 + (stroke(10.0, 1.0) - stroke(10.0, 1.0)[0])])
        reports = told_of(path)
        assert steps(reports).max() < 0.16
        assert places(reports)[-1] == pytest.approx(path[-1], abs=0.12)

    def test_velocity_is_that_of_the_finger(self) -> None:
        last = told_of(stroke(500.0, 0.5))[-1]
        assert (last.vx_mm_s, last.vy_mm_s) == pytest.approx((433.0, 250.0), abs=2.0)

    def test_a_swipe_that_lands_moving_is_followed_from_its_second_report(self) -> None:
        path = stroke(800.0, 0.1)
        assert np.hypot(*(places(told_of(path)) - path).T).max() < 1.0


class TestAhead:
    @pytest.mark.parametrize("predict_ms", [10.0, 100.0])
    def test_a_moving_finger_is_reported_where_it_will_be(self, predict_ms: float) -> None:
        path = stroke(300.0, 0.5)
        ahead_mm = (places(told_of(path, predict_ms=predict_ms)) - path)[-1]
        assert math.hypot(*ahead_mm) == pytest.approx(0.3 * predict_ms, abs=0.3)

    def test_never_beyond_the_edge_of_the_surface(self) -> None:
        path = stroke(380.0, 1.0)
        reported = places(told_of(path, predict_ms=100.0))
        assert reported.max(axis=0)[0] == 350.0
        back = places(told_of(path[::-1].copy(), predict_ms=100.0))
        assert back.min() == 0.0

    def test_a_still_finger_is_where_it_is(self) -> None:
        still, ahead = told_of(resting(5.0), 0.02), told_of(resting(5.0), 0.02, predict_ms=100.0)
        assert still == ahead

    def test_a_sudden_stop_overshoots_by_less_than_the_way_ahead_and_briefly(self) -> None:
        moving = stroke(300.0, 0.5)
        path = np.vstack([moving, np.repeat(moving[-1:], 50, axis=0)])
        over_mm = np.hypot(*(places(told_of(path, predict_ms=50.0)) - path[-1]).T)[50:]
        assert over_mm.max() < 15.0
        assert over_mm[5:].max() < 1.0
        assert over_mm[30:].max() < 0.1

    def test_a_touch_that_is_not_seen_rests_where_it_was_reported(self) -> None:
        tracker = Tracker(TrackingSettings(predict_ms=50.0), SURFACE_MM)
        for number, (x_mm, y_mm) in enumerate(stroke(300.0, 0.2).tolist()):
            contact = Contact(x_mm, y_mm, 12.0, ("C1", "C2", "C3"), 1.0, 0.08)
            (last,) = tracker.update(
                number * PERIOD_S, Crossed.unsupported((contact,), np.array([12.0]))
            )
        (resting_touch,) = tracker.update(20 * PERIOD_S, Crossed.nothing())
        assert (resting_touch.x_mm, resting_touch.y_mm) == (last.x_mm, last.y_mm)
        assert (resting_touch.vx_mm_s, resting_touch.vy_mm_s) == (0.0, 0.0)


@given(
    st.lists(st.tuples(st.floats(0.0, 350.0), st.floats(0.0, 400.0)), min_size=1, max_size=30),
    st.sampled_from([1e-9, 0.001, 0.01, 0.4]),
    st.floats(0.0, 100.0),
    st.booleans(),
    st.sampled_from([0.0, 0.08, 5.0]),
)
def test_reports_are_finite_and_on_the_surface_whatever_a_finger_does(
    path: list[tuple[float, float]],
    period_s: float,
    predict_ms: float,
    smoothing: bool,
    dead_band_mm: float,
) -> None:
    settings = TrackingSettings(
        predict_ms=predict_ms, smoothing=smoothing, dead_band_mm=dead_band_mm
    )
    tracker = Tracker(settings, SURFACE_MM)
    for number, (x_mm, y_mm) in enumerate(path):
        contact = Contact(x_mm, y_mm, 12.0, ("C1", "C2", "C3"), 1.0, 0.08)
        told = Crossed.unsupported((contact,), np.array([12.0]))
        for touch in tracker.update(50.0 + number * period_s, told):
            assert all(map(math.isfinite, (touch.vx_mm_s, touch.vy_mm_s)))
            if predict_ms:
                assert 0.0 <= touch.x_mm <= 350.0
                assert 0.0 <= touch.y_mm <= 400.0
