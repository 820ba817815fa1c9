"""Simulated pictures that come too late: told apart from those that the daemon misses."""

import multiprocessing
import time
from collections.abc import Sequence
from ctypes import c_int64

from cornertouchd.config import Settings
from cornertouchd.fusion.pairing import CAMERAS_TO_REFUSE_GHOSTS
from cornertouchd.model import Picture
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import Script
from cornertouchd.simulation.show import make_show

REMEMBERED_FRAMES = 4096


class Lateness:
    """Which pictures were skipped because the one before was painted too late.

    Shared by the process that paints and the client.  `start_s` is set by the daemon; painter and
    daemon have the same clock.
    """

    def __init__(self, cameras: Sequence[str], rate_hz: float) -> None:
        self._cameras = tuple(cameras)
        self._rate_hz = rate_hz
        self._start_s = multiprocessing.RawValue("d", 0.0)
        self._skipped = multiprocessing.RawArray(c_int64, len(cameras) * REMEMBERED_FRAMES)

    def begin(self, start_s: float) -> None:
        """Say when the first pictures are due."""
        self._start_s.value = start_s

    def note(self, camera: str, index: int, painted_at_s: float) -> None:
        """Take note of a picture that is ready; the camera goes on with the newest one then."""
        if self._start_s.value == 0.0:
            return
        newest = int((painted_at_s - self._start_s.value) * self._rate_hz)
        row = self._cameras.index(camera) * REMEMBERED_FRAMES
        for skipped in range(index + 1, newest):
            self._skipped[row + skipped % REMEMBERED_FRAMES] = skipped

    def was_delivered(self, index: int) -> bool:
        """Tell whether three cameras could have been given an instant in time."""
        rows = range(0, len(self._skipped), REMEMBERED_FRAMES)
        lacking = sum(self._skipped[row + index % REMEMBERED_FRAMES] == index for row in rows)
        return len(self._cameras) - lacking >= CAMERAS_TO_REFUSE_GHOSTS


class TimedRig(SimulatedRig):
    """A simulated rig that notes when its pictures are painted."""

    def __init__(self, rig: SimulatedRig, lateness: Lateness) -> None:
        vars(self).update(vars(rig))
        self._lateness = lateness

    def render(self, camera_id: str, index: int, fingers: Sequence[Finger]) -> Picture:
        """Paint a picture."""
        picture = super().render(camera_id, index, fingers)
        self._lateness.note(camera_id, index, time.monotonic())
        return picture


def make_timed_show(settings: Settings, lateness: Lateness) -> tuple[SimulatedRig, Script]:
    """Return what `make_show` does, with a rig that notes how late it is."""
    rig, script = make_show(settings)
    return TimedRig(rig, lateness), script
