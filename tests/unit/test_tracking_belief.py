"""What tracking tells the crossing, and how it takes what comes back: belief, palms, cameras."""

import math
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import CrossingSettings, TrackingSettings
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import Contact, DirectingLines, Touch

PERIOD_S = 0.01
NEW = -1
SUPPORTED = 15.0


def at(x_mm: float, y_mm: float, diameter_mm: float = 12.0) -> Contact:
    return Contact(x_mm, y_mm, diameter_mm, ("C1", "C2", "C3"), 1.0, 0.1)


def palm_at(x_mm: float, y_mm: float) -> Contact:
    return at(x_mm, y_mm, 40.0)._replace(kind="palm")


def crossed(
    contacts: Sequence[Contact],
    continues: Sequence[int],
    support: float = SUPPORTED,
    own_edges: int = 6,
) -> Crossed:
    count = len(contacts)
    return Crossed(
        tuple(contacts),
        np.full(count, support),
        np.full(count, own_edges, np.intp),
        np.array(continues, np.intp),
        np.empty((count, 0, 2), np.intp),
    )


NOTHING = Crossed.nothing()


class Following:
    """A tracker that gets a frame set every period, from a crossing that heeds predictions."""

    def __init__(self, settings: TrackingSettings | None = None) -> None:
        self.tracker = Tracker(settings or TrackingSettings(), (350.0, 400.0))
        self._now_s = 100.0

    def predict(self) -> Predictions:
        return self.tracker.predict(self._now_s + PERIOD_S)

    def tell(self, told: Crossed, *, hidden: bool = False) -> tuple[Touch, ...]:
        self._now_s += PERIOD_S
        self.tracker.predict(self._now_s)
        return self.tracker.update(self._now_s, told, hides=lambda *_: hidden)

    def skip(self, sets: int) -> None:
        """Let so many periods pass without a frame set."""
        self._now_s += sets * PERIOD_S

    def see(self, *contacts: Contact, support: float = SUPPORTED) -> tuple[Touch, ...]:
        """Tell contacts, each continuing the prediction that is nearest within 20 mm."""
        discs = self.predict().discs
        continues = [_nearest(discs, contact) for contact in contacts]
        return self.tell(crossed(contacts, continues, support))


def _nearest(discs: np.ndarray, contact: Contact) -> int:
    if not len(discs):
        return NEW
    apart = np.hypot(discs[:, 0] - contact.x_mm, discs[:, 1] - contact.y_mm)
    nearest = int(np.argmin(apart))
    return nearest if apart[nearest] < 20.0 else NEW


def ids(touches: Sequence[Touch]) -> list[int]:
    return [touch.id for touch in touches]


class TestPredictions:
    def test_before_anything_there_are_none(self) -> None:
        assert len(Following().predict()) == 0

    def test_say_where_a_moving_finger_will_be_and_how_wide_it_is(self) -> None:
        following = Following()
        for number in range(20):
            following.see(at(50.0 + 5.0 * number, 80.0, diameter_mm=16.0))
        expected = following.predict()
        assert expected.discs[0] == pytest.approx([150.0, 80.0, 8.0], abs=0.05)
        assert 0.1 < math.sqrt(expected.position_variances_mm2[0]) < 1.0
        assert expected.costs[0] == 0.0

    def test_are_uncertain_by_several_millimetres_right_after_a_landing(self) -> None:
        following = Following()
        following.see(at(50.0, 80.0))
        expected = following.predict()
        assert 4.0 < math.sqrt(expected.position_variances_mm2[0]) < 8.0
        assert math.sqrt(expected.radius_variances_mm2[0]) == pytest.approx(1.0)

    def test_do_not_get_vaguer_than_the_widest_gate_while_a_touch_is_missing(self) -> None:
        following = Following(TrackingSettings(coast_frames=20))
        following.see(at(50.0, 80.0))
        for _ in range(20):
            following.see()
        assert math.sqrt(following.predict().position_variances_mm2[0]) < 8.0

    def test_can_be_asked_for_any_time_without_changing_anything(self) -> None:
        asked, silent = Tracker(TrackingSettings()), Tracker(TrackingSettings())
        for number in range(10):
            now_s = 100.0 + number * PERIOD_S
            asked.predict(now_s + 0.3)
            first, second = asked.predict(now_s), asked.predict(now_s)
            assert np.array_equal(first.discs, second.discs)
            told = crossed([at(50.0 + number, 80.0)], [NEW])
            assert asked.update(now_s, told) == silent.update(now_s, told)

    def test_what_continues_a_prediction_keeps_its_id_though_another_is_nearer(self) -> None:
        following = Following()
        following.see(at(50.0, 80.0), at(70.0, 80.0))
        swapped = crossed([at(58.0, 80.0), at(62.0, 80.0)], [1, 0])
        first, second = following.tell(swapped)
        assert (first.id, second.id) == (1, 2)
        assert first.x_mm > second.x_mm

    @pytest.mark.parametrize("wrong", [1, 7, -5])
    def test_a_number_that_none_has_continues_nothing(self, wrong: int) -> None:
        following = Following()
        following.see(at(50.0, 80.0))
        assert ids(following.tell(crossed([at(150.0, 80.0)], [wrong]))) == [1, 2]

    def test_one_is_continued_by_one_contact_only(self) -> None:
        following = Following()
        following.see(at(50.0, 80.0))
        assert ids(following.tell(crossed([at(50.0, 80.0), at(90.0, 80.0)], [0, 0]))) == [1, 2]

    def test_there_are_none_after_time_has_leapt(self) -> None:
        tracker = Tracker(TrackingSettings())
        tracker.update(100.0, crossed([at(50.0, 80.0)], [NEW]))
        assert len(tracker.predict(99.0)) == 0
        assert len(tracker.predict(101.0)) == 0
        assert len(tracker.predict(100.01)) == 1


class TestBelief:
    def test_what_is_not_reported_yet_is_not_favoured(self) -> None:
        following = Following()
        doubtful = at(50.0, 80.0)._replace(confidence=0.2)
        assert following.see(doubtful) == ()
        assert following.predict().costs[0] == 6.0

    def test_comes_quickly_and_goes_slowly(self) -> None:
        following = Following()
        following.see(at(50.0, 80.0), support=6.0)
        assert following.predict().costs[0] == pytest.approx(2.0)
        for _ in range(10):
            following.see(at(50.0, 80.0), support=3.0)
        assert following.predict().costs[0] == pytest.approx(3.0)
        following.see(at(50.0, 80.0), support=9.0)
        assert following.predict().costs[0] == pytest.approx(2.0)
        following.see(at(50.0, 80.0), support=30.0)
        assert following.predict().costs[0] == pytest.approx(0.0)

    def test_goes_while_a_touch_is_missing(self) -> None:
        following = Following()
        following.see(at(50.0, 80.0))
        following.see()
        assert following.predict().costs[0] == pytest.approx(0.1)

    @pytest.mark.parametrize(("support", "own_edges"), [(20.0, 0), (1.0, 3)])
    def test_alone_carries_a_touch_for_half_a_second_and_not_far(
        self, support: float, own_edges: int
    ) -> None:
        following = Following()
        for number in range(20):
            (touch,) = following.see(at(50.0 + 5.0 * number, 80.0))
        last_x_mm, carried = touch.x_mm, 0
        for _ in range(100):
            x_mm, y_mm, radius_mm = following.predict().discs[0].tolist()
            itself = crossed([at(x_mm, y_mm, 2.0 * radius_mm)], [0], support, own_edges)
            touches = following.tell(itself)
            if not touches:
                break
            carried += 1
            assert touches[0].id == 1
            assert touches[0].x_mm < last_x_mm + 40.0
        assert carried == pytest.approx(50, abs=2)
        assert len(following.predict()) == 0

    def test_carries_a_touch_that_shows_itself_now_and_then(self) -> None:
        following = Following()
        seen = [crossed([at(50.0, 80.0)], [0], own_edges=0)] * 40 + [crossed([at(50.0, 80.0)], [0])]
        following.see(at(50.0, 80.0))
        assert all(ids(following.tell(told)) == [1] for told in seen * 5)

    def test_is_not_needed_by_a_crossing_without_predictions(self) -> None:
        following = Following()
        without = crossed([at(50.0, 80.0)], [NEW], support=0.5, own_edges=0)
        following.see(at(50.0, 80.0))
        assert all(ids(following.tell(without)) == [1] for _ in range(100))


class TestSkippedFrameSets:
    """Times at which nobody looked are no sights of nothing."""

    def moving(self, following: Following, sets: int, first: int = 0) -> tuple[Touch, ...]:
        touches: tuple[Touch, ...] = ()
        for number in range(first, first + sets):
            touches = following.see(at(50.0 + 3.0 * number, 80.0))
        return touches

    @pytest.mark.parametrize("skipped", [1, 2, 3, 5, 10])
    def test_a_finger_that_moves_keeps_its_id_over_them(self, skipped: int) -> None:
        following = Following()
        self.moving(following, 20)
        following.skip(skipped)
        (touch,) = self.moving(following, 1, first=20 + skipped)
        assert touch.id == 1
        assert touch.x_mm == pytest.approx(50.0 + 3.0 * (20 + skipped), abs=0.5)

    @pytest.mark.parametrize("skipped", [2, 3, 5, 10])
    def test_a_finger_that_lifts_meanwhile_is_gone_with_the_next_one(self, skipped: int) -> None:
        following = Following()
        self.moving(following, 20)
        following.skip(skipped)
        assert following.see() == ()

    def test_one_at_times_does_not_shorten_the_patience_with_a_dropout(self) -> None:
        following = Following()
        for _ in range(10):
            self.moving(following, 5)
            following.skip(1)
        self.moving(following, 1)
        assert ids(following.see()) == [1]
        assert ids(following.see()) == [1]
        assert ids(following.see()) == []


class TestHidden:
    """A touch that little tells apart before it is missed may be behind others."""

    def half_hidden(self) -> Following:
        following = Following()
        for _ in range(20):
            following.see(at(50.0, 80.0))
        following.see(at(50.0, 80.0), support=6.0)
        return following

    def test_keeps_its_id_for_a_tenth_of_a_second_while_no_camera_sees_light_there(self) -> None:
        following = self.half_hidden()
        told = [ids(following.tell(NOTHING, hidden=True)) for _ in range(12)]
        assert told == [[1]] * 10 + [[]] * 2

    def test_ends_as_any_other_when_a_camera_sees_light_there(self) -> None:
        following = self.half_hidden()
        told = [ids(following.tell(NOTHING, hidden=False)) for _ in range(4)]
        assert told == [[1], [1], [], []]

    def test_nobody_asks_about_a_touch_that_was_clear(self) -> None:
        following = Following()
        for _ in range(20):
            following.see(at(50.0, 80.0))
        told = [ids(following.tell(NOTHING, hidden=True)) for _ in range(4)]
        assert told == [[1], [1], [], []]

    def test_nor_about_one_that_has_just_begun(self) -> None:
        following = Following()
        following.see(at(50.0, 80.0), support=8.0)
        told = [ids(following.tell(NOTHING, hidden=True)) for _ in range(4)]
        assert told == [[1], [1], [], []]

    def test_is_not_led_away_by_a_doubtful_contact(self) -> None:
        following = self.half_hidden()
        ghost = at(57.0, 80.0)._replace(confidence=0.1)
        (touch,) = following.tell(crossed([ghost], [NEW], support=7.1), hidden=True)
        assert (touch.id, touch.x_mm) == (1, pytest.approx(50.0, abs=0.1))

    def test_comes_out_again_as_itself_though_it_was_not_quite_where_it_seemed(self) -> None:
        following = self.half_hidden()
        following.tell(NOTHING, hidden=True)
        (touch,) = following.tell(crossed([at(59.0, 80.0)], [NEW]), hidden=True)
        assert touch.id == 1

    def test_goes_before_what_is_not_reported_yet(self) -> None:
        following = self.half_hidden()
        doubtful = at(60.0, 80.0)._replace(confidence=0.1)
        following.tell(crossed([doubtful], [NEW], support=7.1), hidden=True)
        tentative = following.predict().costs.argmax()
        (touch,) = following.tell(crossed([at(58.0, 80.0)], [int(tentative)]), hidden=True)
        assert touch.id == 1


class TestBirths:
    def births(self, own_edges: int, confidence: float) -> list[list[int]]:
        following = Following()
        contact = at(50.0, 80.0)._replace(confidence=confidence)
        return [
            ids(following.tell(crossed([contact], [number - 1], own_edges=own_edges)))
            for number in [0, 1, 1, 1]
        ]

    def test_a_clear_finger_that_owns_its_edges_is_told_at_once(self) -> None:
        assert self.births(own_edges=4, confidence=0.9) == [[1]] * 4

    def test_one_that_owns_three_is_seen_twice_first(self) -> None:
        assert self.births(own_edges=3, confidence=0.9) == [[], [1], [1], [1]]

    def test_a_doubtful_one_that_owns_three_is_seen_three_times_first(self) -> None:
        assert self.births(own_edges=3, confidence=0.2) == [[], [], [1], [1]]


class TestPalms:
    def test_a_palm_is_no_touch_nor_is_the_finger_that_it_shrinks_to(self) -> None:
        following = Following()
        lifting = [palm_at(100.0, 100.0)] * 5 + [at(100.0, 100.0)] * 45
        assert not any(following.see(contact) for contact in lifting)

    def test_what_is_a_clear_finger_for_half_a_second_was_no_palm(self) -> None:
        following = Following()
        seen = [palm_at(100.0, 100.0)] * 5 + [at(100.0, 100.0)] * 60
        reports = [following.see(contact) for contact in seen]
        assert ids(reports[49]) == []
        assert ids(reports[-1]) == [1]

    def test_what_a_palm_falls_apart_into_is_none_either(self) -> None:
        following = Following()
        for _ in range(5):
            following.see(palm_at(100.0, 100.0))
        apart = [at(100.0, 90.0), at(115.0, 100.0), at(92.0, 112.0)]
        assert not any(following.see(*apart) for _ in range(20))

    def test_after_a_palm_fingers_touch_as_before(self) -> None:
        following = Following()
        following.see(palm_at(100.0, 100.0))
        for _ in range(3):
            following.see()
        assert ids(following.see(at(100.0, 100.0))) == [1]

    def test_a_finger_beside_a_palm_is_a_touch(self) -> None:
        following = Following()
        following.see(palm_at(100.0, 100.0))
        assert ids(following.see(palm_at(100.0, 100.0), at(150.0, 100.0))) == [1]

    def test_a_touch_that_becomes_a_palm_ends_and_does_not_return(self) -> None:
        following = Following()
        following.see(at(100.0, 100.0))
        spreading = [palm_at(100.0, 100.0)] * 3 + [at(100.0, 100.0)] * 20
        seen = [ids(following.see(contact)) for contact in spreading]
        assert seen == [[1]] + [[]] * 22

    def test_one_frame_set_that_takes_a_finger_for_a_palm_does_not_end_it(self) -> None:
        following = Following()
        (before,) = following.see(at(100.0, 100.0))
        (during,) = following.see(palm_at(106.0, 100.0))
        assert (during.id, during.x_mm) == (1, before.x_mm)
        assert ids(following.see(at(100.0, 100.0))) == [1]

    @pytest.mark.parametrize(("finger_sets", "palm_sets"), [(11, 3), (50, 9), (300, 14)])
    def test_the_longer_it_was_a_finger_the_longer_it_may_look_like_a_palm(
        self, finger_sets: int, palm_sets: int
    ) -> None:
        following, finger = Following(), at(100.0, 100.0)
        for _ in range(finger_sets):
            following.see(finger)
        told = [ids(following.see(palm_at(106.0, 100.0))) for _ in range(palm_sets + 2)]
        assert told[: palm_sets - 2] == [[1]] * (palm_sets - 2)
        assert told[-1] == []
        assert ids(following.see(finger)) == []

    def test_two_fingers_that_pass_and_look_like_a_palm_meanwhile_go_on(self) -> None:
        following, finger = Following(), at(100.0, 100.0)
        for _ in range(100):
            following.see(finger)
        for _ in range(10):
            (touch,) = following.see(palm_at(106.0, 100.0))
            assert (touch.id, touch.x_mm) == (1, pytest.approx(100.0))
        assert ids(following.see(finger)) == [1]

    def test_a_palm_that_is_lost_for_two_frame_sets_stays_one(self) -> None:
        following = Following()
        following.see(palm_at(100.0, 100.0))
        following.see()
        following.see()
        assert following.see(at(100.0, 100.0)) == ()

    def test_palms_are_touches_on_request(self) -> None:
        following = Following(TrackingSettings(report_palms=True))
        changing = [at(100.0, 100.0), palm_at(100.0, 100.0), at(100.0, 100.0)] * 3
        assert [ids(following.see(contact)) for contact in changing] == [[1]] * 9


CORNERS = {
    "C1": (-10.0, -10.0),
    "C2": (360.0, -10.0),
    "C3": (360.0, 410.0),
    "C4": (-10.0, 410.0),
}


def lines_of(camera: str, places: Sequence[tuple[float, float]]) -> DirectingLines:
    """Return what a camera sees of discs of 6 mm radius; shadows that overlap are one."""
    x_mm, y_mm = CORNERS[camera]
    shadows: list[list[float]] = []
    for place in sorted(places, key=lambda at: math.atan2(at[1] - y_mm, at[0] - x_mm)):
        away = (place[0] - x_mm, place[1] - y_mm)
        angle, half = math.atan2(away[1], away[0]), math.asin(6.0 / math.hypot(*away))
        if shadows and angle - half < shadows[-1][1]:
            shadows[-1][1] = max(shadows[-1][1], angle + half)
        else:
            shadows.append([angle - half, angle + half])
    edges, seen = np.array(shadows).reshape(-1, 2), np.ones(len(shadows), np.bool_)
    return DirectingLines(
        camera,
        x_mm,
        y_mm,
        first_rad=edges[:, 0].copy(),
        centre_rad=edges.mean(axis=1),
        last_rad=edges[:, 1].copy(),
        first_valid=seen,
        last_valid=seen.copy(),
        sigma_rad=np.full(len(shadows), 3e-4),
    )


def crossing_paths(number: int) -> list[tuple[float, float]]:
    """Three fingers, two of which go past each other 20 mm apart."""
    way = 2.0 * number
    return [(100.0 + way, 150.0), (220.0 - way, 170.0), (160.0, 300.0 - way)]


def test_ids_survive_crossings_and_the_loss_of_a_camera() -> None:
    crossing = make_crossing(CrossingSettings(), (350.0, 400.0))
    tracker = Tracker(TrackingSettings(), (350.0, 400.0))
    finger_of: dict[int, int] = {}
    for number in range(60):
        places, now_s = crossing_paths(number), number * PERIOD_S
        lost = f"C{1 + number // 7 % 4}" if number % 7 >= 4 else None
        lines = [lines_of(camera, places) for camera in CORNERS if camera != lost]
        touches = tracker.update(now_s, crossing.cross(lines, tracker.predict(now_s)))
        assert ids(touches) == [1, 2, 3]
        for touch in touches:
            apart = [math.dist(place, (touch.x_mm, touch.y_mm)) for place in places]
            assert min(apart) < 2.0
            assert finger_of.setdefault(touch.id, apart.index(min(apart))) == apart.index(
                min(apart)
            )


@given(st.data())
def test_whatever_a_crossing_says_touches_come_from_contacts_and_stay_sound(
    data: st.DataObject,
) -> None:
    tracker = Tracker(TrackingSettings(), (350.0, 400.0))
    counts, newest = [0, 0], 0
    for number in range(data.draw(st.integers(1, 12))):
        now_s = 100.0 + number * PERIOD_S
        predicted = len(tracker.predict(now_s))
        contacts = data.draw(
            st.lists(
                st.builds(
                    at,
                    st.floats(0.0, 350.0) | st.just(math.nan),
                    st.floats(0.0, 400.0),
                    st.sampled_from([0.0, 3.0, 12.0, 40.0, math.inf, math.nan]),
                ),
                max_size=4,
            )
        )
        told = Crossed(
            tuple(
                contact._replace(kind=data.draw(st.sampled_from(["finger", "palm", "pen"])))
                for contact in contacts
            ),
            np.array([data.draw(st.floats(-5.0, 40.0) | st.just(math.nan)) for _ in contacts]),
            np.array([data.draw(st.integers(0, 8)) for _ in contacts], np.intp),
            np.array([data.draw(st.integers(-1, predicted)) for _ in contacts], np.intp),
            np.empty((len(contacts), 0, 2), np.intp),
        )
        touches = tracker.update(now_s, told)
        counts = [*counts[-2:], len(contacts)]
        assert len(touches) <= sum(counts)
        assert ids(touches) == sorted(set(ids(touches)))
        assert all(
            math.isfinite(value)
            for touch in touches
            for value in (touch.x_mm, touch.y_mm, touch.vx_mm_s, touch.vy_mm_s)
        )
        new = [identity for identity in ids(touches) if identity > newest]
        assert new == list(range(newest + 1, newest + 1 + len(new)))
        newest += len(new)
        expected = tracker.predict(now_s + PERIOD_S)
        assert np.all(np.isfinite(expected.discs))
        assert np.all((expected.costs >= 0.0) & (expected.costs <= 6.0))
        assert np.all(expected.position_variances_mm2 > 0.0)


class TestMissingCameras:
    def test_what_a_frame_set_without_a_camera_shows_must_be_seen_three_times(self) -> None:
        tracker = Tracker(TrackingSettings(), (350.0, 400.0))
        seen = crossed([at(100.0, 100.0)], [NEW])
        reports = [
            tracker.update(100.0 + number * PERIOD_S, seen, whole=False) for number in range(4)
        ]
        assert [ids(report) for report in reports] == [[], [], [1], [1]]

    def test_a_touch_goes_on_without_a_camera(self) -> None:
        tracker = Tracker(TrackingSettings(), (350.0, 400.0))
        seen = crossed([at(100.0, 100.0)], [NEW])
        assert ids(tracker.update(100.0, seen)) == [1]
        assert ids(tracker.update(100.01, seen, whole=False)) == [1]


def test_touches_that_moved_on_while_nobody_looked_are_not_told_twice() -> None:
    """Also when it is the first frame sets that are skipped, which tell how long others take."""
    tracker = Tracker(TrackingSettings(), (350.0, 400.0))
    tracker.update(100.0, crossed([at(100.0, 100.0), at(200.0, 100.0)], [NEW, NEW]))
    later = crossed([at(100.0, 220.0), at(200.0, 220.0)], [NEW, NEW])
    assert ids(tracker.update(100.15, later)) == [3, 4]
