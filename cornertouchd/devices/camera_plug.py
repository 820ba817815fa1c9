"""Where one camera is plugged in: looked at in sysfs, and reset by USB."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from cornertouchd.devices.camera_places import PlaceError, device_path
from cornertouchd.devices.usb_reset import Reauthorization, UsbReset
from cornertouchd.devices.usb_sysfs import (
    SYSFS,
    read_attribute,
    usb_device_above,
    usb_kind,
)
from cornertouchd.ports import CameraReset, ResetError


class DevicePlug:
    """The plug of a camera that is bound by path, port or serial number.

    Only the very USB device at whose node the camera was is ever reset.
    """

    def __init__(self, device: str, sysfs: Path = SYSFS) -> None:
        self._device = device
        self._sysfs = sysfs
        self._usb_device: Path | None = None
        self._kind = ""
        self.resets: Sequence[CameraReset] = (
            UsbReset(self.require_usb_device),
            Reauthorization(self.require_usb_device),
        )

    def plugged_in(self) -> str:
        """Return port and device number, or the node where there is no USB; empty while absent.

        A device whose driver gave up has no node, but is there: it can be reset.
        """
        with suppress(OSError, PlaceError):
            node = Path(device_path(self._device, self._sysfs))
            if node.exists():
                self._note(node)
                return self._number() if self._usb_device else str(node)
        return self._number() if self._is_still_there() else ""

    def require_usb_device(self) -> Path:
        """Return the camera's device in sysfs.  Raises `ResetError` if that is not there."""
        if not self.plugged_in():
            raise ResetError(f"{self._device} is not plugged in")
        if self._usb_device is None:
            raise ResetError(f"{self._device} is not on USB")
        return self._usb_device

    def _note(self, node: Path) -> None:
        name = node.resolve().name
        self._usb_device = usb_device_above(self._sysfs / "class" / "video4linux" / name)
        self._kind = "" if self._usb_device is None else usb_kind(self._usb_device)

    def _number(self) -> str:
        """Return the number that the kernel gave the device when it was plugged in."""
        if self._usb_device is None:
            return ""
        return f"{self._usb_device.name} {read_attribute(self._usb_device / 'devnum')}"

    def _is_still_there(self) -> bool:
        device = self._usb_device
        return device is not None and device.is_dir() and usb_kind(device) == self._kind
