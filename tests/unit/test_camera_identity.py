"""This very camera is told from others of its kind, as far as the kernel knows it."""

from pathlib import Path

import pytest

from cornertouchd.calibration.calibration import LONGEST_IDENTITY
from cornertouchd.devices.camera_identity import camera_identity
from cornertouchd.devices.opencv_camera import OpenCvCameraPort
from cornertouchd.model import PictureFormat


class Machine:
    """A small sysfs: USB devices with their video nodes."""

    def __init__(self, root: Path) -> None:
        self.sysfs = root / "sys"
        self._class = self.sysfs / "class" / "video4linux"
        self._class.mkdir(parents=True)

    def plug_in(
        self, port: str, nodes: list[int], serial: str | None, product: str = "9230"
    ) -> None:
        usb_device = self.sysfs / "devices" / "pci0000:00" / "usb1" / port
        interface = usb_device / f"{port}:1.0"
        interface.mkdir(parents=True)
        (usb_device / "idVendor").write_text("05a3\n")
        (usb_device / "idProduct").write_text(f"{product}\n")
        if serial is not None:
            (usb_device / "serial").write_text(f"{serial}\n")
        for node in nodes:
            directory = interface / "video4linux" / f"video{node}"
            directory.mkdir(parents=True)
            (directory / "device").symlink_to(interface)
            (self._class / f"video{node}").symlink_to(directory)

    def identity(self, device: str) -> str:
        return camera_identity(device, self.sysfs)


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_a_serial_number_tells_wherever_it_is_plugged_in(machine: Machine) -> None:
    machine.plug_in("1-1", [0, 1], "A17")
    machine.plug_in("1-2.3", [2, 3], "B05")
    assert machine.identity("/dev/video0") == "usb 05a3:9230 serial A17"
    assert machine.identity("/dev/video3") == "usb 05a3:9230 serial B05"


def test_cameras_that_are_all_numbered_alike_are_told_by_their_port(machine: Machine) -> None:
    machine.plug_in("1-1", [0, 1], "SN0001")
    machine.plug_in("1-2.3", [2, 3], "SN0001")
    assert machine.identity("/dev/video0") == "usb 05a3:9230 at port 1-1"
    assert machine.identity("/dev/video2") == "usb 05a3:9230 at port 1-2.3"


def test_the_same_number_on_another_product_does_not_matter(machine: Machine) -> None:
    machine.plug_in("1-1", [0], "SN0001")
    machine.plug_in("1-2", [1], "SN0001", product="9310")
    assert machine.identity("/dev/video0") == "usb 05a3:9230 serial SN0001"


@pytest.mark.parametrize("serial", [None, "", "  "])
def test_without_a_serial_number_the_port_tells(machine: Machine, serial: str | None) -> None:
    machine.plug_in("1-2.3", [0], serial)
    assert machine.identity("/dev/video0") == "usb 05a3:9230 at port 1-2.3"


def test_a_link_of_udev_is_followed(machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    machine.plug_in("1-1", [7], "A17")
    monkeypatch.setattr(Path, "resolve", _as_if_udev_linked(Path.resolve))
    assert machine.identity("/dev/cornertouch/c2") == "usb 05a3:9230 serial A17"


def _as_if_udev_linked(resolve):  # type: ignore[no-untyped-def]
    def resolved(path: Path) -> Path:
        return Path("/dev/video7") if path == Path("/dev/cornertouch/c2") else resolve(path)

    return resolved


def test_a_serial_number_is_plain_short_text(machine: Machine) -> None:
    machine.plug_in("1-1", [0], "A\x07\x1b[31m" + "9" * 500)
    identity = machine.identity("/dev/video0")
    assert identity.startswith("usb 05a3:9230 serial A??[31m999")
    assert len(identity) == LONGEST_IDENTITY


def test_what_is_not_on_usb_or_not_there_is_unknown(machine: Machine, tmp_path: Path) -> None:
    platform = tmp_path / "sys" / "devices" / "platform" / "csi" / "video4linux" / "video4"
    platform.mkdir(parents=True)
    (platform / "device").symlink_to(platform.parents[1])
    (tmp_path / "sys" / "class" / "video4linux" / "video4").symlink_to(platform)
    assert machine.identity("/dev/video4") == ""
    assert machine.identity("/dev/video9") == ""
    assert camera_identity("/dev/video0", tmp_path / "no sysfs") == ""


def test_a_video_file_is_known_by_its_name(machine: Machine) -> None:
    assert machine.identity("somewhere/c2.mkv") == "file c2.mkv"
    assert len(machine.identity("somewhere/" + "c" * 251 + ".mkv")) == LONGEST_IDENTITY


def test_the_port_tells_the_camera_that_is_plugged_in_now(machine: Machine) -> None:
    size = PictureFormat(640, 480, 0, 480)
    port = OpenCvCameraPort("C2", "/dev/video0", size, 100.0, lambda: 0.0, machine.sysfs)
    assert port.identity == ""
    machine.plug_in("1-1", [0], "A17")
    assert port.identity == "usb 05a3:9230 serial A17"
