"""Someone works at the rig: cameras that are missing are told, and then it goes on."""

import signal
from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from cornertouchd.config import CamerasSettings, Settings
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.ports import CameraError
from cornertouchd.runtime import rig_watch
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.rig_watch import watch_rig
from cornertouchd.runtime.stop_signal import StopSignal
from cornertouchd.simulation.camera import (
    Fault,
    SimulatedCamera,
    SimulatedCameraPort,
    painted_ports,
)

CAMERAS = ("C1", "C2", "C3", "C4")
FORMAT = PictureFormat(8, 4, 0, 4)
BLANK = np.zeros((4, 8), np.uint8)
SETTINGS = Settings(cameras=CamerasSettings(source="simulated", read_timeout_s=0.1))
UNPLUGGED = "unplugged; plug it in and open it again"


class Rig:
    """Four cameras at 50 Hz, and what was told of them; after `tolerated` times all is mended."""

    def __init__(self, tolerated: int = 1) -> None:
        self.ports = painted_ports(
            dict.fromkeys(CAMERAS, FORMAT),
            dict.fromkeys(CAMERAS, lambda index, script_s: BLANK),
            MonotonicClock(),
            rate_hz=50.0,
        )
        self.told: list[list[str]] = []
        self._tolerated = tolerated

    def __getitem__(self, camera: str) -> SimulatedCameraPort:
        return self.ports[CAMERAS.index(camera)]

    def tell(self, errors: Sequence[CameraError]) -> None:
        self.told.append([str(error) for error in errors])
        if len(self.told) >= self._tolerated:
            for port in self.ports:
                port.fault = Fault.NONE


@pytest.fixture
def stop() -> Iterator[StopSignal]:
    with StopSignal() as signalled:
        yield signalled


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rig_watch, "LOOK_AGAIN_S", 0.01)


def cameras_of(frames: Sequence[Frame]) -> tuple[str, ...]:
    return tuple(frame.camera for frame in frames)


@pytest.mark.usefixtures("impatient")
def test_all_cameras_that_are_missing_are_told_at_once(stop: StopSignal) -> None:
    rig = Rig(tolerated=3)
    rig["C2"].fault = rig["C4"].fault = Fault.UNPLUGGED
    watch = watch_rig(rig.ports, SETTINGS, stop, rig.tell)
    assert cameras_of(next(watch)) == CAMERAS
    watch.close()
    assert rig.told == [[f"camera C2: {UNPLUGGED}", f"camera C4: {UNPLUGGED}"]] * 3


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize(
    ("fault", "text"),
    [(Fault.UNPLUGGED, UNPLUGGED), (Fault.STALLED, "no picture for 0.1 s")],
)
def test_one_that_is_lost_is_told_and_the_frame_sets_go_on(
    stop: StopSignal, fault: Fault, text: str
) -> None:
    rig = Rig()
    watch = watch_rig(rig.ports, SETTINGS, stop, rig.tell)
    before = [next(watch) for _ in range(3)]
    assert rig.told == []
    rig["C3"].fault = fault
    after = next(frames for frames in watch if rig.told)
    assert cameras_of(after) == CAMERAS
    assert after[0].captured_at_s > before[-1][0].captured_at_s
    assert rig.told == [[f"camera C3: {text}"]]
    watch.close()


@pytest.mark.usefixtures("impatient")
def test_a_driver_that_raises_anything_is_told_like_any_other(
    stop: StopSignal, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = Rig()

    def fail() -> SimulatedCamera:
        if rig.told:
            return SimulatedCamera(rig["C1"], MonotonicClock())
        raise ValueError("negative dimensions")

    monkeypatch.setattr(rig["C1"], "open", fail)
    watch = watch_rig(rig.ports, SETTINGS, stop, rig.tell)
    assert cameras_of(next(watch)) == CAMERAS
    watch.close()
    assert rig.told == [["camera C1: opening failed: negative dimensions"]]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_signal_ends_it(stop: StopSignal, number: signal.Signals) -> None:
    rig = Rig()
    watch = watch_rig(rig.ports, SETTINGS, stop, rig.tell)
    next(watch)
    signal.raise_signal(number)
    assert len(list(watch)) <= 1
    assert rig.told == []


def test_the_signal_ends_it_at_once_while_cameras_are_missing(
    stop: StopSignal, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long it would wait to look again."""
    monkeypatch.setattr(rig_watch, "LOOK_AGAIN_S", 3600.0)
    rig = Rig()
    rig["C1"].fault = Fault.UNPLUGGED
    told: list[int] = []

    def tell(errors: Sequence[CameraError]) -> None:
        told.append(len(errors))
        signal.raise_signal(signal.SIGINT)

    assert list(watch_rig(rig.ports, SETTINGS, stop, tell)) == []
    assert told == [1]


@pytest.mark.usefixtures("impatient")
def test_every_camera_is_closed_again(stop: StopSignal, monkeypatch: pytest.MonkeyPatch) -> None:
    """A device that stays open cannot be opened by the next try."""
    rig = Rig()
    open_now: list[str] = []

    class Counted(SimulatedCamera):
        def __init__(self, port: SimulatedCameraPort) -> None:
            super().__init__(port, MonotonicClock())
            self._name = port.id
            open_now.append(port.id)

        def close(self) -> None:
            super().close()
            if self._name in open_now:
                open_now.remove(self._name)

    for port in rig.ports:
        monkeypatch.setattr(port, "open", lambda port=port: Counted(port))
    watch = watch_rig(rig.ports, SETTINGS, stop, rig.tell)
    next(watch)
    rig["C2"].fault = Fault.STALLED
    next(frames for frames in watch if rig.told)
    assert sorted(open_now) == list(CAMERAS)
    watch.close()
    assert open_now == []
