"""What the LED frame's controller reports: answers with content, and events."""

import struct
from dataclasses import dataclass
from typing import ClassVar, Self

from cornertouchd.wire.ledframe import MAGIC, SIDE_NAMES, Fault, ProtocolError, State
from cornertouchd.wire.ledframe_framing import Kind, Message


@dataclass(frozen=True, slots=True)
class Identity:
    """Who the controller is; the answer to `Hello`.

    `boot_id` differs from start to start: with another one, nothing of what was set is left.
    `reset_cause` has the bits 1 power, 2 reset line, 4 brown-out, 8 watchdog.
    """

    _LAYOUT: ClassVar[struct.Struct] = struct.Struct("<2B3B3B2HB4s")
    protocol: tuple[int, int]
    firmware: tuple[int, int, int]
    sides: int
    max_payload_bytes: int
    reset_cause: int
    boot_id: int
    strobe_max_us: int
    duty_max_percent: int

    @property
    def payload(self) -> bytes:
        """As bytes, without the status before it."""
        return self._LAYOUT.pack(
            *self.protocol,
            *self.firmware,
            self.sides,
            self.max_payload_bytes,
            self.reset_cause,
            self.boot_id,
            self.strobe_max_us,
            self.duty_max_percent,
            MAGIC,
        )

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what an answer says.  Raises `ProtocolError`, also where the magic is missing.

        What a later protocol adds behind it is left alone.
        """
        if len(payload) < cls._LAYOUT.size or payload[13:17] != MAGIC:
            raise ProtocolError("what answers is no cornertouchd LED frame")
        values = cls._LAYOUT.unpack_from(payload)
        return cls((values[0], values[1]), (values[2], values[3], values[4]), *values[5:11])


@dataclass(frozen=True, slots=True)
class ControllerStatus:
    """How the controller is; the answer to `AskStatus`.  The counts wrap around at 65536."""

    _LAYOUT: ClassVar[struct.Struct] = struct.Struct("<BHIIBh4H")
    state: State
    faults: Fault
    uptime_ms: int
    frame: int
    lit_mask: int
    temperature_c: float
    bad_crc: int
    malformed: int
    overflows: int
    repeats: int

    @property
    def payload(self) -> bytes:
        """As bytes, without the status before it."""
        return self._LAYOUT.pack(
            self.state,
            self.faults,
            self.uptime_ms,
            self.frame,
            self.lit_mask,
            round(10.0 * self.temperature_c),
            self.bad_crc,
            self.malformed,
            self.overflows,
            self.repeats,
        )

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what an answer says.  Raises `ProtocolError`."""
        state, faults, uptime_ms, frame, lit_mask, temperature_dc, *counts = _unpack(
            cls.__name__, cls._LAYOUT, payload
        )
        return cls(
            _state(state), Fault(faults), uptime_ms, frame, lit_mask, temperature_dc / 10, *counts
        )


@dataclass(frozen=True, slots=True)
class Booted:
    """The controller has started."""

    OP: ClassVar[int] = 0x40
    _LAYOUT: ClassVar[struct.Struct] = struct.Struct("<BH")
    reset_cause: int
    boot_id: int

    @property
    def payload(self) -> bytes:
        """As bytes."""
        return self._LAYOUT.pack(self.reset_cause, self.boot_id)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what the event says.  Raises `ProtocolError`."""
        return cls(*_unpack(cls.__name__, cls._LAYOUT, payload))


@dataclass(frozen=True, slots=True)
class FaultsChanged:
    """`faults` is all that there are now, `changed` what came or went."""

    OP: ClassVar[int] = 0x41
    _LAYOUT: ClassVar[struct.Struct] = struct.Struct("<HHIB")
    faults: Fault
    changed: Fault
    uptime_ms: int
    state: State

    @property
    def payload(self) -> bytes:
        """As bytes."""
        return self._LAYOUT.pack(self.faults, self.changed, self.uptime_ms, self.state)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what the event says.  Raises `ProtocolError`."""
        faults, changed, uptime_ms, state = _unpack(cls.__name__, cls._LAYOUT, payload)
        return cls(Fault(faults), Fault(changed), uptime_ms, _state(state))


@dataclass(frozen=True, slots=True)
class FrameLit:
    """Period `frame` begins; the sides of `lit_mask` shine in the exposure at its end."""

    OP: ClassVar[int] = 0x42
    _LAYOUT: ClassVar[struct.Struct] = struct.Struct("<IBI")
    frame: int
    lit_mask: int
    uptime_ms: int

    @property
    def payload(self) -> bytes:
        """As bytes."""
        return self._LAYOUT.pack(self.frame, self.lit_mask, self.uptime_ms)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what the event says.  Raises `ProtocolError`."""
        return cls(*_unpack(cls.__name__, cls._LAYOUT, payload))


@dataclass(frozen=True, slots=True)
class StateChanged:
    """The controller went from one state to another; `sides_passed` is of its last self test."""

    OP: ClassVar[int] = 0x43
    _LAYOUT: ClassVar[struct.Struct] = struct.Struct("<3B")
    state: State
    previous: State
    sides_passed: int

    @property
    def payload(self) -> bytes:
        """As bytes."""
        return self._LAYOUT.pack(self.state, self.previous, self.sides_passed)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what the event says.  Raises `ProtocolError`."""
        state, previous, passed = _unpack(cls.__name__, cls._LAYOUT, payload)
        return cls(_state(state), _state(previous), passed)


@dataclass(frozen=True, slots=True)
class SelfTested(StateChanged):
    """The self test is over: `sides_passed` has a bit for each side that drew its current."""

    OP: ClassVar[int] = 0x44

    @property
    def sides_failed(self) -> tuple[str, ...]:
        """Names of the sides that did not."""
        return tuple(
            name for side, name in enumerate(SIDE_NAMES) if not self.sides_passed >> side & 1
        )


Event = Booted | FaultsChanged | FrameLit | StateChanged | SelfTested
EVENTS: tuple[type[Event], ...] = Event.__args__


def encode_event(event: Event, sequence: int) -> Message:
    """Return the message of an event."""
    return Message(Kind.EVENT, sequence, event.OP, event.payload)


def read_event(message: Message) -> Event:
    """Return what an event says.  Raises `ProtocolError`."""
    for event in EVENTS:
        if message.op == event.OP:
            return event.read(message.payload)
    raise ProtocolError(f"event with unknown op 0x{message.op:02x}")


def _unpack(name: str, layout: struct.Struct, payload: bytes) -> tuple[int, ...]:
    if len(payload) != layout.size:
        raise ProtocolError(f"{name} with {len(payload)} bytes, must be {layout.size}")
    return layout.unpack(payload)


def _state(number: int) -> State:
    try:
        return State(number)
    except ValueError:
        raise ProtocolError(f"unknown state {number}") from None
