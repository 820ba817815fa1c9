"""Calibrating from recordings: all parts must be of the same cameras."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.config import VisionSettings
from cornertouchd.devices.recording import Recording, open_recording
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import PictureFormat
from cornertouchd.runtime.recorded_touches import gather_recorded, require_boards_of

FORMATS = {camera: PictureFormat(64, 48, 8, 32) for camera in ("C1", "C2")}


def recording(
    directory: Path, formats: Mapping[str, PictureFormat] = FORMATS, **identities: str
) -> Recording:
    with RecordingWriter(directory, (350.0, 400.0), 100.0, formats, identities=identities):
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


def test_boards_may_be_recorded_with_other_rows(tmp_path: Path) -> None:
    empty = recording(tmp_path / "empty", C1="usb 1:2 serial A")
    whole = dict.fromkeys(FORMATS, PictureFormat(64, 48, 0, 48))
    require_boards_of(empty, recording(tmp_path / "boards", whole, C1="usb 1:2 serial A"))


@pytest.mark.parametrize(
    "formats",
    [
        dict.fromkeys(FORMATS, PictureFormat(64, 36, 0, 36)),
        dict.fromkeys(FORMATS, PictureFormat(32, 48, 0, 48)),
        dict.fromkeys(("C1", "C3"), PictureFormat(64, 48, 0, 48)),
    ],
    ids=["height", "width", "names"],
)
def test_boards_before_other_cameras_are_refused(
    tmp_path: Path, formats: Mapping[str, PictureFormat]
) -> None:
    empty, boards = recording(tmp_path / "empty"), recording(tmp_path / "boards", formats)
    with pytest.raises(CalibrationError, match=r"boards: its cameras or the sizes .*empty; record"):
        require_boards_of(empty, boards)


def test_boards_before_an_exchanged_camera_are_refused(tmp_path: Path) -> None:
    empty = recording(tmp_path / "empty", C1="usb 1:2 serial A")
    boards = recording(tmp_path / "boards", C1="usb 1:2 serial B")
    with pytest.raises(CalibrationError, match=r"boards: camera C1 is another one"):
        require_boards_of(empty, boards)
