"""`cornertouchd cameras` says which camera is where, what is missing, and what to change."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from fake_sysfs import BULK_CAMERA, FakeSysfs, isochronous_camera
from rich.console import Console

from cornertouchd.cli import main
from cornertouchd.cli.camera_table import complaints, show_survey, survey_json
from cornertouchd.config import CamerasSettings
from cornertouchd.devices.camera_places import camera_places
from cornertouchd.devices.camera_survey import CameraAbilities, Survey, survey_cameras
from cornertouchd.devices.udev_rules import render_rules

CORNERS = ("C1", "C2", "C3", "C4")
GREY = CameraAbilities(captures=True, modes=("GREY 640x480 at 60, 30 Hz",), pixel_format="GREY")


class Bench:
    def __init__(self, root: Path) -> None:
        self.machine = FakeSysfs(root)
        self.abilities: dict[str, CameraAbilities] = {}

    def plug_in_four(self, descriptors: bytes = BULK_CAMERA) -> None:
        for number in range(4):
            self.machine.plug_in(
                f"1-{number + 1}", [2 * number, 2 * number + 1], None, descriptors=descriptors
            )

    def survey(self, rate_hz: float = 30.0, **devices: str) -> Survey:
        units = {
            corner: {"device": devices.get(corner, f"port:9-{corner[1]}")} for corner in CORNERS
        }
        settings = CamerasSettings(rate_hz=rate_hz, units=units)
        return survey_cameras(
            settings,
            lambda node: self.abilities.get(node, GREY),
            self.machine.root,
            self.machine.dev,
        )


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


ALL_BOUND = {corner: f"port:1-{corner[1]}" for corner in CORNERS}


def shown(survey: Survey, width: int = 160) -> str:
    console = Console(width=width, record=True, file=None, quiet=False, force_terminal=False)
    with console.capture() as captured:
        console.print(show_survey(survey))
    return captured.get()


def test_cameras_that_are_bound_and_fit_leave_nothing_to_say(bench: Bench) -> None:
    bench.plug_in_four()
    survey = bench.survey(**ALL_BOUND)
    assert {corner: place.node for corner, place in survey.bound.items()} == {
        "C1": "/dev/video0",
        "C2": "/dev/video2",
        "C3": "/dev/video4",
        "C4": "/dev/video6",
    }
    assert list(complaints(survey)) == []
    (load,) = survey.loads
    assert load.bytes_s == pytest.approx(4 * 640 * 480 * 30)
    table = shown(survey)
    for text in ("C3", "/dev/video4", "1-3", "uvcvideo", "480 Mbit/s", "uses GREY", "9.2", "fits"):
        assert text in table


def test_nodes_and_ports_can_be_read_in_a_narrow_terminal(bench: Bench) -> None:
    bench.plug_in_four()
    table = shown(bench.survey(**ALL_BOUND), width=80)
    for text in ("C3", "/dev/video4", "1-3"):
        assert text in table


def test_what_is_missing_and_what_is_unbound_is_told(bench: Bench) -> None:
    bench.plug_in_four()
    survey = bench.survey(C1="port:1-1", C2="/dev/cornertouch/c2", C3="serial:X")
    assert list(survey.bound) == ["C1"]
    assert [camera.corners for camera in survey.cameras] == [("C1",), (), (), ()]
    assert list(complaints(survey)) == [
        "camera C2 (top-right): /dev/cornertouch/c2 is not there",
        "camera C3 (bottom-right): no camera has the serial number X; is it plugged in?",
        "camera C4 (bottom-left): no camera at USB port 9-4; is it plugged in?",
        "to bind cameras to corners: `cornertouchd cameras --identify`",
    ]


def test_a_link_of_udev_leads_to_its_camera(bench: Bench) -> None:
    bench.plug_in_four()
    link = bench.machine.dev / "cornertouch" / "c2"
    link.parent.mkdir()
    (bench.machine.dev / "video6").touch()
    link.symlink_to(bench.machine.dev / "video6")
    assert bench.survey(C2="/dev/cornertouch/c2").bound["C2"].node == "/dev/video6"


def test_one_camera_for_two_corners_is_told(bench: Bench) -> None:
    bench.plug_in_four()
    survey = bench.survey(**{**ALL_BOUND, "C2": "port:1-1:1.0"})
    assert "/dev/video0: is bound to C1 and C2; give each camera its own device" in list(
        complaints(survey)
    )


def test_cameras_that_do_not_fit_their_bus_come_with_the_remedy(bench: Bench) -> None:
    bench.plug_in_four(isochronous_camera(512, 0x0C00, 0x1400))
    told = list(complaints(bench.survey(rate_hz=60.0, **ALL_BOUND)))
    assert len(told) == 1
    assert "the cameras of bus 1" in told[0]
    assert "lower cameras.rate_hz" in told[0]
    assert "does not fit" in shown(bench.survey(rate_hz=60.0, **ALL_BOUND))


def test_a_node_that_gives_no_pictures_is_no_camera(bench: Bench) -> None:
    bench.plug_in_four()
    bench.abilities["/dev/video4"] = CameraAbilities(captures=False)
    survey = bench.survey(**ALL_BOUND)
    assert len(survey.cameras) == 3
    assert survey.missing["C3"] == "/dev/video4 is no camera"


def test_a_camera_that_cannot_be_used_says_why(bench: Bench) -> None:
    bench.plug_in_four()
    bench.abilities["/dev/video0"] = CameraAbilities(True, problem="is in use by guvcview")
    assert "/dev/video0: is in use by guvcview" in list(complaints(bench.survey(**ALL_BOUND)))


def test_json_has_all_of_it(bench: Bench) -> None:
    bench.plug_in_four()
    bench.machine.add_platform_camera(9)
    told = json.loads(json.dumps(survey_json(bench.survey(**ALL_BOUND))))
    first, *_, platform = told["cameras"]
    assert first["corners"] == ["C1"]
    assert first["usb"]["port"] == "1-1"
    assert first["shares_bus_with"] == ["/dev/video2", "/dev/video4", "/dev/video6"]
    assert first["modes"] == list(GREY.modes)
    assert platform["usb"] is None
    assert told["buses"][0]["fits"] is True
    assert told["missing"] == {}


def test_rules_name_each_port_once_and_keep_cameras_awake(bench: Bench) -> None:
    bench.plug_in_four()
    rules = render_rules(bench.survey(**ALL_BOUND).bound)
    lines = [line for line in rules.splitlines() if line and not line.startswith("#")]
    assert lines[2] == (
        'SUBSYSTEM=="video4linux", KERNEL=="video*", ATTR{index}=="0", '
        'ENV{ID_PATH}=="pci-0000:00:14.0-usb-0:3:1.0", SYMLINK+="cornertouch/c3"'
    )
    assert len(lines) == 5
    for part in ('ATTR{idVendor}=="05a3"', 'ATTR{power/control}="on"', 'GROUP="video"'):
        assert part in lines[4]


def test_rules_go_by_the_port_where_udev_gives_no_path_or_one_to_two(bench: Bench) -> None:
    bench.plug_in_four()
    for link in (bench.machine.dev / "v4l/by-path").iterdir():
        link.unlink()
    bench.machine.add_platform_camera(9)
    *_, last, platform = camera_places(bench.machine.root, bench.machine.dev)
    rules = render_rules({"C1": last, "C2": platform})
    assert 'SUBSYSTEMS=="usb", KERNELS=="1-4:1.0", SYMLINK+="cornertouch/c1"' in rules
    assert 'KERNEL=="video9", SYMLINK+="cornertouch/c2"' in rules


def test_rules_without_bound_cameras_are_refused_with_the_remedy() -> None:
    refused = CliRunner().invoke(main, ["cameras", "--udev-rules"])
    assert refused.exit_code == 1
    assert "no camera is bound to a corner yet: run `cornertouchd cameras --identify`" in (
        refused.output
    )
