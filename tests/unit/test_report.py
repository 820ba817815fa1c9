"""`cornertouchd report`: one zip with what there is, what is missing and why, and no secrets."""

import json
import stat
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner, Result
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.cli import main
from cornertouchd.devices.recording import open_recording
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.runtime.asking import AskSocket, document
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.keeping import Keeping
from cornertouchd.runtime.kept_stream import pictures_of
from cornertouchd.runtime.support_report import Part, blanked, secrets_in, write_report

TOKEN = "k3yK3yk3yK3yk3yK3y"
CONFIG = f"""
[cameras]
source = "simulated"  # no cameras to be opened
[monitor]
host = "0.0.0.0"
token = "{TOKEN}"
"""
FORM = PictureFormat(64, 48, 10, 8)


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where everything lies that the daemon and the user have."""
    (tmp_path / "cornertouchd.toml").write_text(CONFIG)
    monkeypatch.chdir(tmp_path)
    for variable in ("RUNTIME_DIRECTORY", "STATE_DIRECTORY"):
        monkeypatch.setenv(variable, str(tmp_path))
    return tmp_path


@pytest.fixture
def daemon(place: Path) -> Iterator[None]:
    kept = Keeping({"C1": FORM, "C2": FORM}, 100.0, 2, 16)
    for number in range(50):
        for camera in ("C1", "C2"):
            kept.put(Frame(camera, number, number / 100, 15, np.zeros((8, 64), np.uint8)))
    rig = SimpleNamespace(
        kept=kept,
        stages=SimpleNamespace(
            calibration=SimpleNamespace(surface_mm=(350.0, 400.0)),
            settings=SimpleNamespace(
                cameras=SimpleNamespace(rate_hz=100.0), pairing=SimpleNamespace(tolerance_ms=4.0)
            ),
            ports=[SimpleNamespace(id=one, format=FORM, identity="") for one in ("C1", "C2")],
        ),
    )
    name = json.dumps({"configuration": str((place / "cornertouchd.toml").resolve())}).encode()
    log = {"lines": [{"at": 0.5, "level": "ERROR", "text": f"somebody said {TOKEN}"}]}
    answers = {
        "hello": document(lambda: name),
        "status": document(lambda: b'{"state": "healthy"}'),
        "log": document(lambda: json.dumps(log).encode()),
        "pictures": pictures_of(rig, MonotonicClock()),  # type: ignore[arg-type]
    }
    with AskSocket(place / "status.sock", answers):
        yield


def report(*arguments: object) -> Result:
    return CliRunner().invoke(
        main, ["report", "--config", "cornertouchd.toml", *map(str, arguments)]
    )


def texts(path: Path) -> dict[str, str]:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        return {
            name.removeprefix(f"{path.stem}/"): archive.read(name).decode(errors="replace")
            for name in archive.namelist()
        }


@pytest.mark.usefixtures("daemon")
def test_everything_is_in_it_and_listed(place: Path) -> None:
    (place / "calibration.json").write_text('{"made": "by hand"}')
    told = report("help.zip")
    assert told.exit_code == 0, told.output
    assert told.stdout.strip() == "help.zip"
    inside = texts(place / "help.zip")
    names = {"cornertouchd.toml", "calibration.json", "status.json", "hello.json", "log.txt"}
    assert names | {"check.json", "versions.json", "README.txt"} <= set(inside)
    assert json.loads(inside["status.json"]) == {"state": "healthy"}
    assert inside["calibration.json"] == '{"made": "by hand"}'
    assert "1970-01-01T00:00:00.500000+00:00 ERROR somebody said" in inside["log.txt"]
    for name in set(inside) - {"README.txt"}:
        assert name in inside["README.txt"]
        assert name in told.stderr
    with zipfile.ZipFile(place / "help.zip") as archive:
        archive.extractall(place)
    assert len(open_recording(place / "help" / "strips")) == 50


@pytest.mark.usefixtures("daemon")
def test_no_secret_is_in_it_wherever_it_was(place: Path) -> None:
    told = report("help.zip")
    inside = texts(place / "help.zip")
    assert not any(TOKEN in text for text in inside.values())
    assert TOKEN not in told.output
    assert 'token = "(left out of the report)"' in inside["cornertouchd.toml"]
    assert "# no cameras to be opened" in inside["cornertouchd.toml"]
    assert stat.S_IMODE((place / "help.zip").stat().st_mode) == 0o600


def test_with_the_daemon_down_it_says_what_is_missing(place: Path) -> None:
    told = report("help.zip")
    assert told.exit_code == 0, told.output
    inside = texts(place / "help.zip")
    for said in (told.stderr, inside["README.txt"]):
        assert "how the daemon does: no daemon runs with this configuration" in said
        assert "calibration.json: No such file or directory" in said
    assert "versions.json" in inside


def test_a_bad_configuration_is_reported_all_the_same(place: Path) -> None:
    (place / "cornertouchd.toml").write_text(f'[monitor]\ntoken = "{TOKEN}"\nhost = 7\n= broken')
    told = report("help.zip")
    assert told.exit_code == 0, told.output
    assert "the defaults are taken for the report" in told.stderr
    inside = texts(place / "help.zip")
    assert "= broken" in inside["cornertouchd.toml"]
    assert TOKEN not in inside["cornertouchd.toml"]


def test_a_report_that_cannot_be_written_leaves_nothing_behind(place: Path) -> None:
    told = report("nowhere/help.zip")
    assert told.exit_code == 1
    assert "nowhere/help.zip: cannot be written" in told.stderr


def test_one_that_is_cut_off_leaves_the_former_one(tmp_path: Path) -> None:
    path = tmp_path / "help.zip"
    path.write_bytes(b"former")

    def interrupted() -> Iterator[tuple[str, bytes]]:
        yield "one", b"1"
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_report(path, [Part("some", interrupted)], ())
    assert path.read_bytes() == b"former"
    assert list(tmp_path.iterdir()) == [path]


def test_a_part_that_fails_half_way_is_held_and_missing(tmp_path: Path) -> None:
    def half() -> Iterator[tuple[str, bytes]]:
        yield "one", b"1"
        raise ZeroDivisionError("nothing by nothing")

    contents = write_report(tmp_path / "a.zip", [Part("some", half)], ())
    assert contents.held == (("some", ("one",)),)
    assert contents.missing == (("some", "nothing by nothing"),)


@given(
    value=st.text(st.characters(codec="ascii", exclude_characters="\r"), min_size=6, max_size=40)
)
def test_a_secret_is_blanked_however_it_is_written(value: str) -> None:
    for line in (
        f"token = {json.dumps(value)}",
        f"monitor = {{ port = 1, Token={json.dumps(value)}, host = 'a' }}",
        f'"api_token" = {json.dumps(value)} # and this',
    ):
        if "\x7f" in value:
            continue  # TOML has it escaped
        assert secrets_in(line) == (value,)
        assert json.dumps(value) not in blanked(line)
