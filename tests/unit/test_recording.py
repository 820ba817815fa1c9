"""Recordings: what is written comes back; what could not be read again is refused."""

import json
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cornertouchd.devices import recording as recording_module
from cornertouchd.devices import recording_writer as writer_module
from cornertouchd.devices.recording import RecordingError, open_recording
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import Frame, PictureFormat

CAMERAS = ("C1", "C2", "C3", "C4")
# Every camera has its own size, so that a mix-up cannot pass.
FORMATS = {
    name: PictureFormat(width_px=32 + 2 * k, height_px=48, row_offset_px=10 + k, rows_px=16)
    for k, name in enumerate(CAMERAS)
}
FRAME_SETS = 6


def make_frame_set(index, formats=FORMATS):
    return tuple(
        Frame(
            camera=name,
            sequence=7 * index + number,
            captured_at_s=100.0 + index / 3 + number * 1e-6,
            lit_mask=(None, 0, 5, 15)[(index + number) % 4],
            pixels=np.random.default_rng([index, number]).integers(
                0, 256, (form.rows_px, form.width_px), np.uint8
            ),
        )
        for number, (name, form) in enumerate(formats.items())
    )


def record(directory, frame_sets, formats=FORMATS):
    with RecordingWriter(directory, (350.0, 400.0), 100.0, formats, "two fingers") as writer:
        for frame_set in frame_sets:
            writer.write(frame_set)


def assert_same(read, written):
    assert len(read) == len(written)
    for frame, original in zip(read, written, strict=True):
        assert frame.camera == original.camera
        assert frame.sequence == original.sequence
        assert frame.captured_at_s == original.captured_at_s
        assert frame.lit_mask == original.lit_mask
        assert frame.pixels.dtype == np.uint8
        np.testing.assert_array_equal(frame.pixels, original.pixels)


def assert_beginning_of(recording, frame_sets):
    read = list(recording)
    assert len(read) == len(recording)
    for frame_set, original in zip(read, frame_sets, strict=False):
        assert_same(frame_set, original)


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
    record(directory, [make_frame_set(index) for index in range(FRAME_SETS)])
    return directory


@pytest.fixture
def directory(pristine, tmp_path):
    """Return a recording of six frame sets that a test may damage."""
    return Path(shutil.copytree(pristine, tmp_path / "recording"))


class TestReadingBack:
    def test_what_was_written_is_read(self, directory):
        recording = open_recording(directory)
        assert recording.surface_mm == (350.0, 400.0)
        assert recording.rate_hz == 100.0
        assert recording.formats == FORMATS
        assert recording.notes == "two fingers"
        assert recording.complete
        assert len(recording) == FRAME_SETS
        for index, frame_set in enumerate(recording):
            assert_same(frame_set, make_frame_set(index))

    def test_which_camera_it_was_is_read_where_it_is_known(self, tmp_path, directory):
        identities = {"C1": "usb 1:2 serial 7"}
        with RecordingWriter(
            tmp_path / "known", (350.0, 400.0), 100.0, FORMATS, identities=identities
        ):
            pass
        unknown = dict.fromkeys(FORMATS, "")
        assert open_recording(tmp_path / "known").identities == unknown | identities
        assert open_recording(directory).identities == unknown
        description = json.loads((directory / "recording.json").read_text())
        for camera in description["cameras"]:
            camera.pop("identity")
        rewrite_description(directory, cameras=description["cameras"])
        assert open_recording(directory).identities == unknown

    def test_it_can_be_read_again_and_twice_at_a_time(self, directory):
        recording = open_recording(directory)
        for first, second in zip(recording, recording, strict=True):
            assert_same(first, second)

    def test_it_is_read_one_frame_set_at_a_time(self, directory, monkeypatch):
        decoded = []
        read_pictures = recording_module.read_pictures

        def counted(path, form):
            for picture in read_pictures(path, form):
                decoded.append(path.name)
                yield picture

        monkeypatch.setattr(recording_module, "read_pictures", counted)
        frame_sets = iter(open_recording(directory))
        assert decoded == []
        next(frame_sets)
        next(frame_sets)
        assert decoded == ["c1.mkv", "c2.mkv", "c3.mkv", "c4.mkv"] * 2

    def test_frames_do_not_share_memory(self, directory):
        frame_sets = list(open_recording(directory))
        before = frame_sets[1][0].pixels.copy()
        frame_sets[0][0].pixels[:] = 0
        np.testing.assert_array_equal(frame_sets[1][0].pixels, before)

    def test_rows_may_be_ordered_by_camera(self, directory):
        rewrite_rows(directory, lambda lines: [lines[0], *sorted(lines[1:])])
        for index, frame_set in enumerate(open_recording(directory)):
            assert_same(frame_set, make_frame_set(index))

    def test_unknown_keys_and_columns_are_ignored(self, directory):
        rewrite_description(directory, weather={"sun": True}, notes="")
        rewrite_rows(
            directory,
            lambda lines: ["gain," + lines[0], *(f"1.5,{line}" for line in lines[1:])],
        )
        assert_beginning_of(
            open_recording(directory), [make_frame_set(index) for index in range(FRAME_SETS)]
        )

    def test_marks_and_line_ends_of_other_systems_do_no_harm(self, directory):
        path = directory / "frames.csv"
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
        assert len(open_recording(directory)) == FRAME_SETS

    def test_complete_need_not_be_said(self, directory):
        description = json.loads((directory / "recording.json").read_text())
        del description["complete"], description["notes"]
        (directory / "recording.json").write_text(json.dumps(description))
        assert len(open_recording(directory)) == FRAME_SETS

    def test_a_video_need_not_declare_its_length(self, directory):
        path = directory / "c2.mkv"
        content = path.read_bytes()
        size_at = content.index(b"\x18\x53\x80\x67") + 4
        assert content[size_at] == 1  # seven bytes of size follow
        path.write_bytes(content[:size_at] + b"\x01" + 7 * b"\xff" + content[size_at + 8 :])
        assert len(list(open_recording(directory))) == FRAME_SETS

    def test_an_empty_recording_is_a_recording(self, tmp_path):
        record(tmp_path / "empty", [])
        recording = open_recording(tmp_path / "empty")
        assert len(recording) == 0
        assert list(recording) == []

    @settings(max_examples=15, deadline=None)
    @given(pictures=st.lists(arrays(np.uint8, (4, 6)), min_size=1, max_size=4))
    def test_any_picture_is_kept_without_loss(self, tmp_path_factory, pictures):
        directory = tmp_path_factory.mktemp("lossless") / "recording"
        formats = {"C1": PictureFormat(6, 4, 0, 4)}
        record(directory, [(Frame("C1", 0, 0.0, None, each),) for each in pictures], formats)
        read = [frame.pixels for (frame,) in open_recording(directory)]
        np.testing.assert_array_equal(read, pictures)


class TestWriting:
    def test_a_recording_is_incomplete_until_it_is_closed(self, tmp_path):
        writer = RecordingWriter(tmp_path / "new" / "one", (350.0, 400.0), 100.0, FORMATS)
        description = tmp_path / "new" / "one" / "recording.json"
        assert json.loads(description.read_text())["complete"] is False
        writer.write(make_frame_set(0))
        writer.close()
        writer.close()
        assert json.loads(description.read_text())["complete"] is True
        assert len(open_recording(tmp_path / "new" / "one")) == 1

    def test_frames_may_come_in_any_order_of_cameras(self, tmp_path):
        record(tmp_path / "r", [make_frame_set(0)[::-1]])
        assert_same(next(iter(open_recording(tmp_path / "r"))), make_frame_set(0))

    def test_pictures_may_be_views(self, tmp_path):
        (frame,) = make_frame_set(0, {"C1": PictureFormat(32, 16, 0, 16)})
        views = [np.asfortranarray(frame.pixels), frame.pixels[::-1], frame.pixels[:, ::-1]]
        formats = {"C1": PictureFormat(32, 16, 0, 16)}
        record(tmp_path / "r", [(Frame("C1", 0, 1.0, None, view),) for view in views], formats)
        read = [frame.pixels for (frame,) in open_recording(tmp_path / "r")]
        np.testing.assert_array_equal(read, views)

    def test_what_was_recorded_before_an_exception_is_kept(self, tmp_path):
        def record_until_interrupted():
            with RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, FORMATS) as writer:
                writer.write(make_frame_set(0))
                raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            record_until_interrupted()
        recording = open_recording(tmp_path / "r")
        assert recording.complete
        assert len(recording) == 1

    def test_nothing_is_overwritten(self, directory):
        before = {path.name: path.read_bytes() for path in directory.iterdir()}
        with pytest.raises(RecordingError, match="is not empty; name a new directory"):
            RecordingWriter(directory, (350.0, 400.0), 100.0, FORMATS)
        assert {path.name: path.read_bytes() for path in directory.iterdir()} == before

    def test_a_file_in_the_place_of_the_directory(self, tmp_path):
        (tmp_path / "r").touch()
        with pytest.raises(RecordingError, match="/r: cannot be written: File exists"):
            RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, FORMATS)

    @pytest.mark.parametrize("form", [PictureFormat(33, 16, 0, 16), PictureFormat(32, 15, 0, 15)])
    def test_odd_sizes_are_refused(self, tmp_path, form):
        with pytest.raises(
            RecordingError, match=r"c1\.mkv: pictures of 3\dx1\d cannot be recorded"
        ):
            RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, {"C1": form})

    @pytest.mark.parametrize(
        ("surface_mm", "rate_hz", "formats"),
        [
            ((0.0, 400.0), 100.0, FORMATS),
            ((350.0, 400.0), float("inf"), FORMATS),
            ((350.0, 400.0), 100.0, {}),
            ((350.0, 400.0), 100.0, {"C1": FORMATS["C1"], "c1": FORMATS["C1"]}),
            ((350.0, 400.0), 100.0, {"a/b": FORMATS["C1"]}),
        ],
    )
    def test_what_could_not_be_read_again_is_refused(self, tmp_path, surface_mm, rate_hz, formats):
        with pytest.raises(RecordingError, match="cannot record"):
            RecordingWriter(tmp_path / "r", surface_mm, rate_hz, formats)
        assert not (tmp_path / "r").exists()

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"camera": "C2"}, r"frame set 1: frames of \['C2', 'C2', 'C3', 'C4'\]"),
            ({"pixels": np.zeros((16, 30), np.uint8)}, r"c1\.mkv: a picture is \(16, 30\) uint8"),
            ({"pixels": np.zeros((16, 32), np.int16)}, r"c1\.mkv: a picture is \(16, 32\) int16"),
            ({"captured_at_s": float("nan")}, r"c1\.mkv: captured_at_s = nan"),
            ({"sequence": -1}, r"c1\.mkv: captured_at_s = .*, sequence = -1"),
            ({"lit_mask": 16}, r"c1\.mkv: lit_mask = 16: must be from 0 to 15"),
        ],
    )
    def test_a_frame_set_that_does_not_fit_leaves_no_trace(self, tmp_path, change, message):
        good = make_frame_set(1)
        values = {name: getattr(good[0], name) for name in Frame.__slots__} | change
        with RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, FORMATS) as writer:
            writer.write(make_frame_set(0))
            with pytest.raises(RecordingError, match=message):
                writer.write((Frame(**values), *good[1:]))
            with pytest.raises(RecordingError, match="frame set 1: frames of"):
                writer.write(good[:3])
            writer.write(good)
        assert_beginning_of(open_recording(tmp_path / "r"), [make_frame_set(0), good])
        assert len(open_recording(tmp_path / "r")) == 2

    def test_nothing_can_be_written_after_the_end(self, tmp_path):
        writer = RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, FORMATS)
        writer.close()
        with pytest.raises(RecordingError, match="the recording has ended"):
            writer.write(make_frame_set(0))


class TestFullDisks:
    def test_a_recording_ends_before_the_disk_is_full(self, tmp_path, monkeypatch):
        free = SimpleNamespace(free=writer_module.LEAST_FREE_BYTES)
        monkeypatch.setattr(writer_module.shutil, "disk_usage", lambda path: free)
        writer = RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, FORMATS)
        for index in range(3):
            writer.write(make_frame_set(index))
        free.free -= 1
        with pytest.raises(RecordingError, match="the disk is full, 16777215 bytes are free"):
            writer.write(make_frame_set(3))
        free.free += 1
        with pytest.raises(RecordingError, match="the recording has ended"):
            writer.write(make_frame_set(3))
        writer.close()
        recording = open_recording(tmp_path / "r")
        assert not recording.complete
        assert len(recording) == 3
        assert_beginning_of(recording, [make_frame_set(index) for index in range(3)])

    def test_no_recording_is_begun_on_a_full_disk(self, tmp_path, monkeypatch):
        free = SimpleNamespace(free=0)
        monkeypatch.setattr(writer_module.shutil, "disk_usage", lambda path: free)
        with pytest.raises(RecordingError, match="the disk is full"):
            RecordingWriter(tmp_path / "r", (350.0, 400.0), 100.0, FORMATS)
