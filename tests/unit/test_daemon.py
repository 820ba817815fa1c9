"""The whole daemon on the simulated rig, while its cameras vanish, stall and send garbage."""

import logging
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.config import CamerasSettings, Settings
from cornertouchd.model import TouchFrame
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.camera import (
    Fault,
    SimulatedCameraPort,
    painted_ports,
    rig_ports,
)
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.painting import painter
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import TimedFinger

PATIENCE_S = 30.0
FINGERS = (Finger(120.0, 150.0, 11.0), Finger(240.0, 280.0, 12.0))
SETTINGS = Settings(
    cameras=CamerasSettings(
        source="simulated",
        rate_hz=40.0,
        read_timeout_s=0.1,
        failures_before_reopen=3,
        reopen_delay_s=0.1,
        reopen_delay_max_s=0.2,
    )
)


class ListeningSink:
    """Knows what a client would show; waits can be put on it."""

    def __init__(self) -> None:
        self._told = threading.Condition()
        self.places: list[tuple[float, float]] = []
        self.most = 0
        self.frames = 0
        self.closed = False

    def send(self, frame: TouchFrame, now_s: float) -> None:
        self._show([(touch.x_mm, touch.y_mm) for touch in frame.touches])

    def lift_all(self, now_s: float) -> None:
        self._show([])

    def tick(self, now_s: float) -> None:
        pass

    def close(self) -> None:
        self._show([])
        self.closed = True

    def _show(self, places: list[tuple[float, float]]) -> None:
        with self._told:
            self.places = places
            self.most = max(self.most, len(places))
            self.frames += 1
            self._told.notify_all()

    def wait_until(self, seen: Callable[["ListeningSink"], bool]) -> None:
        with self._told:
            assert self._told.wait_for(lambda: seen(self), PATIENCE_S), self.places

    def wait_for_frames(self, count: int) -> None:
        until = self.frames + count
        self.wait_until(lambda sink: sink.frames >= until)


def both_fingers(sink: ListeningSink) -> bool:
    return len(sink.places) == 2 and all(
        any(abs(x - f.x_mm) < 1.0 and abs(y - f.y_mm) < 1.0 for x, y in sink.places)
        for f in FINGERS
    )


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig((350.0, 400.0), seed=4)


@pytest.fixture(scope="module")
def calibration(rig: SimulatedRig) -> Calibration:
    return calibrate_rig(rig, SETTINGS)


Running = tuple[ListeningSink, dict[str, SimulatedCameraPort], Daemon]


def one_finger(sink: ListeningSink) -> bool:
    return len(sink.places) == 1 and all(
        abs(x - FINGERS[0].x_mm) < 1.0 and abs(y - FINGERS[0].y_mm) < 1.0 for x, y in sink.places
    )


@pytest.fixture
def fingers() -> list[Finger]:
    """What touches now; tests take fingers away and put them back."""
    return list(FINGERS)


@pytest.fixture
def running(
    rig: SimulatedRig, calibration: Calibration, fingers: list[Finger]
) -> Iterator[Running]:
    clock = MonotonicClock()

    def held(_: float) -> tuple[TimedFinger, ...]:
        return tuple(TimedFinger(k, finger) for k, finger in enumerate(list(fingers)))

    ports = rig_ports(rig, held, clock, SETTINGS.cameras.rate_hz)
    sink = ListeningSink()
    daemon = Daemon(ports, calibration, [sink], SETTINGS, clock)
    daemon.start()
    sink.wait_until(both_fingers)
    yield sink, {port.id: port for port in ports}, daemon
    daemon.stop()


def test_the_end_lifts_all_touches(running: Running) -> None:
    sink, _, daemon = running
    daemon.stop()
    assert sink.closed
    assert sink.places == []


@pytest.mark.parametrize("fault", [Fault.UNPLUGGED, Fault.STALLED, Fault.GARBLED])
def test_three_cameras_carry_on_and_the_fourth_comes_back(
    running: Running, fault: Fault, caplog: pytest.LogCaptureFixture
) -> None:
    sink, ports, daemon = running
    with caplog.at_level(logging.WARNING):
        ports["C2"].fault = fault
        sink.wait_for_frames(60)
        sink.wait_until(both_fingers)
        ports["C2"].fault = Fault.NONE
        frames = daemon.camera_counts()["C2"].frames
        sink.wait_until(lambda _: daemon.camera_counts()["C2"].frames > frames + 5)
        sink.wait_until(both_fingers)
    assert "camera C2" in caplog.text
    assert sink.most == 2


def test_two_of_four_cameras_tell_no_touches_rather_than_ghosts(running: Running) -> None:
    sink, ports, _ = running
    ports["C2"].fault = ports["C3"].fault = Fault.UNPLUGGED
    sink.wait_until(lambda seen: seen.places == [])
    ports["C2"].fault = Fault.NONE
    sink.wait_until(both_fingers)
    assert sink.most == 2


def test_a_touch_that_is_alone_goes_on_with_two_cameras_of_one_side(
    running: Running, fingers: list[Finger], caplog: pytest.LogCaptureFixture
) -> None:
    sink, ports, _ = running
    with caplog.at_level(logging.WARNING):
        ports["C3"].fault = ports["C4"].fault = Fault.UNPLUGGED
        sink.wait_until(lambda seen: seen.places == [])
        fingers.pop()
        sink.wait_until(one_finger)
        sink.wait_for_frames(10)
        assert one_finger(sink)
        fingers.append(FINGERS[1])  # where there could be ghosts, nothing is told
        sink.wait_until(lambda seen: seen.places == [])
        ports["C3"].fault = Fault.NONE
        sink.wait_until(both_fingers)
    assert sink.most == 2


def test_without_cameras_there_are_no_touches_until_they_return(running: Running) -> None:
    sink, ports, _ = running
    for port in ports.values():
        port.fault = Fault.UNPLUGGED
    sink.wait_until(lambda seen: seen.places == [])
    for port in ports.values():
        port.fault = Fault.NONE
    sink.wait_until(both_fingers)
    assert sink.most == 2


def test_a_rig_that_was_not_calibrated_so_is_refused(calibration: Calibration) -> None:
    other = SimulatedRig((350.0, 400.0), width_px=1280, height_px=720, seed=4)
    clock = MonotonicClock()
    ports = rig_ports(other, lambda _: (), clock, 40.0)
    with pytest.raises(CalibrationError, match=r"C1: gives pictures of 1280x720"):
        Daemon(ports, calibration, [], SETTINGS, clock)


def test_cameras_whose_cables_were_exchanged_are_refused(
    rig: SimulatedRig, calibration: Calibration
) -> None:
    clock = MonotonicClock()
    paints = {camera: painter(rig, lambda _: (), camera) for camera in rig.formats}
    known = replace(
        calibration,
        cameras=tuple(replace(c, identity=f"kiosk {c.id}") for c in calibration.cameras),
    )
    same = painted_ports(rig.formats, paints, clock, rig_name="kiosk")
    Daemon(same, known, [], SETTINGS, clock)
    others = painted_ports(rig.formats, paints, clock, rig_name="another kiosk")
    with pytest.raises(CalibrationError, match=r"C1: is another camera .*cables exchanged"):
        Daemon(others, known, [], SETTINGS, clock)
