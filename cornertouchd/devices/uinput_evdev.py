"""A touchscreen made with python-evdev, which only some installations have."""

import os
from collections.abc import Mapping

from evdev import UInput, UInputError

from cornertouchd.wire.touchscreen import BTN_TOUCH, EV_ABS, EV_KEY, INPUT_PROP_DIRECT, Axis

BUS_VIRTUAL = 0x06
VENDOR = 0x1D6B
"""The Linux Foundation's, whose numbers virtual devices bear."""


class EvdevScreen:
    """A touchscreen; fills `uinput_device.ScreenDevice`.  Raises `OSError`."""

    def __init__(self, name: str, product: int, axes: Mapping[int, Axis]) -> None:
        capabilities = {
            EV_KEY: [BTN_TOUCH],
            EV_ABS: [
                (code, (0, 0, axis.largest, 0, 0, axis.per_mm)) for code, axis in axes.items()
            ],
        }
        try:
            self._uinput = _WriteOnly(
                capabilities,
                name=name,
                vendor=VENDOR,
                product=product,
                version=1,
                bustype=BUS_VIRTUAL,
                phys=f"cornertouchd/{product:04x}",
                input_props=[INPUT_PROP_DIRECT],
            )
        except UInputError as error:
            raise OSError(str(error)) from error

    def write(self, events: bytes) -> None:
        """Hand over all events of a report by one system call, which never waits."""
        os.write(self._uinput.fd, events)

    def close(self) -> None:
        """Take the screen away."""
        self._uinput.close()


class _WriteOnly(UInput):
    """A device that is not opened for reading, too: the daemon may not read /dev/input.

    Its user sees no keyboard, and evdev would wait two seconds for that to change.
    """

    def _find_device(self, *_: object) -> None:
        return None
