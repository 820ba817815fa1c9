"""What the tests of the firmware share: it is built once, and each test has a board of its own."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from led_board import LIGHT, Board, Heard, build_board

from cornertouchd.devices.serial_link import SerialLedFrame


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the firmware and the emulated board are built, for the whole session."""
    return build_board(tmp_path_factory.mktemp("build"))


@pytest.fixture
def board(build: Path, tmp_path: Path) -> Iterator[Board]:
    running = Board(build, tmp_path / "ledframe")
    yield running
    running.close()


@pytest.fixture
def heard() -> Heard:
    return Heard()


@pytest.fixture
def frame(board: Board, heard: Heard) -> Iterator[SerialLedFrame]:
    """A link to the board, configured but not armed."""
    link = SerialLedFrame(str(board.link), heard, heard)
    link.configure(LIGHT)
    link.start()
    yield link
    link.close()
