"""One conversation with the LED frame's controller: what to send next, what came back.

No I/O and no clock: bytes and times come in, bytes and reports go out.  The rules: one request in
flight; no answer within 50 ms, then 100, 200 and 400: lost.  The controller runs a repeated request
once.  HELLO comes first; another boot_id means that all settings are sent again.
"""

from collections import deque
from dataclasses import dataclass, field, replace

from cornertouchd.wire.ledframe import (
    Arm,
    AskStatus,
    ClearFaults,
    Disarm,
    Fault,
    Hello,
    ProtocolError,
    Request,
    Response,
    SetLevels,
    SetPattern,
    SetReport,
    SetTiming,
    SetWatchdog,
    State,
    Status,
    encode_request,
    read_response,
)
from cornertouchd.wire.ledframe_faults import DARK, PASSED
from cornertouchd.wire.ledframe_framing import (
    PROTOCOL_MAJOR,
    FramingCounts,
    Kind,
    Message,
    StreamDecoder,
    encode,
)
from cornertouchd.wire.ledframe_reports import (
    Booted,
    ControllerStatus,
    Event,
    FaultsChanged,
    Identity,
    StateChanged,
    read_event,
)

TIMEOUT_S = 0.05
RETRIES = 3
# An Arduino whose port is opened restarts, and its bootloader waits up to two seconds.
HELLO_WITHIN_S = 4.0
# Ten of them fit the controller's patience of 500 ms.
HEARTBEAT_EVERY_S = 0.05
# A request that the controller's state forbids is asked again after so long.
ASK_AGAIN_S = 0.5
# The drivers cool down in minutes.
COOLED_AGAIN_S = 5.0


class LinkLostError(Exception):
    """The conversation is over; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class Light:
    """How the LED frame is to shine; see the requests of `wire.ledframe` for units and bounds."""

    levels: SetLevels
    timing: SetTiming
    pattern: SetPattern
    report: SetReport = field(default_factory=lambda: SetReport(1))
    watchdog: SetWatchdog = field(default_factory=lambda: SetWatchdog(500))

    @property
    def requests(self) -> tuple[Request, ...]:
        """What sets it, in the order in which it is sent."""
        return (self.watchdog, self.timing, self.pattern, self.levels, self.report)


@dataclass(frozen=True, slots=True)
class Refused:
    """The controller did not do what was asked."""

    request: Request
    status: Status


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the daemon wants of the frame."""

    light: Light | None = None
    armed: bool = False


Report = Identity | ControllerStatus | Event | Refused


@dataclass(slots=True)
class _Flight:
    """A request on its way."""

    request: Request
    sequence: int
    wire: bytes
    attempt: int = 0
    due_s: float = 0.0


class LinkSession:
    """Talks to one controller until it is lost.  Used by one thread."""

    def __init__(self, started_s: float, wanted: Wanted) -> None:
        self._wanted = wanted
        self._decoder = StreamDecoder()
        self._received_bytes = 0
        self._now_s = started_s
        self._hello_by_s = started_s + HELLO_WITHIN_S
        self._identity: Identity | None = None
        self._identified = False
        self._held: dict[int, Request] = {}
        self._refused: dict[int, Request] = {}
        self._once: deque[Request] = deque()
        self._flight: _Flight | None = None
        self._sequence = 0
        self._heartbeat_s = started_s
        self._ask_again_s = started_s
        self._cooled_again_s = started_s
        self._state = State.IDLE
        self._faults = Fault(0)
        self._uptime_ms = 0
        self._reports: list[Report] = []

    @property
    def counts(self) -> FramingCounts:
        """What came over the line so far."""
        return self._decoder.counts

    @property
    def identity(self) -> Identity | None:
        """Who answers; None before the first answer."""
        return self._identity

    def want(self, wanted: Wanted) -> None:
        """Change what is wanted; it is sent as soon as the line is free."""
        self._wanted = wanted

    def ask(self, request: Request) -> None:
        """Send a request once, after those asked before; lost with the conversation."""
        self._once.append(request)

    def take_reports(self) -> list[Report]:
        """Return what has been reported since the last call, in order."""
        reports, self._reports = self._reports, []
        return reports

    def receive(self, data: bytes, now_s: float) -> None:
        """Take bytes from the line.  Raises `LinkLostError` if that is no LED frame of ours."""
        self._now_s = now_s
        self._received_bytes += len(data)
        for message in self._decoder.feed(data):
            try:
                if message.kind is Kind.EVENT:
                    self._take_event(read_event(message))
                elif message.kind is Kind.RESPONSE:
                    self._take_response(message)
            except ProtocolError:
                continue  # of a newer controller, perhaps; an answer we need is asked for again

    def to_send(self, now_s: float) -> bytes:
        """Return what must be sent now, perhaps nothing.

        Raises `LinkLostError` when an answer has been waited for in vain.
        """
        if self._flight is None:
            request = self._next_request(now_s)
            if request is None:
                return b""
            self._sequence = (self._sequence + 1) % 256
            wire = encode(encode_request(request, self._sequence))
            self._flight = _Flight(request, self._sequence, wire)
            self._heartbeat_s = now_s + HEARTBEAT_EVERY_S
        elif now_s < self._flight.due_s:
            return b""
        else:
            self._retry(self._flight, now_s)
        self._flight.due_s = now_s + TIMEOUT_S * 2.0**self._flight.attempt
        return self._flight.wire

    def wake_at_s(self) -> float:
        """Return when `to_send` may have something, unless something is received or wanted."""
        return self._heartbeat_s if self._flight is None else self._flight.due_s

    def _retry(self, flight: _Flight, now_s: float) -> None:
        if isinstance(flight.request, Hello):
            if now_s >= self._hello_by_s:
                raise LinkLostError(self._nobody())
            flight.attempt = min(flight.attempt + 1, RETRIES)
            return
        if flight.attempt == RETRIES:
            name = type(flight.request).__name__
            raise LinkLostError(f"does not answer any more ({name}, {RETRIES + 1} times)")
        flight.attempt += 1

    def _nobody(self) -> str:
        if self._identity is not None:
            return "does not answer any more after a restart"
        if self._received_bytes == 0:
            return (
                "nothing answers; check that this is the LED frame's port, that the firmware is "
                "written and that nothing holds the controller in reset"
            )
        return (
            f"no LED frame answers: {self._received_bytes} bytes came, but no greeting; check that "
            "this is the LED frame's port and that its firmware is written"
        )

    def _next_request(self, now_s: float) -> Request | None:
        if not self._identified:
            return Hello()
        if self._once:
            return self._once.popleft()
        for request in self._settings():
            if request not in (self._held.get(request.OP), self._refused.get(request.OP)):
                return request
        return self._next_change(now_s) or (AskStatus() if now_s >= self._heartbeat_s else None)

    def _settings(self) -> tuple[Request, ...]:
        return self._wanted.light.requests if self._wanted.light else ()

    def _next_change(self, now_s: float) -> Request | None:
        """Return what brings the controller from the state it is in to the one that is wanted."""
        if self._wanted.light is None or not self._wanted.armed:
            return Disarm() if self._state is State.ARMED else None
        if self._faults & PASSED and now_s >= self._ask_again_s:
            return ClearFaults(self._faults & PASSED)
        if Fault.OVERTEMPERATURE in self._faults and now_s >= self._cooled_again_s:
            self._cooled_again_s = now_s + COOLED_AGAIN_S
            return ClearFaults(Fault.OVERTEMPERATURE)
        all_set = all(self._held.get(request.OP) == request for request in self._settings())
        ready = all_set and self._state is State.IDLE and not self._faults & DARK
        return Arm() if ready and now_s >= self._ask_again_s else None

    def _take_response(self, message: Message) -> None:
        flight = self._flight
        if flight is None or (message.sequence, message.op) != (flight.sequence, flight.request.OP):
            return  # the answer to a repetition
        response = read_response(message)
        if response.status is Status.VERSION:
            raise LinkLostError(_wrong_version(f"{message.major}"))
        if response.status is not Status.OK:
            self._flight = None
            self._take_refusal(flight.request, response.status)
            return
        self._take_answer(flight.request, response)
        self._flight = None

    def _take_refusal(self, request: Request, status: Status) -> None:
        if isinstance(request, Hello):
            raise LinkLostError(f"answers the greeting with {status.name}; write its firmware anew")
        self._ask_again_s = self._now_s + ASK_AGAIN_S
        if request in self._settings():
            self._refused[request.OP] = request
        still_hot = request == ClearFaults(Fault.OVERTEMPERATURE) and status is Status.STATE
        if not still_hot:
            self._reports.append(Refused(request, status))

    def _take_answer(self, request: Request, response: Response) -> None:
        match request:
            case Hello():
                self._identify(Identity.read(response.payload))
            case AskStatus():
                self._take_status(ControllerStatus.read(response.payload))
            case Arm():
                self._state = State.ARMED
            case Disarm() if self._state is not State.SAFE:
                self._state = State.IDLE
            case ClearFaults(faults):
                self._faults &= ~faults
                if self._state is State.SAFE and not self._faults & DARK:
                    self._state = State.IDLE
            case _:
                self._held[request.OP] = request
                self._refused.pop(request.OP, None)

    def _identify(self, identity: Identity) -> None:
        if identity.protocol[0] != PROTOCOL_MAJOR:
            raise LinkLostError(_wrong_version(".".join(map(str, identity.protocol))))
        if self._identity is None or identity.boot_id != self._identity.boot_id:
            self._held.clear()
            self._refused.clear()
            self._state = State.IDLE
            self._faults = Fault(0)
            self._reports.append(identity)
        self._identity = identity
        self._identified = True
        self._uptime_ms = 0
        self._once.appendleft(AskStatus())  # it may be armed, or have faults, from before

    def _greet_again(self) -> None:
        """Begin anew with HELLO: the controller may have forgotten everything."""
        if self._identity is not None:
            self._identified = False
            self._flight = None
            self._once.clear()
            self._hello_by_s = self._now_s + HELLO_WITHIN_S

    def _take_status(self, status: ControllerStatus) -> None:
        if status.uptime_ms < self._uptime_ms:  # it restarted, and the event got lost
            self._greet_again()
            return
        self._uptime_ms = status.uptime_ms
        self._state = status.state
        if status.faults != self._faults:  # the event got lost
            changed = status.faults ^ self._faults
            self._take_faults(FaultsChanged(status.faults, changed, status.uptime_ms, status.state))
        self._reports.append(status)

    def _take_faults(self, event: FaultsChanged) -> None:
        changed = event.faults ^ self._faults
        self._faults = event.faults
        self._state = event.state
        if changed:
            self._reports.append(replace(event, changed=changed))

    def _take_event(self, event: Event) -> None:
        match event:
            case Booted():
                self._reports.append(event)
                self._greet_again()
            case FaultsChanged():
                self._take_faults(event)
            case StateChanged():
                self._state = event.state
                self._reports.append(event)
            case _:
                self._reports.append(event)


def _wrong_version(version: str) -> str:
    return (
        f"the LED frame speaks protocol {version}, this daemon {PROTOCOL_MAJOR}; write the "
        "firmware that came with this daemon"
    )
