"""Calibrating from recordings: all parts must be of the same cameras."""

from pathlib import Path

import pytest

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.config import VisionSettings
from cornertouchd.devices.recording import Recording, open_recording
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import PictureFormat
from cornertouchd.runtime.recorded_touches import gather_recorded

FORMATS = {camera: PictureFormat(64, 48, 8, 32) for camera in ("C1", "C2")}


def recording(directory: Path, **identities: str) -> Recording:
    with RecordingWriter(directory, (350.0, 400.0), 100.0, FORMATS, identities=identities):
        pass
    return open_recording(directory)


def test_parts_of_other_cameras_are_refused_by_name(tmp_path: Path) -> None:
    taps = recording(tmp_path / "taps", C1="usb 1:2 serial A", C2="usb 1:2 serial B")
    empty = recording(tmp_path / "empty", C1="usb 1:2 serial A", C2="usb 1:2 serial X")
    with pytest.raises(
        CalibrationError,
        match=r"taps: camera C2 is another one \(usb 1:2 serial B\) than in .*empty \(usb 1:2 ser",
    ):
        gather_recorded(taps, (), None, empty, VisionSettings())


def test_parts_whose_cameras_are_not_known_are_taken(tmp_path: Path) -> None:
    taps = recording(tmp_path / "taps", C1="usb 1:2 serial A")
    empty = recording(tmp_path / "empty", C2="usb 1:2 serial X")
    with pytest.raises(CalibrationError, match="no picture of the empty surface"):
        gather_recorded(taps, (), None, empty, VisionSettings())
