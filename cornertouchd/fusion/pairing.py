"""Pairing: observations that the cameras made at one instant, put together by capture time.

Open sets cover disjoint spans of time, in ascending order, none longer than the tolerance.  An
observation joins the set whose span it lies in or can stretch, else it opens a new one.  A set is
given out when every live camera has given to it or is past it, or when it has waited long enough,
and never before an older one.  So a camera that runs ahead of the others waits for them, and one
that lost a picture or is gone holds nobody up for longer than the deadline.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import isfinite

from cornertouchd.config import PairingSettings
from cornertouchd.model import FrameSet, Observation

CAMERAS_TO_REFUSE_GHOSTS = 3
"""Two cameras alone see four crossings where two fingers are; a third tells which are real.  A rig
that has but two works with what they tell; of one that lost two of four, see `is_single_touch`."""

SIDES = ({"C1", "C2"}, {"C2", "C3"}, {"C3", "C4"}, {"C4", "C1"})
"""Cameras in neighbouring corners.  Lines of those in opposite ones are all but parallel along the
diagonal: there they put a finger up to 32 mm beside its place (simulated rig, 350 x 400 mm), those
of a side 4 mm at most and .6 mm in 99 of 100 frame sets."""


@dataclass(slots=True)
class PairingCounts:
    """What pairing has done since it was made; the numbers only grow.

    `incomplete_sets` of the `sets` lacked a live camera.  `missed_observations` are gaps in the
    sequence numbers, `dropped_observations` came after their set, twice, or without a time.
    `restarts` are jumps back in time.
    """

    sets: int = 0
    incomplete_sets: int = 0
    missed_observations: int = 0
    dropped_observations: int = 0
    restarts: int = 0


@dataclass(slots=True)
class _OpenSet:
    """Observations of one instant, by camera, and when the first of them arrived."""

    observations: dict[str, Observation]
    begins_at_s: float
    ends_at_s: float
    arrived_at_s: float

    def length_with_s(self, time_s: float) -> float:
        """Return how long the set would be with an observation of this time."""
        return max(self.ends_at_s, time_s) - min(self.begins_at_s, time_s)

    def grows_s(self, time_s: float) -> float:
        """Return by how much an observation of this time would make it longer."""
        return self.length_with_s(time_s) - (self.ends_at_s - self.begins_at_s)

    def add(self, observation: Observation) -> None:
        time_s = observation.captured_at_s
        self.observations[observation.camera] = observation
        if time_s < self.begins_at_s:
            self.begins_at_s = time_s
        elif time_s > self.ends_at_s:
            self.ends_at_s = time_s


def frame_set_of(observations: Iterable[Observation]) -> FrameSet:
    """Return the frame set of observations that belong together, at least one.

    Its time is their lower median: in the middle, and a time that was really measured.
    """
    together = tuple(observations)
    times = sorted([one.captured_at_s for one in together])
    return FrameSet(times[(len(times) - 1) // 2], together)


def is_worth_fusing(frame_set: FrameSet, cameras: int) -> bool:
    """Tell whether enough of the rig's cameras saw a frame set to refuse ghosts."""
    return len(frame_set.observations) >= min(CAMERAS_TO_REFUSE_GHOSTS, cameras)


def tell_single_touches(live: Iterable[str]) -> bool:
    """Tell whether these cameras, all that are left, can locate a touch that is alone."""
    return set(live) in SIDES


def is_single_touch(frame_set: FrameSet) -> bool:
    """Tell whether two cameras are enough for a frame set, because it cannot hold ghosts.

    Whatever touches throws a shadow into both views, so where both have one, nothing lies but on
    the one crossing.  Without a shadow there is no touch.
    """
    return tell_single_touches(one.camera for one in frame_set.observations) and all(
        len(one.shadows) <= 1 for one in frame_set.observations
    )


class FrameSetPairing:
    """Pairs observations; each is given out in one set, or counted as dropped.

    Owned by one thread.  Times are those of the observations and, as `now_s`, of their arrival; the
    two clocks need not agree.
    """

    def __init__(self, cameras: Sequence[str], settings: PairingSettings) -> None:
        self._cameras = tuple(cameras)
        self._tolerance_s = settings.tolerance_ms / 1000.0
        self._deadline_s = settings.deadline_ms / 1000.0
        self._live = frozenset(cameras)
        self._counts = PairingCounts()
        self._forget()

    @property
    def counts(self) -> PairingCounts:
        """What has been done so far."""
        return replace(self._counts)

    @property
    def next_due_at_s(self) -> float | None:
        """When `due` should be called at the latest; None if nothing waits."""
        arrivals = [waiting.arrived_at_s for waiting in self._open]
        return min(arrivals) + self._deadline_s if arrivals else None

    def set_live(self, cameras: Iterable[str]) -> None:
        """Name the cameras to wait for.  Observations of others still join when they come.

        Raises `ValueError` for a camera that is not one of those given at the beginning.
        """
        live = frozenset(cameras)
        for camera in live:
            self._require_known(camera)
        self._live = live

    def reset(self) -> None:
        """Drop what waits and forget all times; the counts and the live cameras stay."""
        self._counts.dropped_observations += sum(len(one.observations) for one in self._open)
        self._forget()

    def add(self, observation: Observation, now_s: float) -> list[FrameSet]:
        """Take an observation that arrived at `now_s`; return the sets that are ready, in order.

        When the times of a camera jump back, as after the end of a repeated recording, what waits
        is given out and pairing begins anew.  Raises `ValueError` for an unknown camera.
        """
        self._require_known(observation.camera)
        time_s, before = observation.captured_at_s, self._newest.get(observation.camera)
        if not isfinite(time_s) or (before is not None and time_s == before.captured_at_s):
            self._counts.dropped_observations += 1
            return self.due(now_s)
        jumps_back = before is not None and time_s < before.captured_at_s
        ready = self._restart() if jumps_back else []
        self._take_note_of(observation)
        if self._comes_too_late(observation):
            self._behind.add(observation.camera)
            if not self._behind >= self._live:
                self._counts.dropped_observations += 1
                return ready + self.due(now_s)
            # every camera is behind the last set, so it is that one whose time was wrong
            ready += self._restart()
            self._take_note_of(observation)
        self._behind.clear()
        self._put_into_a_set(observation, now_s)
        due = self.due(now_s)
        return ready + due if ready else due

    def due(self, now_s: float) -> list[FrameSet]:
        """Return the sets for which nothing more can come or that have waited long enough."""
        ready = 0
        for number, waiting in enumerate(self._open, start=1):
            if (
                self._is_all_that_can_come(waiting)
                or now_s >= waiting.arrived_at_s + self._deadline_s
            ):
                ready = number
        return self._give_out(ready) if ready else []

    def _forget(self) -> None:
        self._open: list[_OpenSet] = []
        self._newest: dict[str, Observation] = {}
        self._last_given: _OpenSet | None = None
        self._behind: set[str] = set()

    def _restart(self) -> list[FrameSet]:
        ready = self._give_out(len(self._open))
        self._forget()
        self._counts.restarts += 1
        return ready

    def _require_known(self, camera: str) -> None:
        if camera not in self._cameras:
            known = ", ".join(self._cameras)
            raise ValueError(f"camera {camera}: not one of those that are paired: {known}")

    def _take_note_of(self, observation: Observation) -> None:
        """Remember the newest picture of the camera; count those that were never seen.

        A camera that was opened anew begins at a lower number: nothing is missing then.
        """
        before = self._newest.get(observation.camera)
        if before is not None:
            missed = observation.sequence - before.sequence - 1
            if missed > 0:
                self._counts.missed_observations += missed
        self._newest[observation.camera] = observation

    def _comes_too_late(self, observation: Observation) -> bool:
        """Tell whether the observation belongs to the last set given out, or before it."""
        last = self._last_given
        if last is None:
            return False
        belongs_to_it = (
            observation.camera not in last.observations
            and observation.captured_at_s - last.begins_at_s <= self._tolerance_s
        )
        return belongs_to_it or observation.captured_at_s <= last.ends_at_s

    def _put_into_a_set(self, observation: Observation, now_s: float) -> None:
        time_s = observation.captured_at_s
        fitting = [
            waiting
            for waiting in self._open
            if observation.camera not in waiting.observations
            and waiting.length_with_s(time_s) <= self._tolerance_s
        ]
        if len(fitting) == 1:
            fitting[0].add(observation)
        elif fitting:
            min(fitting, key=lambda waiting: waiting.grows_s(time_s)).add(observation)
        elif any(waiting.begins_at_s <= time_s <= waiting.ends_at_s for waiting in self._open):
            # a second picture of the instant: the camera is faster than the tolerance can tell
            self._counts.dropped_observations += 1
        else:
            self._open.append(_OpenSet({observation.camera: observation}, time_s, time_s, now_s))
            self._open.sort(key=lambda waiting: waiting.begins_at_s)

    def _is_all_that_can_come(self, waiting: _OpenSet) -> bool:
        for camera in self._live:  # a loop, since this is asked a thousand times a second
            if camera not in waiting.observations and not self._is_past(camera, waiting):
                return False
        return True

    def _is_past(self, camera: str, waiting: _OpenSet) -> bool:
        newest = self._newest.get(camera)
        return newest is not None and newest.captured_at_s - waiting.begins_at_s > self._tolerance_s

    def _give_out(self, number: int) -> list[FrameSet]:
        """Return the oldest open sets, so many of them, and close them."""
        closed, self._open = self._open[:number], self._open[number:]
        if len(self._cameras) > 1:
            # One camera locates nothing, and one whose clock is ahead must not outdate the others.
            paired = [waiting for waiting in closed if len(waiting.observations) > 1]
            self._counts.dropped_observations += len(closed) - len(paired)
            closed = paired
        if closed:
            self._last_given = closed[-1]
        for waiting in closed:
            self._counts.sets += 1
            self._counts.incomplete_sets += not self._live <= waiting.observations.keys()
        return [self._frame_set(waiting) for waiting in closed]

    def _frame_set(self, waiting: _OpenSet) -> FrameSet:
        return frame_set_of(
            waiting.observations[camera]
            for camera in self._cameras
            if camera in waiting.observations
        )
