"""`cornertouchd check`: what can be wrong is found, and each finding says what to do."""

import json
import os
import pwd
import resource
import shutil
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner
from fake_sysfs import BULK_CAMERA, FakeSysfs, isochronous_camera

from cornertouchd.calibration.file import load_calibration, save_calibration
from cornertouchd.cli import main
from cornertouchd.config import (
    CalibrationSettings,
    CamerasSettings,
    DestinationSettings,
    RuntimeSettings,
    Settings,
    TuioSettings,
)
from cornertouchd.devices.camera_survey import CameraAbilities
from cornertouchd.guiding.finding import Finding
from cornertouchd.runtime import checks
from cornertouchd.runtime.checks import check_installation
from cornertouchd.runtime.checks.bandwidth import bandwidth_of
from cornertouchd.runtime.checks.cameras import cameras_of
from cornertouchd.runtime.checks.files import calibration_of, disk_of, kernels_of
from cornertouchd.runtime.checks.installation import (
    Installation,
    environment_of,
    output_of,
    unit_for,
)
from cornertouchd.runtime.checks.machine import clock_of, groups_of, real_time_of, service_of
from cornertouchd.runtime.checks.targets import targets_of
from cornertouchd.simulation.camera import Fault, SimulatedCameraPort, rig_ports
from cornertouchd.simulation.clock import SimulatedClock
from cornertouchd.simulation.rig import SimulatedRig


class Kiosk:
    """An installation that is well, until a test spoils something."""

    def __init__(self, directory: Path) -> None:
        self.sysfs, self.proc, self.dev = (directory / name for name in ("sys", "proc", "dev"))
        self.unit = {
            "LoadState": "loaded",
            "ActiveState": "inactive",
            "UnitFileState": "enabled",
            "NRestarts": "0",
            "LimitRTPRIO": "20",
        }
        self.settings = Settings()
        self.clock = SimulatedClock()
        self.environ = {"STATE_DIRECTORY": str(directory / "state")}
        self.ports: tuple[SimulatedCameraPort, ...] = ()
        self.set_clock("tsc", "tsc hpet")

    def set_clock(self, current: str, available: str) -> None:
        directory = self.sysfs / "devices/system/clocksource/clocksource0"
        directory.mkdir(parents=True, exist_ok=True)
        (directory / "current_clocksource").write_text(f"{current}\n")
        (directory / "available_clocksource").write_text(f"{available}\n")

    def set_settings(self, **tables: object) -> None:
        self.settings = self.settings.model_copy(update=tables)

    def systemctl(self, *command: str) -> str:
        assert command[:2] == ("systemctl", "show")
        name = command[-1].removeprefix("--property=")
        return f"{name}={self.unit[name]}\n" if name in self.unit else ""

    def find(self, check: Callable[[Installation], object]) -> list[Finding]:
        installation = Installation(
            self.settings,
            self.environ,
            self.clock,
            sysfs=self.sysfs,
            proc=self.proc,
            dev=self.dev,
            look=lambda _node, **_wanted: CameraAbilities(captures=True, pixel_format="GREY"),
            ports=lambda: self.ports,
            output_of=self.systemctl,
        )
        return list(check(installation))  # type: ignore[call-overload]


@pytest.fixture
def kiosk(tmp_path: Path) -> Kiosk:
    return Kiosk(tmp_path)


def only(findings: list[Finding], level: str, *words: str) -> Finding:
    """Return the one finding, which is at this level, has a remedy if need be, and these words."""
    (finding,) = findings
    assert finding.level == level, finding
    assert bool(finding.remedy) == (level != "ok")
    for word in words:
        assert word in finding.text + finding.remedy
    return finding


def test_a_service_that_runs_is_well(kiosk: Kiosk) -> None:
    kiosk.unit |= {"ActiveState": "active", "StatusText": "4 cameras, 100 frame sets/s"}
    only(kiosk.find(service_of), "ok", "4 cameras, 100 frame sets/s")


@pytest.mark.parametrize(
    ("unit", "level", "words"),
    [
        ({"LoadState": "not-found"}, "warning", ["not installed"]),
        ({"ActiveState": "failed"}, "error", ["fails", "journalctl"]),
        ({"ActiveState": "activating", "StatusText": "does not start: x"}, "error", ["not start"]),
        ({"ActiveState": "inactive", "StatusText": "does not start: x"}, "warning", ["inactive"]),
        ({"ActiveState": "active", "StatusText": "degraded: C3 lost"}, "warning", ["C3 lost"]),
        ({"ActiveState": "inactive"}, "warning", ["inactive", "systemctl start"]),
    ],
)
def test_a_service_that_does_not_is_told(
    kiosk: Kiosk, unit: dict[str, str], level: str, words: list[str]
) -> None:
    kiosk.unit |= unit
    only(kiosk.find(service_of), level, *words)


def test_restarts_and_a_unit_that_is_not_enabled_are_told(kiosk: Kiosk) -> None:
    kiosk.unit |= {"ActiveState": "active", "StatusText": "", "NRestarts": "7"}
    kiosk.unit |= {"UnitFileState": "disabled"}
    _, restarts, disabled = kiosk.find(service_of)
    assert "restarted it 7 times" in restarts.text
    assert "systemctl enable" in disabled.remedy


@pytest.mark.parametrize(
    ("groups", "level"), [(["video", "dialout"], "ok"), (["video"], "error"), ([], "error")]
)
def test_the_service_user_needs_its_groups(
    kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch, groups: list[str], level: str
) -> None:
    user = SimpleNamespace(pw_name="cornertouchd", pw_uid=999, pw_gid=999)
    names = dict(enumerate(groups))
    module = "cornertouchd.runtime.checks.machine"
    monkeypatch.setattr(f"{module}.pwd.getpwnam", lambda _: user)
    monkeypatch.setattr(f"{module}.os.getgrouplist", lambda *_: list(names))
    monkeypatch.setattr(f"{module}.grp.getgrgid", lambda gid: SimpleNamespace(gr_name=names[gid]))
    found = only(kiosk.find(groups_of), level)
    assert level == "ok" or "usermod -aG" in found.remedy


def test_without_the_user_of_the_service_root_is_no_measure(
    kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(_: str) -> None:
        raise KeyError

    module = "cornertouchd.runtime.checks.machine"
    monkeypatch.setattr(f"{module}.pwd.getpwnam", nobody)
    monkeypatch.setattr(f"{module}.os.getuid", lambda: 0)
    root = pwd.struct_passwd(("root", "x", 0, 0, "", "/root", "/bin/sh"))
    monkeypatch.setattr(f"{module}.pwd.getpwuid", lambda _: root)
    only(kiosk.find(groups_of), "warning", "systemd-sysusers")


@pytest.mark.parametrize(
    ("wanted", "limit", "level"), [(10, "20", "ok"), (10, "0", "warning"), (0, "0", "ok")]
)
def test_the_priority_is_measured_by_the_limit_of_the_unit(
    kiosk: Kiosk, wanted: int, limit: str, level: str
) -> None:
    kiosk.set_settings(runtime=RuntimeSettings(realtime_priority=wanted))
    kiosk.unit["LimitRTPRIO"] = limit
    only(kiosk.find(real_time_of), level)


def test_without_a_unit_the_limit_of_this_process_counts(
    kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch
) -> None:
    del kiosk.unit["LimitRTPRIO"]
    monkeypatch.setattr(resource, "getrlimit", lambda _: (5, 5))
    only(kiosk.find(real_time_of), "warning", "up to 5")


def test_clocks(kiosk: Kiosk) -> None:
    only(kiosk.find(clock_of), "ok", "tsc")
    kiosk.set_clock("hpet", "tsc hpet acpi_pm")
    only(kiosk.find(clock_of), "warning", "hpet", "clocksource=tsc")
    shutil.rmtree(kiosk.sysfs)
    only(kiosk.find(clock_of), "warning", "does not tell")


def test_a_good_calibration(kiosk: Kiosk, calibration_file: Path) -> None:
    kiosk.set_settings(calibration=CalibrationSettings(file=str(calibration_file)))
    only(kiosk.find(calibration_of), "ok", "0 days old", "residual")


def test_no_calibration(kiosk: Kiosk) -> None:
    only(kiosk.find(calibration_of), "error", "no calibration", "cornertouchd calibrate")


def test_the_simulated_rig_needs_none(kiosk: Kiosk) -> None:
    kiosk.set_settings(cameras=CamerasSettings(source="simulated"))
    only(kiosk.find(calibration_of), "ok")


@pytest.mark.parametrize(
    ("made_at", "words"), [("2019-05-01T12:00:00+00:00", "off"), ("2219-05-01T12:00:00", "clock")]
)
def test_an_old_calibration_and_one_of_the_future(
    kiosk: Kiosk, calibration_file: Path, tmp_path: Path, made_at: str, words: str
) -> None:
    path = tmp_path / "old.json"
    save_calibration(replace(load_calibration(calibration_file), created_at=made_at), path)
    kiosk.set_settings(calibration=CalibrationSettings(file=str(path)))
    only(kiosk.find(calibration_of), "warning", words)


def test_a_calibration_that_the_service_cannot_read(
    kiosk: Kiosk, calibration_file: Path, tmp_path: Path
) -> None:
    path = tmp_path / "mine.json"
    path.write_bytes(calibration_file.read_bytes())
    path.chmod(0o600)
    kiosk.set_settings(calibration=CalibrationSettings(file=str(path)))
    only(kiosk.find(calibration_of)[1:], "warning", "chmod a+r")


def test_a_camera_that_is_not_calibrated(kiosk: Kiosk, calibration_file: Path) -> None:
    kiosk.set_settings(
        calibration=CalibrationSettings(file=str(calibration_file)),
        cameras=CamerasSettings(units={"C5": {"device": "/dev/video9"}}),
    )
    only(kiosk.find(calibration_of)[1:], "error", "camera C5 is not calibrated")


@pytest.mark.parametrize(
    ("free_bytes", "level"), [(10**10, "ok"), (50 * 10**6, "warning"), (10**6, "error")]
)
def test_space_for_a_calibration(
    kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch, free_bytes: int, level: str
) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free_bytes))
    only(kiosk.find(disk_of), level, "MB free")


def test_kernels(kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    only(kiosk.find(kernels_of), "ok", "compiled functions")
    monkeypatch.setattr("cornertouchd.runtime.checks.files.compiled_directory", lambda: tmp_path)
    only(kiosk.find(kernels_of), "warning", "takes a minute")
    monkeypatch.setattr(os, "access", lambda *_: False)
    only(kiosk.find(kernels_of), "warning", "cannot be written")


def tuio(host: str, port: int = 3333) -> TuioSettings:
    return TuioSettings(destinations=(DestinationSettings(host=host, port=port),))


def test_a_client_that_listens(kiosk: Kiosk) -> None:
    kiosk.proc = Path("/proc")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.bind(("127.0.0.1", 0))
        port = client.getsockname()[1]
        kiosk.set_settings(tuio=tuio("127.0.0.1", port))
        only(kiosk.find(targets_of), "ok", "a client listens")
    only(kiosk.find(targets_of), "warning", "nobody listens", "cornertouchd listen")


def test_a_receiver_elsewhere_whose_name_is_not_known(
    kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unknown(*_: object, **__: object) -> None:
        raise socket.gaierror(-2, "Name or service not known")

    monkeypatch.setattr(socket, "getaddrinfo", unknown)
    kiosk.set_settings(tuio=tuio("wall.invalid"))
    only(kiosk.find(targets_of), "error", "wall.invalid:3333", "not known")


def test_touches_for_nobody(kiosk: Kiosk) -> None:
    kiosk.set_settings(tuio=TuioSettings(destinations=()))
    only(kiosk.find(targets_of), "warning", "nobody")


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig((350.0, 400.0), seed=4)


def plug_in(kiosk: Kiosk, rig: SimulatedRig, given_hz: float = 20.0) -> None:
    kiosk.set_settings(cameras=CamerasSettings(source="simulated", rate_hz=20.0))
    kiosk.ports = rig_ports(rig, lambda _: (), kiosk.clock, given_hz)[:1]


def test_a_good_camera(kiosk: Kiosk, rig: SimulatedRig) -> None:
    plug_in(kiosk, rig)
    rate, *light = kiosk.find(cameras_of)
    assert rate.level == "ok"
    assert "of 20 pictures/s" in rate.text
    assert all(one.level != "error" for one in light)


def test_a_camera_that_is_slow(kiosk: Kiosk, rig: SimulatedRig) -> None:
    plug_in(kiosk, rig, given_hz=10.0)
    slow = kiosk.find(cameras_of)[0]
    assert (slow.level, slow.text) == ("warning", "10 of 20 pictures/s")
    assert "exposure" in slow.remedy


def test_a_camera_that_is_not_there(kiosk: Kiosk, rig: SimulatedRig) -> None:
    plug_in(kiosk, rig)
    kiosk.ports[0].fault = Fault.UNPLUGGED
    only(kiosk.find(cameras_of), "error", "unplugged")


def test_a_camera_that_shows_noise(kiosk: Kiosk, rig: SimulatedRig) -> None:
    plug_in(kiosk, rig)
    kiosk.ports[0].fault = Fault.GARBLED
    _, noise = kiosk.find(cameras_of)
    assert noise.level == "error"
    assert "cable" in noise.remedy


def test_cameras_that_the_service_has_are_left_alone(kiosk: Kiosk, rig: SimulatedRig) -> None:
    plug_in(kiosk, rig)
    kiosk.unit["ActiveState"] = "active"
    kiosk.ports[0].fault = Fault.UNPLUGGED
    only(kiosk.find(cameras_of), "ok", "in use by cornertouchd.service")


@pytest.mark.parametrize(("control", "level"), [("auto", "warning"), ("on", None)])
def test_a_camera_that_may_be_suspended(kiosk: Kiosk, control: str, level: str | None) -> None:
    usb = kiosk.sysfs / "devices/usb1/1-1"
    interface = usb / "1-1:1.0"
    interface.mkdir(parents=True)
    (usb / "power").mkdir()
    (usb / "idVendor").write_text("05a3\n")
    (usb / "power/control").write_text(f"{control}\n")
    node = kiosk.sysfs / "class/video4linux/video7"
    node.mkdir(parents=True)
    (node / "device").symlink_to(interface)
    units = {"C1": {"device": "/dev/video7"}}
    kiosk.set_settings(cameras=CamerasSettings(units=units))
    found = kiosk.find(cameras_of)
    if level is None:
        assert found == []
    else:
        only(found, level, "suspended", "60-cornertouchd.rules")


def plug_into_one_bus(kiosk: Kiosk, descriptors: bytes, rate_hz: float) -> None:
    machine = FakeSysfs(kiosk.sysfs.parent)
    for number in range(1, 5):
        machine.plug_in(f"1-{number}", [2 * number, 2 * number + 1], None, descriptors=descriptors)
    units = {f"C{number}": {"device": f"port:1-{number}"} for number in range(1, 5)}
    kiosk.set_settings(cameras=CamerasSettings(units=units, rate_hz=rate_hz))


def test_cameras_that_fit_their_bus(kiosk: Kiosk) -> None:
    plug_into_one_bus(kiosk, BULK_CAMERA, rate_hz=30.0)
    only(kiosk.find(bandwidth_of), "ok", "bus 1", "480 Mbit/s", "/dev/video2", "92%")


def test_cameras_that_do_not_fit_their_bus(kiosk: Kiosk) -> None:
    plug_into_one_bus(kiosk, isochronous_camera(0x1400), rate_hz=30.0)
    only(kiosk.find(bandwidth_of), "error", "bus 1", "80%", "cameras.rate_hz", "another bus")


def test_a_camera_without_a_setting_that_is_fast_enough(kiosk: Kiosk) -> None:
    plug_into_one_bus(kiosk, isochronous_camera(0x0100), rate_hz=30.0)
    alone, *_, bus = kiosk.find(bandwidth_of)
    assert (alone.level, bus.level) == ("error", "error")
    assert "/dev/video2 cannot send 9.2 MB/s" in alone.text
    assert "cameras.pixel_format" in alone.remedy


def test_the_simulated_rig_takes_no_bandwidth(kiosk: Kiosk) -> None:
    kiosk.set_settings(cameras=CamerasSettings(source="simulated"))
    assert kiosk.find(bandwidth_of) == []


def test_a_check_that_fails_does_not_hide_the_others(
    kiosk: Kiosk, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: Installation) -> None:
        raise ZeroDivisionError("a bug")

    monkeypatch.setattr(checks, "CHECKS", {"clock": fail, "real time": real_time_of})
    broken, well = kiosk.find(check_installation)
    assert (broken.subject, broken.level) == ("clock", "error")
    assert "a bug" in broken.text
    assert well.level == "ok"


def test_a_file_of_a_surface_belongs_to_its_unit() -> None:
    assert unit_for(None) == unit_for(Path("/etc/cornertouchd/cornertouchd.toml"))
    assert unit_for(Path("/home/me/left.toml")) == "cornertouchd.service"
    unit = unit_for(Path("/etc/cornertouchd/left.toml"))
    assert unit == "cornertouchd@left.service"
    assert environment_of(unit, {})["STATE_DIRECTORY"] == "/var/lib/cornertouchd/left"
    assert environment_of(unit, {"STATE_DIRECTORY": "/x"})["STATE_DIRECTORY"] == "/x"
    assert environment_of("cornertouchd.service", {}) == {}


def test_a_program_that_is_missing_or_fails_says_nothing() -> None:
    assert output_of("no-such-program-here") == ""
    assert output_of("false") == ""
    assert output_of("echo", "well") == "well\n"


@pytest.mark.parametrize("as_json", [True, False])
def test_the_command_tells_the_errors_of_the_file_and_fails(tmp_path: Path, as_json: bool) -> None:
    path = tmp_path / "bad.toml"
    path.write_text("[cameras]\nrate_hz = 0\nwidht_px = 640\n")
    arguments = ["check", "--config", str(path), *["--json"] * as_json]
    ran = CliRunner().invoke(main, arguments, env={"COLUMNS": "300"})
    assert ran.exit_code == 1
    if as_json:
        findings = json.loads(ran.stdout)
        assert [one["level"] for one in findings] == ["error", "error"]
        assert set(findings[0]) == {"subject", "level", "text", "remedy"}
    for word in ("rate_hz", "widht_px", "width_px"):
        assert word in ran.stdout
