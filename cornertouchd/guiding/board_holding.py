"""A step that waits until a board has been held before all cameras often enough."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.lenses import fit_lens
from cornertouchd.calibration.stereo import chain_poses
from cornertouchd.guiding.board_gathering import BoardGathering, BoardProgress
from cornertouchd.guiding.status import Result, Status, Step
from cornertouchd.model import Frame, PictureFormat


class HoldBoards:
    """Gathers sights of the board, each when it holds still at a new place."""

    def __init__(self, plan: BoardPlan, formats: Mapping[str, PictureFormat]) -> None:
        self._gathering = BoardGathering(plan, formats)
        self._formats = formats
        self._progress: BoardProgress | None = None
        self._kept = 0
        self._trouble = ""

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        if self._progress is None:
            return Status("boards", "hold the board up, so that two cameras see all of it")
        hint = self._trouble or _hint(self._progress)
        return Status("boards", hint, self._progress.share, number=self._kept)

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set of whole pictures; return the sights when the cameras can be fitted."""
        self._progress = self._gathering.feed(frames)
        self._kept += self._progress.kept
        if not (self._progress.enough and self._progress.kept):
            return self
        try:
            chain_poses(
                {
                    camera: fit_lens(camera, self._gathering.sights, size)
                    for camera, size in self._formats.items()
                }
            )
        except CalibrationError as error:
            self._trouble = f"not yet: {error}"
            return self
        return HeldBoards(self._gathering.sights)


@dataclass(frozen=True)
class HeldBoards(Result):
    """The last step: every sight that was kept."""

    sights: tuple[BoardSight, ...]


def _hint(progress: BoardProgress) -> str:
    wanted = " and ".join(progress.missing[0]) if progress.missing else "all cameras"
    views = ", ".join(f"{camera} {count}" for camera, count in progress.views.items())
    if progress.kept:
        return f"taken; now hold it elsewhere, before {wanted} ({views})"
    if progress.holds_still:
        return f"seen here before: hold it elsewhere, before {wanted} ({views})"
    return f"hold the board still before {wanted} ({views})"
