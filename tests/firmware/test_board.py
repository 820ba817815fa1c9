"""The real binary on the emulated board and the daemon's own link: light equals command."""

import random
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from led_board import CYCLES_PER_S, LIGHT, ROOT, Board, Heard, end_host, make, start_host

from cornertouchd.devices.serial_link import SerialLedFrame, open_port
from cornertouchd.wire import ledframe as wire
from cornertouchd.wire.ledframe import Fault, SetLevels, SetPattern, SetTiming, State, Status
from cornertouchd.wire.ledframe_framing import Kind, StreamDecoder, encode
from cornertouchd.wire.ledframe_reports import (
    Booted,
    ControllerStatus,
    FrameLit,
    Identity,
    SelfTested,
)
from cornertouchd.wire.ledframe_session import Light, Refused

# The emulated controller keeps real time at best; hundreds of starts take minutes.
pytestmark = pytest.mark.timeout(600)

HALF_A_SECOND = CYCLES_PER_S // 2
PATIENCE_MS, STEP_MS = 60_000, 10
"""Noise may cut a line off four times in a row, and it is taken up again after seconds."""


def lit_up(frame: SerialLedFrame, heard: Heard) -> None:
    frame.arm()
    heard.wait_for(lambda: state(frame) is State.ARMED, "an armed frame")


def state(frame: SerialLedFrame) -> State | None:
    return frame.status.controller.state if frame.status.controller else None


def faults(frame: SerialLedFrame) -> Fault:
    return frame.status.controller.faults if frame.status.controller else Fault(0)


def light_with(**changed: Any) -> Light:
    parts = {"levels": LIGHT.levels, "timing": LIGHT.timing, "pattern": LIGHT.pattern}
    return Light(**(parts | changed))


def test_less_than_half_of_flash_and_ram(build: Path) -> None:
    said = make(ROOT / "firmware", "avr", build)
    shares = [float(share) for share in re.findall(r"\(([\d.]+) %\)", said)]
    assert len(shares) == 2
    assert max(shares) < 50


def test_light_equals_command(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    lit_up(frame, heard)
    board.wait_ms(50)
    light = board.measure(1000)
    assert light["levels"] == [40, 80, 120, 200]
    assert light["strobe_us"] == pytest.approx([400, 400], abs=1)
    assert light["lead_us"] == pytest.approx([20, 20], abs=1)
    assert light["period_us"] == pytest.approx([8333, 8333], abs=1)
    assert light["dark"] == 0
    assert light["lit"] == [light["strobes"]] * 4
    assert light["lit_us"] == pytest.approx([400 * light["strobes"]] * 4, rel=0.01)


@pytest.mark.parametrize("masks", [(15, 0), (1, 2, 4, 8, 0), (5, 10, 15)])
def test_frames_shine_as_their_events_say(
    board: Board, frame: SerialLedFrame, heard: Heard, masks: tuple[int, ...]
) -> None:
    frame.configure(light_with(pattern=SetPattern(masks)))
    lit_up(frame, heard)
    board.wait_ms(20)
    board.do("zero")
    before = len(heard.of(FrameLit))
    board.wait_ms(800)
    light = board.get()
    told = heard.of(FrameLit)[before:]
    for side in range(4):
        expected = sum(1 for event in told if event.lit_mask >> side & 1)
        assert abs(light["lit"][side] - expected) <= 2
    assert abs(light["dark"] - sum(1 for event in told if event.lit_mask == 0)) <= 2
    numbers = [event.frame for event in told]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_no_strobe_is_too_long_while_timings_change(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    board.wait_ms(20)
    board.do("zero")
    timings = [SetTiming(4000, 800, 0), SetTiming(32000, 2000, 1000), SetTiming(4000, 50, -40),
               SetTiming(32000, 50, 0), SetTiming(8000, 1600, -1000)]  # fmt: skip
    for timing in timings * 6:
        frame.configure(light_with(timing=timing))
        board.wait_ms(90)
    light = board.get()
    assert light["strobe_us"] == pytest.approx([50, 2000], abs=1)
    assert light["period_us"] == pytest.approx([4000, 32000], abs=1000)  # the lead moves the rise


def test_a_level_of_zero_is_dark(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    frame.configure(light_with(levels=SetLevels((0, 80, 0, 200))))
    lit_up(frame, heard)
    board.wait_ms(20)
    light = board.measure(200)
    assert (light["lit"][0], light["lit"][2]) == (0, 0)
    assert light["lit"][1] == light["lit"][3] > 20


def test_silence_is_dark_within_half_a_second(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    board.do("unplug")
    board.wait_ms(1000)
    light = board.get()
    assert 0 < light["last_lit_cycle"] - light["last_byte_cycle"] <= HALF_A_SECOND
    after = board.measure(300)
    assert after["lit"] == [0] * 4
    assert after["triggers"] > 30  # the cameras keep their trigger


@pytest.fixture
def host(board: Board) -> Iterator[subprocess.Popen[str]]:
    process = start_host(board)
    yield process
    end_host(process)


@pytest.mark.parametrize("how", [signal.SIGSTOP, signal.SIGKILL])
def test_dark_within_half_a_second_of_the_end_of_the_host(
    board: Board, host: subprocess.Popen[str], how: signal.Signals
) -> None:
    assert board.measure(200)["lit"][0] > 20
    host.send_signal(how)
    board.wait_ms(1000)
    light = board.get()
    assert light["last_lit_cycle"] - light["last_byte_cycle"] <= HALF_A_SECOND
    assert board.measure(300)["lit"] == [0] * 4


def test_a_host_that_was_stopped_lights_up_again(board: Board, host: subprocess.Popen[str]) -> None:
    host.send_signal(signal.SIGSTOP)
    board.wait_ms(1000)
    host.send_signal(signal.SIGCONT)
    board.wait_ms(1000)
    assert board.measure(200)["lit"][0] > 20


def test_a_host_that_ends_switches_off_at_once(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    frame.close()
    board.wait_ms(20)
    assert board.measure(200)["lit"] == [0] * 4


def test_a_reset_in_mid_gesture_sends_everything_again(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    first = heard.of(Identity)[-1]
    heard.forget()
    board.do("reset")
    heard.wait_for(lambda: bool(heard.of(Identity)), "a new identity")
    heard.wait_for(lambda: bool(heard.of(Booted)), "the event of the start")
    heard.wait_for(lambda: state(frame) is State.ARMED, "an armed frame")
    assert heard.of(Identity)[0].boot_id == first.boot_id + 1
    board.wait_ms(50)
    light = board.measure(200)
    assert light["levels"] == [40, 80, 120, 200]
    assert light["period_us"] == pytest.approx([8333, 8333], abs=1)
    assert light["lit"][0] == light["strobes"]


def test_overcurrent(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    lit_up(frame, heard)
    board.do("fault 1")
    heard.wait_for(lambda: state(frame) is State.SAFE, "the safe state")
    assert board.measure(200)["lit"] == [0] * 4
    assert any("over-current" in fault for fault in heard.faults)
    frame.ask(wire.ClearFaults(Fault.OVERCURRENT))
    heard.wait_for(lambda: bool(heard.of(Refused)), "a refusal while it lasts")
    board.do("fault 0")
    frame.ask(wire.ClearFaults(Fault.OVERCURRENT))
    heard.wait_for(lambda: state(frame) is State.ARMED, "light after the fault was cleared")


def test_an_open_side_is_named_and_the_others_shine_on(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    board.do("open 2")
    lit_up(frame, heard)
    heard.wait_for(lambda: faults(frame) == Fault.OPEN_RIGHT, "the open side")
    assert any(fault.startswith("right side: no current") for fault in heard.faults)
    assert board.measure(200)["lit"][0] > 20


def test_a_short_darkens_all(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    lit_up(frame, heard)
    board.do("short 8")
    heard.wait_for(lambda: state(frame) is State.SAFE, "the safe state")
    assert faults(frame) & Fault.SHORT_LEFT
    assert board.measure(200)["lit"] == [0] * 4


def test_overtemperature_until_it_has_cooled_down(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    board.do("temperature 1350")  # 85 degrees
    heard.wait_for(lambda: state(frame) is State.SAFE, "the safe state")
    board.do("temperature 1250")  # 75
    assert board.measure(300)["lit"] == [0] * 4
    board.do("temperature 1000")  # 50
    heard.wait_for(lambda: state(frame) is State.ARMED, "light after cooling down")
    assert frame.status.controller is not None
    assert frame.status.controller.temperature_c == pytest.approx(50, abs=1)


def test_a_brownout_is_told_and_lit_again(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    heard.forget()
    board.do("brownout")
    heard.wait_for(lambda: any("supply had dropped" in fault for fault in heard.faults), "words")
    heard.wait_for(lambda: state(frame) is State.ARMED, "light")


def test_a_restart_by_the_watchdog(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    lit_up(frame, heard)
    heard.forget()
    frame.ask(wire.Reset())
    heard.wait_for(lambda: any(event.reset_cause & 8 for event in heard.of(Booted)), "the start")
    heard.wait_for(lambda: state(frame) is State.ARMED, "light")


def test_the_self_test_names_a_side(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    board.do("open 8")
    heard.wait_for(lambda: state(frame) is State.IDLE, "an idle frame")
    frame.ask(wire.SelfTest())
    heard.wait_for(lambda: bool(heard.of(SelfTested)), "the result")
    assert heard.of(SelfTested)[0].sides_failed == ("left",)


def test_a_refused_setting_is_told_once_and_nothing_shines_as_nobody_asked(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    frame.configure(light_with(timing=SetTiming(8333, 3000, 0)))
    frame.arm()
    heard.wait_for(lambda: bool(heard.of(Refused)), "the refusal")
    light = board.measure(500)
    assert light["lit"] == [0] * 4
    assert [refused.status for refused in heard.of(Refused)] == [Status.RANGE]
    assert any("limits of the firmware" in fault for fault in heard.faults)


def test_every_command_is_right_in_noise(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    lit_up(frame, heard)
    board.do("noise_in 40")
    board.do("noise_out 40")
    for number in range(150):
        levels = (number % 250 + 1, 10, 20, 30)
        frame.configure(light_with(levels=SetLevels(levels)))
        for _ in range(0, PATIENCE_MS, STEP_MS):
            board.wait_ms(STEP_MS)
            if board.get()["levels"] == list(levels):
                break
        else:
            pytest.fail(f"levels {levels} never arrived; {heard.faults}")
    assert frame.status.bad_messages > 10


def test_garbage_from_the_host_harms_nothing(board: Board) -> None:
    with open_port(str(board.link)) as port:
        port.write(random.Random(1).randbytes(4096))
        port.write(b"\xff" * 300)
        board.wait_ms(200)
        status = ask(port, wire.AskStatus(), board)
    assert status.state is State.IDLE
    assert status.bad_crc + status.malformed + status.overflows > 5
    assert board.get()["starts"] == 1


def ask(port: serial.Serial, request: wire.AskStatus, board: Board) -> ControllerStatus:
    decoder = StreamDecoder()
    port.write(encode(wire.encode_request(request, 77)))
    for _ in range(100):
        board.wait_ms(5)
        for message in decoder.feed(port.read(4096)):
            if message.kind is Kind.RESPONSE and message.sequence == 77:
                return ControllerStatus.read(message.payload[1:])
    pytest.fail("no answer")


def test_garbage_from_the_board_harms_nothing(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    board.do("babble 4096")
    board.wait_ms(300)
    assert board.measure(200)["lit"][0] > 20


def test_unplugged_and_plugged_in_again(board: Board, frame: SerialLedFrame, heard: Heard) -> None:
    lit_up(frame, heard)
    board.do("unplug")
    heard.wait_for(lambda: any("is gone" in fault for fault in heard.faults), "words")
    heard.wait_for(lambda: any("not there" in fault for fault in heard.faults), "more words")
    heard.forget()
    board.do("plug")
    heard.wait_for(lambda: state(frame) is State.ARMED, "light")
    assert board.measure(200)["lit"][0] > 20
    assert frame.status.connections == 2


def test_a_second_program_is_told_that_the_port_is_taken(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    second = Heard()
    other = SerialLedFrame(str(board.link), second, second)
    other.start()
    second.wait_for(lambda: any("another program" in fault for fault in second.faults), "words")
    other.close()
    assert board.measure(200)["lit"][0] > 20


def test_a_deaf_controller_is_told_and_lit_again(
    board: Board, frame: SerialLedFrame, heard: Heard
) -> None:
    lit_up(frame, heard)
    board.do("deaf 1")
    heard.wait_for(lambda: any("does not answer" in fault for fault in heard.faults), "words")
    board.do("deaf 0")
    heard.wait_for(lambda: state(frame) is State.ARMED, "light")


def test_a_hundred_boards_come_and_go(build: Path, tmp_path: Path, heard: Heard) -> None:
    frame = SerialLedFrame(str(tmp_path / "ledframe"), heard, heard)
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    for _ in range(100):
        board = Board(build, tmp_path / "ledframe")
        heard.wait_for(lambda: state(frame) is State.ARMED, "light")
        board.kill()
        heard.wait_for(lambda: frame.status.identity is None, "the loss")
    assert frame.status.connections == 100
    frame.close()


def test_a_hundred_hosts_come_and_go(board: Board) -> None:
    for _ in range(100):
        end_host(start_host(board))
    board.wait_ms(1000)
    light = board.get()
    assert light["last_lit_cycle"] - light["last_byte_cycle"] <= HALF_A_SECOND
    assert light["starts"] == 1
    assert light["strobe_us"][1] <= 401
