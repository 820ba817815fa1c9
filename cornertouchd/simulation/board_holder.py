"""A person who holds a board before the cameras of a simulated rig, here and there."""

from functools import partial

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.model import Picture
from cornertouchd.simulation.boards import BoardShow, board_poses
from cornertouchd.simulation.painting import Paint
from cornertouchd.simulation.rig import SimulatedRig

POSES = 60
PATIENCE_S = 2.5
"""A board that is not taken after this is held elsewhere."""


class BoardHolder:
    """Holds the board at one pose until it has been taken; any thread may paint what is seen.

    `rig` gives pictures with all their rows.
    """

    def __init__(self, rig: SimulatedRig, plan: BoardPlan, seed: int) -> None:
        cameras = rig.truth.cameras
        self._show = BoardShow(rig, plan)
        self._poses = board_poses(plan, rig.surface_mm, rig.formats, cameras, POSES, seed)
        self._pose = 0
        self._taken = 0
        self._since_s: float | None = None
        self.paints: dict[str, Paint] = {name: partial(self._paint, name) for name in rig.formats}

    def hold(self, taken: int, now_s: float) -> None:
        """Go to the next pose when this one was taken, or is not taken for long."""
        if self._since_s is None:
            self._since_s = now_s
        if taken > self._taken or now_s - self._since_s > PATIENCE_S:
            self._pose = (self._pose + 1) % POSES
            self._taken, self._since_s = taken, now_s

    def _paint(self, camera_id: str, index: int, _: float) -> Picture:
        return self._show.render(camera_id, index, self._poses[self._pose])
