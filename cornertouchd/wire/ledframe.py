"""What the daemon and the LED frame's controller tell each other: protocol version 1.

docs/led-frame.md has the tables.  Integers are little-endian; sides are bits 0 to 3: top, right,
bottom, left.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import ClassVar, Self

from cornertouchd.wire.ledframe_framing import MAX_PAYLOAD_BYTES, Kind, Message

MAGIC = b"CTLF"
SIDE_NAMES = ("top", "right", "bottom", "left")


class ProtocolError(ValueError):
    """A message that is whole but says nothing the protocol knows."""


class Status(IntEnum):
    """What a request is answered."""

    OK = 0
    BAD_OP = 1
    BAD_LENGTH = 2
    RANGE = 3
    STATE = 4
    FAULTED = 5
    BUSY = 6
    VERSION = 7


class State(IntEnum):
    """What the controller does: only ARMED and SELF_TEST shine."""

    IDLE = 0
    ARMED = 1
    SAFE = 2
    SELF_TEST = 3


class Fault(IntFlag):
    """What the controller has found; it stays until it is cleared."""

    OVERCURRENT = 1 << 0
    OVERTEMPERATURE = 1 << 1
    HOST_LOST = 1 << 2
    BROWNOUT = 1 << 3
    WATCHDOG_RESET = 1 << 4
    OPEN_TOP = 1 << 8
    OPEN_RIGHT = 1 << 9
    OPEN_BOTTOM = 1 << 10
    OPEN_LEFT = 1 << 11
    SHORT_TOP = 1 << 12
    SHORT_RIGHT = 1 << 13
    SHORT_BOTTOM = 1 << 14
    SHORT_LEFT = 1 << 15


class _Plain:
    """A request without payload."""

    __slots__ = ()

    @property
    def payload(self) -> bytes:
        return b""

    @classmethod
    def read(cls, payload: bytes) -> Self:
        _require_length(cls.__name__, payload, 0)
        return cls()


@dataclass(frozen=True, slots=True)
class Hello(_Plain):
    """Who are you?  Answered by `Identity`."""

    OP: ClassVar[int] = 0x01


@dataclass(frozen=True, slots=True)
class AskStatus(_Plain):
    """How are you?  Answered by `ControllerStatus`; sent regularly, it keeps the light on."""

    OP: ClassVar[int] = 0x02


@dataclass(frozen=True, slots=True)
class Echo:
    """Answered by the same at most 47 bytes."""

    OP: ClassVar[int] = 0x03
    payload: bytes

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says."""
        return cls(payload)


@dataclass(frozen=True, slots=True)
class SetLevels:
    """Current of each side, 0..255 of full current."""

    OP: ClassVar[int] = 0x10
    levels: tuple[int, int, int, int]

    @property
    def payload(self) -> bytes:
        """As bytes.  Raises `ValueError` for a level out of range."""
        return bytes(self.levels)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says.  Raises `ProtocolError`."""
        top, right, bottom, left = _unpack(cls.__name__, "<4B", payload)
        return cls((top, right, bottom, left))


@dataclass(frozen=True, slots=True)
class SetTiming:
    """Length of a period, of the strobe in it, and how long before it the trigger rises.

    The controller takes periods of 4000..32000 us, strobes of 50..2000 us and at most a fifth of
    the period, leads of -1000..1000 us.
    """

    OP: ClassVar[int] = 0x11
    _FORMAT: ClassVar[str] = "<HHh"
    period_us: int
    strobe_us: int
    lead_us: int

    @property
    def payload(self) -> bytes:
        """As bytes.  Raises `struct.error` for what does not fit 16 bits."""
        return struct.pack(self._FORMAT, self.period_us, self.strobe_us, self.lead_us)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says.  Raises `ProtocolError`."""
        return cls(*_unpack(cls.__name__, cls._FORMAT, payload))


@dataclass(frozen=True, slots=True)
class SetPattern:
    """Which sides shine in one period after the other: 1..8 masks, over and over."""

    OP: ClassVar[int] = 0x12
    masks: tuple[int, ...]

    @property
    def payload(self) -> bytes:
        """As bytes.  Raises `ValueError` for a mask out of range."""
        return bytes(self.masks)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says."""
        return cls(tuple(payload))


@dataclass(frozen=True, slots=True)
class Arm(_Plain):
    """Shine, as levels, timing and pattern say."""

    OP: ClassVar[int] = 0x13


@dataclass(frozen=True, slots=True)
class Disarm(_Plain):
    """Be dark; the trigger runs on."""

    OP: ClassVar[int] = 0x14


@dataclass(frozen=True, slots=True)
class ClearFaults:
    """Forget faults; refused while over-current or over-temperature lasts."""

    OP: ClassVar[int] = 0x15
    faults: Fault

    @property
    def payload(self) -> bytes:
        """As bytes."""
        return struct.pack("<H", self.faults)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says.  Raises `ProtocolError`."""
        return cls(Fault(*_unpack(cls.__name__, "<H", payload)))


@dataclass(frozen=True, slots=True)
class SetWatchdog:
    """Be dark when the host was silent for so long: 50..5000 ms, 500 after a start."""

    OP: ClassVar[int] = 0x16
    timeout_ms: int

    @property
    def payload(self) -> bytes:
        """As bytes.  Raises `struct.error` for what does not fit 16 bits."""
        return struct.pack("<H", self.timeout_ms)

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says.  Raises `ProtocolError`."""
        return cls(*_unpack(cls.__name__, "<H", payload))


@dataclass(frozen=True, slots=True)
class SelfTest(_Plain):
    """Light one side after the other and measure its current; `SelfTested` tells the result."""

    OP: ClassVar[int] = 0x17


@dataclass(frozen=True, slots=True)
class SetReport:
    """Send `FrameLit` every so many periods, 0..255; 0: never."""

    OP: ClassVar[int] = 0x18
    every: int

    @property
    def payload(self) -> bytes:
        """As bytes.  Raises `ValueError` for a number out of range."""
        return bytes((self.every,))

    @classmethod
    def read(cls, payload: bytes) -> Self:
        """Return what `payload` says.  Raises `ProtocolError`."""
        return cls(*_unpack(cls.__name__, "<B", payload))


@dataclass(frozen=True, slots=True)
class Reset(_Plain):
    """Start anew."""

    OP: ClassVar[int] = 0x7F


Request = (
    Hello
    | AskStatus
    | Echo
    | SetLevels
    | SetTiming
    | SetPattern
    | Arm
    | Disarm
    | ClearFaults
    | SetWatchdog
    | SelfTest
    | SetReport
    | Reset
)
REQUESTS: tuple[type[Request], ...] = Request.__args__


@dataclass(frozen=True, slots=True)
class Response:
    """The answer to the request of the same sequence number and op."""

    sequence: int
    op: int
    status: Status
    payload: bytes = b""


def encode_request(request: Request, sequence: int) -> Message:
    """Return the message that asks for `request`.  Raises as its `payload` does."""
    return Message(Kind.REQUEST, sequence, request.OP, request.payload)


def read_request(message: Message) -> Request:
    """Return what a request asks for.  Raises `ProtocolError`."""
    for request in REQUESTS:
        if message.op == request.OP:
            return request.read(message.payload)
    raise ProtocolError(f"request with unknown op 0x{message.op:02x}")


def encode_response(response: Response) -> Message:
    """Return the message of a response."""
    payload = bytes((response.status,)) + response.payload
    return Message(Kind.RESPONSE, response.sequence, response.op, payload)


def read_response(message: Message) -> Response:
    """Return what a response says.  Raises `ProtocolError`."""
    if not message.payload:
        raise ProtocolError(f"response to op 0x{message.op:02x} without a status")
    try:
        status = Status(message.payload[0])
    except ValueError:
        raise ProtocolError(
            f"response to op 0x{message.op:02x} with unknown status {message.payload[0]}"
        ) from None
    return Response(message.sequence, message.op, status, message.payload[1:])


def _require_length(name: str, payload: bytes, length: int) -> None:
    if len(payload) != length or length > MAX_PAYLOAD_BYTES:
        raise ProtocolError(f"{name} with {len(payload)} bytes, must be {length}")


def _unpack(name: str, layout: str, payload: bytes) -> tuple[int, ...]:
    _require_length(name, payload, struct.calcsize(layout))
    return struct.unpack(layout, payload)
