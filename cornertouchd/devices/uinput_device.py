"""The kernel's uinput: a touchscreen of this machine that a program makes and moves."""

import errno
import importlib.util
import os
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from cornertouchd.errors import ReportedError
from cornertouchd.wire.touchscreen import Axis

NODE = Path("/dev/uinput")
PRODUCTS = 0x10000

_REMEDIES = {
    errno.ENOENT: "load the kernel's module: modprobe uinput",
    errno.ENODEV: "load the kernel's module: modprobe uinput",
    errno.EACCES: "install systemd/60-cornertouchd.rules and be in the group uinput",
    errno.EPERM: "the unit has to allow it, by systemd/screens.conf (docs/desktop-touch.md)",
}


class ScreenError(ReportedError):
    """A touchscreen cannot be made; the text says why and what to do."""


class ScreenDevice(Protocol):
    """A touchscreen that exists.  Used by one thread at a time."""

    def write(self, events: bytes) -> None:
        """Hand over events at once.  Raises `OSError`: the screen is gone or refuses them."""
        ...

    def close(self) -> None:
        """Take the screen away; touches that are down on it end."""
        ...


OpenScreen = Callable[[str, Mapping[int, Axis]], ScreenDevice]
"""Makes a touchscreen with this name and these axes; may take a while.  Raises `ScreenError`."""


def open_screen(name: str, axes: Mapping[int, Axis]) -> ScreenDevice:
    """Make a touchscreen by the kernel's uinput.  Raises `ScreenError`."""
    require_uinput()
    from cornertouchd.devices.uinput_evdev import EvdevScreen  # noqa: PLC0415  evdev is an extra

    try:
        return EvdevScreen(name, product_of(name), axes)
    except (OSError, ValueError) as error:
        raise ScreenError(f"{NODE} makes no touchscreen: {error}") from error


def require_uinput(node: Path = NODE) -> None:
    """Raise `ScreenError` unless touchscreens can be made."""
    if importlib.util.find_spec("evdev") is None:
        raise ScreenError(
            "python-evdev is not installed; run `pip install cornertouchd[uinput]`, or install "
            "python3-evdev"
        )
    try:
        os.close(os.open(node, os.O_WRONLY | os.O_NONBLOCK | os.O_CLOEXEC))
    except OSError as error:
        remedy = _REMEDIES.get(error.errno or 0, "look for why in the kernel's log")
        raise ScreenError(f"{node}: {error.strerror}; {remedy}") from error


def product_of(name: str) -> int:
    """Return the product number of a screen, 16 bits made from its name.

    Some desktops know screens by vendor and product only, and have to tell several apart.
    """
    return zlib.crc32(name.encode()) % PRODUCTS
