"""Exposure, gain and whatever else a driver lets one set, by the names that v4l2-ctl shows."""

import ctypes
import difflib
import errno
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from cornertouchd.devices import v4l2_abi as abi
from cornertouchd.devices.v4l2_device import MOST_LISTED
from cornertouchd.devices.v4l2_node import Node

ControlValue = bool | int | str

QUIET_DEFAULTS: Mapping[int, int] = {
    abi.CID_EXPOSURE_AUTO: 1,  # V4L2_EXPOSURE_MANUAL
    abi.CID_EXPOSURE_AUTO_PRIORITY: 0,
    abi.CID_AUTOGAIN: 0,
    abi.CID_AUTO_WHITE_BALANCE: 0,
    abi.CID_HUE_AUTO: 0,
    abi.CID_FOCUS_AUTO: 0,
    abi.CID_POWER_LINE_FREQUENCY: 0,
}
"""What a strip needs from every camera: nothing that changes by itself.

A camera that follows the light by itself answers a hand before the strip with more exposure, and
against flicker of the mains it lowers the rate.
"""


class Kind(Enum):
    """What values a control takes."""

    NUMBER = "a number"
    BITS = "some bits"
    SWITCH = "on or off"
    MENU = "one of some choices"
    BUTTON = "a push"
    OTHER = "something that cannot be set here"


_KINDS = {
    abi.CTRL_TYPE_INTEGER: Kind.NUMBER,
    abi.CTRL_TYPE_BOOLEAN: Kind.SWITCH,
    abi.CTRL_TYPE_MENU: Kind.MENU,
    abi.CTRL_TYPE_BUTTON: Kind.BUTTON,
    abi.CTRL_TYPE_INTEGER64: Kind.NUMBER,
    abi.CTRL_TYPE_BITMASK: Kind.BITS,
    abi.CTRL_TYPE_INTEGER_MENU: Kind.MENU,
}


@dataclass(frozen=True, slots=True)
class Control:
    """A control of a driver; `choices` are those of a menu by their number."""

    id: int
    name: str
    kind: Kind
    wide: bool
    lowest: int
    highest: int
    step: int
    default: int
    flags: int
    choices: Mapping[int, str]

    @property
    def bounds(self) -> str:
        """Which values it takes, in words."""
        match self.kind:
            case Kind.SWITCH:
                return "false or true"
            case Kind.MENU:
                return ", ".join(f'{number} "{text}"' for number, text in self.choices.items())
            case Kind.NUMBER:
                step = f" in steps of {self.step}" if self.step > 1 else ""
                return f"{self.lowest} to {self.highest}{step}, {self.default} at start"
            case Kind.BITS:
                return f"bits of {self.highest:#x}"
            case _:
                return str(self.kind.value)


class ControlError(Exception):
    """A control is not as it was configured; the text says why and what it takes."""


class Controls:
    """The controls of an opened device."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.by_name = {control.name: control for control in self._listed()}

    def apply(self, wanted: Mapping[str, ControlValue]) -> tuple[str, ...]:
        """Set the wanted controls and those of `QUIET_DEFAULTS`; return what went wrong.

        Automatic modes come first, for they lock what they rule.  A default that a driver refuses
        is no complaint.  Raises `OSError` if the device is gone.
        """
        for control in self.by_name.values():
            if control.id in QUIET_DEFAULTS and control.name not in wanted:
                self._set_if_it_can(control)
        complaints = []
        for name in sorted(wanted, key=lambda name: ("auto" not in name, name)):
            try:
                self.set(name, wanted[name])
            except ControlError as error:
                complaints.append(str(error))
        return tuple(complaints)

    def set(self, name: str, value: ControlValue) -> None:
        """Set one control and read it back.  Raises `ControlError`, or `OSError` if it is gone."""
        control = self.by_name.get(name)
        if control is None:
            raise ControlError(self._unknown(name, value))
        here = f"control {name} = {_shown(value)}"
        if control.kind is Kind.OTHER or control.flags & abi.CTRL_FLAG_READ_ONLY:
            raise ControlError(f"{here}: the driver lets nobody set it; remove it")
        number = _number(control, value)
        if number is None:
            raise ControlError(f"{here}: it takes {control.bounds}")
        try:
            self.write(control, number)
        except OSError as error:
            raise ControlError(f"{here}: {self._refusal(control, error)}") from None
        if control.kind is Kind.BUTTON or control.flags & abi.CTRL_FLAG_WRITE_ONLY:
            return
        now = self.read(control)
        if now != number:
            raise ControlError(
                f"{here}: the driver made {now} of it; it takes {control.bounds}; write a value "
                "that it keeps"
            )

    def read(self, control: Control) -> int:
        """Return the value of a control.  Raises `OSError`."""
        held = abi.ExtendedControl(id=control.id)
        self._do(abi.VIDIOC_G_EXT_CTRLS, held)
        return int(held.value64 if control.wide else held.value)

    def write(self, control: Control, number: int) -> None:
        """Set the value of a control.  Raises `OSError`."""
        held = abi.ExtendedControl(id=control.id)
        if control.wide:
            held.value64 = number
        else:
            held.value = number
        self._do(abi.VIDIOC_S_EXT_CTRLS, held)

    def _do(self, request: int, held: abi.ExtendedControl) -> None:
        several = abi.ExtendedControls(which=abi.CTRL_WHICH_CUR_VAL, count=1)
        several.controls = ctypes.pointer(held)
        self._node.ioctl(request, several)

    def _set_if_it_can(self, control: Control) -> None:
        try:
            self.write(control, QUIET_DEFAULTS[control.id])
        except OSError as error:
            if error.errno == errno.ENODEV:
                raise

    def _unknown(self, name: str, value: ControlValue) -> str:
        near = difflib.get_close_matches(name, self.by_name, n=1)
        known = ", ".join(self.by_name) or "none at all"
        remedy = f"did you mean {near[0]}?" if near else f"it has {known}"
        return f"control {name} = {_shown(value)}: the camera has no such control; {remedy}"

    def _refusal(self, control: Control, error: OSError) -> str:
        if error.errno == errno.ENODEV:
            raise error
        if error.errno == errno.EBUSY or self._flags(control) & abi.CTRL_FLAG_GRABBED:
            return "the driver holds it while pictures flow, or for another program"
        if self._flags(control) & abi.CTRL_FLAG_INACTIVE:
            return "an automatic mode rules it: turn that off, too"
        return f"the driver refuses it ({error.strerror}); it takes {control.bounds}"

    def _flags(self, control: Control) -> int:
        asked = abi.QueryExtendedControl(id=control.id)
        self._node.ioctl(abi.VIDIOC_QUERY_EXT_CTRL, asked)
        return int(asked.flags)

    def _listed(self) -> list[Control]:
        found: list[Control] = []
        last = 0
        for _ in range(MOST_LISTED):
            entry = abi.QueryExtendedControl(id=last | abi.CTRL_FLAG_NEXT_CTRL)
            try:
                self._node.ioctl(abi.VIDIOC_QUERY_EXT_CTRL, entry)
            except OSError as error:
                if error.errno in (errno.EINVAL, errno.ENOTTY):
                    break
                raise
            last = entry.id
            if entry.type == abi.CTRL_TYPE_CTRL_CLASS:
                continue  # a heading
            kind = _KINDS.get(entry.type, Kind.OTHER)
            if entry.flags & (abi.CTRL_FLAG_DISABLED | abi.CTRL_FLAG_HAS_PAYLOAD):
                kind = Kind.OTHER
            name = control_name(entry.name.decode("utf-8", errors="replace"))
            found.append(
                Control(
                    entry.id,
                    name,
                    kind,
                    entry.type == abi.CTRL_TYPE_INTEGER64,
                    entry.minimum,
                    entry.maximum,
                    entry.step,
                    entry.default_value,
                    entry.flags,
                    self._choices(entry) if kind is Kind.MENU else {},
                )
            )
        return found

    def _choices(self, control: abi.QueryExtendedControl) -> dict[int, str]:
        choices = {}
        for number in range(control.minimum, min(control.maximum, MOST_LISTED) + 1):
            entry = abi.QueryMenu(id=control.id, index=number)
            try:
                self._node.ioctl(abi.VIDIOC_QUERYMENU, entry)
            except OSError as error:
                if error.errno == errno.ENODEV:
                    raise
                continue  # menus have holes
            named = control.type == abi.CTRL_TYPE_MENU
            text = entry.name.decode("utf-8", errors="replace") if named else str(entry.value)
            choices[number] = text
        return choices


def control_name(shown: str) -> str:
    """Return the name of a control as v4l2-ctl writes it: "Exposure Time, Absolute" in words."""
    plain = "".join(c.lower() if c.isascii() and c.isalnum() else " " for c in shown)
    return "_".join(plain.split())


def _number(control: Control, value: ControlValue) -> int | None:
    """Return the number that a value stands for, None if the control does not take it."""
    if isinstance(value, str):
        asked = value.casefold()
        matches = [n for n, text in control.choices.items() if text.casefold() == asked]
        return matches[0] if matches else None
    number = int(value)
    if control.kind is Kind.BUTTON:
        return number
    if control.kind is Kind.MENU:
        return number if number in control.choices else None
    if control.kind is Kind.BITS:
        return number if number >= 0 and not number & ~control.highest else None
    inside = control.lowest <= number <= control.highest
    whole_steps = (number - control.lowest) % max(1, control.step) == 0
    return number if inside and whole_steps else None


def _shown(value: ControlValue) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f'"{value}"' if isinstance(value, str) else str(value)
