"""Two ways to make a USB camera begin anew without pulling its plug."""

from collections.abc import Callable
from pathlib import Path

import usb.core
import usb.util

from cornertouchd.devices.usb_sysfs import read_attribute, usb_kind
from cornertouchd.ports import ResetError


class UsbReset:
    """The port resets the device (USB 2.0, 7.1.7.5), the kernel probes it again.

    `usb_device` returns the camera in sysfs, or raises `ResetError`.
    """

    name = "USB reset"

    def __init__(self, usb_device: Callable[[], Path]) -> None:
        self._usb_device = usb_device

    def apply(self) -> None:
        """Reset the device.  Raises `ResetError` if that is not possible."""
        directory = self._usb_device()
        try:
            device = usb.core.find(custom_match=lambda found: _is_at(found, directory))
        except usb.core.NoBackendError as error:
            raise ResetError("libusb is missing; install libusb-1.0-0") from error
        if device is None:
            raise ResetError(f"libusb does not show the device at USB port {directory.name}")
        try:
            device.reset()
        except OSError as error:
            raise ResetError(
                f"USB port {directory.name}: {error.strerror or error}; may this user write to "
                "/dev/bus/usb (see the udev rules)?"
            ) from error
        finally:
            usb.util.dispose_resources(device)


class Reauthorization:
    """The kernel is told not to use the device, then to use it: a plug pulled without a hand.

    It frees the device from its drivers and chooses its configuration anew.
    """

    name = "reauthorization"

    def __init__(self, usb_device: Callable[[], Path]) -> None:
        self._usb_device = usb_device

    def apply(self) -> None:
        """Switch the device off and on.  Raises `ResetError` if that is not possible."""
        switch = self._usb_device() / "authorized"
        try:
            switch.write_text("0")
        except OSError as error:
            raise ResetError(
                f"{switch} cannot be written: {error.strerror}; install the udev rules of "
                "`cornertouchd cameras --udev-rules`"
            ) from error
        try:
            switch.write_text("1")
        except OSError as error:
            raise ResetError(
                f"{switch} was set to 0 and cannot be set back to 1: {error.strerror}; pull the "
                "camera's plug and put it back in"
            ) from error


def _is_at(device: usb.core.Device, directory: Path) -> bool:
    """Tell whether libusb's device is the one in sysfs, by place and by kind."""
    return (
        str(device.bus) == read_attribute(directory / "busnum")
        and str(device.address) == read_attribute(directory / "devnum")
        and f"{device.idVendor:04x}:{device.idProduct:04x}" == usb_kind(directory)
    )
