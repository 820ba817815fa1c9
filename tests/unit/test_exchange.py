"""A daemon that gets another configuration loses no frame set and leaves no touch behind.

Its cameras give a picture when the test feeds one, so that every frame set can be counted.
"""

import queue
import threading
from collections.abc import Callable, Iterator

import pytest

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import (
    CamerasSettings,
    PairingSettings,
    RuntimeSettings,
    Settings,
    TrackingSettings,
)
from cornertouchd.model import Frame, PictureFormat, TouchFrame
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon, DaemonStages, make_stages
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

PATIENCE_S = 30.0
FINGER = Finger(120.0, 150.0, 11.0)
SETTINGS = Settings(
    cameras=CamerasSettings(source="simulated", read_timeout_s=3.0),
    pairing=PairingSettings(deadline_ms=1000.0),  # a busy machine is slow, not wrong
    runtime=RuntimeSettings(realtime_priority=0),
)
OTHERWISE_TRACKED = SETTINGS.model_copy(update={"tracking": TrackingSettings(smoothing=False)})


class FedPort:
    """A camera that shows what it is fed."""

    identity = ""

    def __init__(self, camera_id: str, form: PictureFormat) -> None:
        self.id, self.format = camera_id, form
        self.pictures: queue.Queue[Frame] = queue.Queue()
        self.opened = self.closed = 0
        self._is_reading = False

    def open(self) -> "FedPort":
        self.opened += 1
        return self

    def read(self, timeout_s: float) -> Frame | None:
        if self._is_reading:  # what was read before has been dealt with
            self._is_reading = False
            self.pictures.task_done()
        try:
            picture = self.pictures.get(timeout=timeout_s)
        except queue.Empty:
            return None
        self._is_reading = True
        return picture

    def close(self) -> None:
        self.closed += 1


class CountingSink:
    """Keeps every frame that it is told; waits can be put on it."""

    def __init__(self) -> None:
        self._told = threading.Condition()
        self.frames: list[TouchFrame] = []
        self.shown: tuple[int, ...] = ()
        self.lifted_ids: list[tuple[int, ...]] = []
        self.closed = False

    def send(self, frame: TouchFrame, now_s: float) -> None:
        with self._told:
            self.frames.append(frame)
            self.shown = tuple(touch.id for touch in frame.touches)
            self._told.notify_all()

    def lift_all(self, now_s: float) -> None:
        with self._told:
            self.lifted_ids += [self.shown] if self.shown else []
            self.shown = ()

    def tick(self, now_s: float) -> None:
        pass

    def close(self) -> None:
        self.lift_all(0.0)
        with self._told:
            self.closed = True
            self._told.notify_all()

    def wait_until(self, told: Callable[["CountingSink"], bool]) -> None:
        with self._told:
            assert self._told.wait_for(lambda: told(self), PATIENCE_S), len(self.frames)


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig((350.0, 400.0), seed=4)


@pytest.fixture(scope="module")
def calibration(rig: SimulatedRig) -> Calibration:
    return calibrate_rig(rig, SETTINGS)


class Kiosk:
    """A daemon on cameras that are fed, a finger always down."""

    def __init__(self, rig: SimulatedRig, calibration: Calibration) -> None:
        self.calibration = calibration
        self.ports = {camera: FedPort(camera, form) for camera, form in rig.formats.items()}
        self.sink = CountingSink()
        self._rig, self._set = rig, 0
        clock = MonotonicClock()
        self.daemon = Daemon(tuple(self.ports.values()), calibration, (self.sink,), SETTINGS, clock)
        self.daemon.start()

    def feed(self, cameras: tuple[str, ...] = ("C1", "C2", "C3", "C4")) -> float:
        """Take the next picture with these cameras; return its time."""
        for frame in self._rig.frame_set(self._set, self._set / 100, (FINGER,)):
            if frame.camera in cameras and frame.camera in self.ports:
                self.ports[frame.camera].pictures.put(frame)
        self._set += 1
        return (self._set - 1) / 100

    def wake(self) -> None:
        """Feed the pictures with which cameras come to life, each when it does: no frame set."""
        self.feed()
        for port in self.ports.values():
            port.pictures.join()

    def exchange_while_fed(self, stages: DaemonStages, gone: FedPort) -> None:
        """Exchange while pictures go on to come, from the camera that goes too."""
        exchanging = threading.Thread(target=self.daemon.exchange, args=(stages,))
        exchanging.start()
        while exchanging.is_alive():
            time_s = self.feed()
            gone.pictures.put(self._rig.frame_set(self._set, time_s, ())[0])
            exchanging.join(0.02)

    def show(self, frame_sets: int, sink: CountingSink | None = None) -> None:
        """Feed frame sets one after the other, each when the one before has been told."""
        sink = sink or self.sink
        if not all(counts.live for counts in self.daemon.camera_counts().values()):
            self.wake()
        for _ in range(frame_sets):
            time_s = self.feed()
            sink.wait_until(
                lambda heard, time_s=time_s: (
                    bool(heard.frames) and heard.frames[-1].captured_at_s >= time_s
                )
            )

    def stages(
        self, settings: Settings = OTHERWISE_TRACKED, sink: CountingSink | None = None
    ) -> DaemonStages:
        ports = tuple(self.ports.values())
        return make_stages(ports, self.calibration, (sink or self.sink,), settings)


@pytest.fixture
def kiosk(rig: SimulatedRig, calibration: Calibration) -> Iterator[Kiosk]:
    made = Kiosk(rig, calibration)
    made.show(20)
    yield made
    made.feed()
    made.daemon.stop()


def test_no_frame_set_is_lost_between_two_configurations(kiosk: Kiosk) -> None:
    configurations = [kiosk.stages() for _ in range(5)]
    kiosk.show(1)
    before = kiosk.daemon.fusion_counts().frame_sets
    for stages in configurations:
        kiosk.daemon.exchange(stages)
        kiosk.show(10)
    times = [round(100 * frame.captured_at_s) for frame in kiosk.sink.frames[-51:]]
    assert times == list(range(times[0], times[0] + 51))
    assert kiosk.daemon.fusion_counts().frame_sets == before + 50


def test_cameras_stay_open_and_touches_are_lifted_before_they_begin_anew(kiosk: Kiosk) -> None:
    (former,) = kiosk.sink.shown
    kiosk.daemon.exchange(kiosk.stages())
    kiosk.show(20)
    assert kiosk.sink.lifted_ids == [(former,)]
    assert len(kiosk.sink.shown) == 1
    touch = kiosk.sink.frames[-1].touches[0]
    assert (touch.x_mm, touch.y_mm) == pytest.approx((FINGER.x_mm, FINGER.y_mm), abs=1.0)
    assert all((port.opened, port.closed) == (1, 0) for port in kiosk.ports.values())


def test_a_frame_set_torn_by_the_exchange_invents_nothing(kiosk: Kiosk) -> None:
    stages = kiosk.stages()
    kiosk.feed(("C1", "C3"))
    kiosk.daemon.exchange(stages)
    kiosk.show(20)
    assert all(len(frame.touches) <= 1 for frame in kiosk.sink.frames)
    assert len(kiosk.sink.shown) == 1


def test_touches_go_on_to_other_receivers_and_end_at_the_former(kiosk: Kiosk) -> None:
    (touch,) = kiosk.sink.shown
    other = CountingSink()
    kiosk.daemon.exchange(kiosk.daemon.stages.with_sinks((other,), SETTINGS))
    kiosk.show(5, other)
    assert kiosk.sink.closed
    assert kiosk.sink.shown == ()
    assert other.shown == (touch,)
    assert len(other.frames) == 5


def test_a_camera_with_another_port_is_closed_and_opened(kiosk: Kiosk) -> None:
    former = kiosk.ports["C2"]
    kiosk.ports["C2"] = FedPort("C2", former.format)
    kiosk.exchange_while_fed(kiosk.stages(), former)
    assert former.closed == 1
    kiosk.show(20)
    assert kiosk.ports["C2"].opened == 1
    assert kiosk.ports["C1"].opened == 1
    assert len(kiosk.sink.shown) == 1


def test_a_camera_that_is_taken_out_is_closed_and_three_go_on(kiosk: Kiosk) -> None:
    former = kiosk.ports.pop("C4")
    kiosk.exchange_while_fed(kiosk.stages(), former)
    assert former.closed == 1
    assert set(kiosk.daemon.camera_counts()) == {"C1", "C2", "C3"}
    kiosk.show(20)
    assert len(kiosk.sink.shown) == 1


def test_the_end_comes_as_well_after_an_exchange(kiosk: Kiosk) -> None:
    kiosk.daemon.exchange(kiosk.stages())
    kiosk.show(1)
    kiosk.daemon.stop()
    assert kiosk.sink.closed
