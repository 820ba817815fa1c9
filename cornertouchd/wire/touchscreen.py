"""Touches as a Linux touchscreen tells them: input events of multi-touch protocol B.

Kernel documentation: https://docs.kernel.org/input/multi-touch-protocol.html.  A touch has a slot
from its landing to its lifting, and a tracking id that no touch shortly before it had.
"""

import math
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping

# linux/input-event-codes.h
EV_SYN, EV_KEY, EV_ABS = 0x00, 0x01, 0x03
SYN_REPORT = 0
BTN_TOUCH = 0x14A
ABS_X, ABS_Y = 0x00, 0x01
ABS_MT_SLOT = 0x2F
ABS_MT_TOUCH_MAJOR = 0x30
ABS_MT_POSITION_X, ABS_MT_POSITION_Y = 0x35, 0x36
ABS_MT_TRACKING_ID = 0x39
INPUT_PROP_DIRECT = 0x01

EVENT = struct.Struct("@LLHHi")
"""struct input_event: seconds, microseconds, type, code, value."""

UNITS_PER_MM = 100
"""A hundredth of a millimetre is below the noise of any touch."""

LARGEST_DIAMETER_MM = 250
"""A forearm; what is larger is told as that."""

LARGEST_TRACKING_ID = 0xFFFF
"""That of the kernel's own drivers (input_mt_init_slots)."""

_LIFTED = -1
_MICROSECONDS = 1_000_000
_MEASURES = (ABS_MT_POSITION_X, ABS_MT_POSITION_Y, ABS_MT_TOUCH_MAJOR)
"""What is told of a touch, in this order."""

Event = tuple[int, int, int]
"""Type, code, value."""


@dataclass(frozen=True, slots=True)
class Axis:
    """The values of an axis: 0..`largest`, `per_mm` of them a millimetre, 0 if it has no length."""

    largest: int
    per_mm: int = 0


@dataclass(slots=True)
class _Held:
    """A slot in use: by which touch, the how many-th that is, and what was told of it last."""

    touch_id: int
    number: int
    measures: tuple[int, ...]


class TouchscreenSession:
    """What one touchscreen tells: which touch has which slot, where it is, what has changed.

    A touch that is not on the display is lifted, and lands again when it comes back.  If there are
    more touches than `slots`, those that came first are told; the others are counted and take the
    slots that become free.  Raises `ValueError` without a slot.
    """

    def __init__(self, mapping: DisplayMapping, slots: int) -> None:
        if slots < 1:
            raise ValueError(f"a touchscreen has {slots} slots, must have at least 1")
        self._mapping = mapping
        self._units = tuple(max(1, round(side * UNITS_PER_MM)) for side in mapping.picture_mm)
        self._slots: list[_Held | None] = [None] * slots
        self._active_slot = 0
        self._landed = 0
        self._pointer: tuple[int, ...] = ()
        self._told_at_s = 0.0
        self._waiting: set[int] = set()
        self._left_out = 0

    @property
    def axes(self) -> Mapping[int, Axis]:
        """The absolute axes of the screen, by their code."""
        x, y = (Axis(units - 1, UNITS_PER_MM) for units in self._units)
        return {
            ABS_X: x,
            ABS_Y: y,
            ABS_MT_SLOT: Axis(len(self._slots) - 1),
            ABS_MT_TOUCH_MAJOR: Axis(LARGEST_DIAMETER_MM * UNITS_PER_MM, UNITS_PER_MM),
            ABS_MT_POSITION_X: x,
            ABS_MT_POSITION_Y: y,
            ABS_MT_TRACKING_ID: Axis(LARGEST_TRACKING_ID),
        }

    @property
    def touches_left_out(self) -> int:
        """How many touches had to wait because there were no slots left."""
        return self._left_out

    def frame(self, frame: TouchFrame) -> bytes:
        """Return the events that tell what has changed, none if nothing has."""
        shown = {touch.id: touch for touch in frame.touches if self._is_shown(touch)}
        just_lifted = self._free(shown)
        return self._report(
            [
                *self._lift(just_lifted),
                *self._move(shown),
                *self._land(shown, just_lifted),
            ],
            frame.captured_at_s,
        )

    def lift_all(self, now_s: float) -> bytes:
        """Return the events that lift all touches, none if there are none."""
        return self._report(list(self._lift(self._free({}))), now_s)

    def forget(self) -> None:
        """Begin anew: the device that was told is gone."""
        self._slots = [None] * len(self._slots)
        self._active_slot = 0
        self._pointer = ()

    def _is_shown(self, touch: Touch) -> bool:
        return (
            math.isfinite(touch.x_mm)
            and math.isfinite(touch.y_mm)
            and self._mapping.contains(touch.x_mm, touch.y_mm)
        )

    def _measures(self, touch: Touch) -> tuple[int, ...]:
        shares = self._mapping.to_display(touch.x_mm, touch.y_mm)
        x, y = (
            min(round(share * units), units - 1)
            for share, units in zip(shares, self._units, strict=True)
        )
        return x, y, _whole_mm(touch.diameter_mm)

    def _free(self, shown: Mapping[int, Touch]) -> list[int]:
        """Free the slots of touches that are gone, and return them."""
        gone = [
            slot
            for slot, held in enumerate(self._slots)
            if held is not None and held.touch_id not in shown
        ]
        for slot in gone:
            self._slots[slot] = None
        return gone

    def _lift(self, slots: Iterable[int]) -> Iterator[Event]:
        for slot in slots:
            yield from self._select(slot)
            yield EV_ABS, ABS_MT_TRACKING_ID, _LIFTED

    def _move(self, shown: Mapping[int, Touch]) -> Iterator[Event]:
        for slot, held in enumerate(self._slots):
            if held is None:
                continue
            measures = self._measures(shown[held.touch_id])
            if measures != held.measures:
                yield from self._select(slot)
                for code, before, now in zip(_MEASURES, held.measures, measures, strict=True):
                    if now != before:
                        yield EV_ABS, code, now
                held.measures = measures

    def _land(self, shown: Mapping[int, Touch], just_lifted: list[int]) -> Iterator[Event]:
        held = {one.touch_id for one in self._slots if one is not None}
        new = sorted((one for one in shown.values() if one.id not in held), key=_first_comes_first)
        # A slot that is freed and taken in one report would look like one touch that jumps.
        free = [
            slot for slot, one in enumerate(self._slots) if one is None and slot not in just_lifted
        ]
        self._count_waiting({touch.id for touch in new[len(free) :]})
        for slot, touch in zip(free, new, strict=False):
            one = self._slots[slot] = _Held(touch.id, self._landed, self._measures(touch))
            self._landed += 1
            yield from self._select(slot)
            yield EV_ABS, ABS_MT_TRACKING_ID, one.number & LARGEST_TRACKING_ID
            for code, value in zip(_MEASURES, one.measures, strict=True):
                yield EV_ABS, code, value

    def _select(self, slot: int) -> Iterator[Event]:
        if slot != self._active_slot:
            self._active_slot = slot
            yield EV_ABS, ABS_MT_SLOT, slot

    def _point(self) -> Iterator[Event]:
        """Tell programs that know one touch of the one that has been there for longest."""
        held = [one for one in self._slots if one is not None]
        before = self._pointer
        self._pointer = min(held, key=lambda one: one.number).measures[:2] if held else ()
        if bool(before) != bool(self._pointer):
            yield EV_KEY, BTN_TOUCH, int(bool(self._pointer))
        for axis, (code, value) in enumerate(zip((ABS_X, ABS_Y), self._pointer, strict=False)):
            if not before or before[axis] != value:
                yield EV_ABS, code, value

    def _count_waiting(self, waiting: set[int]) -> None:
        self._left_out += len(waiting - self._waiting)
        self._waiting = waiting

    def _report(self, events: list[Event], time_s: float) -> bytes:
        """Return events as one report, of the time at which the picture was taken.

        Kernels before 5.14 put the time of writing in its place.
        """
        if not events:
            return b""
        self._told_at_s = max(self._told_at_s, time_s) if math.isfinite(time_s) else self._told_at_s
        seconds, microseconds = divmod(int(self._told_at_s * _MICROSECONDS), _MICROSECONDS)
        events += [*self._point(), (EV_SYN, SYN_REPORT, 0)]
        return b"".join(EVENT.pack(seconds, microseconds, *event) for event in events)


def _whole_mm(diameter_mm: float) -> int:
    """Return a diameter in units, in steps of a millimetre: it is not known any better."""
    if not math.isfinite(diameter_mm):
        return 0
    return UNITS_PER_MM * round(min(max(diameter_mm, 0.0), LARGEST_DIAMETER_MM))


def _first_comes_first(touch: Touch) -> float:
    return -touch.age_s
