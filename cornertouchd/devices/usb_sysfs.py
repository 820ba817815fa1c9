"""What the kernel says of USB devices in sysfs: nothing is asked of the devices themselves."""

from pathlib import Path

SYSFS = Path("/sys")

LONGEST_TEXT = 126
"""Characters of a string descriptor (USB 2.0, 9.6.7); longer ones are no serial numbers."""


def usb_device_above(node: Path) -> Path | None:
    """Return the USB device above the sysfs directory of a node; None if it is not on USB."""
    interface = (node / "device").resolve()
    for directory in (interface, *interface.parents):
        if (directory / "idVendor").is_file():
            return directory
    return None


def usb_device_at(port: str, sysfs: Path = SYSFS) -> Path | None:
    """Return what is plugged in at a port such as 1-2.3; None if nothing is."""
    device = sysfs / "bus" / "usb" / "devices" / port
    return device.resolve() if (device / "idVendor").is_file() else None


def usb_kind(usb_device: Path) -> str:
    """Return vendor and product, such as 05a3:9230."""
    return f"{read_attribute(usb_device / 'idVendor')}:{read_attribute(usb_device / 'idProduct')}"


def read_attribute(attribute: Path) -> str:
    """Return an attribute as plain text, empty if there is none or the device is just leaving."""
    try:
        text = attribute.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""
    plain = "".join(c if c.isprintable() and c.isascii() else "?" for c in text.strip())
    return plain[:LONGEST_TEXT]


def read_number(attribute: Path) -> float:
    """Return an attribute that is a number, 0 if there is none."""
    try:
        return float(read_attribute(attribute))
    except ValueError:
        return 0.0
