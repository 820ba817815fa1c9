"""Holding a board: taken when it stands still at a new place, and told where it is wanted next."""

import pytest

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.guiding.board_holding import HeldBoards, HoldBoards
from cornertouchd.guiding.status import Step
from cornertouchd.model import Frame
from cornertouchd.simulation.board_holder import BoardHolder
from cornertouchd.simulation.rig import SimulatedRig

PLAN = BoardPlan()


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig((350.0, 400.0), rows_px=480, seed=3)


@pytest.fixture
def holder(rig: SimulatedRig) -> BoardHolder:
    return BoardHolder(rig, PLAN, seed=1)


def test_a_board_that_is_held_still_is_taken_once(rig: SimulatedRig, holder: BoardHolder) -> None:
    step: Step = HoldBoards(PLAN, rig.formats)
    assert "hold the board up" in step.status.hint

    def see(index: int) -> None:
        nonlocal step
        frames = [
            Frame(name, index, index / 10, 15, paint(index, index / 10))
            for name, paint in holder.paints.items()
        ]
        step = step.feed(frames)

    holder.hold(0, 0.0)
    see(0)
    assert step.status.number == 0
    see(1)
    assert step.status.number == 1
    assert step.status.hint.startswith("taken; now hold it elsewhere, before C")
    assert 0.0 < step.status.progress < 0.2
    see(2)
    assert step.status.number == 1
    assert step.status.hint.startswith("seen here before")

    holder.hold(1, 1.0)
    see(3)
    assert step.status.hint.startswith("hold the board still")
    see(4)
    assert step.status.number == 2
    assert not isinstance(step, HeldBoards)


def test_a_board_that_is_not_taken_is_held_elsewhere_after_a_while(holder: BoardHolder) -> None:
    def shown() -> bytes:
        return b"".join(paint(100, 0.0).tobytes() for paint in holder.paints.values())

    holder.hold(0, 2.0)
    before = shown()
    holder.hold(0, 3.0)
    assert shown() == before
    holder.hold(0, 20.0)
    assert shown() != before
