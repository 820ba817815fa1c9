"""Each picture's lit mask is right or unknown, whatever is dropped, late or drifting."""

import random
from dataclasses import dataclass

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cornertouchd.runtime.lit_masks import FrameReports, MaskMatcher, MatchCounts
from cornertouchd.wire.ledframe_reports import FrameLit

PERIOD_S = 0.01
SIDES = (2, 4)  # a camera in the top-left corner sees right and bottom
AMBIENT, SIDES_IN_TURN = (15, 15, 15, 0), (1, 2, 4, 8)
PATTERNS = [(15,), (15, 0), AMBIENT, (15,) * 7 + (0,), SIDES_IN_TURN, (15, 1, 15, 2, 15, 4, 15, 8)]


@dataclass
class World:
    """A controller with its own clock, a line that is late, a camera that drops pictures."""

    masks: tuple[int, ...]
    seed: int = 1
    drift: float = 0.0
    jitter_s: float = 0.001
    stamp_s: float = 0.004
    stamp_jitter_s: float = 0.0005
    dropped: float = 0.01
    lost_reports: float = 0.0
    sun_grey: float = 10.0

    def __post_init__(self) -> None:
        self.random = random.Random(self.seed)
        self.reports = FrameReports(PERIOD_S)
        self.matcher = MaskMatcher(self.reports, SIDES)
        self.period_s = PERIOD_S * (1.0 + self.drift)
        self.number = 0
        self.now_s = 1000.0
        self.pending: list[tuple[float, int]] = []

    def lit_mask(self, number: int) -> int:
        return self.masks[number % len(self.masks)]

    def brightness(self, mask: int) -> list[float]:
        return [
            self.sun_grey + (140.0 if mask & side else 0.0) + self.random.gauss(0.0, 1.5)
            for side in SIDES
        ]

    def restart(self) -> None:
        self.number = 0

    def frame(self) -> tuple[int, int | None] | None:
        """Let one period pass; return true and told mask of its picture, None if it is dropped.

        The picture of a period arrives two periods after its begin.
        """
        number, began_s = self.number, self.now_s
        self.number += 1
        self.now_s += self.period_s
        if self.random.random() >= self.lost_reports:
            late_s = 0.0005 + self.random.random() * self.jitter_s
            self.reports.add(FrameLit(number, self.lit_mask(number), number * 10), began_s + late_s)
        if self.random.random() < self.dropped:
            return None
        jitter_s = self.random.uniform(-1.0, 1.0) * self.stamp_jitter_s
        captured_at_s = began_s + self.period_s + self.stamp_s + jitter_s
        self.pending.append((captured_at_s, self.lit_mask(number)))
        if len(self.pending) < 3:
            return None
        captured_at_s, mask = self.pending.pop(0)
        return mask, self.matcher.mask(captured_at_s, self.brightness(mask))

    def run(self, frames: int) -> list[tuple[int, int | None]]:
        return [told for told in (self.frame() for _ in range(frames)) if told is not None]


def wrong(told: list[tuple[int, int | None]]) -> list[tuple[int, int | None]]:
    return [(true, mask) for true, mask in told if mask is not None and mask != true]


@pytest.mark.parametrize("masks", PATTERNS)
@pytest.mark.parametrize("drift", [0.0, 0.004, -0.004])
def test_ten_thousand_frames_with_one_percent_dropped(masks: tuple[int, ...], drift: float) -> None:
    told = World(masks, drift=drift).run(10_000)
    assert not wrong(told)
    unknown = sum(mask is None for _, mask in told)
    assert unknown < 100, unknown


@settings(max_examples=40, deadline=None)
@example((15,), 0, 0.0, 0.0, 0.015625, 0.0, 0.0, 0.0, 0.0)  # pictures overtake their reports
@given(
    masks=st.sampled_from(PATTERNS),
    seed=st.integers(0, 2**31),
    drift=st.floats(-0.005, 0.005),
    jitter_s=st.floats(0.0, 0.003),
    stamp_s=st.floats(0.0, 0.018),
    stamp_jitter_s=st.floats(0.0, 0.002),
    dropped=st.floats(0.0, 0.2),
    lost_reports=st.floats(0.0, 0.1),
    sun_grey=st.floats(0.0, 100.0),
)
def test_a_mask_is_right_or_unknown(
    masks: tuple[int, ...],
    seed: int,
    drift: float,
    jitter_s: float,
    stamp_s: float,
    stamp_jitter_s: float,
    dropped: float,
    lost_reports: float,
    sun_grey: float,
) -> None:
    world = World(
        masks, seed, drift, jitter_s, stamp_s, stamp_jitter_s, dropped, lost_reports, sun_grey
    )
    told = world.run(1000)
    assert not wrong(told)
    known = sum(mask is not None for _, mask in told)
    assert known >= (1.0 - lost_reports * 2.0 - 0.2) * len(told) * 0.9


def test_a_constant_pattern_is_known_as_soon_as_a_few_frames_are() -> None:
    told = World((15,)).run(20)
    assert [mask for _, mask in told[5:]] == [15] * (len(told) - 5)


def test_a_restart_of_the_controller_is_followed() -> None:
    world = World(AMBIENT)
    world.run(500)
    world.restart()
    told = world.run(500)
    assert not wrong(told)
    assert sum(mask is None for _, mask in told) < 60


def test_without_reports_nothing_is_known() -> None:
    reports = FrameReports(PERIOD_S)
    matcher = MaskMatcher(reports, SIDES)
    assert matcher.mask(1000.0, (150.0, 150.0)) is None
    reports.add(FrameLit(1, 15, 10), 1000.0)
    assert matcher.mask(1005.0, (150.0, 150.0)) is None
    assert matcher.counts == MatchCounts(0, 2, 0)


def test_a_bright_picture_is_never_called_dark() -> None:
    world = World(AMBIENT)
    world.run(200)
    world.brightness = lambda mask: [150.0, 150.0]  # type: ignore[method-assign]
    told = world.run(100)
    assert all(mask != 0 for _, mask in told)
    assert world.matcher.counts.contradicting > 5


def test_dimmed_leds_stay_known() -> None:
    world = World(AMBIENT)
    world.run(200)
    bright = world.brightness
    world.brightness = lambda mask: [  # type: ignore[method-assign]
        10.0 + 0.4 * (grey - 10.0) for grey in bright(mask)
    ]
    told = world.run(300)
    assert [mask for _, mask in told] == [true for true, _ in told]


def test_a_controller_that_has_got_another_period_is_followed() -> None:
    world = World(AMBIENT)
    world.run(100)
    world.period_s = 0.02  # for a while it has not been set up anew
    world.run(100)
    world.period_s = PERIOD_S
    told = world.run(1000)
    assert not wrong(told[300:])
    assert sum(mask is None for _, mask in told[300:]) < 10
