"""`cornertouchd leds flash`: avrdude writes through a real bootloader, on the emulated board.

The bootloader is that of older Nanos, as Debian's arduino-core-avr has it.
"""

import fcntl
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from led_board import ROOT, Board

pytestmark = pytest.mark.timeout(180)

BOOTLOADERS = Path("/usr/share/arduino/hardware/arduino/avr/bootloaders/atmega")
NANO, OTHER = "ATmegaBOOT_168_atmega328.hex", "ATmegaBOOT_168_diecimila.hex"
OLD_BAUD = "57600"


@pytest.fixture(autouse=True)
def tools() -> None:
    missing = [
        package
        for package, is_there in (
            ("avrdude", shutil.which("avrdude") is not None),
            ("arduino-core-avr", (BOOTLOADERS / NANO).exists()),
        )
        if not is_there
    ]
    if missing:
        told = f"flashing needs {' '.join(missing)}; apt-get install it"
        if os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS"):
            pytest.fail(told)
        pytest.skip(told)


Start = Callable[..., Board]


@pytest.fixture
def arduino(build: Path, tmp_path: Path) -> Iterator[Start]:
    """Start a board without firmware."""
    running: list[Board] = []

    def start(bootloader: str = NANO, controller: str = "atmega328p") -> Board:
        link = tmp_path / "arduino"
        running.append(Board(build, link, BOOTLOADERS / bootloader, controller))
        return running[-1]

    yield start
    for board in running:
        board.close()


def leds(port: Path | str, *arguments: str, path: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "cornertouchd", "leds", "--port", str(port), *arguments],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | ({"PATH": path} if path else {}),
    )


def flash(port: Path | str, image: Path, path: str = "") -> subprocess.CompletedProcess[str]:
    return leds(port, "flash", "--image", str(image), "--baud", OLD_BAUD, path=path)


def program_of(image: Path) -> dict[int, int]:
    """Return the bytes of an Intel HEX file by their addresses."""
    program = {}
    for line in image.read_text().split():
        record = bytes.fromhex(line[1:])
        if record[3] == 0:
            first = record[1] << 8 | record[2]
            program |= dict(enumerate(record[4:-1], first))
    return program


def test_a_blank_board_is_written_restarts_and_answers(
    arduino: Start, build: Path, tmp_path: Path
) -> None:
    board = arduino()
    image = build / "ledframe.hex"
    done = flash(board.link, image)
    assert done.returncode == 0, done.stderr
    assert f"{board.link}: {image} is written" in done.stderr
    assert "100%" in done.stderr
    dump = tmp_path / "program"
    board.do(f"program {dump}")
    memory, program = dump.read_bytes(), program_of(image)
    assert len(program) > 5000
    assert all(memory[address] == byte for address, byte in program.items())
    print(f"{len(program)} bytes written and verified")
    status = leds(board.link, "status")
    assert status.returncode == 0, status.stderr
    assert "1.0.0" in status.stdout
    assert "idle" in status.stdout


def test_another_controller_is_refused(arduino: Start, build: Path, tmp_path: Path) -> None:
    board = arduino(OTHER, "atmega168")
    done = flash(board.link, build / "ledframe.hex")
    assert done.returncode == 1
    assert f"{board.link}: not written: the controller is another one" in done.stderr
    assert "an ATmega328P is needed" in done.stderr
    board.do(f"program {tmp_path / 'program'}")
    assert set((tmp_path / "program").read_bytes()[:1024]) == {0xFF}


def test_a_board_whose_bootloader_does_not_answer(board: Board, build: Path) -> None:
    """Our firmware runs on it, and nothing resets it."""
    done = flash(board.link, build / "ledframe.hex")
    assert done.returncode == 1
    assert "no bootloader answers at 57600 baud" in done.stderr
    assert "--baud 57600" in done.stderr


def test_a_port_in_use_is_left_alone(board: Board, build: Path) -> None:
    with board.link.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # as every other program of ours holds it
        done = flash(board.link, build / "ledframe.hex")
    assert done.returncode == 1
    assert "another program uses it" in done.stderr
    assert "systemctl stop cornertouchd" in done.stderr


def test_what_is_missing_is_said(build: Path, tmp_path: Path) -> None:
    image = build / "ledframe.hex"
    assert "avrdude is not installed; apt install avrdude" in flash("/dev/null", image, "/").stderr
    assert "it is not there" in flash(tmp_path / "nowhere", image).stderr
    assert "no such firmware; build it" in flash("/dev/null", tmp_path / "none.hex").stderr
