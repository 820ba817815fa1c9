"""The firmware's real binary on an emulated board, and all that is heard of it."""

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cornertouchd.ports import Report
from cornertouchd.wire.ledframe import SetLevels, SetPattern, SetTiming
from cornertouchd.wire.ledframe_session import Light

ROOT = Path(__file__).resolve().parent.parent
CYCLES_PER_S = 16_000_000
DEADLINE_S = 30.0

LIGHT = Light(SetLevels((40, 80, 120, 200)), SetTiming(8333, 400, 20), SetPattern((15,)))


def make(directory: Path, target: str, build: Path) -> str:
    done = subprocess.run(
        ["make", "-C", directory, target, f"BUILD={build}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build_board(into: Path) -> Path:
    """Build the firmware and the board that runs it; return where."""
    make(ROOT / "firmware", "avr", into)
    make(ROOT / "tests" / "firmware" / "board", f"{into}/board", into)
    return into


class Board:
    """One emulated board; `link` is the name of its serial port."""

    def __init__(
        self,
        build: Path,
        link: Path,
        program: Path | None = None,
        controller: str = "atmega328p",
    ) -> None:
        """`program` is a bootloader; without it our firmware runs."""
        self.link = link
        self._process = subprocess.Popen(
            [build / "board", program or build / "ledframe.elf", link, controller],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )
        assert "ready" in self._answer()

    def do(self, command: str) -> dict[str, Any]:
        assert self._process.stdin is not None
        self._process.stdin.write(command + "\n")
        answer = self._answer()
        assert "unknown" not in answer, answer
        return answer

    def get(self) -> dict[str, Any]:
        return self.do("get")

    def wait_ms(self, count: int) -> None:
        """Let so much time of the controller pass."""
        self.do(f"wait {count}")

    def measure(self, count_ms: int) -> dict[str, Any]:
        """What shines within so much time of the controller."""
        self.do("zero")
        self.wait_ms(count_ms)
        return self.get()

    def stand_still(self) -> None:
        """Let no time of the controller pass."""
        self._process.send_signal(signal.SIGSTOP)

    def go_on(self) -> None:
        self._process.send_signal(signal.SIGCONT)

    def kill(self) -> None:
        self._process.kill()
        self.close()

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(DEADLINE_S)
        self._process.stdout.close()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        answer: dict[str, Any] = json.loads(self._process.stdout.readline())
        return answer


class Heard:
    """Everything that a link reported and complained of, to wait for."""

    def __init__(self) -> None:
        self.reports: list[Report] = []
        self.faults: list[str] = []
        self._changed = threading.Condition()

    def __call__(self, report: Report, received_at_s: float) -> None:
        with self._changed:
            self.reports.append(report)
            self._changed.notify_all()

    def fault(self, kind: str, detail: object = "") -> None:
        with self._changed:
            self.faults.append(f"{kind}: {detail}")
            self._changed.notify_all()

    def good(self) -> None:
        pass

    def of(self, kind: type[Report]) -> list[Any]:
        with self._changed:
            return [report for report in self.reports if type(report) is kind]

    def forget(self) -> None:
        with self._changed:
            self.reports.clear()
            self.faults.clear()

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        with self._changed:
            if not self._changed.wait_for(condition, DEADLINE_S):
                pytest.fail(f"{what} never came; {self.faults}; {self.reports[-10:]}")


def start_host(board: Board) -> subprocess.Popen[str]:
    """Start a process that arms the board, and return once it shines."""
    process = subprocess.Popen(
        [sys.executable, ROOT / "tests" / "firmware" / "host_program.py", board.link],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "armed\n"
    return process


def end_host(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.wait()
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.close()
    process.stdout.close()
