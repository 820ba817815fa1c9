"""Gathers sights of a board while a person moves it before the live cameras."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.board_sights import BoardSight, common_corners, sights_in
from cornertouchd.calibration.boards import FEWEST_CORNERS, BoardPlan
from cornertouchd.model import FloatArray, Frame, PictureFormat

VIEWS_WANTED = 12
COMMON_WANTED = 6
"""That is 24 boards, six before each pair: on simulated rigs they leave .1 to .25 mm, 40 boards
hardly less."""

STILL_PX = 0.5
"""A hand at rest moves a corner by less than this between two pictures."""

MOVED_SHARE = 0.06
"""Share of the picture's width by which corners must have moved, on average, to tell anew."""


@dataclass(frozen=True)
class BoardProgress:
    """What has been gathered: sights of each camera, and of each pair of neighbours at once.

    `holds_still` tells whether the board of the last frame set did, `kept` whether it was counted.
    """

    views: Mapping[str, int]
    common: Mapping[tuple[str, str], int]
    holds_still: bool
    kept: bool

    @property
    def missing(self) -> tuple[tuple[str, ...], ...]:
        """Cameras and pairs that need more, those with least first."""
        counts: list[tuple[float, tuple[str, ...]]] = [
            (count / VIEWS_WANTED, (camera,)) for camera, count in self.views.items()
        ]
        counts += [(count / COMMON_WANTED, pair) for pair, count in self.common.items()]
        return tuple(who for share, who in sorted(counts) if share < 1.0)

    @property
    def share(self) -> float:
        """How much of what is wanted is there, 0..1."""
        have = sum(min(count, VIEWS_WANTED) for count in self.views.values())
        have += sum(min(count, COMMON_WANTED) for count in self.common.values())
        return have / (VIEWS_WANTED * len(self.views) + COMMON_WANTED * len(self.common))

    @property
    def enough(self) -> bool:
        """Whether the cameras can be calibrated: the ring of pairs may lack one."""
        cameras = [who for who in self.missing if len(who) == 1]
        return not cameras and len(self.missing) <= 1


class BoardGathering:
    """Feed it frame sets one by one; it keeps those that tell something new."""

    def __init__(self, plan: BoardPlan, formats: Mapping[str, PictureFormat]) -> None:
        self._plan = plan
        self._formats = formats
        self._last: tuple[BoardSight, ...] = ()
        self._kept: list[tuple[BoardSight, ...]] = []

    @property
    def sights(self) -> tuple[BoardSight, ...]:
        """Everything that was kept."""
        return tuple(sight for sights in self._kept for sight in sights)

    def feed(self, frames: Sequence[Frame]) -> BoardProgress:
        """Look at the frames of one instant."""
        sights = sights_in(self._plan, len(self._kept), frames, self._formats)
        still = _held_still(self._last, sights)
        self._last = sights
        kept = still and self._tells_something_new(sights)
        if kept:
            self._kept.append(sights)
        return self._progress(still, kept)

    def _tells_something_new(self, sights: Sequence[BoardSight]) -> bool:
        """Tell whether no set that was kept shows the board to all these cameras where it is."""
        now = {sight.camera: sight for sight in sights}
        return not any(
            all(
                camera in before and self._same_place(before[camera], now[camera]) for camera in now
            )
            for before in ({sight.camera: sight for sight in kept} for kept in self._kept)
        )

    def _same_place(self, a: BoardSight, b: BoardSight) -> bool:
        moved = _moved_px(a, b)
        wanted = MOVED_SHARE * self._formats[a.camera].width_px
        return len(moved) >= FEWEST_CORNERS and float(np.mean(moved)) < wanted

    def _progress(self, still: bool, kept: bool) -> BoardProgress:
        cameras = list(self._formats)
        pairs = list(zip(cameras, cameras[1:] + cameras[:1], strict=True))
        seen = [{sight.camera for sight in sights} for sights in self._kept]
        return BoardProgress(
            {camera: sum(camera in one for one in seen) for camera in cameras},
            {pair: sum(pair[0] in one and pair[1] in one for one in seen) for pair in pairs},
            still,
            kept,
        )


def _moved_px(a: BoardSight, b: BoardSight) -> FloatArray:
    """Return how far each corner that is in both moved in the picture."""
    _, before, after = common_corners(a, b)
    moved: FloatArray = np.hypot(*(after - before).T)
    return moved


def _held_still(before: Sequence[BoardSight], after: Sequence[BoardSight]) -> bool:
    """Tell whether the board stands still in all cameras that see it both times."""
    moved = [_moved_px(a, b) for a in before for b in after if a.camera == b.camera]
    still = [float(np.median(one)) < STILL_PX for one in moved if len(one)]
    return bool(still) and all(still)
