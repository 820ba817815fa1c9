import math
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import PairingSettings
from cornertouchd.fusion.pairing import FrameSetPairing
from cornertouchd.model import FrameSet, Observation, Shadows

CAMERAS = ("C1", "C2", "C3", "C4")
TOLERANCE_S = 0.004
DEADLINE_S = 0.015
ROUNDING_S = 1e-12


@pytest.fixture
def pairing() -> FrameSetPairing:
    return FrameSetPairing(CAMERAS, PairingSettings(tolerance_ms=4.0, deadline_ms=15.0))


def seen(camera: str, captured_at_s: float, sequence: int = 0) -> Observation:
    return Observation(camera, sequence, captured_at_s, shadows=Shadows.of(()))


def cameras_of(frame_set: FrameSet) -> tuple[str, ...]:
    return tuple(observation.camera for observation in frame_set.observations)


def add_all(
    pairing: FrameSetPairing, observations: Iterable[Observation], now_s: float
) -> list[FrameSet]:
    return [
        frame_set for observation in observations for frame_set in pairing.add(observation, now_s)
    ]


def test_the_last_camera_completes_the_set_in_the_order_of_the_cameras(
    pairing: FrameSetPairing,
) -> None:
    assert add_all(pairing, [seen("C3", 1.001), seen("C1", 1.0), seen("C4", 1.002)], 5.0) == []
    (frame_set,) = pairing.add(seen("C2", 1.0005), now_s=5.001)
    assert cameras_of(frame_set) == CAMERAS
    assert pairing.counts.sets == 1
    assert pairing.counts.incomplete_sets == 0


def test_pictures_of_exactly_one_instant_keep_its_time_to_the_last_bit(
    pairing: FrameSetPairing,
) -> None:
    (frame_set,) = add_all(pairing, [seen(camera, 0.1 + 0.2) for camera in CAMERAS], 5.0)
    assert frame_set.captured_at_s == 0.1 + 0.2


def test_the_time_of_a_set_lies_amid_its_pictures(pairing: FrameSetPairing) -> None:
    times_s = dict(zip(CAMERAS, (1.0, 1.003, 1.001, 1.002), strict=True))
    (frame_set,) = add_all(pairing, [seen(c, t) for c, t in times_s.items()], 5.0)
    assert frame_set.captured_at_s == 1.001


def test_a_missing_camera_holds_the_others_up_until_the_deadline_and_no_longer(
    pairing: FrameSetPairing,
) -> None:
    add_all(pairing, [seen(camera, 1.0) for camera in ("C1", "C2", "C3")], now_s=5.0)
    assert pairing.next_due_at_s == 5.0 + DEADLINE_S
    assert pairing.due(5.0149) == []
    (frame_set,) = pairing.due(5.0 + DEADLINE_S)
    assert cameras_of(frame_set) == ("C1", "C2", "C3")
    assert pairing.counts.incomplete_sets == 1
    assert pairing.next_due_at_s is None


def test_the_deadline_counts_from_the_first_picture_of_the_set(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C1", 1.0), now_s=5.0)
    pairing.add(seen("C2", 1.0), now_s=5.014)
    assert cameras_of(pairing.due(5.015)[0]) == ("C1", "C2")


def test_a_camera_that_lost_a_picture_is_not_waited_for(pairing: FrameSetPairing) -> None:
    add_all(pairing, [seen(camera, 1.0) for camera in ("C1", "C2", "C3")], now_s=5.0)
    (frame_set,) = pairing.add(seen("C4", 1.01), now_s=5.001)
    assert cameras_of(frame_set) == ("C1", "C2", "C3")


def test_a_camera_that_runs_ahead_waits_for_the_others(pairing: FrameSetPairing) -> None:
    early = [seen("C1", t, n) for n, t in enumerate((1.0, 1.01, 1.02))]
    assert add_all(pairing, early, now_s=5.0) == []
    late = [seen(c, t) for t in (1.0, 1.01, 1.02) for c in ("C2", "C3", "C4")]
    assert [cameras_of(frame_set) for frame_set in add_all(pairing, late, 5.001)] == [CAMERAS] * 3


def test_only_live_cameras_are_waited_for(pairing: FrameSetPairing) -> None:
    pairing.set_live(["C1", "C3"])
    pairing.add(seen("C1", 1.0), 5.0)
    (frame_set,) = pairing.add(seen("C3", 1.0), 5.0)
    assert cameras_of(frame_set) == ("C1", "C3")
    assert pairing.counts.incomplete_sets == 0


def test_a_camera_that_dies_frees_the_set_that_waits_for_it(pairing: FrameSetPairing) -> None:
    add_all(pairing, [seen(camera, 1.0) for camera in ("C1", "C2", "C3")], now_s=5.0)
    pairing.set_live(["C1", "C2", "C3"])
    assert cameras_of(pairing.due(5.0)[0]) == ("C1", "C2", "C3")


def test_a_camera_that_is_not_live_still_joins(pairing: FrameSetPairing) -> None:
    pairing.set_live(["C1", "C2"])
    add_all(pairing, [seen("C4", 1.0), seen("C1", 1.0)], 5.0)
    assert cameras_of(pairing.add(seen("C2", 1.0), 5.0)[0]) == ("C1", "C2", "C4")


def test_a_picture_that_comes_after_its_set_is_dropped_and_counted(
    pairing: FrameSetPairing,
) -> None:
    add_all(pairing, [seen(camera, 1.0) for camera in ("C1", "C2", "C3")], now_s=5.0)
    pairing.due(6.0)
    assert pairing.add(seen("C4", 1.001), now_s=6.0) == []
    assert pairing.due(7.0) == []
    assert pairing.counts.dropped_observations == 1


def test_the_same_picture_twice_is_dropped_and_counted(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C1", 1.0), 5.0)
    pairing.add(seen("C1", 1.0), 5.0)
    pairing.add(seen("C2", 1.0), 5.0)
    (frame_set,) = pairing.due(6.0)
    assert cameras_of(frame_set) == ("C1", "C2")
    assert pairing.counts.dropped_observations == 1


def test_one_camera_alone_makes_no_frame_set(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C1", 1.0), 5.0)
    assert pairing.due(6.0) == []
    assert pairing.counts.dropped_observations == 1


@pytest.mark.parametrize("ahead_s", [0.02, 0.05, 1.0])
def test_a_camera_whose_clock_is_ahead_does_not_silence_the_others(
    pairing: FrameSetPairing, ahead_s: float
) -> None:
    sets = []
    for tick in range(100):
        now_s = 50.0 + 0.01 * tick
        sets += pairing.add(seen("C1", 0.01 * tick + ahead_s), now_s)
        for camera in ("C2", "C3", "C4"):
            sets += pairing.add(seen(camera, 0.01 * tick), now_s)
        sets += pairing.due(now_s + 0.009)
    assert sum({"C2", "C3", "C4"} <= set(cameras_of(one)) for one in sets) > 90


def test_a_picture_without_a_time_is_dropped_and_counted(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C1", math.nan), 5.0)
    assert pairing.due(6.0) == []
    assert pairing.counts.dropped_observations == 1


def test_gaps_in_the_sequence_are_counted_per_camera(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C1", 1.00, sequence=7), 5.0)
    pairing.add(seen("C2", 1.00, sequence=90), 5.0)
    pairing.add(seen("C1", 1.03, sequence=10), 5.03)
    pairing.add(seen("C2", 1.01, sequence=91), 5.03)
    assert pairing.counts.missed_observations == 2


def test_a_camera_that_is_opened_anew_counts_from_the_beginning(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C1", 1.0, sequence=5000), 5.0)
    pairing.add(seen("C1", 2.0, sequence=0), 6.0)
    pairing.add(seen("C1", 2.01, sequence=1), 6.01)
    assert pairing.counts.missed_observations == 0
    assert pairing.counts.restarts == 0


def test_a_recording_that_starts_over_is_paired_again(pairing: FrameSetPairing) -> None:
    times_s = [1.0, 1.01, 1.02]
    twice = [seen(camera, t) for _ in range(2) for t in times_s for camera in CAMERAS]
    frame_sets = add_all(pairing, twice, now_s=5.0)
    assert [frame_set.captured_at_s for frame_set in frame_sets] == times_s * 2
    assert all(cameras_of(frame_set) == CAMERAS for frame_set in frame_sets)
    assert pairing.counts.restarts == 1
    assert pairing.counts.dropped_observations == 0


def test_what_waits_is_given_out_when_time_jumps_back(pairing: FrameSetPairing) -> None:
    add_all(pairing, [seen("C1", 9.0), seen("C2", 9.0)], 5.0)
    (before,) = pairing.add(seen("C1", 1.0), 5.0)
    assert cameras_of(before) == ("C1", "C2")


def test_one_wrong_time_does_not_silence_the_cameras(pairing: FrameSetPairing) -> None:
    pairing.add(seen("C4", 1e9), now_s=5.0)
    pairing.due(5.1)
    pairing.set_live(["C1", "C2", "C3"])
    times_s = [1.0 + 0.01 * n for n in range(10)]
    late = [seen(camera, t) for t in times_s for camera in ("C1", "C2", "C3")]
    frame_sets = add_all(pairing, late, now_s=5.2)
    assert [frame_set.captured_at_s for frame_set in frame_sets][-9:] == times_s[1:]


def test_a_reset_drops_what_waits_and_begins_anew(pairing: FrameSetPairing) -> None:
    add_all(pairing, [seen("C1", 9.0), seen("C2", 9.0)], 5.0)
    pairing.reset()
    assert pairing.counts.dropped_observations == 2
    frame_sets = add_all(pairing, [seen(camera, 1.0) for camera in CAMERAS], 6.0)
    assert [cameras_of(frame_set) for frame_set in frame_sets] == [CAMERAS]


def test_an_unknown_camera_is_refused_by_name(pairing: FrameSetPairing) -> None:
    with pytest.raises(ValueError, match=r"camera C7.*C1, C2, C3, C4"):
        pairing.add(seen("C7", 1.0), 5.0)
    with pytest.raises(ValueError, match="camera C7"):
        pairing.set_live(["C1", "C7"])


@st.composite
def arrivals(draw: st.DrawFn) -> list[tuple[float, Observation]]:
    """Pictures of four cameras with lost ones, jitter and delays of up to three periods."""
    period_s = draw(st.sampled_from([0.008, 0.010, 0.033]))
    coming = []
    for camera in CAMERAS:
        offset_s = draw(st.floats(0.0, 0.012))
        for number in range(draw(st.integers(0, 12))):
            if draw(st.integers(0, 9)) == 0:
                continue
            captured_at_s = number * period_s + offset_s + draw(st.floats(0.0, 0.003))
            delay_s = draw(st.floats(0.0, 3.0 * period_s))
            coming.append((captured_at_s + delay_s, seen(camera, captured_at_s, number)))
    newest_s: dict[str, float] = {}
    in_order = []
    for arrived_at_s, observation in sorted(coming, key=lambda one: one[0]):
        if observation.captured_at_s > newest_s.get(observation.camera, -1.0):
            newest_s[observation.camera] = observation.captured_at_s
            in_order.append((arrived_at_s, observation))
    return in_order


@given(arrivals())
def test_any_order_of_arrival_gives_sets_of_one_instant_in_order_of_time(
    coming: list[tuple[float, Observation]],
) -> None:
    pairing = FrameSetPairing(CAMERAS, PairingSettings(tolerance_ms=4.0, deadline_ms=15.0))
    frame_sets = [
        frame_set for now_s, observation in coming for frame_set in pairing.add(observation, now_s)
    ]
    frame_sets += pairing.due(math.inf)

    for frame_set in frame_sets:
        times_s = [observation.captured_at_s for observation in frame_set.observations]
        assert max(times_s) - min(times_s) <= TOLERANCE_S
        assert min(times_s) <= frame_set.captured_at_s <= max(times_s)
        assert list(cameras_of(frame_set)) == sorted(set(cameras_of(frame_set)))

    given_out = [observation for one in frame_sets for observation in one.observations]
    assert len(given_out) == len(set(map(id, given_out)))
    assert len(given_out) + pairing.counts.dropped_observations == len(coming)
    assert pairing.counts.sets == len(frame_sets)
    if pairing.counts.restarts == 0:
        times_s = [frame_set.captured_at_s for frame_set in frame_sets]
        assert times_s == sorted(set(times_s))


@given(arrivals())
def test_no_picture_waits_longer_than_the_deadline(
    coming: list[tuple[float, Observation]],
) -> None:
    pairing = FrameSetPairing(CAMERAS, PairingSettings(tolerance_ms=4.0, deadline_ms=15.0))
    waiting_since_s: dict[int, float] = {}
    for now_s, observation in coming:
        while pairing.next_due_at_s is not None and pairing.next_due_at_s <= now_s:
            due_at_s = pairing.next_due_at_s
            for frame_set in pairing.due(due_at_s):
                for given_out in frame_set.observations:
                    assert due_at_s - waiting_since_s[id(given_out)] <= DEADLINE_S + ROUNDING_S
        waiting_since_s[id(observation)] = now_s
        for frame_set in pairing.add(observation, now_s):
            for given_out in frame_set.observations:
                assert now_s - waiting_since_s[id(given_out)] <= DEADLINE_S + ROUNDING_S
