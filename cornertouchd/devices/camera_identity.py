"""What tells one camera from another of the same kind, read from sysfs."""

from collections.abc import Iterator
from pathlib import Path

from cornertouchd.calibration.calibration import LONGEST_IDENTITY

SYSFS = Path("/sys")


def camera_identity(device: str, sysfs: Path = SYSFS) -> str:
    """Return the identity of a video device or file, empty if there is no telling.

    A USB camera is known by its serial number, wherever it is plugged in; where it has none, or
    other cameras bear the same (some makers number all of them alike), by the port it hangs on.
    Of a long one, as much as calibrations keep.
    """
    return _identity(device, sysfs)[:LONGEST_IDENTITY]


def _identity(device: str, sysfs: Path) -> str:
    if not device.startswith("/dev/"):
        return f"file {Path(device).name}"
    class_directory = sysfs / "class" / "video4linux"
    usb_device = _usb_device(class_directory / Path(device).resolve().name)
    if usb_device is None:
        return ""
    kind, serial = _kind(usb_device), _read(usb_device / "serial")
    namesakes = {other for other in _usb_devices(class_directory) if _kind(other) == kind}
    if serial and [_read(other / "serial") for other in namesakes].count(serial) == 1:
        return f"usb {kind} serial {serial}"
    return f"usb {kind} at port {usb_device.name}"


def _usb_devices(class_directory: Path) -> Iterator[Path]:
    """Yield the USB devices of all video nodes; one camera often has several nodes."""
    for node in class_directory.iterdir():
        usb_device = _usb_device(node)
        if usb_device is not None:
            yield usb_device


def _usb_device(node: Path) -> Path | None:
    """Return the USB device above a video node, which hangs on one of its interfaces."""
    interface = (node / "device").resolve()
    for directory in (interface, *interface.parents):
        if (directory / "idVendor").is_file():
            return directory
    return None


def _kind(usb_device: Path) -> str:
    return f"{_read(usb_device / 'idVendor')}:{_read(usb_device / 'idProduct')}"


def _read(attribute: Path) -> str:
    """Return an attribute as plain text, empty if there is none or the device is just leaving."""
    try:
        text = attribute.read_text(encoding="ascii", errors="replace")
    except OSError:
        return ""
    return "".join(c if c.isprintable() else "?" for c in text.strip())
