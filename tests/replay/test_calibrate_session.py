"""A guided calibration in a real terminal, from first look to saved file, by one who taps."""

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cornertouchd.calibration.file import load_calibration
from cornertouchd.simulation.hand import place_on_rows

ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
TARGET = re.compile(
    r"(Taps|Check) - (\d+) of (\d+)(?:, [a-z ]+)? - "
    r"(\d+) mm from the left, (\d+) mm from the top - ([^\r\n]*)"
)
PATIENCE_S = 60.0


class Terminal:
    """A terminal of 132 x 43 in which the command runs, and a finger on its simulated rig."""

    def __init__(self, *arguments: object, home: Path) -> None:
        self._ours, theirs = pty.openpty()
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 43, 132, 0, 0))
        modes = termios.tcgetattr(theirs)
        modes[3] &= ~termios.ECHO
        termios.tcsetattr(theirs, termios.TCSANOW, modes)
        command = [sys.executable, "-m", "cornertouchd", "calibrate", "--simulate"]
        environment = {**os.environ, "HOME": str(home), "TERM": "xterm-256color"}
        for size in ("COLUMNS", "LINES"):  # the size of some other terminal
            environment.pop(size, None)
        self.process = subprocess.Popen(
            [*command, "--finger", "-", *map(str, arguments)],
            stdin=theirs,
            stdout=theirs,
            stderr=theirs,
            env=environment,
            start_new_session=True,
        )
        os.close(theirs)
        self.text = ""

    def read(self) -> bool:
        """Take in what is printed; False when the command has ended."""
        ready, _, _ = select.select([self._ours], [], [], PATIENCE_S)
        assert ready, f"nothing printed for a minute; last: {self.text[-500:]}"
        try:
            printed = os.read(self._ours, 65536)
        except OSError:  # Linux says EIO when the other end is closed
            return False
        self.text += ESCAPES.sub("", printed.decode(errors="replace"))
        return bool(printed)

    def forget(self) -> None:
        """Look only at what is printed from now on."""
        self.text = ""

    def wait_for(self, pattern: str) -> re.Match[str]:
        """Read until something like this is printed."""
        until_s = time.monotonic() + PATIENCE_S
        while not (found := re.search(pattern, self.text)):
            assert self.read(), f"ended without {pattern!r}: {self.text[-2000:]}"
            assert time.monotonic() < until_s, f"no {pattern!r}: {self.text[-2000:]}"
        return found

    def target(self) -> tuple[str, int, float, float]:
        """Return step, number and place of the target that is shown."""
        while not (found := TARGET.findall(self.text)):
            assert self.read(), self.text[-2000:]
        step, number, _, x_mm, y_mm, _ = found[-1]
        return step, int(number), float(x_mm), float(y_mm)

    def touch(self, x_mm: float, y_mm: float) -> None:
        os.write(self._ours, f"{x_mm} {y_mm}\n".encode())

    def lift(self) -> None:
        os.write(self._ours, b"\n")

    def tap(
        self, x_mm: float, y_mm: float, until: str = "lift the finger|mm off|Scribble - "
    ) -> None:
        """Touch, wait for what the command says to it, lift."""
        self.forget()
        self.touch(x_mm, y_mm)
        self.wait_for(until)
        self.forget()
        self.lift()

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        os.close(self._ours)


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path / "home"


@pytest.fixture
def terminals(home: Path) -> Iterator[list[Terminal]]:
    opened: list[Terminal] = []
    yield opened
    for terminal in opened:
        terminal.close()


def test_a_person_calibrates_from_start_to_saved_file(
    terminals: list[Terminal], home: Path, tmp_path: Path
) -> None:
    output = tmp_path / "calibration.json"
    terminal = Terminal("--output", output, home=home)
    terminals.append(terminal)
    terminal.wait_for("hands off the surface")
    step, number, x_mm, y_mm = terminal.target()
    assert (step, number) == ("Taps", 1)

    terminal.tap(x_mm + 150.0, y_mm + 150.0)
    terminal.wait_for(r"Taps - 1 of 16 .* that was about \d+ mm off: tap the marked place")
    for _ in range(2):
        terminal.tap(x_mm, y_mm, until="- hold still")
        terminal.wait_for("Taps - 1 of 16 .* too short")

    for expected in range(1, 7):
        terminal.wait_for(f"Taps - {expected} of 16")
        terminal.tap(*terminal.target()[2:])
    terminal.wait_for("Taps - 7 of 16")
    terminal.process.send_signal(signal.SIGINT)
    while terminal.read():
        pass
    assert terminal.process.wait() == 1
    assert "6 taps are kept: start again to go on" in terminal.text
    assert not output.exists()

    pictures = tmp_path / "errors.png", tmp_path / "strip.png"
    drawn = "--error-map", pictures[0], "--strip-picture", pictures[1]
    terminal = Terminal("--output", output, *drawn, home=home)
    terminals.append(terminal)
    terminal.wait_for("6 taps are kept from before")
    for expected in range(7, 17):
        terminal.wait_for(f"Taps - {expected} of 16")
        terminal.tap(*terminal.target()[2:])
    terminal.wait_for("Scribble - ")
    way_mm = 0.0
    while "saved" not in terminal.text:
        terminal.touch(*place_on_rows((350.0, 400.0), way_mm))
        way_mm += 20.0
        terminal.read()
    terminal.lift()
    for name in ("centre", "upper left", "upper right", "lower right", "lower left"):
        terminal.wait_for(f"of 5, {name} ")
        terminal.tap(*terminal.target()[2:], until="lift the finger|good")
    while terminal.read():
        pass
    assert terminal.process.wait() == 0, terminal.text[-2000:]

    assert all(picture.read_bytes().startswith(b"\x89PNG") for picture in pictures)
    calibration = load_calibration(output)
    assert calibration.reference_points == 16
    assert calibration.scribble_points > 50
    assert calibration.expected.rms_mm < 0.6
    assert [path.name for path in tmp_path.glob("calibration*")] == ["calibration.json"]
