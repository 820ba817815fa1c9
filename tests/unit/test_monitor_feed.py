"""Whoever asks for what happens is told what is new, newest first lost, and no more."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from live_messages import ToldMoment, ToldStrip, read_message

from cornertouchd.model import Frame, FrameSet, Observation, Shadows
from cornertouchd.pipeline import PictureError
from cornertouchd.runtime.monitor_feed import STRIP_EVERY_S, LiveStream, MonitorFeed
from cornertouchd.vision.strip_view import StripView
from cornertouchd.wire.live import Moment

PIXELS = np.full((4, 8), 90, np.uint8)


class FakePipeline:
    """Shows a picture as it is."""

    refuses = False

    def show(self, frame: Frame) -> StripView:
        if self.refuses:
            raise PictureError("another size")
        column = np.ones(8)
        return StripView(
            frame.captured_at_s, frame.pixels, column, column > 0, column, column[:0], 1, 1, 0
        )


@dataclass
class FakeDaemon:
    """A daemon with two cameras, as far as the feed looks at it."""

    moment: Moment | None = None
    pictures: dict[str, Frame] = field(default_factory=dict)
    stages: Any = None

    def __post_init__(self) -> None:
        self.stages = self.new_stages()

    def new_stages(self) -> Any:
        return SimpleNamespace(
            ports=[SimpleNamespace(id="C1"), SimpleNamespace(id="C2")],
            calibration=SimpleNamespace(cameras=(), surface_mm=(350.0, 400.0)),
            settings=SimpleNamespace(crossing=SimpleNamespace(edge_sigma_px=0.1)),
            captures={name: SimpleNamespace(pipeline=FakePipeline()) for name in ("C1", "C2")},
            kept=SimpleNamespace(latest=self.pictures.get),
        )

    def capture(self, camera: str, at_s: float, lit_mask: int | None = 15) -> None:
        self.pictures[camera] = Frame(camera, 0, at_s, lit_mask, PIXELS)


def moment(at_s: float) -> Moment:
    seen = Observation("C1", 0, at_s, Shadows.of([]))
    return Moment(FrameSet(at_s, (seen,)), (), (), (), at_s + 0.004)


@pytest.fixture
def daemon() -> FakeDaemon:
    return FakeDaemon()


@pytest.fixture
def stream(daemon: FakeDaemon) -> LiveStream:
    return LiveStream(daemon)


def news(stream: LiveStream, now_s: float = 0.0, strips: bool = False) -> list[Any]:
    return [read_message(message) for message in stream.news(now_s, wants_strips=strips)]


def strips_of(told: list[Any]) -> list[tuple[int, float]]:
    return [(one.camera, one.captured_at_s) for one in told if isinstance(one, ToldStrip)]


def test_a_moment_is_told_once(daemon, stream):
    assert news(stream) == []
    daemon.moment = moment(1.0)
    (told,) = news(stream)
    assert isinstance(told, ToldMoment)
    assert told.latency_ms == pytest.approx(4.0, abs=1e-3)
    assert news(stream) == []
    daemon.moment = moment(2.0)
    daemon.moment = moment(3.0)
    assert [one.captured_at_s for one in news(stream)] == [3.0]


def test_strips_come_only_when_wanted_each_picture_once_and_not_too_often(daemon, stream):
    daemon.capture("C1", 1.0)
    daemon.capture("C2", 1.0)
    assert news(stream, 10.0) == []
    assert strips_of(news(stream, 10.0, strips=True)) == [(0, 1.0), (1, 1.0)]
    daemon.capture("C1", 1.01)
    assert news(stream, 10.0 + 0.5 * STRIP_EVERY_S, strips=True) == []
    assert strips_of(news(stream, 10.0 + STRIP_EVERY_S, strips=True)) == [(0, 1.01)]


@pytest.mark.parametrize("lit_mask", [0, 3])
def test_instead_of_a_dark_picture_the_next_lit_one_is_shown(daemon, stream, lit_mask):
    daemon.capture("C1", 1.0, lit_mask)
    assert news(stream, 10.0, strips=True) == []
    daemon.capture("C1", 1.01, None)
    assert strips_of(news(stream, 10.01, strips=True)) == [(0, 1.01)]


def test_a_picture_that_fits_no_longer_is_left_out(daemon, stream):
    daemon.capture("C1", 1.0)
    daemon.stages.captures["C1"].pipeline.refuses = True
    assert news(stream, 10.0, strips=True) == []


def test_another_configuration_is_followed(daemon, stream):
    daemon.stages = daemon.new_stages()
    daemon.stages.ports.reverse()
    daemon.capture("C1", 1.0)
    assert strips_of(news(stream, 10.0, strips=True)) == [(1, 1.0)]


class FakeClock:
    time_s = 5.0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        self.time_s = max(self.time_s, time_s)


class FakeAsker:
    """Asks for a second; wants strips from a half on."""

    def __init__(self, daemon: FakeDaemon, clock: FakeClock, request: dict[str, Any]) -> None:
        self.request = request
        self.told: list[Any] = []
        self._daemon, self._clock = daemon, clock
        self._wishes = [(5.5, {"strips": True}), (5.5, {"nonsense": 1}), (5.5, {"strips": True})]

    @property
    def has_enough(self) -> bool:
        self._daemon.moment = moment(self._clock.time_s)
        self._daemon.capture("C1", self._clock.time_s)
        return self._clock.time_s >= 6.0

    def further(self) -> list[dict[str, Any]]:
        due = [wish for at_s, wish in self._wishes if at_s <= self._clock.time_s]
        self._wishes = [one for one in self._wishes if one[0] > self._clock.time_s]
        return due

    def send(self, data: bytes) -> None:
        length = int.from_bytes(data[:4], "little")
        assert len(data) == 4 + length
        self.told.append(read_message(data[4:]))


def test_who_asks_is_told_sixty_moments_a_second_and_strips_from_when_he_wants_them(daemon):
    clock = FakeClock()
    asker = FakeAsker(daemon, clock, {"ask": "live", "strips": False})
    MonitorFeed(daemon, clock)(asker)
    assert 59 <= sum(isinstance(one, ToldMoment) for one in asker.told) <= 61
    strips = [one for one in asker.told if isinstance(one, ToldStrip)]
    assert 4 <= len(strips) <= 5
    assert all(one.captured_at_s >= 5.5 for one in strips)
