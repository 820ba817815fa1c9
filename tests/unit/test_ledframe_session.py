"""The conversation with the LED frame, on the firmware's own core and without a clock."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from led_core import Core, build_core

from cornertouchd.wire import ledframe as wire
from cornertouchd.wire.ledframe import Fault, SetLevels, SetPattern, SetTiming, State, Status
from cornertouchd.wire.ledframe_framing import Kind, Message, StreamDecoder, encode
from cornertouchd.wire.ledframe_reports import Booted, ControllerStatus, Identity, encode_event
from cornertouchd.wire.ledframe_session import (
    HEARTBEAT_EVERY_S,
    HELLO_WITHIN_S,
    Light,
    LinkLostError,
    LinkSession,
    Refused,
    Wanted,
)

LIGHT = Light(SetLevels((10, 20, 30, 40)), SetTiming(8000, 400, 20), SetPattern((15, 0)))
SHINE = Wanted(LIGHT, armed=True)
STEP_MS = 5


@pytest.fixture(scope="module")
def shared_core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return Core(build_core(tmp_path_factory.mktemp("core")))


@pytest.fixture
def core(shared_core: Core) -> Core:
    shared_core.start()
    return shared_core


def clean(data: bytes) -> bytes:
    return data


class Line:
    """A session and the core, with what the line does to bytes between them."""

    def __init__(self, core: Core, wanted: Wanted, now_s: float = 0.0) -> None:
        self.core = core
        self.session = LinkSession(now_s, wanted)
        self.now_s = now_s
        self.there: Callable[[bytes], bytes] = clean
        self.back: Callable[[bytes], bytes] = clean
        self.asked: list[wire.Request] = []
        self.reports: list[object] = []

    def run_ms(self, count: int) -> None:
        for _ in range(count // STEP_MS):
            sent = self.session.to_send(self.now_s)
            self.asked += [wire.read_request(message) for message in StreamDecoder().feed(sent)]
            self.core.receive(self.there(sent))
            self.core.pass_ms(STEP_MS)
            self.now_s += STEP_MS / 1000
            self.session.receive(self.back(self.core.take_sent()), self.now_s)
            self.reports += self.session.take_reports()

    def of(self, kind: type) -> list[object]:
        return [report for report in self.reports if type(report) is kind]


def test_hello_first_then_all_settings_then_light(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    assert [type(request) for request in line.asked[:9]] == [
        wire.Hello, wire.AskStatus, wire.SetWatchdog, wire.SetTiming, wire.SetPattern,
        wire.SetLevels, wire.SetReport, wire.Arm, wire.AskStatus,
    ]  # fmt: skip
    assert (core.levels, core.timing_us, core.state) == ((10, 20, 30, 40), (8000, 400, 20), 1)


def test_only_what_changed_is_sent(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    line.asked.clear()
    line.session.want(replace(SHINE, light=replace(LIGHT, levels=SetLevels((1, 2, 3, 4)))))
    line.run_ms(60)
    assert [request for request in line.asked if request != wire.AskStatus()] == [
        SetLevels((1, 2, 3, 4))
    ]


def test_the_heartbeat_keeps_the_light_on(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(3000)
    assert core.state == State.ARMED
    beats = line.asked.count(wire.AskStatus())
    assert beats == pytest.approx(3.0 / (HEARTBEAT_EVERY_S + STEP_MS / 1000), rel=0.15)


def test_disarming_is_dark(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    line.session.want(replace(SHINE, armed=False))
    line.run_ms(100)
    assert core.state == State.IDLE


def test_another_boot_id_means_all_settings_again(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    line.asked.clear()
    core.start(reset_cause=8, boot_id=2)
    line.run_ms(300)
    assert [type(request) for request in line.asked].count(wire.Hello) == 1
    assert set(LIGHT.requests) <= set(line.asked)
    assert (core.levels, core.state) == ((10, 20, 30, 40), State.ARMED)
    assert [identity.boot_id for identity in line.of(Identity)] == [1, 2]  # type: ignore[attr-defined]


def test_a_restart_is_noticed_even_if_its_event_is_lost(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(500)
    core.start(boot_id=2)
    core.take_sent()
    line.run_ms(300)
    assert (core.levels, core.state) == ((10, 20, 30, 40), State.ARMED)


def test_a_second_event_of_the_same_start_changes_nothing(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    line.asked.clear()
    line.session.receive(encode(encode_event(Booted(1, 1), 0)), line.now_s)
    line.run_ms(100)
    assert not set(LIGHT.requests) & set(line.asked)


def test_lost_hosts_light_up_again(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    core.pass_ms(600)  # the host was stopped
    assert core.state == State.SAFE
    line.run_ms(300)
    assert (core.state, core.faults) == (State.ARMED, 0)


def test_overcurrent_stays_dark_until_a_person_clears_it(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    core.overcurrent(True)
    core.overcurrent(False)
    line.run_ms(8000)
    assert core.state == State.SAFE
    line.session.ask(wire.ClearFaults(Fault.OVERCURRENT))
    line.run_ms(200)
    assert core.state == State.ARMED


def test_light_returns_when_the_drivers_have_cooled_down(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    core.temperature(85.0)
    line.run_ms(12000)
    assert core.state == State.SAFE
    assert not line.of(Refused)
    core.temperature(40.0)
    line.run_ms(6000)
    assert core.state == State.ARMED


def test_what_is_refused_is_told_once_and_leaves_it_dark(core: Core) -> None:
    too_long = replace(LIGHT, timing=SetTiming(8000, 1601, 0))
    line = Line(core, replace(SHINE, light=too_long))
    line.run_ms(3000)
    assert line.of(Refused) == [Refused(SetTiming(8000, 1601, 0), Status.RANGE)]
    assert core.state == State.IDLE
    line.session.want(SHINE)
    line.run_ms(600)
    assert core.state == State.ARMED


def test_four_unanswered_requests_are_the_end(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    line.there = lambda data: b""
    began_s = line.now_s
    with pytest.raises(LinkLostError, match="does not answer any more"):
        line.run_ms(2000)
    # the heartbeat is due at once or 50 ms later; 50 + 100 + 200 + 400 ms of waiting
    assert 0.74 <= line.now_s - began_s <= 0.86


def test_a_lost_response_runs_the_request_once(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(200)
    line.session.ask(wire.Reset())
    losses = iter([b""] * 3)
    line.back = lambda data: next(losses, data) if data else data
    line.run_ms(300)
    assert core.resets == 1


def test_silence_and_strangers_are_told_apart(core: Core) -> None:
    line = Line(core, SHINE)
    line.there = line.back = lambda data: b""
    with pytest.raises(LinkLostError, match="nothing answers"):
        line.run_ms(6000)
    assert line.now_s == pytest.approx(HELLO_WITHIN_S, abs=0.5)
    line = Line(core, SHINE)
    line.back = lambda data: b"$GPGGA,115739.00,4158.84\r\n"
    with pytest.raises(LinkLostError, match=r"no LED frame answers: \d+ bytes"):
        line.run_ms(6000)


def test_a_modem_that_echoes_is_no_led_frame(core: Core) -> None:
    session = LinkSession(0.0, SHINE)

    def echo_for_ten_seconds() -> None:
        for step in range(1000):
            session.receive(session.to_send(step / 100), step / 100)

    with pytest.raises(LinkLostError, match="no LED frame answers"):
        echo_for_ten_seconds()


@pytest.mark.parametrize("major", [0, 2, 63])
def test_another_protocol_is_named_with_the_remedy(major: int) -> None:
    session = LinkSession(0.0, SHINE)
    (hello,) = StreamDecoder().feed(session.to_send(0.0))
    identity = Identity((major, 3), (9, 0, 0), 4, 48, 1, 1, 2000, 20)
    answer = wire.Response(hello.sequence, hello.op, Status.OK, identity.payload)
    with pytest.raises(LinkLostError, match=rf"protocol {major}\.3, this daemon 1; write the"):
        session.receive(encode(wire.encode_response(answer)), 0.01)


def test_a_firmware_that_refuses_the_version_is_named() -> None:
    session = LinkSession(0.0, SHINE)
    (hello,) = StreamDecoder().feed(session.to_send(0.0))
    refusal = Message(Kind.RESPONSE, hello.sequence, hello.op, bytes((7,)), major=3)
    with pytest.raises(LinkLostError, match="protocol 3, this daemon 1"):
        session.receive(encode(refusal), 0.01)


@settings(max_examples=25)
@given(st.randoms(use_true_random=False))
def test_every_setting_arrives_through_noise(shared_core: Core, random: object) -> None:
    """A bit in one of 40 bytes is flipped, both ways."""

    def noisy(data: bytes) -> bytes:
        chance = random.random  # type: ignore[attr-defined]
        return bytes(byte ^ 1 << int(8 * chance()) if chance() < 1 / 40 else byte for byte in data)

    shared_core.start()
    line = Line(shared_core, SHINE)
    line.there = line.back = noisy
    try:
        line.run_ms(2500)
    except LinkLostError:
        line = Line(shared_core, SHINE, line.now_s)  # as the port's thread does
        line.run_ms(2500)
    line.there = line.back = clean
    line.run_ms(1000)
    assert shared_core.levels == (10, 20, 30, 40)
    assert shared_core.timing_us == (8000, 400, 20)
    assert shared_core.state == State.ARMED


@settings(max_examples=25)
@given(st.lists(st.binary(max_size=60), max_size=20))
def test_garbage_never_raises_anything_else(shared_core: Core, garbage: list[bytes]) -> None:
    shared_core.start()
    line = Line(shared_core, SHINE)
    for noise in garbage:
        line.run_ms(20)
        line.session.receive(noise, line.now_s)
    line.run_ms(1500)
    assert shared_core.state == State.ARMED


def test_status_is_reported(core: Core) -> None:
    line = Line(core, SHINE)
    line.run_ms(300)
    status = line.of(ControllerStatus)[-1]
    assert isinstance(status, ControllerStatus)
    assert (status.state, status.temperature_c) == (State.ARMED, 25.0)
