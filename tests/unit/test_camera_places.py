"""Cameras are found by what they hang on, whatever number their node has today."""

from pathlib import Path

import pytest
from fake_sysfs import FakeSysfs

from cornertouchd.config import CamerasSettings
from cornertouchd.devices.camera_places import PlaceError, bus_mates, camera_places, device_path


@pytest.fixture
def machine(tmp_path: Path) -> FakeSysfs:
    return FakeSysfs(tmp_path)


def test_each_camera_is_listed_once_with_where_it_hangs(machine: FakeSysfs) -> None:
    machine.plug_in("1-2.3", [10, 11], "B05", speed="480")
    machine.plug_in("2-1", [2, 3], None, speed="5000")
    machine.add_platform_camera(4)
    fast, platform, slow = camera_places(machine.root, machine.dev)
    assert [place.node for place in (fast, platform, slow)] == [
        "/dev/video2",
        "/dev/video4",
        "/dev/video10",
    ]
    assert platform.usb is None
    assert (platform.name, platform.driver, platform.by_path) == ("csi-cap", "", "")
    assert slow.usb is not None
    assert (slow.usb.port, slow.usb.interface, slow.usb.serial) == ("1-2.3", "1.0", "B05")
    assert (slow.usb.bus, slow.usb.root_hub, slow.usb.kind) == (1, "usb1", "05a3:9230")
    assert slow.usb.speed_mbit_s == 480.0
    assert slow.driver == "uvcvideo"
    assert slow.by_path == "pci-0000:00:14.0-usb-0:2.3:1.0-video-index0"
    assert fast.usb is not None
    assert (fast.usb.serial, fast.usb.speed_mbit_s) == ("", 5000.0)


def test_without_sysfs_there_are_no_cameras(tmp_path: Path) -> None:
    assert camera_places(tmp_path, tmp_path) == ()


def test_cameras_of_one_bus_share_it(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0, 1], None)
    machine.plug_in("1-2.3", [2, 3], None)
    machine.plug_in("2-1", [4, 5], None)
    machine.add_platform_camera(6)
    places = camera_places(machine.root, machine.dev)
    assert [mate.node for mate in bus_mates(places[0], places)] == ["/dev/video2"]
    assert bus_mates(places[2], places) == ()
    assert bus_mates(places[3], places) == ()


def test_a_path_is_taken_as_it_is(machine: FakeSysfs) -> None:
    assert device_path("/dev/cornertouch/c1", machine.root) == "/dev/cornertouch/c1"
    assert device_path("videos/c1.mkv", machine.root) == "videos/c1.mkv"


def test_a_port_keeps_its_camera_when_nodes_are_renumbered(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0, 1], "A")
    machine.plug_in("1-2.3", [2, 3], "B")
    assert device_path("port:1-2.3", machine.root) == "/dev/video2"
    machine.pull_out("1-2.3")
    with pytest.raises(PlaceError, match=r"no camera at USB port 1-2\.3; is it plugged in"):
        device_path("port:1-2.3", machine.root)
    machine.plug_in("1-2.3", [7, 8], "B")
    assert device_path("port:1-2.3", machine.root) == "/dev/video7"


def test_a_serial_number_follows_the_camera(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0, 1], "A17")
    machine.plug_in("1-2", [2, 3], "B05")
    assert device_path("serial:B05", machine.root) == "/dev/video2"
    machine.pull_out("1-2")
    with pytest.raises(PlaceError, match="no camera has the serial number B05"):
        device_path("serial:B05", machine.root)
    machine.plug_in("1-4.1", [2, 3], "B05")
    assert device_path("serial:B05", machine.root) == "/dev/video2"


def test_a_serial_number_of_several_cameras_is_refused_and_they_are_named(
    machine: FakeSysfs,
) -> None:
    machine.plug_in("1-1", [0, 1], "SN0001")
    machine.plug_in("1-2.3", [2, 3], "SN0001")
    with pytest.raises(PlaceError) as refused:
        device_path("serial:SN0001", machine.root)
    assert "2 cameras have the serial number SN0001" in str(refused.value)
    assert "port:1-1 (/dev/video0), port:1-2.3 (/dev/video2)" in str(refused.value)


def test_what_is_no_camera_is_named(machine: FakeSysfs) -> None:
    machine.plug_in("1-3", [], None, product="0001")
    with pytest.raises(PlaceError, match=r"at USB port 1-3 \(05a3:0001\) gives no pictures"):
        device_path("port:1-3", machine.root)


def test_several_cameras_in_one_housing_are_told_by_their_interface(machine: FakeSysfs) -> None:
    machine.plug_in("1-1", [0, 1], None)
    second = machine.root / "devices/pci0000:00/0000:00:14.0/usb1/1-1/1-1:1.2/video4linux/video2"
    second.mkdir(parents=True)
    (second / "device").symlink_to(second.parents[1])
    (second / "index").write_text("0\n")
    (machine.root / "class/video4linux/video2").symlink_to(second)
    with pytest.raises(PlaceError, match=r"choose one of port:1-1:1\.0, port:1-1:1\.2"):
        device_path("port:1-1", machine.root)
    assert device_path("port:1-1:1.2", machine.root) == "/dev/video2"


@pytest.mark.parametrize("device", ["port:1-2.3", "port:12-1:1.2", "serial:A 1", "/dev/video0"])
def test_settings_take_places(device: str) -> None:
    assert CamerasSettings(units={"C1": {"device": device}}).units["C1"].device == device


@pytest.mark.parametrize("device", ["port:", "port:1", "port:1-2/../..", "port:usb1", "serial: "])
def test_settings_refuse_what_no_camera_has(device: str) -> None:
    with pytest.raises(ValueError, match=r"port:1-2\.3|serial:NUMBER"):
        CamerasSettings(units={"C1": {"device": device}})
