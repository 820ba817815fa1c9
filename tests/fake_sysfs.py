"""A small sysfs in the shape that Linux gives it: USB devices with their video nodes.

Taken from what uvcvideo shows; tests/guest/test_recovery.py reads the real one in the same way.
"""

from pathlib import Path

_HEAD = bytes.fromhex("12010002ef02014005a3309200010102030109028000020100803209040000000e010000")
"""Device and configuration, and the interface by which a camera is controlled."""

BULK_CAMERA = _HEAD + bytes.fromhex("09040100010e02000007058102000200")
"""A streaming interface with a bulk endpoint of 512 bytes."""


def isochronous_camera(*packets: int) -> bytes:
    """Return descriptors of a camera with one alternate setting per wMaxPacketSize."""
    settings = [
        bytes((9, 4, 1, number, 1, 0x0E, 2, 0, 0))
        + bytes((7, 5, 0x81, 5, packet & 255, packet >> 8, 1))
        for number, packet in enumerate(packets, start=1)
    ]
    return _HEAD + bytes((9, 4, 1, 0, 0, 0x0E, 2, 0, 0)) + b"".join(settings)


class FakeSysfs:
    """Devices are plugged in and pulled out; nodes are renumbered as Linux does."""

    def __init__(self, root: Path) -> None:
        self.root = root / "sys"
        self.dev = root / "dev"
        self._class = self.root / "class" / "video4linux"
        self._usb = self.root / "bus" / "usb" / "devices"
        self._device_number = 1
        for directory in (self._class, self._usb, self.dev / "v4l" / "by-path"):
            directory.mkdir(parents=True)

    def plug_in(
        self,
        port: str,
        nodes: list[int],
        serial: str | None,
        product: str = "9230",
        speed: str = "480",
        descriptors: bytes = BULK_CAMERA,
    ) -> Path:
        """Plug a camera in: its first node gives pictures, a second one metadata."""
        self._device_number += 1
        bus = port.partition("-")[0]
        device = (
            self.root / "devices" / "pci0000:00" / f"0000:00:14.{int(bus) - 1}" / f"usb{bus}" / port
        )
        interface = device / f"{port}:1.0"
        interface.mkdir(parents=True)
        attributes = {
            "idVendor": "05a3", "idProduct": product, "busnum": bus, "speed": speed,
            "devnum": str(self._device_number), "authorized": "1", "product": "IR camera",
        }  # fmt: skip
        if serial is not None:
            attributes["serial"] = serial
        for name, value in attributes.items():
            (device / name).write_text(f"{value}\n")
        (device / "descriptors").write_bytes(descriptors)
        (self._usb / port).symlink_to(device)
        driver = self.root / "bus" / "usb" / "drivers" / "uvcvideo"
        driver.mkdir(parents=True, exist_ok=True)
        (interface / "driver").symlink_to(driver)
        for index, node in enumerate(nodes):
            self._add_node(interface, node, index, "IR camera")
            controller, ports = f"pci-0000:00:14.{int(bus) - 1}", port.partition("-")[2]
            name = f"{controller}-usb-0:{ports}:1.0-video-index{index}"
            (self.dev / "v4l" / "by-path" / name).symlink_to(self.dev / f"video{node}")
        return device

    def pull_out(self, port: str) -> None:
        """Pull a camera out."""
        device = (self._usb / port).resolve()
        (self._usb / port).unlink()
        for node in device.glob("*/video4linux/*"):
            (self._class / node.name).unlink()
            (self.dev / node.name).unlink(missing_ok=True)
            for name in (self.dev / "v4l" / "by-path").iterdir():
                if name.readlink().name == node.name:
                    name.unlink()
        device.rename(device.with_name(f"gone {self._device_number} {port}"))

    def add_platform_camera(self, node: int) -> None:
        """Add a camera that is not on USB."""
        platform = self.root / "devices" / "platform" / "csi"
        platform.mkdir(parents=True)
        self._add_node(platform, node, 0, "csi-cap")

    def _add_node(self, parent: Path, node: int, index: int, name: str) -> None:
        directory = parent / "video4linux" / f"video{node}"
        directory.mkdir(parents=True)
        (directory / "device").symlink_to(parent)
        (directory / "name").write_text(f"{name}\n")
        (directory / "index").write_text(f"{index}\n")
        (self._class / f"video{node}").symlink_to(directory)
