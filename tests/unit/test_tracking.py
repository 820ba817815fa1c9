import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import Contact, Touch

PERIOD_S = 0.01


def at(x_mm: float, y_mm: float, confidence: float = 1.0, sigma_mm: float = 0.1) -> Contact:
    return Contact(x_mm, y_mm, 12.0, ("C1", "C2", "C3"), confidence, sigma_mm)


def update(tracker: Tracker, now_s: float, contacts: Sequence[Contact]) -> tuple[Touch, ...]:
    supports = np.array([6.0 * contact.confidence for contact in contacts])
    return tracker.update(now_s, Crossed.unsupported(tuple(contacts), supports))


def follow(
    tracker: Tracker, frame_sets: Iterable[Sequence[Contact]], since_s: float = 100.0
) -> list[tuple[Touch, ...]]:
    """Return the touches of frame sets that come one period after the other."""
    return [
        update(tracker, since_s + number * PERIOD_S, contacts)
        for number, contacts in enumerate(frame_sets)
    ]


def ids(reports: Iterable[tuple[Touch, ...]]) -> list[list[int]]:
    return [[touch.id for touch in touches] for touches in reports]


@pytest.fixture
def tracker() -> Tracker:
    return Tracker(TrackingSettings())


def test_the_first_report_is_the_measurement(tracker: Tracker) -> None:
    (touch,) = update(tracker, 100.0, [at(31.7, 88.3)])
    assert touch == Touch(
        id=1, x_mm=31.7, y_mm=88.3, vx_mm_s=0.0, vy_mm_s=0.0, age_s=0.0, diameter_mm=12.0
    )


AS_MEASURED = TrackingSettings(smoothing=False, dead_band_mm=0.0)


@pytest.mark.parametrize(
    ("settings", "off_mm"), [(AS_MEASURED, 0.02), (TrackingSettings(), 0.12)], ids=["raw", "smooth"]
)
@pytest.mark.parametrize("speed_mm_s", [0.0, 30.0, 500.0, 1500.0])
def test_a_finger_that_moves_straight_keeps_its_id_and_is_where_it_is(
    settings: TrackingSettings, off_mm: float, speed_mm_s: float
) -> None:
    path = [at(20.0 + speed_mm_s * PERIOD_S * n, 60.0) for n in range(20)]
    reports = follow(Tracker(settings), [[contact] for contact in path])
    assert ids(reports) == [[1]] * 20
    assert reports[-1][0].x_mm == pytest.approx(path[-1].x_mm, abs=off_mm)
    assert reports[-1][0].vx_mm_s == pytest.approx(speed_mm_s, abs=5.0)
    assert reports[-1][0].vy_mm_s == pytest.approx(0.0, abs=1e-9)
    assert reports[-1][0].age_s == pytest.approx(19 * PERIOD_S)


def test_a_finger_on_a_tight_circle_keeps_its_id(tracker: Tracker) -> None:
    """20 mm of radius at 800 mm/s: three times the acceleration of gravity."""
    turned_rad = np.arange(60) * (800.0 * PERIOD_S / 20.0)
    circle = [at(100.0 + 20.0 * math.cos(a), 100.0 + 20.0 * math.sin(a)) for a in turned_rad]
    reports = follow(tracker, [[contact] for contact in circle])
    assert ids(reports) == [[1]] * 60
    for contact, (touch,) in zip(circle, reports, strict=True):
        assert math.hypot(touch.x_mm - contact.x_mm, touch.y_mm - contact.y_mm) < 1.0


def test_noise_of_a_resting_finger_is_smoothed(tracker: Tracker) -> None:
    rng = np.random.default_rng(1)
    noise_mm = rng.normal(0.0, 0.3, 200)
    reports = follow(tracker, [[at(100.0 + dx, 100.0, sigma_mm=0.3)] for dx in noise_mm])
    reported_mm = np.array([touches[0].x_mm - 100.0 for touches in reports])
    assert np.std(reported_mm) < 0.9 * np.std(noise_mm)


def test_two_fingers_that_pass_20_mm_apart_keep_their_ids(tracker: Tracker) -> None:
    steps = np.arange(60)
    to_the_right = [at(20.0 + 5.0 * n, 100.0) for n in steps]
    to_the_left = [at(315.0 - 5.0 * n, 120.0) for n in steps]
    reports = follow(tracker, zip(to_the_right, to_the_left, strict=True))
    assert ids(reports) == [[1, 2]] * 60
    first, second = reports[-1]
    assert (first.y_mm, second.y_mm) == pytest.approx((100.0, 120.0), abs=0.1)
    assert first.x_mm > second.x_mm


def test_the_order_of_the_contacts_does_not_matter(tracker: Tracker) -> None:
    pair = [at(100.0, 100.0), at(120.0, 100.0)]
    reports = follow(tracker, [pair, pair[::-1], pair, pair[::-1]])
    assert ids(reports) == [[1, 2]] * 4
    assert reports[-1][0].x_mm == pytest.approx(100.0)


@pytest.mark.parametrize("missing", [1, 2])
def test_a_dropout_of_up_to_two_frame_sets_keeps_id_and_report(
    tracker: Tracker, missing: int
) -> None:
    path = [[at(20.0 + 5.0 * n, 60.0)] for n in range(20)]
    for n in range(10, 10 + missing):
        path[n] = []
    reports = follow(tracker, path)
    assert ids(reports) == [[1]] * 20
    assert reports[10][0].x_mm == pytest.approx(65.0, abs=0.5)  # where it was seen last
    assert reports[10][0].vx_mm_s == 0.0
    assert reports[10 + missing][0].x_mm == pytest.approx(70.0 + 5.0 * missing, abs=0.5)
    ages_s = [touches[0].age_s for touches in reports]
    assert ages_s == sorted(ages_s)


def test_a_dropout_of_three_frame_sets_ends_the_touch(tracker: Tracker) -> None:
    resting = [at(60.0, 60.0)]
    reports = follow(tracker, [resting] * 5 + [[]] * 3 + [resting] * 2)
    assert ids(reports) == [[1]] * 7 + [[]] + [[2]] * 2


def test_without_coasting_a_touch_ends_at_once() -> None:
    tracker = Tracker(TrackingSettings(coast_frames=0))
    assert ids(follow(tracker, [[at(60.0, 60.0)], []])) == [[1], []]


def test_a_doubtful_blip_of_one_frame_set_is_never_reported(tracker: Tracker) -> None:
    finger, ghost = at(60.0, 60.0), at(200.0, 300.0, confidence=0.2)
    reports = follow(tracker, [[finger], [finger, ghost], [finger], [finger], [finger, ghost], []])
    assert ids(reports) == [[1]] * 6


def test_a_doubtful_contact_that_stays_is_reported_where_it_is_measured(tracker: Tracker) -> None:
    places = [at(60.0, 60.0, confidence=0.2), at(62.0, 61.0, confidence=0.2)]
    reports = follow(tracker, [[place] for place in places])
    assert ids(reports) == [[], [1]]
    assert (reports[1][0].x_mm, reports[1][0].y_mm) == (62.0, 61.0)
    assert reports[1][0].age_s == 0.0


def test_a_doubtful_contact_that_becomes_clear_is_reported_then() -> None:
    tracker = Tracker(TrackingSettings(confirm_frames=10))
    doubtful, clear = at(60.0, 60.0, confidence=0.2), at(60.0, 60.0, confidence=0.9)
    assert ids(follow(tracker, [[doubtful], [doubtful], [clear]])) == [[], [], [1]]


def test_a_doubtful_contact_of_two_cameras_stays_doubtful_until_a_third_sees_it(
    tracker: Tracker,
) -> None:
    third = at(60.0, 60.0, confidence=0.2)
    ghost = third._replace(cameras=("C1", "C3"))
    assert ids(follow(tracker, [[ghost]] * 5 + [[third]])) == [[], [], [], [], [], [1]]


def test_a_touch_stays_one_when_it_becomes_doubtful(tracker: Tracker) -> None:
    clear, doubtful = at(60.0, 60.0), at(60.0, 60.0, confidence=0.1)
    assert ids(follow(tracker, [[clear]] + [[doubtful]] * 5)) == [[1]] * 6


def test_a_contact_outside_the_gate_is_another_touch(tracker: Tracker) -> None:
    resting, far = at(60.0, 60.0), at(90.0, 60.0)
    assert ids(follow(tracker, [[resting], [resting], [far]])) == [[1], [1], [1, 2]]


def test_a_finger_that_lands_beside_one_that_just_lifted_is_another_touch(
    tracker: Tracker,
) -> None:
    resting, beside = at(60.0, 60.0), at(72.0, 60.0)
    assert ids(follow(tracker, [[resting]] * 5 + [[beside]] * 3))[-1] == [2]


def test_ids_are_never_used_again(tracker: Tracker) -> None:
    seen: list[int] = []
    for number in range(5):
        reports = follow(tracker, [[at(60.0, 60.0)], [], [], []], since_s=100.0 + number)
        seen += reports[0][0].id, reports[2][0].id
        tracker.reset()
    assert seen == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]


def test_a_reset_lifts_everything(tracker: Tracker) -> None:
    update(tracker, 100.0, [at(60.0, 60.0)])
    tracker.reset()
    assert update(tracker, 100.01, []) == ()


@pytest.mark.parametrize("then_s", [100.0, 99.0, 0.0, 110.0, 1e9])
def test_time_that_does_not_advance_or_leaps_lifts_and_begins_anew(
    tracker: Tracker, then_s: float
) -> None:
    update(tracker, 100.0, [at(60.0, 60.0)])
    (touch,) = update(tracker, then_s, [at(60.0, 60.0)])
    assert touch == Touch(
        id=2, x_mm=60.0, y_mm=60.0, vx_mm_s=0.0, vy_mm_s=0.0, age_s=0.0, diameter_mm=12.0
    )


@pytest.mark.parametrize(
    "contact",
    [
        at(60.0, 60.0)._replace(touching=False),
        at(60.0, 60.0)._replace(kind="palm"),
        at(math.nan, 60.0),
        at(60.0, math.inf),
    ],
)
def test_what_does_not_touch_like_a_finger_is_no_touch(tracker: Tracker, contact: Contact) -> None:
    assert ids(follow(tracker, [[contact]] * 5)) == [[]] * 5


def test_a_pen_is_a_touch(tracker: Tracker) -> None:
    assert ids(follow(tracker, [[at(60.0, 60.0)._replace(kind="pen")]])) == [[1]]


def test_a_finger_that_lifts_to_hover_ends_its_touch(tracker: Tracker) -> None:
    down = [at(60.0, 60.0)]
    hovering = [at(60.0, 60.0)._replace(touching=False)]
    assert ids(follow(tracker, [down] * 3 + [hovering] * 3))[-1] == []


@given(
    st.lists(
        st.tuples(
            st.floats(-0.02, 0.6),
            st.lists(
                st.tuples(
                    st.floats(0.0, 350.0),
                    st.floats(0.0, 400.0),
                    st.floats(0.0, 1.0),
                    st.sampled_from([0.0, 0.05, 3.0, 1e6, math.nan, math.inf]),
                ),
                max_size=6,
            ),
        ),
        max_size=15,
    )
)
def test_whatever_comes_the_touches_are_sound_and_the_same_again(
    steps: list[tuple[float, list[tuple[float, float, float, float]]]],
) -> None:
    def run() -> list[tuple[Touch, ...]]:
        tracker, now_s, reports = Tracker(TrackingSettings()), 100.0, []
        for elapsed_s, contacts in steps:
            now_s += elapsed_s
            reports.append(update(tracker, now_s, [at(*contact) for contact in contacts]))
        return reports

    reports = run()
    assert reports == run()
    newest, gone = 0, set()
    contacts_of = [contacts for _, contacts in steps]
    for number, (before, touches) in enumerate(pairwise([(), *reports])):
        assert len(touches) <= sum(map(len, contacts_of[max(number - 2, 0) : number + 1]))
        assert ids([touches]) == [sorted({touch.id for touch in touches})]
        new = [touch.id for touch in touches if touch.id > newest]
        assert new == list(range(newest + 1, newest + 1 + len(new)))
        newest += len(new)
        gone |= {touch.id for touch in before} - {touch.id for touch in touches}
        assert not gone & {touch.id for touch in touches}
        for touch in touches:
            assert all(map(math.isfinite, (touch.x_mm, touch.y_mm, touch.age_s)))
            assert math.isfinite(touch.vx_mm_s)
            assert math.isfinite(touch.vy_mm_s)
            assert touch.age_s >= 0.0
