"""The commands as their users run them: what they print, how they end, what reaches a client."""

import csv
import json
import math
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from cornertouchd.cli import main
from cornertouchd.wire.tuio_reader import TuioReader

COMMAND = [sys.executable, "-m", "cornertouchd"]
SIMULATED = """
[cameras]
source = "simulated"
[simulation]
touches = 3
[[tuio.destinations]]
port = {port}
"""


def invoke(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """A home of its own for state and caches; the simulated rig calibrates once."""
    return {**os.environ, "HOME": str(tmp_path_factory.mktemp("home")), "XDG_CACHE_HOME": ""}


class Client:
    """A TUIO client: a socket and a reader of what comes."""

    def __init__(self) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._socket.settimeout(20.0)
        self.port = self._socket.getsockname()[1]
        self.reader = TuioReader()
        self.added = 0

    def read_until(self, enough: object) -> None:
        """Take packets in until `enough()`; fails if they stop coming."""
        while not enough():
            events = self.reader.feed(self._socket.recv(65536), "tracker", time.monotonic())
            self.added += sum(event.kind == "add" for event in events)

    @property
    def touches(self) -> int:
        return sum(len(source.cursors) for source in self.reader.sources.values())

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def client() -> Iterator[Client]:
    made = Client()
    yield made
    made.close()


def start(*arguments: object, environment: dict[str, str]) -> subprocess.Popen[str]:
    command = [*COMMAND, *map(str, arguments)]
    return subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_run_sends_touches_and_stops_clean(
    number: signal.Signals, client: Client, tmp_path: Path, environment: dict[str, str]
) -> None:
    config = tmp_path / "kiosk.toml"
    config.write_text(SIMULATED.format(port=client.port))
    daemon = start("run", "--config", config, environment=environment)
    try:
        client.read_until(lambda: client.added >= 3 and client.touches >= 2)
        began = time.monotonic()
        daemon.send_signal(number)
        client.read_until(lambda: client.touches == 0)
        assert daemon.wait(timeout=10) == 0
        assert time.monotonic() - began < 3.0  # a second is promised, 0.3 s usual; a busy machine
    finally:
        daemon.kill()
        _, messages = daemon.communicate()
    assert "stopped" in messages
    assert "Traceback" not in messages


def test_demo_ends_by_itself(client: Client, environment: dict[str, str]) -> None:
    arguments = ["demo", "--seconds", "2", "--touches", "2", "--no-monitor"]
    demo = start(*arguments, "--tuio", f"127.0.0.1:{client.port}", environment=environment)
    try:
        client.read_until(lambda: client.touches == 2)
        _, messages = demo.communicate(timeout=30)
    finally:
        demo.kill()
    assert demo.returncode == 0
    assert "frame sets/s" in messages


def test_what_is_recorded_can_be_replayed(
    client: Client, tmp_path: Path, environment: dict[str, str]
) -> None:
    config = tmp_path / "rig.toml"
    config.write_text(SIMULATED.format(port=client.port))
    recording = tmp_path / "recording"
    done = subprocess.run(
        [*COMMAND, "record", recording, "--seconds", "0.6", "--config", config],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert "frame sets" in done.stderr
    demo = ["demo", "--seconds", "0.1", "--tuio", f"127.0.0.1:{client.port}"]
    start(*demo, environment=environment).communicate(timeout=60)
    (calibration,) = Path(environment["HOME"]).glob(".cache/cornertouchd/simulated-*.json")
    output = tmp_path / "touches.jsonl"
    result = invoke("replay", recording, "--calibration", calibration, "--output", output)
    assert result.exit_code == 0, result.output
    lines = [json.loads(line) for line in output.read_text().splitlines()]
    assert len(lines) > 20
    assert max(len(line["touches"]) for line in lines) == 3
    assert len({touch["id"] for line in lines for touch in line["touches"]}) <= 6


def test_replay_to_a_client_lifts_at_its_end(
    client: Client, recordings: Path, calibration_file: Path
) -> None:
    arguments = [recordings / "multi02_small", "--calibration", calibration_file]
    result = invoke("replay", *arguments, "--tuio", f"127.0.0.1:{client.port}", "--speed", "max")
    assert result.exit_code == 0, result.output
    client.read_until(lambda: client.added >= 2 and client.touches == 0)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_record_ends_with_a_whole_recording(
    number: signal.Signals, tmp_path: Path, environment: dict[str, str]
) -> None:
    config = tmp_path / "rig.toml"
    config.write_text(SIMULATED.format(port=9))
    recorder = start("record", tmp_path / "taken", "--config", config, environment=environment)
    assert recorder.stderr is not None
    assert "Ctrl-C ends" in recorder.stderr.readline()
    recorder.send_signal(number)
    _, messages = recorder.communicate(timeout=30)
    assert recorder.returncode == 0, messages
    assert json.loads((tmp_path / "taken" / "recording.json").read_text())["complete"]


def test_a_replay_that_is_stopped_lifts_and_writes_nothing(
    client: Client,
    recordings: Path,
    calibration_file: Path,
    tmp_path: Path,
    environment: dict[str, str],
) -> None:
    output = tmp_path / "contacts.jsonl"
    arguments = [recordings / "multi02_small", "--calibration", calibration_file]
    arguments += ["--tuio", f"127.0.0.1:{client.port}", "--speed", "0.01", "--output", output]
    process = start("replay", *arguments, environment=environment)
    client.read_until(lambda: client.touches == 2)
    process.send_signal(signal.SIGTERM)
    client.read_until(lambda: client.touches == 0)
    _, messages = process.communicate(timeout=30)
    assert process.returncode == 1
    assert "stopped after" in messages
    assert not output.exists()


def test_reference_points_that_do_not_fit_are_refused_and_nothing_saved(
    recordings: Path, tmp_path: Path
) -> None:
    points = tmp_path / "points.csv"
    rows = (recordings / "calib_few_small" / "points.csv").read_text().splitlines()
    mirrored = [row.split(",") for row in rows[1:]]
    lines = [f"{k},{350 - float(x)},{y},{d}" for k, x, y, d in mirrored]
    points.write_text("\n".join([rows[0], *lines]) + "\n")
    output = tmp_path / "calibration.json"
    result = invoke(
        "calibrate",
        *("--recording", recordings / "calib_few_small", "--empty", recordings / "empty_small"),
        *("--points", points, "--output", output),
    )
    assert result.exit_code == 1
    assert "check the reference points" in result.stderr
    assert not output.exists()


def test_a_configuration_of_another_surface_is_refused(
    calibration_file: Path, tmp_path: Path
) -> None:
    config = tmp_path / "kiosk.toml"
    config.write_text(f"[surface]\nwidth_mm = 2400.0\n[calibration]\nfile = '{calibration_file}'\n")
    result = invoke("run", "--config", config)
    assert result.exit_code == 1
    assert "2400x400 mm in the configuration, 350x400 mm in the calibration" in result.stderr


def test_an_unknown_key_is_named_with_the_nearest_known_one(tmp_path: Path) -> None:
    config = tmp_path / "kiosk.toml"
    config.write_text("[surface]\nwidht_mm = 350.0\n")
    result = invoke("run", "--config", config)
    assert result.exit_code == 1
    assert "kiosk.toml" in result.stderr
    assert "widht_mm" in result.stderr
    assert "width_mm" in result.stderr


def test_a_missing_calibration_is_named(recordings: Path, tmp_path: Path) -> None:
    missing = tmp_path / "none.json"
    result = invoke("replay", recordings / "single_small", "--calibration", missing)
    assert result.exit_code == 1
    assert f"{missing}: no calibration is there" in result.stderr


def test_run_without_a_calibration_says_where_it_looked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    config = tmp_path / "kiosk.toml"
    config.write_text("")
    result = invoke("run", "--config", config)
    assert result.exit_code == 1
    assert str(tmp_path / "calibration.json") in result.stderr
    assert "cornertouchd calibrate" in result.stderr


@pytest.fixture
def copy(recordings: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(recordings / "multi02_small", tmp_path / "copy"))


def test_a_truncated_video_is_named_and_nothing_written(
    copy: Path, calibration_file: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    video = copy / "c3.mkv"
    video.write_bytes(video.read_bytes()[:20_000])
    output = tmp_path / "contacts.jsonl"
    result = invoke("replay", copy, "--calibration", calibration_file, "--output", output)
    assert result.exit_code == 1
    assert "c3.mkv" in result.stderr
    assert capfd.readouterr().err == ""  # what FFmpeg has to say would be no help
    assert not output.exists()


def test_a_recording_of_another_size_is_named(copy: Path, calibration_file: Path) -> None:
    description = json.loads((copy / "recording.json").read_text())
    for camera in description["cameras"]:
        camera["row_offset_px"] += 2
    (copy / "recording.json").write_text(json.dumps(description))
    result = invoke("replay", copy, "--calibration", calibration_file)
    assert result.exit_code == 1
    assert "camera C1" in result.stderr
    assert "calibrated at 640x480" in result.stderr


def test_a_failed_replay_leaves_the_former_output(
    copy: Path, calibration_file: Path, tmp_path: Path
) -> None:
    output = tmp_path / "contacts.jsonl"
    output.write_text("former\n")
    (copy / "c2.mkv").unlink()
    result = invoke("replay", copy, "--calibration", calibration_file, "--output", output)
    assert result.exit_code == 1
    assert output.read_text() == "former\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ["replay"],
        ["replay", "somewhere"],
        ["replay", "somewhere", "--calibration", "x", "--empty", "y", "--empty-sets", "0-3"],
        ["replay", "somewhere", "--calibration", "x", "--empty-sets", "3-1"],
        ["replay", "somewhere", "--calibration", "x", "--speed", "fast"],
        ["demo", "--tuio", "nowhere"],
        ["demo", "--touches", "99"],
        ["calibrate", "--method", "magic"],
        ["dance"],
    ],
    ids=" ".join,
)
def test_wrong_usage_ends_with_2(arguments: list[str]) -> None:
    assert invoke(*arguments).exit_code == 2


@pytest.mark.parametrize("option", ["--empty", "--empty-sets"])
def test_the_background_can_be_given_anew(
    option: str, recordings: Path, calibration_file: Path, tmp_path: Path
) -> None:
    """Measured against frame sets that show its own finger, a recording shows no finger."""
    recording = recordings / "single_small"
    value = recording if option == "--empty" else "0-0"
    arguments = [recording, "--calibration", calibration_file, "--independent"]
    outputs = {}
    for name, more in (("before", []), ("after", [option, value])):
        output = tmp_path / f"{name}.jsonl"
        result = invoke("replay", *arguments, *more, "--output", output)
        assert result.exit_code == 0, result.output
        outputs[name] = [json.loads(line)["contacts"] for line in output.read_text().splitlines()]
    assert len(outputs["before"][0]) == 1
    assert outputs["before"] != outputs["after"]
    if option == "--empty-sets":
        assert outputs["after"][0] == []


def test_vanishing_point_calibrates_too(
    recordings: Path, whole_recordings: Path, tmp_path: Path
) -> None:
    calibration, output = tmp_path / "vanishing.json", tmp_path / "contacts.jsonl"
    result = invoke(
        "calibrate",
        *("--recording", recordings / "calib_few_small", "--empty", recordings / "empty_small"),
        *("--method", "vanishing-point", "--output", calibration),
    )
    assert result.exit_code == 0, result.output
    arguments = ["--calibration", calibration, "--independent", "--output", output]
    result = invoke("replay", whole_recordings / "single_small", *arguments)
    assert result.exit_code == 0, result.output
    lines = [json.loads(line)["contacts"] for line in output.read_text().splitlines()]
    with (whole_recordings / "single_small" / "truth.csv").open(newline="") as file:
        truth = list(csv.DictReader(file))
    off_mm = [
        math.dist((c["x_mm"], c["y_mm"]), (float(t["section_x_mm"]), float(t["section_y_mm"])))
        for contacts, t in zip(lines, truth, strict=True)
        for c in contacts
    ]
    assert len(off_mm) >= 0.8 * len(truth)
    assert sorted(off_mm)[len(off_mm) // 2] < 6.0  # barrel lenses: the paper's pinhole bends
