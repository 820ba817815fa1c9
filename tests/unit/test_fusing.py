"""The fusion thread tells the sinks everything they must hear, whatever its stages do."""

import logging
import threading
from collections.abc import Callable, Iterator

import pytest

from cornertouchd.calibration.drift import Drift
from cornertouchd.config import PairingSettings
from cornertouchd.fusion.dirt import Dirt
from cornertouchd.fusion.pairing import FrameSetPairing
from cornertouchd.model import Contact, FrameSet, Observation, Shadow, Shadows, Touch, TouchFrame
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.fusing import FusionCounts, FusionStages, FusionThread
from cornertouchd.runtime.latest import Latest

CAMERAS = ("C1", "C2", "C3", "C4")
PATIENCE_S = 20.0


class RecordingSink:
    """Keeps what it is told; waits can be put on what it has heard."""

    def __init__(self) -> None:
        self._told = threading.Condition()
        self.frames: list[TouchFrame] = []
        self.lifts = self.ticks = self.closed = 0

    def send(self, frame: TouchFrame, now_s: float) -> None:
        with self._told:
            self.frames.append(frame)
            self._told.notify_all()

    def lift_all(self, now_s: float) -> None:
        with self._told:
            self.lifts += 1
            self._told.notify_all()

    def tick(self, now_s: float) -> None:
        with self._told:
            self.ticks += 1
            self._told.notify_all()

    def close(self) -> None:
        with self._told:
            self.closed += 1

    def wait_until(self, heard: Callable[["RecordingSink"], bool]) -> None:
        with self._told:
            assert self._told.wait_for(lambda: heard(self), PATIENCE_S)


class StubSurface:
    """One touch in every frame set; raises while `broken`."""

    def __init__(self) -> None:
        self.broken = self.drift_broken = False
        self.resets = 0
        self.drift: Drift | None = None
        self.dirt: tuple[Dirt, ...] = ()
        self.refused: tuple[Contact, ...] = ()

    def follow(self, frame_set: FrameSet) -> tuple[tuple[Contact, ...], tuple[Touch, ...]]:
        if self.broken:
            raise ZeroDivisionError("a stage's bug")
        return (), (Touch(1, 10.0, 20.0, 0.0, 0.0, 0.0),)

    def find_drift(self, *_: object) -> Drift | None:
        if self.drift_broken:
            raise ZeroDivisionError("a bug in the watch")
        return self.drift

    def reset(self) -> None:
        self.resets += 1


class Bench:
    def __init__(self) -> None:
        self.box = Latest[Observation]()
        self.sink, self.surface = RecordingSink(), StubSurface()
        self.clock = MonotonicClock()
        self.live = CAMERAS
        self.thread = FusionThread(
            self.stages_with(self.surface, self.sink),
            self.clock,
            lambda: self.live,
        )
        self.thread.start()

    def stages_with(self, surface: StubSurface, sink: RecordingSink) -> FusionStages:
        pairing = FrameSetPairing(CAMERAS, PairingSettings())
        return FusionStages(self.box, pairing, surface, [sink], CAMERAS)

    def wait_for_counts(self, reached: Callable[[FusionCounts], bool]) -> None:
        """Wait, from tick to tick, until the thread has counted so far."""
        for _ in range(1000):
            if reached(self.thread.counts()):
                return
            ticks = self.sink.ticks
            self.sink.wait_until(lambda sink, ticks=ticks: sink.ticks > ticks)
        raise AssertionError(self.thread.counts())

    def see(
        self, captured_at_s: float, cameras: tuple[str, ...] = CAMERAS, shadows: int = 0
    ) -> None:
        """Put what the cameras saw at a time."""
        seen = Shadows.of(Shadow(10.0 * k, 10.0 * k + 5.0, True, True, 0.9) for k in range(shadows))
        for camera in cameras:
            self.box.put(camera, Observation(camera, 0, captured_at_s, seen))


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.thread.stop()
    made.thread.join(5.0)


def test_a_frame_set_reaches_the_sink_at_the_time_of_its_pictures(bench: Bench) -> None:
    bench.see(7.25)
    bench.sink.wait_until(lambda sink: len(sink.frames) == 1)
    assert bench.sink.frames[0].captured_at_s == 7.25
    assert [touch.id for touch in bench.sink.frames[0].touches] == [1]


def test_the_time_that_it_took_and_ghosts_are_counted(bench: Bench) -> None:
    ghost = Contact(1.0, 2.0, 9.0, ("C1", "C2"), 0.2, 0.1)
    bench.surface.refused = (ghost, ghost)
    bench.see(bench.clock.now_s() - 0.033)
    bench.wait_for_counts(lambda counts: counts.frame_sets == 1)
    counts = bench.thread.counts()
    assert counts.ghosts == 2
    assert sum(counts.latency.counts) == 1
    assert counts.latency.sum_s >= 0.033
    moment = bench.thread.moment
    assert moment is not None
    assert moment.refused == (ghost, ghost)


def test_the_start_says_that_there_are_no_touches(bench: Bench) -> None:
    bench.sink.wait_until(lambda sink: sink.lifts == 1)


def test_sinks_tick_while_no_camera_sees_anything(bench: Bench) -> None:
    bench.sink.wait_until(lambda sink: sink.ticks >= 5)


def test_a_missing_camera_delays_but_does_not_stop(bench: Bench) -> None:
    bench.see(1.0, cameras=("C1", "C2", "C4"))
    bench.sink.wait_until(lambda sink: len(sink.frames) == 1)
    bench.wait_for_counts(lambda counts: counts.partial == 1)


def test_two_of_four_cameras_are_not_enough_to_refuse_ghosts(bench: Bench) -> None:
    bench.see(1.0, cameras=("C1", "C3"))
    bench.wait_for_counts(lambda counts: counts.skipped == 1)
    bench.see(1.1)
    bench.sink.wait_until(lambda sink: len(sink.frames) == 1)
    assert bench.sink.frames[0].captured_at_s == 1.1


@pytest.mark.parametrize("shadows", [0, 1])
def test_two_cameras_that_are_left_on_a_side_tell_a_touch_that_is_alone(
    bench: Bench, shadows: int
) -> None:
    bench.live = ("C2", "C3")
    bench.see(1.0, cameras=("C2", "C3"), shadows=shadows)
    bench.sink.wait_until(lambda sink: len(sink.frames) == 1)


@pytest.mark.parametrize(("left", "shadows"), [(("C2", "C3"), 2), (("C1", "C3"), 1)])
def test_two_cameras_that_are_left_tell_nothing_else(
    bench: Bench, left: tuple[str, ...], shadows: int
) -> None:
    bench.live = left
    bench.see(1.0, cameras=left, shadows=shadows)
    bench.wait_for_counts(lambda counts: counts.skipped == 1)


def test_two_late_cameras_of_four_are_waited_for_rather_than_done_without(bench: Bench) -> None:
    bench.see(1.0, cameras=("C1", "C2"), shadows=1)
    bench.wait_for_counts(lambda counts: counts.skipped == 1)


def test_silence_lifts_all_touches(bench: Bench) -> None:
    bench.see(1.0)
    bench.sink.wait_until(lambda sink: len(sink.frames) == 1)
    bench.sink.wait_until(lambda sink: sink.lifts == 2)
    assert bench.surface.resets == 1
    assert bench.thread.counts().touches_now == 0


def test_a_stage_that_raises_lifts_and_the_thread_goes_on(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        bench.see(1.0)
        bench.sink.wait_until(lambda sink: len(sink.frames) == 1)
        bench.surface.broken = True
        bench.see(1.01)
        bench.sink.wait_until(lambda sink: sink.lifts >= 2)
        bench.surface.broken = False
        for step in range(60):
            bench.see(1.02 + 0.01 * step)
            bench.sink.wait_until(lambda sink, step=step: len(sink.frames) == 2 + step)
    assert "a stage's bug" in caplog.text
    assert "works again" in caplog.text
    assert bench.thread.counts().faults >= 1


def test_a_drift_is_told_once_and_so_is_its_end(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    drift = Drift("C3", 0.7, 0.8, 0.0, 0.0)
    with caplog.at_level(logging.WARNING):
        for step, found in enumerate((None, drift, drift, drift, None, None)):
            bench.surface.drift = found
            bench.see(1.0 + 0.01 * step)
            bench.sink.wait_until(lambda sink, step=step: len(sink.frames) == 1 + step)
            bench.wait_for_counts(lambda counts, step=step: counts.touches_begun == 1)
            bench.sink.wait_until(lambda sink, ticks=bench.sink.ticks: sink.ticks > ticks)
            assert bench.thread.drift is found
    told = [record.message for record in caplog.records]
    assert told == [
        "camera C3 has moved about 0.8 mm; recalibrate",
        "touches fit the calibration again",
    ]


def test_dirt_is_told_when_it_is_found_and_when_it_is_gone(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    gum = Dirt("C2", 201.0, 206.0, 7.0, 60.0)
    for number, dirt in enumerate([(gum,), (gum,), ()]):
        bench.surface.dirt = dirt
        bench.see(7.0 + number)
        bench.sink.wait_until(lambda sink, sent=number + 1: len(sink.frames) == sent)
        bench.wait_for_counts(lambda counts, sets=number + 1: counts.frame_sets == sets)
    bench.see(20.0)
    bench.sink.wait_until(lambda sink: len(sink.frames) == 4)
    told = [record.message for record in caplog.records]
    assert told == [str(gum), "camera C2: the strip is clear again at columns 201..206"]
    assert bench.thread.dirt == ()


def test_a_watch_for_drift_that_raises_costs_no_touch(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    bench.sink.wait_until(lambda sink: sink.lifts == 1)
    bench.surface.drift_broken = True
    with caplog.at_level(logging.WARNING):
        bench.see(1.0)
        bench.wait_for_counts(lambda counts: counts.faults == 1)
    assert [touch.id for touch in bench.sink.frames[-1].touches] == [1]
    assert bench.surface.resets == 0
    assert "drift: not looked for: a bug in the watch" in caplog.text


def test_the_end_closes_the_sinks(bench: Bench) -> None:
    bench.thread.stop()
    bench.thread.join(5.0)
    assert bench.sink.closed == 1
