"""Frames of one instant come together, whatever order and gaps they arrive in."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.model import Frame
from cornertouchd.ports import CameraError
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.recorder import FrameGrouping, Recorder
from cornertouchd.simulation.camera import Fault, rig_ports
from cornertouchd.simulation.rig import SimulatedRig

CAMERAS = ("C1", "C2", "C3")
PIXELS = np.zeros((2, 2), np.uint8)


def frame(camera: str, tick: int, skew_s: float = 0.0) -> Frame:
    return Frame(camera, tick, 0.01 * tick + skew_s, 15, PIXELS)


@given(
    seen=st.lists(st.sets(st.sampled_from(CAMERAS)), max_size=20),
    skews=st.lists(st.floats(-0.0015, 0.0015), min_size=3, max_size=3),
)
def test_exactly_the_whole_instants_come_out(seen: list[set[str]], skews: list[float]) -> None:
    grouping = FrameGrouping(CAMERAS, tolerance_s=0.004)
    skew = dict(zip(CAMERAS, skews, strict=True))
    out = []
    for tick, cameras in enumerate([*seen, set(CAMERAS)]):
        for camera in sorted(cameras):
            out += grouping.add(frame(camera, tick, skew[camera]))
    whole = [k for k, cameras in enumerate([*seen, set(CAMERAS)]) if cameras == set(CAMERAS)]
    assert [frames[0].sequence for frames in out] == whole
    for frames in out:
        assert tuple(f.camera for f in frames) == CAMERAS
        assert len({f.sequence for f in frames}) == 1
    assert grouping.dropped == sum(len(c) for c in seen if c != set(CAMERAS))


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig((350.0, 400.0), seed=2)


def test_a_rig_is_recorded_whole(rig: SimulatedRig) -> None:
    ports = rig_ports(rig, lambda _: (), MonotonicClock(), rate_hz=50.0)
    sets = Recorder(ports, tolerance_s=0.004, timeout_s=2.0).frame_sets(lambda: False)
    got = [next(sets) for _ in range(4)]
    sets.close()
    for frames in got:
        assert [f.camera for f in frames] == ["C1", "C2", "C3", "C4"]
        assert len({f.captured_at_s for f in frames}) == 1
    assert [f[0].sequence for f in got] == sorted({f[0].sequence for f in got})


def test_a_camera_that_stalls_ends_the_recording_by_name(rig: SimulatedRig) -> None:
    ports = rig_ports(rig, lambda _: (), MonotonicClock(), rate_hz=50.0)
    ports[2].fault = Fault.STALLED
    with pytest.raises(CameraError, match="C3"):
        next(Recorder(ports, tolerance_s=0.004, timeout_s=0.2).frame_sets(lambda: False))


def test_it_stops_when_asked_though_no_set_was_ever_whole(rig: SimulatedRig) -> None:
    ports = rig_ports(rig, lambda _: (), MonotonicClock(), rate_hz=50.0)
    asked = iter([False] * 5)
    sets = Recorder(ports, tolerance_s=-1.0, timeout_s=2.0).frame_sets(lambda: next(asked, True))
    assert list(sets) == []


def test_cameras_out_of_step_end_the_recording(rig: SimulatedRig) -> None:
    ports = rig_ports(rig, lambda _: (), MonotonicClock(), rate_hz=500.0)
    with pytest.raises(CameraError, match="never sees the same instant"):
        list(Recorder(ports, tolerance_s=-1.0, timeout_s=2.0).frame_sets(lambda: False))
