"""Simulated cameras behind the camera port: pacing, skipping and faults, on a simulated clock."""

from functools import cache

import numpy as np
import pytest

from cornertouchd.model import Frame
from cornertouchd.ports import Camera, CameraError, CameraPort, Clock
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.simulation.camera import Fault, SimulatedCameraPort, rig_ports
from cornertouchd.simulation.clock import SimulatedClock
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import TimedFinger, drag

START_S = 5000.0
RATE_HZ = 100.0


@cache
def rig() -> SimulatedRig:
    return SimulatedRig(width_px=160, height_px=120, rows_px=24)


def ports(clock: Clock, speed: float = 1.0) -> tuple[SimulatedCameraPort, ...]:
    script = drag((60.0, 60.0), (290.0, 340.0), speed_mm_s=100.0)
    return rig_ports(rig(), script, clock, RATE_HZ, speed)


def read(camera: Camera, timeout_s: float = 0.5) -> Frame:
    frame = camera.read(timeout_s)
    assert frame is not None
    return frame


@pytest.mark.parametrize("clock", [SimulatedClock(START_S), MonotonicClock()], ids=["fake", "real"])
def test_the_simulated_clock_keeps_the_promises_of_the_real_one(clock: Clock) -> None:
    before_s = clock.now_s()
    clock.sleep_until(before_s - 10.0)
    assert clock.now_s() >= before_s
    clock.sleep_until(before_s + 0.002)
    assert clock.now_s() >= before_s + 0.002


def test_a_port_names_its_camera_and_its_format() -> None:
    opened: tuple[CameraPort, ...] = ports(SimulatedClock(START_S))
    assert [port.id for port in opened] == ["C1", "C2", "C3", "C4"]
    assert [port.format for port in opened] == list(rig().formats.values())


def test_pictures_come_at_the_rate_and_are_stamped_when_they_were_taken() -> None:
    clock = SimulatedClock(START_S)
    camera = ports(clock)[0].open()
    for sequence in range(5):
        frame = read(camera)
        assert (frame.camera, frame.sequence, frame.lit_mask) == ("C1", sequence, 15)
        assert frame.captured_at_s == pytest.approx(START_S + sequence / RATE_HZ)
        assert clock.now_s() == pytest.approx(frame.captured_at_s)


def test_all_cameras_share_their_instants_and_show_the_same_fingers() -> None:
    asked_s = []

    def script(t_s: float) -> tuple[TimedFinger, ...]:
        asked_s.append(t_s)
        return ()

    clock = SimulatedClock(START_S)
    opened = [port.open() for port in rig_ports(rig(), script, clock, RATE_HZ)]
    clock.sleep_until(START_S + 0.0712)
    frames = [read(camera) for camera in opened]
    assert {frame.captured_at_s for frame in frames} == {START_S + 0.07}
    assert {frame.sequence for frame in frames} == {7}
    assert asked_s == [0.07] * 4


def test_a_late_reader_skips_pictures_and_can_see_how_many() -> None:
    clock = SimulatedClock(START_S)
    camera = ports(clock)[0].open()
    assert read(camera).sequence == 0
    clock.sleep_until(START_S + 0.0575)
    assert read(camera).sequence == 5
    assert read(camera).sequence == 6


def test_no_picture_is_lost_or_doubled_by_rounding_after_weeks() -> None:
    clock = SimulatedClock(START_S)
    camera = ports(clock)[0].open()
    clock.sleep_until(START_S + 3_000_000.0)
    first = read(camera).sequence
    assert [read(camera).sequence - first for _ in range(50)] == list(range(1, 51))


def test_a_reader_without_patience_gets_nothing_until_the_picture_is_due() -> None:
    clock = SimulatedClock(START_S)
    camera = ports(clock)[0].open()
    assert read(camera).sequence == 0
    assert camera.read(timeout_s=0.004) is None
    assert clock.now_s() == pytest.approx(START_S + 0.004)
    assert camera.read(timeout_s=0.004) is None
    assert read(camera, timeout_s=0.004).sequence == 1


def test_opened_again_a_camera_goes_on_with_new_pictures_only() -> None:
    clock = SimulatedClock(START_S)
    port = ports(clock)[0]
    camera = port.open()
    clock.sleep_until(START_S + 0.123)
    assert read(camera).sequence == 12
    camera.close()
    camera.close()
    with pytest.raises(CameraError, match="camera C1: closed; open it again"):
        camera.read(0.1)
    assert read(port.open()).sequence == 13


def test_speed_changes_what_is_shown_and_not_how_often() -> None:
    clock = SimulatedClock(START_S)
    fast, normal = (ports(clock, speed)[0].open() for speed in (4.0, 1.0))
    clock.sleep_until(START_S + 0.2)
    shown = read(fast)
    clock.sleep_until(START_S + 0.8)
    reached = read(normal)
    assert (shown.sequence, reached.sequence) == (20, 80)
    apart = np.abs(shown.pixels.astype(int) - reached.pixels.astype(int))
    assert np.max(apart) < 25, "the same fingers but for the noise"
    clock.sleep_until(START_S + 1.0)
    moved = np.abs(read(normal).pixels.astype(int) - reached.pixels.astype(int))
    assert np.max(moved) > 40


def test_an_unplugged_camera_fails_and_comes_back() -> None:
    clock = SimulatedClock(START_S)
    port, other = ports(clock)[:2]
    camera, neighbour = port.open(), other.open()
    assert read(camera).sequence == 0
    port.fault = Fault.UNPLUGGED
    with pytest.raises(CameraError, match="camera C1: unplugged"):
        camera.read(0.5)
    with pytest.raises(CameraError, match="camera C1: unplugged"):
        port.open()
    assert read(neighbour).camera == "C2"
    port.fault = Fault.NONE
    clock.sleep_until(START_S + 1.0)
    assert read(port.open()).sequence == 100


def test_a_stalled_camera_sends_nothing_until_the_timeout_and_recovers_by_itself() -> None:
    clock = SimulatedClock(START_S)
    port = ports(clock)[0]
    camera = port.open()
    port.fault = Fault.STALLED
    assert camera.read(timeout_s=0.25) is None
    assert clock.now_s() == pytest.approx(START_S + 0.25)
    port.fault = Fault.NONE
    assert read(camera).sequence == 25


def test_a_garbled_camera_sends_noise_of_the_right_size() -> None:
    clock = SimulatedClock(START_S)
    port = ports(clock)[0]
    camera = port.open()
    port.fault = Fault.GARBLED
    frame = read(camera)
    assert frame.pixels.shape == (port.format.rows_px, port.format.width_px)
    assert frame.pixels.dtype == np.uint8
    assert 120.0 < np.mean(frame.pixels) < 135.0
    port.fault = Fault.NONE
    assert np.mean(read(camera).pixels) < 100.0


def test_a_rate_of_nothing_is_refused() -> None:
    with pytest.raises(ValueError, match="camera C1: rate_hz is 0; give one above 0"):
        rig_ports(rig(), drag((0.0, 0.0), (9.0, 9.0)), SimulatedClock(), rate_hz=0.0)
