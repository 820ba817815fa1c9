"""Recordings that were cut off: what a crash or a full disk leaves can be read."""

import json
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.devices.recording import RecordingError, open_recording
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import Frame, PictureFormat

CAMERAS = ("C1", "C2", "C3", "C4")
SMALL = {name: PictureFormat(32, 48, 10, 16) for name in CAMERAS}
# Noise does not compress: a picture takes the 16 KiB in the file that it has pixels.
LARGE = {name: PictureFormat(128, 128, 0, 128) for name in CAMERAS}
FRAME_SETS = 6


def make_frame_set(index, formats=SMALL):
    return tuple(
        Frame(
            camera=name,
            sequence=index,
            captured_at_s=index / 3 + number,
            lit_mask=number,
            pixels=np.random.default_rng([index, number]).integers(
                0, 256, (form.rows_px, form.width_px), np.uint8
            ),
        )
        for number, (name, form) in enumerate(formats.items())
    )


def assert_beginning(recording, formats=SMALL):
    """Check that a recording has what was recorded, as far as it goes."""
    index = -1
    for index, frame_set in enumerate(recording):
        for frame, original in zip(frame_set, make_frame_set(index, formats), strict=True):
            assert (frame.camera, frame.sequence) == (original.camera, original.sequence)
            assert (frame.captured_at_s, frame.lit_mask) == (
                original.captured_at_s,
                original.lit_mask,
            )
            np.testing.assert_array_equal(frame.pixels, original.pixels)
    assert len(recording) == index + 1


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    directory = tmp_path_factory.mktemp("recordings") / "pristine"
    with RecordingWriter(directory, (350.0, 400.0), 100.0, SMALL) as writer:
        for index in range(FRAME_SETS):
            writer.write(make_frame_set(index))
    description = directory / "recording.json"
    description.write_text(json.dumps(json.loads(description.read_text()) | {"complete": False}))
    return directory


@pytest.fixture
def directory(pristine, tmp_path):
    """Return a recording of six frame sets that was not closed."""
    return Path(shutil.copytree(pristine, tmp_path / "recording"))


def cut(path, place):
    content = path.read_bytes()
    path.write_bytes(content[: int(place * len(content))])


def run_writer(directory, program):
    """Start a process that runs `program` with `open_writer` and `make_frame_set` at hand."""
    preparation = f"""
import importlib.util
from pathlib import Path
from cornertouchd.devices.recording_format import RecordingError
from cornertouchd.devices.recording_writer import RecordingWriter
spec = importlib.util.spec_from_file_location("writer_test", {__file__!r})
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
def make_frame_set(index):
    return module.make_frame_set(index, module.LARGE)
def open_writer():
    return RecordingWriter(Path({str(directory)!r}), (350.0, 400.0), 100.0, module.LARGE)
"""
    return subprocess.Popen(
        [sys.executable, "-c", preparation + textwrap.dedent(program)],
        stdout=subprocess.PIPE,
        text=True,
    )


class TestCutOff:
    def test_videos_that_could_not_be_written_are_noticed(self, tmp_path):
        """No file may grow beyond 100 kB: the videos' writes fail as they do on a full disk."""
        messages = run_writer(
            tmp_path / "r",
            """
            import resource
            resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
            writer = open_writer()
            for index in range(40):
                writer.write(make_frame_set(index))
            try:
                writer.close()
            except RecordingError as error:
                print(error)
            """,
        ).communicate()[0]
        assert "c1.mkv: only " in messages
        assert "of 40 pictures could be written" in messages
        recording = open_recording(tmp_path / "r")
        assert not recording.complete
        assert 0 < len(recording) < 40
        assert_beginning(recording, LARGE)

    def test_a_killed_writer_loses_what_its_videos_hold_in_memory(self, tmp_path):
        writer = run_writer(
            tmp_path / "r",
            """
            writer = open_writer()
            index = 0
            while True:
                writer.write(make_frame_set(index))
                print(index, flush=True)
                index += 1
            """,
        )
        with writer:
            for line in writer.stdout:
                if line.strip() == "60":
                    break
            writer.kill()
        recording = open_recording(tmp_path / "r")
        assert not recording.complete
        in_memory = 256 // 16 + 12 + 1  # file buffer, a cluster of the video, one in between
        assert len(recording) >= 61 - in_memory
        assert_beginning(recording, LARGE)

    @settings(max_examples=40, deadline=None)
    @given(
        name=st.sampled_from(["c1.mkv", "c4.mkv", "frames.csv"]),
        place=st.floats(0.0, 1.0),
        other_place=st.floats(0.0, 1.0),
    )
    def test_a_cut_off_recording_has_the_frame_sets_that_are_whole(
        self, pristine, tmp_path_factory, name, place, other_place
    ):
        directory = tmp_path_factory.mktemp("cut") / "recording"
        shutil.copytree(pristine, directory)
        cut(directory / name, place)
        cut(directory / "c2.mkv", other_place)
        recording = open_recording(directory)
        assert_beginning(recording)
        if place == other_place == 1.0:
            assert len(recording) == FRAME_SETS

    @pytest.mark.parametrize("sets", range(FRAME_SETS + 1))
    def test_every_whole_row_counts(self, directory, sets):
        path = directory / "frames.csv"
        lines = path.read_text().splitlines(keepends=True)
        path.write_text("".join(lines[: 1 + 4 * sets]) + "C1,6,9,1")
        assert len(open_recording(directory)) == sets

    def test_a_row_in_the_middle_must_parse_all_the_same(self, directory):
        path = directory / "frames.csv"
        lines = path.read_text().splitlines(keepends=True)
        path.write_text("".join([*lines[:6], "C2,1,x,0.0,15\n", *lines[7:]]))
        with pytest.raises(RecordingError, match=r"frames\.csv: row 6 \(line 7\): sequence = 'x'"):
            open_recording(directory)

    def test_points_beyond_the_cut_are_left_out(self, directory):
        (directory / "points.csv").write_text("set,x_mm,y_mm,diameter_mm\n1,1,2,3\n6,1,2,3\n")
        assert [point.set for point in open_recording(directory).points] == [1]
