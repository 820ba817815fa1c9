"""What tells one camera from another of the same kind, read from sysfs."""

from collections.abc import Iterator
from pathlib import Path

from cornertouchd.calibration.calibration import LONGEST_IDENTITY
from cornertouchd.devices.camera_places import PlaceError, device_path
from cornertouchd.devices.usb_sysfs import SYSFS, read_attribute, usb_device_above, usb_kind


def camera_identity(device: str, sysfs: Path = SYSFS) -> str:
    """Return the identity of a video device or file, empty if there is no telling.

    A USB camera is known by its serial number, wherever it is plugged in, and by the port it hangs
    on; by its port alone where it has no number, or other cameras bear the same (some makers number
    all of them alike).  Of a long one, as much as calibrations keep.
    """
    try:
        return _identity(device_path(device, sysfs), sysfs)[:LONGEST_IDENTITY]
    except PlaceError:
        return ""


def _identity(device: str, sysfs: Path) -> str:
    if not device.startswith("/dev/"):
        return f"file {Path(device).name}"
    class_directory = sysfs / "class" / "video4linux"
    usb_device = usb_device_above(class_directory / Path(device).resolve().name)
    if usb_device is None:
        return ""
    kind, serial = usb_kind(usb_device), read_attribute(usb_device / "serial")
    namesakes = {other for other in _usb_devices(class_directory) if usb_kind(other) == kind}
    if serial and [read_attribute(other / "serial") for other in namesakes].count(serial) == 1:
        return f"usb {kind} serial {serial} at port {usb_device.name}"
    return f"usb {kind} at port {usb_device.name}"


def _usb_devices(class_directory: Path) -> Iterator[Path]:
    """Yield the USB devices of all video nodes; one camera often has several nodes."""
    for node in class_directory.iterdir():
        usb_device = usb_device_above(node)
        if usb_device is not None:
            yield usb_device
