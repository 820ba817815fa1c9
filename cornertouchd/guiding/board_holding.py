"""A step that waits until a board has been held before all cameras often enough."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.guiding.board_gathering import BoardGathering, BoardProgress
from cornertouchd.guiding.status import Status, Step
from cornertouchd.model import Frame, PictureFormat


class HoldBoards:
    """Gathers sights of the board, each when it holds still at a new place."""

    def __init__(self, plan: BoardPlan, formats: Mapping[str, PictureFormat]) -> None:
        self._gathering = BoardGathering(plan, formats)
        self._progress: BoardProgress | None = None
        self._kept = 0

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        if self._progress is None:
            return Status("boards", "hold the board up, so that two cameras see all of it")
        return Status("boards", _hint(self._progress), self._progress.share, number=self._kept)

    def feed(self, frames: Sequence[Frame]) -> Step:
        """Take a frame set of whole pictures; return the sights when they are enough."""
        self._progress = self._gathering.feed(frames)
        self._kept += self._progress.kept
        return HeldBoards(self._gathering.sights) if self._progress.enough else self


@dataclass(frozen=True)
class HeldBoards:
    """The last step: every sight that was kept."""

    sights: tuple[BoardSight, ...]

    @property
    def status(self) -> Status:
        """Nothing is left to do."""
        return Status("done", "", 1.0)

    def feed(self, frames: Sequence[Frame]) -> Step:  # noqa: ARG002  nothing is left to see
        """Stay."""
        return self


def _hint(progress: BoardProgress) -> str:
    wanted = " and ".join(progress.missing[0]) if progress.missing else "all cameras"
    views = ", ".join(f"{camera} {count}" for camera, count in progress.views.items())
    if progress.kept:
        return f"taken; now hold it elsewhere, before {wanted} ({views})"
    if progress.holds_still:
        return f"seen here before: hold it elsewhere, before {wanted} ({views})"
    return f"hold the board still before {wanted} ({views})"
