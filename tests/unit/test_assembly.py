"""The settings decide through what the cameras are read."""

import pytest

from cornertouchd.config import CamerasSettings, Settings
from cornertouchd.devices.opencv_camera import OpenCvCameraPort
from cornertouchd.devices.v4l2_camera import V4l2CameraPort
from cornertouchd.ports import CameraError
from cornertouchd.runtime.assembly import make_ports
from cornertouchd.runtime.clock import MonotonicClock


@pytest.mark.parametrize(
    ("source", "kind"), [("v4l2", V4l2CameraPort), ("opencv", OpenCvCameraPort)]
)
def test_real_cameras_are_read_as_configured(source: str, kind: type) -> None:
    units = {"C2": {"enabled": False}, "C3": {"row_offset_px": 30, "rows_px": 60}}
    cameras = CamerasSettings(source=source, units=units, height_px=120)
    ports = make_ports(Settings(cameras=cameras), MonotonicClock())
    assert [port.id for port in ports] == ["C1", "C3", "C4"]
    assert all(isinstance(port, kind) for port in ports)
    assert [str(port.format) for port in ports] == [
        "640x120, rows 0..120",
        "640x120, rows 30..90",
        "640x120, rows 0..120",
    ]
    with pytest.raises(CameraError, match=r"camera C3: /dev/cornertouch/c3 is not there"):
        ports[1].open()
