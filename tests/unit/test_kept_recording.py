"""`cornertouchd record` from a running daemon: whole, in order, and the daemon never waits."""

import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from click.testing import CliRunner, Result

from cornertouchd.cli import main
from cornertouchd.devices.recording import open_recording
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.runtime.asking import Answer, Asker, AskSocket, RefusedError, document
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.keeping import Keeping
from cornertouchd.runtime.kept_recorder import KeptRecorder
from cornertouchd.runtime.kept_stream import pictures_of
from cornertouchd.wire.pictures import PictureStreamError

CAMERAS = ("C1", "C2", "C3")
FORM = PictureFormat(64, 48, 10, 8)
RATE_HZ = 100.0


def never() -> bool:
    return False


class Daemon:
    """What a daemon keeps, and as much of it as a recording asks for."""

    def __init__(self) -> None:
        self.clock = MonotonicClock()
        self.kept = Keeping(dict.fromkeys(CAMERAS, FORM), RATE_HZ, 2, 16)
        self.stages = SimpleNamespace(
            calibration=SimpleNamespace(surface_mm=(350.0, 400.0)),
            settings=SimpleNamespace(
                cameras=SimpleNamespace(rate_hz=RATE_HZ),
                pairing=SimpleNamespace(tolerance_ms=4.0),
            ),
            ports=[SimpleNamespace(id=one, format=FORM, identity=f"A{one}") for one in CAMERAS],
        )

    def see(self, first: int, end: int, cameras: tuple[str, ...] = CAMERAS) -> None:
        for number in range(first, end):
            pixels = np.full((FORM.rows_px, FORM.width_px), number % 256, np.uint8)
            for camera in cameras:
                lit_mask = None if number % 3 else 0
                self.kept.put(Frame(camera, number, number / RATE_HZ, lit_mask, pixels))

    def answers(self) -> dict[str, Answer]:
        pictures: Any = pictures_of(self, self.clock)  # type: ignore[arg-type]
        hello = document(lambda: b'{"configuration": ""}')
        return {"hello": hello, "pictures": pictures}


class Rig(NamedTuple):
    daemon: Daemon
    path: Path


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Rig]:
    monkeypatch.setattr(os, "nice", lambda _: 0)  # the tests after this one are as important
    monkeypatch.setenv("RUNTIME_DIRECTORY", str(tmp_path))
    monkeypatch.delenv("CORNERTOUCHD_CONFIG", raising=False)
    daemon = Daemon()
    path = tmp_path / "status.sock"
    with AskSocket(path, daemon.answers()):
        yield Rig(daemon, path)


def record(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["record", *map(str, arguments)])


def test_what_is_kept_is_recorded(rig: Rig, tmp_path: Path) -> None:
    rig.daemon.see(0, 300)
    told = record(tmp_path / "taken", "--last", 1)
    assert told.exit_code == 0, told.output
    recording = open_recording(tmp_path / "taken")
    assert recording.complete
    assert recording.identities == {"C1": "AC1", "C2": "AC2", "C3": "AC3"}
    assert recording.formats == dict.fromkeys(CAMERAS, FORM)
    numbers = [frames[0].sequence for frames in recording]
    assert numbers == list(range(numbers[0], 300))
    assert numbers[0] in {199, 200}
    for frames in recording:
        for frame in frames:
            assert (frame.pixels == frame.sequence % 256).all()
            assert frame.lit_mask == (None if frame.sequence % 3 else 0)


def test_what_comes_is_recorded_until_it_is_enough(rig: Rig) -> None:
    rig.daemon.see(0, 10)
    with KeptRecorder(rig.path, 0.02, None) as recorder:
        enough = threading.Event()
        numbers = []
        for frames in recorder.frame_sets(enough.is_set):
            numbers.append(frames[0].sequence)
            if frames[0].sequence == 9:
                rig.daemon.see(10, 60)
            if frames[0].sequence == 59:
                enough.set()
        assert numbers == list(range(7, 60))
        assert (recorder.missing, recorder.dropped) == (0, 0)


def test_pictures_that_nobody_fetched_in_time_are_counted(rig: Rig) -> None:
    rig.daemon.see(0, 10)
    with KeptRecorder(rig.path, 0.0, None) as recorder:
        rig.daemon.see(10, 20_000)  # forty times what is kept, and far more than a socket holds
        frames = recorder.frame_sets(lambda: True)
        count = sum(1 for _ in frames)
        assert recorder.missing > 0
        assert recorder.missing + 3 * count + recorder.dropped >= 3 * 19_990


def test_a_camera_that_gives_nothing_is_left_out_and_named(rig: Rig, tmp_path: Path) -> None:
    rig.daemon.see(0, 1)
    rig.daemon.see(1000, 1100, ("C1", "C3"))
    told = record(tmp_path / "taken", "--last", 0.5)
    assert told.exit_code == 0, told.output
    assert "without C2: no pictures of the last seconds" in told.stderr
    assert list(open_recording(tmp_path / "taken").formats) == ["C1", "C3"]


def test_frames_of_a_camera_that_dies_do_not_pile_up(rig: Rig) -> None:
    rig.daemon.see(0, 20)
    rig.daemon.see(20, 200, ("C1", "C3"))
    with KeptRecorder(rig.path, 2.0, 0.0) as recorder:
        count = sum(1 for _ in recorder.frame_sets(never))
    assert count == 20
    assert recorder.dropped > 100


def test_a_daemon_that_follows_another_configuration_ends_the_recording(rig: Rig) -> None:
    rig.daemon.see(0, 10)
    with KeptRecorder(rig.path, 1.0, None) as recorder:
        rig.daemon.kept = Keeping(dict.fromkeys(CAMERAS, FORM), RATE_HZ, 2, 16)
        assert sum(1 for _ in recorder.frame_sets(never)) == 10


def test_a_daemon_that_dies_is_told_and_what_came_stays(tmp_path: Path, rig: Rig) -> None:
    rig.daemon.see(0, 50)
    path = tmp_path / "dying" / "status.sock"
    whole = rig.daemon.answers()["pictures"]

    class Dying:
        def __init__(self, asker: Asker) -> None:
            self.asker = asker
            self.request = {"last_s": 5.0}
            self.has_enough = False
            self.sent = 0

        def send(self, data: bytes) -> None:
            self.sent += 1
            if self.sent > 100:
                raise OSError("gone")
            self.asker.send(data)

        def further(self) -> list[object]:
            return []

    with AskSocket(path, {"pictures": lambda asker: whole(Dying(asker))}):  # type: ignore[arg-type]
        told = record(tmp_path / "taken", "--socket", path, "--last", 5)
    assert told.exit_code == 1
    assert "was cut off: the daemon has gone; 33 frame sets until then are in" in told.stderr
    assert len(open_recording(tmp_path / "taken")) == 33


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"last_s": "all"}, "last_s = 'all': must be a number"),
        ({"last_s": -1}, "last_s = -1: must be 0 or more"),
        ({"seconds": True}, "seconds = True: must be a number"),
    ],
)
def test_what_makes_no_sense_is_refused(rig: Rig, asked: dict[str, Any], said: str) -> None:
    with pytest.raises(RefusedError, match=said):
        KeptRecorder(rig.path, **{"last_s": 0.0, "seconds": 0.0, **asked})


def test_what_listens_there_may_be_something_else(tmp_path: Path) -> None:
    with (
        AskSocket(tmp_path / "s", {"pictures": document(lambda: b"hello")}),
        pytest.raises(PictureStreamError),
    ):
        KeptRecorder(tmp_path / "s", 0.0, 0.0)


def test_a_full_disk_ends_it_and_what_was_written_can_be_read(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.daemon.see(0, 200)
    looks = iter(range(10_000))
    monkeypatch.setattr(
        shutil, "disk_usage", lambda _: SimpleNamespace(free=2**30 if next(looks) < 50 else 0)
    )
    told = record(tmp_path / "taken", "--last", 2)
    assert told.exit_code == 1
    assert "the disk is full" in told.stderr
    assert "49 frame sets until then are in" in told.stderr
    assert len(open_recording(tmp_path / "taken")) == 49


def test_it_ends_when_it_is_as_large_as_allowed(rig: Rig, tmp_path: Path) -> None:
    form = PictureFormat(640, 480, 10, 64)
    noise = np.random.default_rng(1).integers(0, 256, (form.rows_px, form.width_px), np.uint8)
    rig.daemon.kept = Keeping(dict.fromkeys(CAMERAS, form), RATE_HZ, 1, 16)
    for port in rig.daemon.stages.ports:
        port.format = form
    for number in range(120):
        for camera in CAMERAS:
            rig.daemon.kept.put(Frame(camera, number, number / RATE_HZ, 15, noise))
    told = record(tmp_path / "taken", "--last", 1, "--max-mb", 1)
    assert told.exit_code == 0, told.output
    assert "as large as --max-mb allows" in told.stderr
    recording = open_recording(tmp_path / "taken")
    assert (recording.complete, len(recording)) == (True, 50)


def test_only_a_daemon_keeps_what_was(rig: Rig, tmp_path: Path) -> None:
    config = tmp_path / "other.toml"
    config.write_text("")
    told = record(tmp_path / "taken", "--last", 5, "--config", config)
    assert told.exit_code == 1
    assert "no daemon runs with these settings" in told.stderr
    gone = record(tmp_path / "taken", "--last", 5, "--socket", tmp_path / "none")
    assert gone.exit_code == 1
    assert "no daemon answers" in gone.stderr
