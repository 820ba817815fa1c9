"""SIGHUP: a good configuration is followed, a bad one refused in one line."""

import logging
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cornertouchd.calibration.file import load_calibration
from cornertouchd.config import ConfigError
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.parts import Parts, make_parts
from cornertouchd.runtime.reloading import Outcome, Reload, ReloadSignal

PATIENCE_S = 60.0
SURFACE = "[surface]\nwidth_mm = 350.0\nheight_mm = 400.0\n"


class Installation:
    """A configuration file, a calibration, and a daemon that has no cameras plugged in."""

    def __init__(self, directory: Path, calibration: Path) -> None:
        self.file = directory / "kiosk.toml"
        self.calibration = directory / "calibration.json"
        self.calibration.write_bytes(calibration.read_bytes())
        cameras = load_calibration(calibration).cameras
        self.offsets_px = [camera.format.row_offset_px for camera in cameras]
        self.write()
        self.parts = self.make(None)
        self.daemon = Daemon(
            self.parts.ports,
            self.parts.calibration,
            self.parts.sinks,
            self.parts.settings,
            MonotonicClock(),
        )
        self.daemon.start()
        self._reload = Reload(self.daemon, self.parts, self.make)

    def write(self, cameras: str = "", more: str = "") -> None:
        place = f'[calibration]\nfile = "{self.calibration}"\n'
        formats = "height_px = 480\nread_timeout_s = 0.1\nreopen_delay_s = 0.1\n"
        units = "".join(
            f'[cameras.C{n}]\ndevice = "/dev/none{n}"\nrow_offset_px = {offset}\nrows_px = 64\n'
            for n, offset in enumerate(self.offsets_px, 1)
        )
        self.file.write_text(f"{SURFACE}{place}[cameras]\n{formats}{cameras}{units}{more}")

    def make(self, before: Parts | None) -> Parts:
        return make_parts(self.file, {}, MonotonicClock(), before)

    def reload(self) -> Outcome | None:
        self._reload.begin()
        return self._reload.finish(PATIENCE_S)


@pytest.fixture(scope="module")
def steady(
    tmp_path_factory: pytest.TempPathFactory, calibration_file: Path
) -> Iterator[Installation]:
    """One for all tests that change nothing in the end."""
    made = Installation(tmp_path_factory.mktemp("steady"), calibration_file)
    yield made
    made.daemon.stop()


@pytest.fixture
def installation(tmp_path: Path, calibration_file: Path) -> Iterator[Installation]:
    made = Installation(tmp_path, calibration_file)
    yield made
    made.daemon.stop()


def test_nothing_new_changes_nothing(steady: Installation) -> None:
    stages = steady.daemon.stages
    assert steady.reload() == "unchanged"
    assert steady.daemon.stages is stages


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda kiosk: kiosk.write("rate_hz = 0\n"), "rate_hz = 0: must be a number from 1"),
        (lambda kiosk: kiosk.write("rate_hz = \n"), "line"),
        (lambda kiosk: kiosk.file.unlink(), "no such file"),
        (lambda kiosk: kiosk.calibration.write_text("{"), "calibration"),
        (lambda kiosk: kiosk.write("width_px = 800\n"), "800x480"),
    ],
    ids=["value", "syntax", "no file", "calibration", "camera that does not fit"],
)
def test_a_bad_one_is_refused_in_one_line_and_the_former_goes_on(
    steady: Installation,
    spoil: Callable[[Installation], None],
    said: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    stages, calibration = steady.daemon.stages, steady.calibration.read_bytes()
    spoil(steady)
    with caplog.at_level(logging.INFO):
        outcome = steady.reload()
    steady.write()
    steady.calibration.write_bytes(calibration)
    assert outcome == "refused"
    assert steady.daemon.stages is stages
    (told,) = [one.message for one in caplog.records if "reload" in one.message]
    assert told.startswith("reload refused, the former configuration goes on: ")
    assert said in told
    assert "\n" not in told


def test_after_a_bad_one_a_good_one_is_followed(installation: Installation) -> None:
    installation.write("rate_hz = 0\n")
    assert installation.reload() == "refused"
    installation.write(more="[[tuio.destinations]]\nport = 3334\n")
    assert installation.reload() == "changed"
    (destination,) = installation.daemon.stages.settings.tuio.destinations
    assert destination.port == 3334


def test_other_receivers_leave_cameras_and_all_that_was_learned_alone(
    installation: Installation,
) -> None:
    before = installation.daemon.stages
    installation.write(more="[[tuio.destinations]]\nport = 3334\n")
    assert installation.reload() == "changed"
    after = installation.daemon.stages
    assert after.captures is before.captures
    assert after.fusion.pipeline is before.fusion.pipeline
    assert after.fusion.sinks[0] is not before.fusion.sinks[0]


def test_settings_of_the_touches_leave_cameras_and_receivers_alone(
    installation: Installation,
) -> None:
    before = installation.daemon.stages
    installation.write(more="[tracking]\nsmoothing = false\n")
    assert installation.reload() == "changed"
    after = installation.daemon.stages
    assert after.ports == before.ports
    assert after.fusion.sinks is before.fusion.sinks
    assert after.fusion.pipeline is not before.fusion.pipeline


def test_only_the_camera_with_other_settings_gets_another_port(
    installation: Installation,
) -> None:
    before = {port.id: port for port in installation.daemon.stages.ports}
    text = installation.file.read_text().replace("/dev/none3", "/dev/other3")
    installation.file.write_text(text)
    assert installation.reload() == "changed"
    after = {port.id: port for port in installation.daemon.stages.ports}
    assert [camera for camera in after if after[camera] is not before[camera]] == ["C3"]


def test_a_camera_can_be_taken_out(installation: Installation) -> None:
    before = {port.id: port for port in installation.daemon.stages.ports}
    text = installation.file.read_text().replace("[cameras.C4]", "[cameras.C4]\nenabled = false")
    installation.file.write_text(text)
    assert installation.reload() == "changed"
    after = {port.id: port for port in installation.daemon.stages.ports}
    assert list(after) == ["C1", "C2", "C3"]
    assert all(after[camera] is before[camera] for camera in after)


def test_an_error_that_nobody_expected_is_refused_too(
    steady: Installation, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(_: Parts) -> Parts:
        raise ZeroDivisionError("a bug")

    reload = Reload(steady.daemon, steady.parts, fail)
    reload.begin()
    assert reload.finish(PATIENCE_S) == "refused"
    assert "a bug" in caplog.text


def test_without_a_reload_nothing_is_finished(steady: Installation) -> None:
    reload = Reload(steady.daemon, steady.parts, steady.make)
    assert reload.finish() is None
    assert not reload.is_under_way


def test_a_missing_file_at_the_start_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        make_parts(tmp_path / "none.toml", {}, MonotonicClock())


def test_several_signals_count_as_one_and_the_former_handler_returns() -> None:
    former = signal.getsignal(signal.SIGHUP)
    with ReloadSignal() as hangup:
        assert not hangup.take()
        os.kill(os.getpid(), signal.SIGHUP)
        os.kill(os.getpid(), signal.SIGHUP)
        assert hangup.take()
        assert not hangup.take()
    assert signal.getsignal(signal.SIGHUP) is former
