"""A plug is looked at in sysfs; only the camera's own device is ever reset."""

from pathlib import Path
from types import SimpleNamespace

import pytest
import usb.core
from fake_sysfs import FakeSysfs

from cornertouchd.devices.camera_plug import DevicePlug
from cornertouchd.ports import ResetError


@pytest.fixture
def machine(tmp_path: Path) -> FakeSysfs:
    return FakeSysfs(tmp_path)


class Rig:
    """One camera, bound by a link of udev, as in /dev/cornertouch."""

    def __init__(self, machine: FakeSysfs) -> None:
        self.machine = machine
        self.link = machine.dev / "c1"
        self.plug = DevicePlug(str(self.link), machine.root)

    def plug_in(self, node: int = 0) -> Path:
        device = self.machine.plug_in("1-2.3", [node, node + 1], None)
        (self.machine.dev / f"video{node}").touch()
        self.link.symlink_to(self.machine.dev / f"video{node}")
        return device

    def lose_node(self) -> None:
        self.link.unlink()


@pytest.fixture
def rig(machine: FakeSysfs) -> Rig:
    return Rig(machine)


def test_a_plug_tells_each_plugging_in_from_others(rig: Rig) -> None:
    assert rig.plug.plugged_in() == ""
    rig.plug_in()
    first = rig.plug.plugged_in()
    assert first
    assert rig.plug.plugged_in() == first
    rig.machine.pull_out("1-2.3")
    rig.lose_node()
    assert rig.plug.plugged_in() == ""
    rig.plug_in(node=4)
    assert rig.plug.plugged_in() not in {"", first}


def test_a_device_whose_driver_gave_up_is_still_there(rig: Rig) -> None:
    rig.plug_in()
    plugged = rig.plug.plugged_in()
    rig.lose_node()
    assert rig.plug.plugged_in() == plugged


def test_another_device_in_the_port_is_not_the_camera(rig: Rig) -> None:
    device = rig.plug_in()
    rig.plug.plugged_in()
    rig.lose_node()
    (device / "idProduct").write_text("0001\n")
    assert rig.plug.plugged_in() == ""
    with pytest.raises(ResetError, match="is not plugged in"):
        rig.plug.require_usb_device()


def test_a_camera_that_is_not_on_usb_is_seen_but_not_reset(machine: FakeSysfs) -> None:
    machine.add_platform_camera(4)
    node = machine.dev / "video4"
    node.touch()
    plug = DevicePlug(str(node), machine.root)
    assert plug.plugged_in() == str(node)
    for reset in plug.resets:
        with pytest.raises(ResetError, match="is not on USB"):
            reset.apply()


class FakeUsb:
    """The devices of a bus, as libusb shows them."""

    def __init__(self, *devices: tuple[int, int, int]) -> None:
        self.reset_at: list[int] = []
        self.error: OSError | None = None
        self._devices = [
            SimpleNamespace(
                bus=bus,
                address=address,
                idVendor=0x05A3,
                idProduct=product,
                reset=lambda address=address: self._reset(address),
                _ctx=SimpleNamespace(dispose=lambda _: None),
            )
            for bus, address, product in devices
        ]

    def find(self, custom_match):  # type: ignore[no-untyped-def]
        return next(filter(custom_match, self._devices), None)

    def _reset(self, address: int) -> None:
        if self.error is not None:
            raise self.error
        self.reset_at.append(address)


@pytest.fixture
def fake_usb(monkeypatch: pytest.MonkeyPatch) -> FakeUsb:
    fake = FakeUsb((2, 2, 0x9230), (1, 2, 0x9230), (1, 3, 0x9230))
    monkeypatch.setattr(usb.core, "find", fake.find)
    return fake


def test_the_usb_reset_is_of_the_cameras_own_device(rig: Rig, fake_usb: FakeUsb) -> None:
    device = rig.plug_in()
    assert (device / "devnum").read_text() == "2\n"
    (device / "devnum").write_text("3\n")
    rig.plug.resets[0].apply()
    assert fake_usb.reset_at == [3]


def test_a_device_of_another_kind_is_not_reset(rig: Rig, fake_usb: FakeUsb) -> None:
    device = rig.plug_in()
    (device / "idProduct").write_text("0001\n")
    with pytest.raises(ResetError, match=r"libusb does not show the device at USB port 1-2\.3"):
        rig.plug.resets[0].apply()
    assert fake_usb.reset_at == []


def test_what_libusb_refuses_is_told_with_the_remedy(rig: Rig, fake_usb: FakeUsb) -> None:
    rig.plug_in()
    fake_usb.error = usb.core.USBError("Access denied", -3, 13)
    with pytest.raises(ResetError, match=r"USB port 1-2\.3: Access denied.*udev rules"):
        rig.plug.resets[0].apply()


def test_without_libusb_the_package_to_install_is_named(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_backend(**_: object) -> None:
        raise usb.core.NoBackendError("no backend available")

    rig.plug_in()
    monkeypatch.setattr(usb.core, "find", no_backend)
    with pytest.raises(ResetError, match=r"libusb is missing; install libusb-1\.0-0"):
        rig.plug.resets[0].apply()


def test_reauthorization_leaves_the_device_switched_on(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    device = rig.plug_in()
    written = []
    write_text = Path.write_text

    def note(path: Path, text: str) -> int:
        written.append((path, text))
        return write_text(path, text)

    monkeypatch.setattr(Path, "write_text", note)
    rig.plug.resets[1].apply()
    assert written == [(device / "authorized", "0"), (device / "authorized", "1")]


def test_a_switch_that_may_not_be_written_is_told_with_the_remedy(
    rig: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, text: str) -> int:
        raise PermissionError(13, "Permission denied", str(path))

    rig.plug_in()
    monkeypatch.setattr(Path, "write_text", refuse)
    with pytest.raises(ResetError, match=r"authorized cannot be written: Permission denied.*udev"):
        rig.plug.resets[1].apply()
