"""`cornertouchd calibrate display` as its users run it, and fingers that a file moves."""

import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from cornertouchd.calibration.display import CORNERS, load_display
from cornertouchd.cli import main
from cornertouchd.cli.guided_rig import PICTURE_INSET_MM
from cornertouchd.config import (
    CamerasSettings,
    DestinationSettings,
    Settings,
    TuioSettings,
)
from cornertouchd.model import Touch, TouchFrame
from cornertouchd.runtime.assembly import calibration_file, make_tuio_sink
from cornertouchd.runtime.displays import display_file, find_displays
from cornertouchd.wire.tuio_reader import TuioReader

COMMAND = [sys.executable, "-m", "cornertouchd", "calibrate"]
SURFACE_MM = (350.0, 400.0)


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """A home of its own, and a state directory whatever this machine has."""
    ours = {"HOME": str(tmp_path / "home"), "STATE_DIRECTORY": str(tmp_path / "state")}
    return {**os.environ, **ours, "XDG_CACHE_HOME": "", "CACHE_DIRECTORY": ""}


@pytest.fixture
def client() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listening:
        listening.bind(("127.0.0.1", 0))
        listening.settimeout(20.0)
        yield listening


def test_four_taps_make_clients_hear_of_the_pictures_own_places(
    environment: dict[str, str], client: socket.socket
) -> None:
    calibration = calibration_file(Settings(), environment)
    file = display_file(calibration)
    done = subprocess.run(
        [*COMMAND, "display", "--simulate", "--output", file],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    for number, corner in enumerate(CORNERS, 1):
        assert f"Display - {number} of 4, {corner} of the picture - tap" in done.stderr
    assert f"saved {file}" in done.stderr
    place = load_display(file)
    assert (place.rotation_deg, place.mirror) == (0, False)
    found = (place.left_mm, place.top_mm, place.width_mm, place.height_mm)
    width, height = (side - 2 * PICTURE_INSET_MM for side in SURFACE_MM)
    assert found == pytest.approx((PICTURE_INSET_MM, PICTURE_INSET_MM, width, height), abs=2.0)

    destination = DestinationSettings(port=client.getsockname()[1])
    settings = Settings(
        cameras=CamerasSettings(source="v4l2"), tuio=TuioSettings(destinations=(destination,))
    )
    sink = make_tuio_sink(settings, SURFACE_MM, "", find_displays(settings, calibration))
    centre_left = Touch(1, place.left_mm, SURFACE_MM[1] / 2, 0.0, 0.0, 0.0)
    now_s = time.monotonic()
    sink.send(TouchFrame(now_s, (centre_left,)), now_s)
    reader = TuioReader()
    while not (cursors := [c for s in reader.sources.values() for c in s.cursors.values()]):
        reader.feed(client.recv(65536), "tracker", now_s)
    sink.close()
    assert (cursors[0].x, cursors[0].y) == pytest.approx((0.0, 0.5), abs=0.01)


def test_a_line_that_is_no_place_is_told_and_passed_over(
    environment: dict[str, str], tmp_path: Path
) -> None:
    pipe, output = tmp_path / "finger", tmp_path / "calibration.json"
    os.mkfifo(pipe)
    finger = os.open(pipe, os.O_RDWR)  # unlike for writing alone, this waits for nobody
    session = subprocess.Popen(
        [*COMMAND, "--simulate", "--finger", pipe, "--output", output],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    told: list[str] = []

    def read_until(pattern: str) -> re.Match[str]:
        assert session.stderr is not None
        for line in session.stderr:
            told.append(line)
            if found := re.search(pattern, line):
                return found
        raise AssertionError("".join(told))

    try:
        target = read_until(r"Taps - 1 of 16 - (\d+) mm from the left, (\d+) mm from the top")
        os.write(finger, b"25 and 30\nnan 30\n25\n25 30 35\n\xff\xfe\n")
        os.write(finger, f"{target[1]} {target[2]}\n".encode())
        read_until("Taps - 2 of 16 .* lift the finger")
        session.send_signal(signal.SIGINT)
        read_until("1 tap is kept: start again to go on")
        assert session.wait(timeout=30) == 1
    finally:
        session.kill()
        session.communicate()
        os.close(finger)
    for line in ("25 and 30", "nan 30", "25", "25 30 35"):
        assert f"{line!r} is not X Y in millimetres\n" in told
    assert "Traceback" not in "".join(told)


def test_a_file_of_places_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    missing = tmp_path / "nowhere"
    result = CliRunner().invoke(main, ["calibrate", "--simulate", "--finger", str(missing)])
    assert result.exit_code == 1
    assert f"{missing}: cannot be read: No such file" in result.stderr


def test_what_was_found_can_be_forgotten(
    environment: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", environment["STATE_DIRECTORY"])
    calibration = calibration_file(Settings(), environment)
    file = display_file(calibration)
    file.parent.mkdir()
    file.write_text("{}")
    result = CliRunner().invoke(main, ["calibrate", "display", "--forget"])
    assert result.exit_code == 0, result.output
    assert not file.exists()
    assert CliRunner().invoke(main, ["calibrate", "display", "--forget"]).exit_code == 0


def test_without_a_calibration_taps_cannot_be_located(
    environment: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", environment["STATE_DIRECTORY"])
    config = tmp_path / "kiosk.toml"
    config.write_text('[cameras]\nsource = "v4l2"\n')
    result = CliRunner().invoke(main, ["calibrate", "display", "--config", str(config)])
    assert result.exit_code == 1
    assert "calibration.json: no calibration is there; run `cornertouchd" in result.stderr
