"""The LED frame of a kiosk: the daemon under systemd, a UART, the firmware's real binary.

The guest's serial line is that of the emulated board, which is a process beside the guest: commands
go to the guest, and what shines is measured here, in cycles of the controller.  One test goes on
where the one before has ended.
"""

import json
import time
from collections.abc import Iterator
from typing import Any

import pytest
from led_board import CYCLES_PER_S, Board, build_board
from system.kiosk.guest import KioskGuest
from system.kiosk.machine import Machine
from system.kiosk.shell import GuestShell

pytestmark = pytest.mark.timeout(660)

GUEST_S = 600.0
UNIT = "cornertouchd.service"
CONFIG = "/etc/cornertouchd/cornertouchd.toml"
LEVELS, BRIGHTER = (60, 90, 140, 200), (70, 100, 150, 210)
STROBE_US = 700
RATE_HZ = 32.0
"""Slow: user-mode Linux never reads a serial line again that was full once, which it is when the
daemon takes no report for seven seconds at this rate.  Drivers of real UARTs do read again."""
PATIENCE_S = 120.0
HALF_A_SECOND = CYCLES_PER_S // 2
AT_ONCE = CYCLES_PER_S // 20
"""Longer than a period, far from the half second after which the controller itself goes dark."""

# The pictures are simulated and know nothing of the board: nothing may be regulated by them.
SETTINGS = """[cameras]
source = "simulated"
rate_hz = 10.0
[led_frame]
enabled = true
port = "/dev/ttyS0"
level_top = {}
level_right = {}
level_bottom = {}
level_left = {}
rate_hz = {}
strobe_us = {}
automatic_brightness = false
[monitor]
enabled = false
"""


@pytest.fixture(scope="module")
def board(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Board]:
    build = build_board(tmp_path_factory.mktemp("build"))
    running = Board(build, build / "ledframe")
    yield running
    running.close()


@pytest.fixture(scope="module")
def shell(installed: Machine, board: Board) -> Iterator[GuestShell]:
    """The guest, in which the service has been started."""
    with (
        KioskGuest(installed, "systemd", serial=board.link) as guest,
        GuestShell(guest, GUEST_S) as shell,
    ):
        configure(shell, LEVELS)
        shell.do(f"systemctl restart {UNIT}")
        yield shell


def configure(shell: GuestShell, levels: tuple[int, ...]) -> None:
    settings = SETTINGS.format(*levels, RATE_HZ, STROBE_US)
    shell.do(f"cat >{CONFIG} <<'end'\n{settings}end")


def journal(shell: GuestShell) -> str:
    return shell.do(f"journalctl --sync; journalctl -u {UNIT} --no-pager -o cat")


def steady_light(board: Board, levels: tuple[int, ...] = LEVELS) -> dict[str, Any]:
    """Return what shines within a second in which all sides shine at their levels all the time."""
    until_s = time.monotonic() + PATIENCE_S
    while True:
        light = board.measure(1000)
        if light["levels"] == list(levels) and light["lit"] == [light["strobes"]] * 4:
            return light
        if time.monotonic() > until_s:
            pytest.fail(f"no steady light: {light}")


def test_light_equals_configuration(shell: GuestShell, board: Board) -> None:
    light = steady_light(board)
    print(f"\n  {light}")
    assert light["strobes"] == pytest.approx(RATE_HZ, abs=1)
    assert light["dark"] == 0
    assert light["period_us"] == pytest.approx([1e6 / RATE_HZ] * 2, abs=1)
    assert light["strobe_us"] == pytest.approx([STROBE_US] * 2, abs=1)
    assert light["lit_us"] == pytest.approx([STROBE_US * light["strobes"]] * 4, rel=0.01)


def test_the_status_tells_who_shines(shell: GuestShell) -> None:
    told = json.loads(shell.do("cornertouchd status --json || [ $? = 1 ]"))
    light = told["light"]
    assert (light["port"], light["controller"], light["faults"]) == ("/dev/ttyS0", "armed", [])
    assert light["levels"] == list(LEVELS)
    assert light["temperature_c"] == pytest.approx(25.0, abs=1.0)
    assert not any("LED frame" in problem for problem in told["problems"])
    assert "LED frame at /dev/ttyS0: firmware 1." in journal(shell)


def test_a_controller_that_restarts_is_set_up_again(shell: GuestShell, board: Board) -> None:
    board.do("reset")
    steady_light(board)
    assert "start 2; it has restarted and is set up again" in journal(shell)


def test_a_daemon_that_is_killed_leaves_it_dark_until_it_is_back(
    shell: GuestShell, board: Board
) -> None:
    """The controller does it within half a second; systemd starts the daemon anew.

    It shines before the start is over, during which systemd would take no reload.
    """
    steady_light(board)
    before = board.get()
    restarts = int(shell.do(f"systemctl show --property=NRestarts --value {UNIT}"))
    shell.do(f"systemctl kill --signal=SIGKILL {UNIT}")
    board.wait_ms(600)
    light = board.get()
    after_s = (light["last_lit_cycle"] - light["last_byte_cycle"]) / CYCLES_PER_S
    print(f"\n  SIGKILL: dark {after_s:.3f} s after the last byte")
    assert board.measure(100)["lit"] == [0] * 4
    assert light["last_byte_cycle"] > before["last_byte_cycle"]
    assert 0 < light["last_lit_cycle"] - light["last_byte_cycle"] <= HALF_A_SECOND
    assert light["triggers"] > before["triggers"]  # cameras go on
    board.stand_still()  # what it told now would fill the line, see RATE_HZ
    shell.do(
        f"until journalctl -u {UNIT} -o cat | grep -c ^running: | grep -qx 2; do sleep 1; done"
    )
    board.go_on()
    assert steady_light(board)["starts"] == before["starts"]
    shell.do(f"until systemctl is-active --quiet {UNIT}; do sleep 0.5; done")
    assert int(shell.do(f"systemctl show --property=NRestarts --value {UNIT}")) == restarts + 1


def test_another_level_needs_a_reload_only(shell: GuestShell, board: Board) -> None:
    configure(shell, BRIGHTER)
    shell.do(f"systemctl reload {UNIT}")
    steady_light(board, BRIGHTER)


def test_stopping_the_service_switches_it_off_at_once(shell: GuestShell, board: Board) -> None:
    assert board.measure(300)["lit"][0] > 0
    shell.do(f"systemctl stop {UNIT}")
    light = board.measure(300)
    assert light["lit"] == [0] * 4
    assert light["triggers"] > 5
    assert light["last_lit_cycle"] - light["last_byte_cycle"] < AT_ONCE


def test_beside_the_stopped_service_a_command_finds_it_idle(shell: GuestShell) -> None:
    told = json.loads(shell.do("cornertouchd leds status --json 2>/dev/null"))
    print(f"\n  {told}")
    assert (told["state"], told["faults"]) == ("idle", [])
