"""Damaged recordings: every fault is told with file, place and remedy."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.devices.recording import (
    RecordedPoint,
    RecordingError,
    open_recording,
    read_points,
)
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import Frame, PictureFormat

CAMERAS = ("C1", "C2", "C3", "C4")
# Every camera has its own size, so that a mix-up cannot pass.
FORMATS = {
    name: PictureFormat(width_px=32 + 2 * k, height_px=48, row_offset_px=10 + k, rows_px=16)
    for k, name in enumerate(CAMERAS)
}
FRAME_SETS = 6


def record(directory, frame_sets):
    pixels = {
        name: np.random.default_rng(k).integers(0, 256, (form.rows_px, form.width_px), np.uint8)
        for k, (name, form) in enumerate(FORMATS.items())
    }
    with RecordingWriter(directory, (350.0, 400.0), 100.0, FORMATS) as writer:
        for index in range(frame_sets):
            writer.write([Frame(name, index, index / 3, 15, pixels[name]) for name in CAMERAS])


def rewrite_description(directory, **changes):
    path = directory / "recording.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def rewrite_rows(directory, change):
    path = directory / "frames.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join(change(lines)) + "\n")


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    directory = tmp_path_factory.mktemp("recordings") / "pristine"
    record(directory, FRAME_SETS)
    return directory


@pytest.fixture
def directory(pristine, tmp_path):
    """Return a recording of six frame sets that a test may damage."""
    return Path(shutil.copytree(pristine, tmp_path / "recording"))


class TestDamage:
    """Every fault is told when the recording is opened, with file, place and remedy."""

    def refused(self, directory, *fragments):
        with pytest.raises(RecordingError) as refusal:
            open_recording(directory)
        for fragment in fragments:
            assert fragment in str(refusal.value)

    def test_no_such_directory(self, tmp_path):
        self.refused(tmp_path / "none", str(tmp_path / "none" / "recording.json"), "No such file")

    @pytest.mark.parametrize("name", ["recording.json", "frames.csv", "c3.mkv"])
    def test_a_missing_file(self, directory, name):
        (directory / name).unlink()
        self.refused(directory, str(directory / name), "o such file")

    @pytest.mark.parametrize(
        "content", [b"", b"{", b"[1]", b"\xff\xfe", b"[" * 100_000, b'{"format": 1'], ids=repr
    )
    def test_a_description_that_is_no_json_object(self, directory, content):
        (directory / "recording.json").write_bytes(content)
        self.refused(directory, "recording.json: ")

    @pytest.mark.parametrize(
        ("changes", "fragment"),
        [
            ({"format": "video"}, "format = 'video': "),
            ({"version": 2}, "version = 2: "),
            ({"surface_mm": [350.0]}, "surface_mm.1: "),
            ({"surface_mm": [0.0, 400.0]}, "surface_mm.0 = 0.0: "),
            ({"surface_mm": [float("nan"), 400.0]}, "surface_mm.0 = nan: "),
            ({"rate_hz": "fast"}, "rate_hz = 'fast': "),
            ({"rate_hz": 0}, "rate_hz = 0"),
            ({"cameras": []}, "cameras = []: "),
            ({"complete": "no"}, "complete = 'no': "),
        ],
    )
    def test_a_description_with_a_wrong_value(self, directory, changes, fragment):
        rewrite_description(directory, **changes)
        self.refused(directory, "recording.json: ", fragment)

    @pytest.mark.parametrize("key", ["format", "version", "surface_mm", "rate_hz", "cameras"])
    def test_a_description_without_a_key(self, directory, key):
        description = json.loads((directory / "recording.json").read_text())
        del description[key]
        (directory / "recording.json").write_text(json.dumps(description))
        self.refused(directory, f"recording.json: {key}: Field required")

    @pytest.mark.parametrize(
        ("changes", "fragments"),
        [
            ({"width_px": 40}, ["c2.mkv", "34x16", "40x16"]),
            ({"rows_px": 14}, ["c2.mkv", "34x16", "34x14"]),
            ({"width_px": "34"}, ["recording.json", "cameras.1.width_px = '34'"]),
            ({"rows_px": True}, ["recording.json", "cameras.1.rows_px = True"]),
            ({"row_offset_px": 33}, ["recording.json", "rows end at 49, the image at 48"]),
            ({"id": "C1"}, ["recording.json", "same id"]),
            ({"file": "c1.mkv"}, ["recording.json", "same file"]),
            ({"file": "../c2.mkv"}, ["recording.json", "cameras.1.file = '../c2.mkv'"]),
            ({"file": ".."}, ["recording/..", "no such file"]),
            ({"id": "C7"}, ["frames.csv: row 2 (line 3)", "camera = 'C2'", "C1, C7, C3, C4"]),
        ],
    )
    def test_a_camera_that_is_described_wrongly(self, directory, changes, fragments):
        cameras = json.loads((directory / "recording.json").read_text())["cameras"]
        cameras[1] |= changes
        rewrite_description(directory, cameras=cameras)
        self.refused(directory, *fragments)

    @pytest.mark.parametrize(
        ("row", "fragment"),
        [
            ("C9,1,0,0.0,15", "camera = 'C9'"),
            ("C2,2,0,0.0,15", "index = '2': must be 1"),
            ("C2,0,0,0.0,15", "index = '0': must be 1"),
            ("C2,-1,0,0.0,15", "index = '-1': must be a whole number"),
            ("C2,1,zero,0.0,15", "sequence = 'zero'"),
            ("C2,1,,0.0,15", "sequence = ''"),
            ("C2,1,1_0,0.0,15", "sequence = '1_0'"),
            (f"C2,1,{'9' * 5000},0.0,15", "sequence = '9999"),
            ("C2,1,0,now,15", "captured_at_s = 'now'"),
            ("C2,1,0,nan,15", "captured_at_s = 'nan'"),
            ("C2,1,0,0.0,16", "lit_mask = '16': must be at most 15"),
            ("C2,1,0,0.0,all", "lit_mask = 'all'"),
            ("C2,1,0,0.0", "4 values for 5 columns"),
            ('C2,1,0,0.0,"15', "line"),
        ],
    )
    def test_a_row_that_does_not_parse(self, directory, row, fragment):
        rewrite_rows(directory, lambda lines: [*lines[:6], row, *lines[7:]])
        place = "frames.csv: " if row.endswith('"15') else "frames.csv: row 6 (line 7): "
        self.refused(directory, place, fragment)

    def test_rows_without_a_column(self, directory):
        rewrite_rows(directory, lambda lines: [line.rsplit(",", 1)[0] for line in lines])
        self.refused(directory, "frames.csv: line 1: no column 'lit_mask'")

    def test_an_empty_table(self, directory):
        (directory / "frames.csv").write_bytes(b"")
        self.refused(directory, "frames.csv: line 1: no column 'camera'")

    def test_a_table_that_is_no_text(self, directory):
        (directory / "frames.csv").write_bytes(b"\xff\xfe\x00")
        self.refused(directory, "frames.csv: ", "UTF-8")

    def test_a_row_that_is_missing(self, directory):
        rewrite_rows(directory, lambda lines: lines[:-1])
        self.refused(directory, "c4.mkv", "6 pictures", "5 rows of C4")

    def test_a_camera_without_rows(self, directory):
        rewrite_rows(directory, lambda lines: [line for line in lines if "C3" not in line])
        self.refused(directory, "c3.mkv", "6 pictures", "0 rows of C3")

    def test_a_camera_that_stopped_before_the_others(self, directory, tmp_path):
        record(tmp_path / "short", FRAME_SETS - 1)
        shutil.copy(tmp_path / "short" / "c3.mkv", directory / "c3.mkv")
        rewrite_rows(directory, lambda lines: [line for line in lines if "C3,5" not in line])
        self.refused(directory, "c3.mkv", "has 5 pictures", "C1 has 6")

    def test_a_video_of_another_size(self, directory):
        shutil.copy(directory / "c1.mkv", directory / "c2.mkv")
        self.refused(directory, "c2.mkv", "32x16", "34x16")

    def test_a_video_in_colour(self, directory):
        video = cv2.VideoWriter(
            str(directory / "c1.mkv"),
            cv2.CAP_FFMPEG,
            cv2.VideoWriter.fourcc(*"FFV1"),
            100,
            (32, 16),
        )
        for _ in range(FRAME_SETS):
            video.write(np.zeros((16, 32, 3), np.uint8))
        video.release()
        self.refused(directory, "c1.mkv", "not 8-bit grey")

    def test_a_video_that_is_none(self, directory):
        (directory / "c1.mkv").write_bytes(b"no video" * 1000)
        self.refused(directory, "c1.mkv", "0 pictures")

    def test_a_video_that_vanishes_after_opening(self, directory):
        recording = open_recording(directory)
        (directory / "c2.mkv").unlink()
        with pytest.raises(RecordingError, match=r"c2\.mkv: picture 0 of 6 cannot be read"):
            list(recording)

    def test_a_video_that_changes_its_size_after_opening(self, directory):
        recording = open_recording(directory)
        shutil.copy(directory / "c1.mkv", directory / "c2.mkv")
        with pytest.raises(RecordingError, match=r"c2\.mkv: a picture is \(16, 32\)"):
            list(recording)

    def test_a_video_that_lacks_its_last_byte(self, directory):
        path = directory / "c2.mkv"
        path.write_bytes(path.read_bytes()[:-1])
        self.refused(directory, "c2.mkv: is truncated after 6 pictures, 1 bytes are missing")

    @settings(max_examples=40, deadline=None)
    @given(place=st.floats(0.0, 1.0, exclude_max=True), camera=st.sampled_from(CAMERAS))
    def test_a_video_cut_anywhere_is_refused(self, pristine, tmp_path_factory, place, camera):
        directory = tmp_path_factory.mktemp("cut") / "recording"
        shutil.copytree(pristine, directory)
        path = directory / f"{camera.lower()}.mkv"
        content = path.read_bytes()
        path.write_bytes(content[: int(place * len(content))])
        self.refused(directory, f"{camera.lower()}.mkv")


class TestPoints:
    def test_a_recording_without_points(self, directory):
        assert open_recording(directory).points == ()

    def test_points_of_a_recording(self, directory):
        (directory / "points.csv").write_text(
            "set,x_mm,y_mm,diameter_mm,kind\n0,1.5,2,8.0,disc\n0,100,-2.5,,disc\n5,3,4,,\n"
        )
        assert open_recording(directory).points == (
            RecordedPoint(0, 1.5, 2.0, 8.0),
            RecordedPoint(0, 100.0, -2.5, None),
            RecordedPoint(5, 3.0, 4.0, None),
        )

    @pytest.mark.parametrize(
        ("row", "fragment"),
        [
            ("0,far,2,8", "x_mm = 'far': must be a number"),
            ("0,1,,8", "y_mm = '': must be a number"),
            ("0,1,2,inf", "diameter_mm = 'inf': must be a number"),
            ("1.0,1,2,8", "set = '1.0': must be a whole number"),
        ],
    )
    def test_a_row_that_does_not_parse(self, tmp_path, row, fragment):
        path = tmp_path / "points.csv"
        path.write_text(f"set,x_mm,y_mm,diameter_mm\n0,1,2,3\n{row}\n")
        with pytest.raises(RecordingError) as refusal:
            read_points(path)
        assert f"{path}: row 2 (line 3): {fragment}" in str(refusal.value)

    def test_a_point_beyond_the_end(self, directory):
        (directory / "points.csv").write_text("set,x_mm,y_mm,diameter_mm\n5,1,2,3\n6,1,2,3\n")
        with pytest.raises(RecordingError, match=r"points\.csv: row 2: set = 6: .* less than 6"):
            open_recording(directory)

    def test_no_such_file(self, tmp_path):
        with pytest.raises(RecordingError, match=r"points\.csv: cannot be read: No such file"):
            read_points(tmp_path / "points.csv")
