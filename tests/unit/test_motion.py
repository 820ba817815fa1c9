"""Cameras that take their pictures at different times agree about where a moving finger is."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from seen_discs import CORNERS, WIDTH_PX, Disc, observe, shadow_of, surface_pipeline

from cornertouchd.config import MotionSettings, Settings
from cornertouchd.fusion.motion import CommonTime
from cornertouchd.fusion.pairing import frame_set_of
from cornertouchd.model import FrameSet, Observation, Shadow, Shadows

PERIOD_S = 0.01
LATE_S = {"C1": 0.0, "C2": 0.0025, "C3": 0.005, "C4": 0.0075}
Discs = Sequence[Disc]


def common_time(*, carry_edges: bool = True) -> CommonTime:
    return CommonTime(MotionSettings(carry_edges=carry_edges), dict.fromkeys(CORNERS, WIDTH_PX))


def seen(camera: str, captured_at_s: float, *shadows: Shadow) -> Observation:
    return Observation(camera, 0, captured_at_s, Shadows.of(shadows))


def shadow(
    left: float, right: float, *, left_valid: bool = True, right_valid: bool = True
) -> Shadow:
    return Shadow(left, right, left_valid, right_valid, 1.0)


def carried(
    common: CommonTime, number: int, *shadows: Shadow, ahead_s: float = 0.004
) -> list[Shadow]:
    """Return the shadows of a camera that took its picture `ahead_s` before the common time."""
    now_s = number * PERIOD_S
    late = seen("C1", now_s - ahead_s, *shadows)
    frame_set = common.carry(FrameSet(now_s, (late, seen("C2", now_s))))
    return list(frame_set.observations[0].shadows)


def skewed(discs_at: Callable[[float], Discs], number: int, rng: np.random.Generator) -> FrameSet:
    return frame_set_of(
        observe(camera, discs_at(time_s), time_s, rng=rng)
        for camera, late_s in LATE_S.items()
        for time_s in [number * PERIOD_S + late_s]
    )


def circling(speed_mm_s: float, radius_mm: float = 60.0) -> Callable[[float], Discs]:
    def discs_at(time_s: float) -> Discs:
        angle = speed_mm_s / radius_mm * time_s
        return [(175.0 + radius_mm * np.cos(angle), 200.0 + radius_mm * np.sin(angle), 6.0)]

    return discs_at


class TestCarriedEdges:
    def test_pictures_of_one_time_are_left_alone(self) -> None:
        common = common_time()
        for number in range(4):
            at_once = frame_set_of(
                seen(camera, number * PERIOD_S, shadow(100.0 + 5 * number, 120.0 + 5 * number))
                for camera in CORNERS
            )
            assert common.carry(at_once) is at_once

    def test_the_setting_turns_it_off(self) -> None:
        common, discs_at = common_time(carry_edges=False), circling(500.0)
        for number in range(4):
            apart = skewed(discs_at, number, np.random.default_rng(1))
            assert common.carry(apart) is apart

    @pytest.mark.parametrize("ahead_s", [-0.004, -0.001, 0.001, 0.004])
    def test_edges_go_where_they_are_at_the_common_time(self, ahead_s: float) -> None:
        common, speed_px_s = common_time(), 900.0
        for number in range(5):
            moved_px = 200.0 + speed_px_s * (number * PERIOD_S - ahead_s)
            (one,) = carried(common, number, shadow(moved_px, moved_px + 14.0), ahead_s=ahead_s)
        assert one.left_px == pytest.approx(200.0 + speed_px_s * 4 * PERIOD_S, abs=0.01)
        assert one.right_px == pytest.approx(214.0 + speed_px_s * 4 * PERIOD_S, abs=0.01)
        assert one.left_valid
        assert one.right_valid

    def test_the_first_picture_of_a_finger_is_left_alone(self) -> None:
        common = common_time()
        carried(common, 0)
        assert carried(common, 1, shadow(100.0, 120.0)) == [shadow(100.0, 120.0)]

    def test_a_still_finger_does_not_jitter_more(self) -> None:
        rng, common = np.random.default_rng(3), common_time()
        given_px, carried_px = [], []
        for number in range(400):
            given_px.append(300.0 + rng.normal(0.0, 0.1))
            (one,) = carried(common, number, shadow(given_px[-1], 320.0 + rng.normal(0.0, 0.1)))
            carried_px.append(one.left_px)
        assert np.std(carried_px[5:]) < 1.15 * np.std(given_px[5:])

    def test_edges_go_on_through_a_merger(self) -> None:
        """One finger's shadow runs into that of another, which rests."""
        common = common_time()
        for number in range(8):
            runs = 100.0 + 8.0 * (number - 0.4)
            both = (
                [shadow(runs, runs + 20.0), shadow(150.0, 170.0)]
                if runs + 20.0 < 148.0
                else [shadow(runs, 170.0)]
            )
            found = carried(common, number, *both)
            assert found[0].left_px == pytest.approx(100.0 + 8.0 * number - 3.2 * (number < 1))
            assert found[-1].right_px == pytest.approx(170.0)

    def test_an_edge_without_a_clear_partner_is_not_moved(self) -> None:
        common = common_time()
        carried(common, 0, shadow(100.0, 160.0))
        comb = [shadow(110.0, 118.0), shadow(125.0, 133.0), shadow(140.0, 148.0)]
        assert carried(common, 1, *comb)[1] == comb[1]

    def test_a_leap_is_no_motion(self) -> None:
        common = common_time()
        carried(common, 0, shadow(100.0, 120.0))
        assert carried(common, 1, shadow(300.0, 320.0)) == [shadow(300.0, 320.0)]

    def test_what_leaves_the_picture_ends_at_its_border(self) -> None:
        common = common_time()
        for number in range(4):
            left = 625.0 + 4.0 * number
            right_valid = left + 6.0 < WIDTH_PX
            one = shadow(left, min(left + 6.0, 640.0), right_valid=right_valid)
            (found,) = carried(common, number, one)
        assert (found.left_px, found.right_px) == (pytest.approx(638.6), WIDTH_PX)
        assert found.left_valid
        assert not found.right_valid
        assert one.left_px < found.left_px

    def test_an_edge_at_the_border_stays_there(self) -> None:
        common = common_time()
        for number in range(4):
            (found,) = carried(common, number, shadow(0.0, 30.0 + 5.0 * number, left_valid=False))
        assert found == shadow(0.0, pytest.approx(47.0), left_valid=False)

    def test_shadows_that_meet_on_the_way_lose_their_inner_edges(self) -> None:
        common = common_time()
        for number in range(4):
            step = 10.0 * number
            first, second = carried(
                common,
                number,
                shadow(100.0 + step, 120.0 + step),
                shadow(185.0 - step, 205.0 - step),
            )
        assert first.left_px == pytest.approx(134.0)
        assert second.right_px == pytest.approx(171.0)
        assert first.right_px == second.left_px
        assert (first.left_valid, first.right_valid) == (True, False)
        assert (second.left_valid, second.right_valid) == (False, True)

    @pytest.mark.parametrize("pause_s", [0.5, -0.2])
    def test_after_a_pause_or_a_jump_back_nothing_is_known(self, pause_s: float) -> None:
        common = common_time()
        for number in range(3):
            carried(common, number, shadow(100.0 + 5.0 * number, 120.0 + 5.0 * number))
        one = shadow(112.0, 132.0)
        assert carried(common, 3 + round(pause_s / PERIOD_S), one) == [one]

    def test_after_a_reset_nothing_is_known(self) -> None:
        common = common_time()
        for number in range(3):
            carried(common, number, shadow(100.0 + 5.0 * number, 120.0 + 5.0 * number))
        common.reset()
        assert carried(common, 3, shadow(115.0, 135.0)) == [shadow(115.0, 135.0)]

    def test_it_carries_on_when_the_cameras_fall_out_of_step(self) -> None:
        common = common_time()
        for number in range(3):
            carried(common, number, shadow(100.0 + 5.0 * number, 120.0 + 5.0 * number), ahead_s=0.0)
        (one,) = carried(common, 3, shadow(113.0, 133.0))
        assert one.left_px == pytest.approx(115.1, abs=0.2)


columns = st.lists(st.floats(0.0, 640.0), max_size=16, unique=True).map(sorted)


@settings(max_examples=60)
@given(
    st.lists(st.tuples(columns, st.randoms(use_true_random=False)), min_size=2, max_size=4),
    st.floats(-0.005, 0.005),
)
def test_whatever_is_seen_stays_in_order_and_in_the_picture(
    pictures: Sequence[tuple[list[float], "np.random.Generator"]], ahead_s: float
) -> None:
    common = common_time()
    for number, (edges, random) in enumerate(pictures):
        given_shadows = [
            shadow(a, b, left_valid=random.random() < 0.8, right_valid=random.random() < 0.8)
            for a, b in zip(edges[::2], edges[1::2], strict=False)
        ]
        found = carried(common, number, *given_shadows, ahead_s=ahead_s)
        assert len(found) == len(given_shadows)
        ends = [edge for one in found for edge in (one.left_px, one.right_px)]
        assert ends == sorted(ends)
        assert all(0.0 <= edge <= WIDTH_PX for edge in ends)
        for one, before in zip(found, given_shadows, strict=True):
            assert one.left_valid <= before.left_valid
            assert one.right_valid <= before.right_valid


class TestTouches:
    def errors_mm(
        self, discs_at: Callable[[float], Discs], *, carry_edges: bool, count: int = 40
    ) -> list[float]:
        """Return how far the contact is from the finger, inf where there is not just one."""
        pipeline = surface_pipeline(Settings(motion=MotionSettings(carry_edges=carry_edges)))
        rng, errors = np.random.default_rng(2), []
        for number in range(count):
            frame_set = skewed(discs_at, number, rng)
            contacts, _ = pipeline.follow(frame_set)
            x, y, _ = discs_at(frame_set.captured_at_s)[0]
            off = [np.hypot(one.x_mm - x, one.y_mm - y) for one in contacts]
            errors.append(float(off[0]) if len(off) == 1 else np.inf)
        return errors[3:]

    @pytest.mark.parametrize(("speed_mm_s", "within_mm"), [(500.0, 0.3), (1000.0, 0.5)])
    def test_a_quick_finger_is_where_it_is(self, speed_mm_s: float, within_mm: float) -> None:
        assert max(self.errors_mm(circling(speed_mm_s), carry_edges=True)) < within_mm
        assert np.median(self.errors_mm(circling(speed_mm_s), carry_edges=False)) > 3 * within_mm

    def test_each_frame_set_on_its_own_is_taken_as_it_is(self) -> None:
        pipeline, rng = surface_pipeline(), np.random.default_rng(2)
        for number in range(4):
            frame_set = skewed(circling(500.0), number, rng)
            pipeline.follow(frame_set)
        assert pipeline.cross(frame_set) == surface_pipeline().cross(frame_set)


def test_the_scenes_move_as_they_say() -> None:
    left, right = shadow_of("C1", circling(500.0)(0.0)[0])
    assert 0.0 < left < right < WIDTH_PX
