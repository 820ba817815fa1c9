"""Cameras through OpenCV; a video file stands in for the device, decoded by the real library."""

from pathlib import Path

import numpy as np
import pytest

from cornertouchd.devices.opencv_camera import OpenCvCameraPort
from cornertouchd.devices.recording import open_recording
from cornertouchd.model import PictureFormat
from cornertouchd.ports import CameraError


def port(device: Path, picture: PictureFormat, now_s: float = 50.0) -> OpenCvCameraPort:
    return OpenCvCameraPort("C2", str(device), picture, 100.0, lambda: now_s)


@pytest.fixture
def video(recordings: Path) -> Path:
    return recordings / "multi02_small" / "c2.mkv"


def test_pictures_come_in_order_cut_to_the_band(video: Path) -> None:
    camera = port(video, PictureFormat(640, 64, 20, 30)).open()
    whole = [frames[1].pixels for frames in open_recording(video.parent)]
    for number, expected in enumerate(whole):
        frame = camera.read(1.0)
        assert frame is not None
        assert (frame.camera, frame.sequence) == ("C2", number)
        assert np.array_equal(frame.pixels, expected[20:50])
    camera.close()


def test_a_stamp_from_another_clock_is_replaced_by_the_time_of_arrival(video: Path) -> None:
    camera = port(video, PictureFormat(640, 64, 0, 64), now_s=50.0).open()
    frame = camera.read(1.0)
    assert frame is not None
    assert frame.captured_at_s == 50.0
    camera.close()


def test_the_end_of_the_pictures_is_told(video: Path) -> None:
    camera = port(video, PictureFormat(640, 64, 0, 64)).open()
    pictures = len(open_recording(video.parent))
    assert all(camera.read(1.0) for _ in range(pictures))
    assert camera.read(1.0) is None
    camera.close()
    camera.close()


def test_another_size_is_refused(video: Path) -> None:
    with pytest.raises(CameraError, match=r"gives 640x64, configured 640x480"):
        port(video, PictureFormat(640, 480, 0, 480)).open()


def test_a_device_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(CameraError, match=r"camera C2: .*/c2 is not there; is it plugged in"):
        port(tmp_path / "c2", PictureFormat(640, 480, 0, 480)).open()
