"""This very camera is told from others of its kind, as far as the kernel knows it."""

from pathlib import Path

import pytest
from fake_sysfs import FakeSysfs

from cornertouchd.calibration.calibration import LONGEST_IDENTITY
from cornertouchd.calibration.same_camera import same_camera
from cornertouchd.devices.camera_identity import camera_identity
from cornertouchd.devices.opencv_camera import OpenCvCameraPort
from cornertouchd.model import PictureFormat


@pytest.fixture
def machine(tmp_path: Path) -> FakeSysfs:
    return FakeSysfs(tmp_path)


def identity(machine: FakeSysfs, device: str) -> str:
    return camera_identity(device, machine.root)


def test_a_serial_number_tells_wherever_it_is_plugged_in(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0, 1], "A17")
    machine.plug_in("1-2.3", [2, 3], "B05")
    assert identity(machine, "/dev/video0") == "usb 05a3:9230 serial A17 at port 1-1"
    assert identity(machine, "/dev/video3") == "usb 05a3:9230 serial B05 at port 1-2.3"


def test_cameras_that_are_all_numbered_alike_are_told_by_their_port(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0, 1], "SN0001")
    machine.plug_in("1-2.3", [2, 3], "SN0001")
    assert identity(machine, "/dev/video0") == "usb 05a3:9230 at port 1-1"
    assert identity(machine, "/dev/video2") == "usb 05a3:9230 at port 1-2.3"


def test_the_same_number_on_another_product_does_not_matter(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0], "SN0001")
    machine.plug_in("1-2", [1], "SN0001", product="9310")
    assert identity(machine, "/dev/video0") == "usb 05a3:9230 serial SN0001 at port 1-1"


@pytest.mark.parametrize("serial", [None, "", "  "])
def test_without_a_serial_number_the_port_tells(machine: FakeSysfs, serial: str | None) -> None:
    machine.plug_in("1-2.3", [0], serial)
    assert identity(machine, "/dev/video0") == "usb 05a3:9230 at port 1-2.3"


def test_a_link_of_udev_is_followed(machine: FakeSysfs, monkeypatch: pytest.MonkeyPatch) -> None:
    machine.plug_in("1-1", [7], "A17")
    monkeypatch.setattr(Path, "resolve", _as_if_udev_linked(Path.resolve))
    assert identity(machine, "/dev/cornertouch/c2") == "usb 05a3:9230 serial A17 at port 1-1"


def _as_if_udev_linked(resolve):  # type: ignore[no-untyped-def]
    def resolved(path: Path) -> Path:
        return Path("/dev/video7") if path == Path("/dev/cornertouch/c2") else resolve(path)

    return resolved


def test_a_serial_number_is_plain_short_text(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0], "A\x07\x1b[31m" + "9" * 500)
    told = identity(machine, "/dev/video0")
    assert told.startswith("usb 05a3:9230 serial A??[31m999")
    assert told.endswith("9 at port 1-1")
    assert len(told) <= LONGEST_IDENTITY


def test_what_is_not_on_usb_or_not_there_is_unknown(machine: FakeSysfs, tmp_path: Path) -> None:
    machine.add_platform_camera(4)
    assert identity(machine, "/dev/video4") == ""
    assert identity(machine, "/dev/video9") == ""
    assert identity(machine, "port:1-1") == ""
    assert camera_identity("/dev/video0", tmp_path / "no sysfs") == ""


def test_a_camera_is_known_at_the_place_that_it_is_bound_to(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [4, 5], "A17")
    assert identity(machine, "port:1-1") == identity(machine, "/dev/video4")
    assert identity(machine, "serial:A17") == identity(machine, "/dev/video4")


def test_cameras_that_are_numbered_alike_are_the_same_when_they_are_plugged_in_alone(
    machine: FakeSysfs,
) -> None:
    machine.plug_in("1-1", [0], "SN0001")
    machine.plug_in("1-2", [2], "SN0001")
    calibrated = identity(machine, "/dev/video0")
    machine.pull_out("1-2")
    alone = identity(machine, "/dev/video0")
    assert alone != calibrated
    assert same_camera(alone, calibrated)
    machine.pull_out("1-1")
    machine.plug_in("1-2", [0], "SN0001")
    assert not same_camera(identity(machine, "/dev/video0"), calibrated)


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ("", "usb 1:2 serial A", True),
        ("usb 1:2 serial A", "usb 1:2 serial A at port 1-1", True),
        ("usb 1:2 serial A at port 1-2", "usb 1:2 serial A at port 1-1", True),
        ("usb 1:2 serial A at port 1-1", "usb 1:2 serial B at port 1-1", False),
        ("usb 1:2 at port 1-1", "usb 1:2 serial B at port 1-1", True),
        ("usb 1:2 at port 1-1", "usb 1:3 at port 1-1", False),
        ("usb 1:2 at port 1-1", "usb 1:2 serial A", False),
        ("usb 1:2 serial A at port 9 at port 1-1", "usb 1:2 serial A at port 9", False),
        ("file c1.mkv", "file c2.mkv", False),
        ("file c1.mkv", "usb 1:2 serial A", False),
    ],
)
def test_the_serial_number_decides_and_else_the_port(one: str, other: str, same: bool) -> None:
    assert same_camera(one, other) is same
    assert same_camera(other, one) is same


def test_a_video_file_is_known_by_its_name(machine: FakeSysfs) -> None:
    assert identity(machine, "somewhere/c2.mkv") == "file c2.mkv"
    assert len(identity(machine, "somewhere/" + "c" * 251 + ".mkv")) == LONGEST_IDENTITY


def test_the_port_tells_the_camera_that_is_plugged_in_now(machine: FakeSysfs) -> None:
    size = PictureFormat(640, 480, 0, 480)
    port = OpenCvCameraPort("C2", "/dev/video0", size, 100.0, lambda: 0.0, machine.root)
    assert port.identity == ""
    machine.plug_in("1-1", [0], "A17")
    assert port.identity == "usb 05a3:9230 serial A17 at port 1-1"
