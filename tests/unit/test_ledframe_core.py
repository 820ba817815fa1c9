"""The firmware's core in C, driven from Python: it keeps its limits, whatever the host does."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from led_core import Core, build_core

from cornertouchd.wire import ledframe as wire
from cornertouchd.wire.ledframe import Fault, State, Status
from cornertouchd.wire.ledframe_framing import Kind, Message, StreamDecoder, crc16, encode
from cornertouchd.wire.ledframe_reports import (
    Booted,
    ControllerStatus,
    FaultsChanged,
    FrameLit,
    Identity,
    SelfTested,
    read_event,
)

DARK = Fault.OVERCURRENT | Fault.OVERTEMPERATURE | Fault.HOST_LOST | Fault(0xF000)
FULL_LEVEL_COUNTS = 510


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_core(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="module")
def shared_core(library: Path) -> Core:
    return Core(library)


@pytest.fixture
def core(shared_core: Core) -> Core:
    shared_core.start()
    shared_core.take_sent()
    return shared_core


class Host:
    """Asks one request after the other, as the daemon does."""

    def __init__(self, core: Core) -> None:
        self.core = core
        self.sequence = 0

    def ask(self, request: wire.Request) -> wire.Response:
        self.sequence = (self.sequence + 1) % 256
        answers = self.core.ask(wire.encode_request(request, self.sequence))
        responses = [message for message in answers if message.kind is Kind.RESPONSE]
        (response,) = map(wire.read_response, responses)
        assert (response.sequence, response.op) == (self.sequence, request.OP)
        return response

    def status(self) -> ControllerStatus:
        return ControllerStatus.read(self.ask(wire.AskStatus()).payload)

    def arm_with_levels(self, level: int) -> None:
        self.ask(wire.SetLevels((level,) * 4))
        self.core.pass_ms(20)
        assert self.ask(wire.Arm()).status is Status.OK


@pytest.fixture
def host(core: Core) -> Host:
    return Host(core)


@given(st.binary(max_size=48))
def test_both_checksums_agree(shared_core: Core, data: bytes) -> None:
    assert shared_core.crc16(data) == crc16(data)


@given(st.binary(max_size=47), st.integers(0, 255))
def test_both_codecs_agree(shared_core: Core, payload: bytes, sequence: int) -> None:
    shared_core.start()
    shared_core.take_sent()
    shared_core.receive(encode(wire.encode_request(wire.Echo(payload), sequence)))
    expected = wire.encode_response(wire.Response(sequence, 3, Status.OK, payload))
    assert shared_core.take_sent() == encode(expected)


@given(st.binary(max_size=300))
def test_both_decoders_agree_on_garbage(shared_core: Core, garbage: bytes) -> None:
    shared_core.start()
    host = Host(shared_core)
    decoder = StreamDecoder()
    decoder.feed(garbage + b"\0")
    shared_core.receive(garbage + b"\0")
    status = host.status()
    assert status.bad_crc + status.malformed + status.overflows == decoder.counts.bad
    assert host.ask(wire.Echo(b"still there")).payload == b"still there"


def test_a_start_is_told(shared_core: Core) -> None:
    shared_core.start(reset_cause=8, boot_id=0x1234)
    shared_core.pass_ms(1)
    booted, faults = map(read_event, shared_core.messages())
    assert booted == Booted(8, 0x1234)
    assert isinstance(faults, FaultsChanged)
    assert faults.faults is Fault.WATCHDOG_RESET


def test_hello_says_who_it_is(host: Host) -> None:
    identity = Identity.read(host.ask(wire.Hello()).payload)
    assert identity == Identity((1, 0), (1, 0, 0), 4, 48, 1, 1, 2000, 20)


@pytest.mark.parametrize(
    ("timing", "status"),
    [
        (wire.SetTiming(8333, 400, 20), Status.OK),
        (wire.SetTiming(10000, 2000, 1000), Status.OK),
        (wire.SetTiming(32000, 2000, -1000), Status.OK),
        (wire.SetTiming(32000, 2001, 0), Status.RANGE),
        (wire.SetTiming(4000, 800, 0), Status.OK),
        (wire.SetTiming(4000, 801, 0), Status.RANGE),
        (wire.SetTiming(3999, 400, 0), Status.RANGE),
        (wire.SetTiming(32001, 400, 0), Status.RANGE),
        (wire.SetTiming(8000, 49, 0), Status.RANGE),
        (wire.SetTiming(8000, 400, -391), Status.RANGE),
        (wire.SetTiming(8000, 400, 1001), Status.RANGE),
    ],
)
def test_timing_beyond_the_limits_is_refused(
    host: Host, timing: wire.SetTiming, status: Status
) -> None:
    before = host.core.timing_us
    assert host.ask(timing).status is status
    asked = (timing.period_us, timing.strobe_us, timing.lead_us)
    assert host.core.timing_us == (asked if status is Status.OK else before)


@pytest.mark.parametrize("masks", [(15, 0), (1, 2, 4, 8, 0), (15,), (1, 2, 3, 4, 5, 6, 7, 8)])
def test_frames_follow_the_pattern(host: Host, masks: tuple[int, ...]) -> None:
    host.ask(wire.SetPattern(masks))
    host.ask(wire.SetReport(1))
    host.ask(wire.Arm())
    host.core.take_sent()
    lit, told = [], []
    for _ in range(3 * len(masks)):
        host.core.pass_frame()
        lit.append(host.core.lit)
        (event,) = map(read_event, host.core.messages())
        assert isinstance(event, FrameLit)
        told.append((event.frame, event.lit_mask))
    assert lit == list(masks) * 3
    assert [mask for _, mask in told] == lit
    assert [frame for frame, _ in told] == list(range(1, len(lit) + 1))


@pytest.mark.parametrize("masks", [(), (16,), (1,) * 9])
def test_impossible_patterns_are_refused(host: Host, masks: tuple[int, ...]) -> None:
    assert host.ask(wire.SetPattern(masks)).status in (Status.RANGE, Status.BAD_LENGTH)


def test_dark_in_the_very_millisecond_that_the_host_was_silent_for_too_long(host: Host) -> None:
    host.arm_with_levels(100)
    host.core.pass_frame()
    assert host.core.lit == 15
    host.core.pass_ms(499)
    assert host.core.lit == 15
    host.core.pass_ms(1)
    assert (host.core.lit, host.core.state) == (0, State.SAFE)
    host.core.pass_frame()
    assert host.core.lit == 0


def test_safe_is_latched_until_it_is_cleared(host: Host) -> None:
    host.arm_with_levels(100)
    host.core.pass_ms(500)
    assert host.ask(wire.Arm()).status is Status.FAULTED
    host.ask(wire.Disarm())
    assert host.core.state == State.SAFE
    assert host.ask(wire.ClearFaults(Fault.HOST_LOST)).status is Status.OK
    assert host.ask(wire.Arm()).status is Status.OK


def test_a_repeated_request_runs_once(host: Host) -> None:
    reset = wire.encode_request(wire.Reset(), 9)
    first = host.core.ask(reset)
    assert host.core.ask(reset) == first
    assert host.core.resets == 1
    assert host.status().repeats == 1


def test_hello_runs_every_time(host: Host) -> None:
    hello = wire.encode_request(wire.Hello(), 9)
    host.core.ask(hello)
    host.core.ask(hello)
    assert host.status().repeats == 0


def test_a_host_of_another_version_is_told_so_but_greeted(host: Host) -> None:
    (answer,) = host.core.ask(Message(Kind.REQUEST, 1, wire.Arm.OP, b"", major=2))
    assert wire.read_response(answer).status is Status.VERSION
    assert host.core.state == State.IDLE
    (answer,) = host.core.ask(Message(Kind.REQUEST, 2, wire.Hello.OP, b"new", major=2))
    assert wire.read_response(answer).status is Status.OK


@given(op=st.integers(0, 255), payload=st.binary(max_size=48))
def test_wrong_lengths_and_ops_are_named(shared_core: Core, op: int, payload: bytes) -> None:
    shared_core.start()
    (answer, *_) = (
        message
        for message in shared_core.ask(Message(Kind.REQUEST, 1, op, payload))
        if message.kind is Kind.RESPONSE
    )
    status = wire.read_response(answer).status
    known = {request.OP: request for request in wire.REQUESTS}
    assert (status is Status.BAD_OP) == (op not in known)
    if op in known and op not in (wire.Hello.OP, wire.Echo.OP, wire.SetPattern.OP):
        try:
            known[op].read(payload)
        except wire.ProtocolError:
            assert status is Status.BAD_LENGTH
        else:
            assert status is not Status.BAD_LENGTH


def test_overcurrent_is_dark_at_once_and_stays_while_it_lasts(host: Host) -> None:
    host.arm_with_levels(100)
    host.core.pass_frame()
    host.core.overcurrent(True)
    assert (host.core.lit, host.core.state) == (0, State.SAFE)
    assert host.ask(wire.ClearFaults(Fault.OVERCURRENT)).status is Status.STATE
    host.core.overcurrent(False)
    assert host.ask(wire.ClearFaults(Fault.OVERCURRENT)).status is Status.OK
    assert host.ask(wire.Arm()).status is Status.OK


def test_overtemperature_is_cleared_only_after_cooling_down(host: Host) -> None:
    host.arm_with_levels(100)
    host.core.temperature(79.9)
    assert host.core.state == State.ARMED
    host.core.temperature(80.0)
    assert host.core.state == State.SAFE
    host.core.temperature(70.0)
    assert host.ask(wire.ClearFaults(Fault.OVERTEMPERATURE)).status is Status.STATE
    host.core.temperature(69.9)
    assert host.ask(wire.ClearFaults(Fault.OVERTEMPERATURE)).status is Status.OK


@pytest.mark.parametrize("masks", [(15,), (1, 2, 4, 8, 0), (1, 2, 4, 8), (15, 0), (5, 10)])
@pytest.mark.parametrize("side", range(4))
def test_an_open_side_is_found_in_every_pattern_and_only_warns(
    host: Host, masks: tuple[int, ...], side: int
) -> None:
    host.ask(wire.SetPattern(masks))
    host.arm_with_levels(100)
    sense = tuple(0 if open_side == side else 200 for open_side in range(4))
    for _ in range(5 * 4 * 3):
        host.core.pass_frame(sense)
    assert host.core.faults == Fault.OPEN_TOP << side
    assert host.core.state == State.ARMED


@pytest.mark.parametrize("level", [20, 100, 255])
def test_a_short_is_found_at_every_level(host: Host, level: int) -> None:
    host.arm_with_levels(level)
    sense = (level * 2, level * 2, 1000, level * 2)
    for _ in range(8):
        host.core.pass_frame(sense)
    assert host.core.faults == Fault.SHORT_BOTTOM
    assert (host.core.state, host.core.lit) == (State.SAFE, 0)


def test_dimming_is_no_short_while_the_current_settles(host: Host) -> None:
    host.ask(wire.SetPattern((1,)))  # the same side is sensed in every frame
    host.arm_with_levels(255)
    host.ask(wire.SetLevels((40,) * 4))
    for counts in (FULL_LEVEL_COUNTS, 400, 250):
        host.core.pass_frame((counts,) * 4)
        host.core.pass_ms(4)
    host.core.pass_ms(4)
    for _ in range(3):
        host.core.pass_frame((80,) * 4)
    assert (host.core.faults, host.core.state) == (0, State.ARMED)
    for _ in range(2):
        host.core.pass_frame((250,) * 4)  # by now it should have settled
    assert host.core.faults == Fault.SHORT_TOP


def test_brightening_is_no_open_side_while_the_current_settles(host: Host) -> None:
    host.ask(wire.SetPattern((1,)))
    host.arm_with_levels(20)
    host.ask(wire.SetLevels((255,) * 4))
    for _ in range(14):
        host.core.pass_frame((40,) * 4)
        host.core.pass_ms(1)
    assert host.core.faults == 0
    host.core.pass_ms(1)
    for _ in range(3):
        host.core.pass_frame((40,) * 4)
    assert host.core.faults == Fault.OPEN_TOP


def test_the_self_test_names_the_sides_that_draw_no_current(host: Host) -> None:
    host.ask(wire.SetLevels((255,) * 4))
    host.core.pass_ms(20)
    assert host.ask(wire.SelfTest()).status is Status.OK
    assert host.core.levels == (64,) * 4
    lit = []
    for _ in range(65):
        host.core.pass_ms(8)
        host.status()  # the host keeps speaking
        host.core.pass_frame((128, 128, 0, 128))
        lit.append(host.core.lit)
    host.core.pass_ms(1)
    events = [read_event(message) for message in host.core.messages() if message.kind is Kind.EVENT]
    assert [event.sides_failed for event in events if isinstance(event, SelfTested)] == [
        ("bottom",)
    ]
    assert lit == [1] * 16 + [2] * 16 + [4] * 16 + [8] * 16 + [0]
    assert host.core.state == State.IDLE
    assert host.core.levels == (255,) * 4
    assert host.core.faults == Fault.OPEN_BOTTOM


def test_events_that_found_no_room_are_told_later(host: Host) -> None:
    host.arm_with_levels(100)
    host.core.take_sent()
    host.core.fill_line(True)
    host.core.pass_ms(500)
    assert host.core.messages() == []
    host.core.fill_line(False)
    host.core.pass_ms(1)
    events = [read_event(message) for message in host.core.messages()]
    assert any(isinstance(event, FaultsChanged) for event in events)


REQUESTS = st.one_of(
    st.builds(Message, st.just(Kind.REQUEST), st.just(0), st.integers(0, 255),
              st.binary(max_size=8)),
    st.builds(wire.SetTiming, st.integers(0, 40000), st.integers(0, 3000),
              st.integers(-2000, 2000)).map(lambda timing: wire.encode_request(timing, 0)),
    st.just(wire.encode_request(wire.Arm(), 0)),
    st.just(wire.encode_request(wire.SelfTest(), 0)),
    st.just(wire.encode_request(wire.ClearFaults(Fault(0xFFFF)), 0)),
)  # fmt: skip
STEPS = st.one_of(
    st.tuples(st.just("ask"), REQUESTS),
    st.tuples(st.just("ms"), st.integers(1, 700)),
    st.tuples(st.just("frame"), st.tuples(*[st.integers(0, 1023)] * 4)),
    st.tuples(st.just("overcurrent"), st.booleans()),
    st.tuples(st.just("temperature"), st.integers(-40, 125)),
    st.tuples(st.just("noise"), st.binary(max_size=80)),
)


@settings(max_examples=300)
@given(st.lists(STEPS, max_size=40))
def test_never_beyond_the_limits(shared_core: Core, steps: list[tuple[str, object]]) -> None:
    core = shared_core
    core.start()
    sequence = silent_ms = 0
    for what, value in steps:
        match what, value:
            case "ask", Message() as message:
                sequence = (sequence + 1) % 256
                core.receive(encode(Message(Kind.REQUEST, sequence, message.op, message.payload)))
                silent_ms = 0
            case "ms", int(count):
                core.pass_ms(count)
                silent_ms += count
            case "frame", tuple(sense):
                core.pass_frame(sense)
            case "overcurrent", bool(active):
                core.overcurrent(active)
            case "temperature", int(temperature_c):
                core.temperature(temperature_c)
            case "noise", bytes(noise):
                core.receive(b"\0" + noise.replace(b"\0", b"") + b"\0")
        period_us, strobe_us, lead_us = core.timing_us
        assert 4000 <= period_us <= 32000
        assert strobe_us <= 2000
        assert strobe_us * 100 <= period_us * 20
        assert strobe_us + lead_us >= 10
        assert core.lock_depth == 0
        if core.faults & DARK or core.state in (State.IDLE, State.SAFE) or silent_ms > 5000:
            assert core.lit == core.mask == 0
        if core.faults & DARK:
            assert core.state == State.SAFE
