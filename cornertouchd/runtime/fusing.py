"""The fusion thread: pair, cross, track, tell the sinks."""

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from cornertouchd.calibration.drift import Drift
from cornertouchd.fusion.dirt import Dirt
from cornertouchd.fusion.pairing import FrameSetPairing, is_single_touch, is_worth_fusing
from cornertouchd.model import Contact, FrameSet, Observation, Touch, TouchFrame
from cornertouchd.pipeline import SurfacePipeline
from cornertouchd.ports import Clock, TouchSink
from cornertouchd.runtime.camera_roll import CameraRoll
from cornertouchd.runtime.faults import FaultLog
from cornertouchd.runtime.latency import NO_LATENCY, Latency, LatencyHistogram
from cornertouchd.runtime.latest import Latest
from cornertouchd.wire.live import Moment

WAIT_S = 0.02
"""Longest wait for an observation: sinks tick at least this often."""

SILENCE_S = 0.25
"""Touches are lifted when no frame set came for so long: 25 at the usual rate, and still before a
person has moved on to the next gesture."""

SKIPPED_IN_A_ROW = 50
"""Frame sets skipped one after the other until it is said: half a second at the usual rate."""

CAMERAS_OF_A_SIDE = 2

_log = logging.getLogger("cornertouchd")


@dataclass(frozen=True, slots=True)
class FusionCounts:
    """What happened in the fusion thread since the start."""

    frame_sets: int
    partial: int
    skipped: int
    touches_begun: int
    touches_now: int
    faults: int
    dropped: int
    turns: int
    """Of the loop, which turns without cameras too."""
    ghosts: int = 0
    """Contacts that were found and denied by cameras that see light there."""
    latency: Latency = NO_LATENCY
    """From the picture until the touches were sent."""


@dataclass(frozen=True, slots=True)
class FusionStages:
    """What the fusion thread works with; `cameras` are all that put something into the box."""

    box: Latest[Observation]
    pairing: FrameSetPairing
    pipeline: SurfacePipeline
    sinks: Sequence[TouchSink]
    cameras: Sequence[str]


class FusionThread:
    """Turns observations into touches and tells them.

    Guarantees: the sinks are called from this thread only, tick at least every 25 ms, and hear of
    every lift, also when cameras fall silent or a stage raises.  Never waits for a camera.
    """

    def __init__(
        self,
        stages: FusionStages,
        clock: Clock,
        live_cameras: Callable[[], Sequence[str]],
    ) -> None:
        self._all_cameras: Sequence[str] = ()
        self._use(stages)
        self._wanted = self._used = stages
        self._clock = clock
        self._live_cameras = live_cameras
        self._cameras: Sequence[str] = ()
        self._exchanged = threading.Event()
        self._turns = 0
        self._stop = threading.Event()
        self._faults = FaultLog("fusion")
        self._pictures = FaultLog("frame sets")
        self._drift_faults = FaultLog("drift")
        self._thread = threading.Thread(target=self._run, name="fusion", daemon=True)
        self._last_set_s: float | None = None
        self._moment: Moment | None = None
        self._begun: set[int] = set()
        self._frame_sets = self._partial = self._skipped = self._skipped_in_a_row = 0
        self._touches_begun = self._touches_now = self._dropped = self._ghosts = 0
        self._latency = LatencyHistogram()
        self._drift: Drift | None = None
        self._dirt: tuple[Dirt, ...] = ()

    def start(self) -> None:
        """Begin to fuse."""
        self._thread.start()

    def stop(self) -> None:
        """Ask the thread to lift all touches, close the sinks and end; returns at once."""
        self._stop.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the end."""
        self._thread.join(timeout_s)

    def exchange(self, stages: FusionStages, timeout_s: float) -> bool:
        """Work with other stages from the next frame set on; tell whether that began in time.

        Touches go on if the pipeline stays the same, else they are lifted.  Sinks that are not
        among the new ones are closed.  For one thread at a time.
        """
        self._exchanged.clear()
        self._wanted = stages
        return self._exchanged.wait(timeout_s)

    @property
    def native_id(self) -> int | None:
        """What the kernel calls the thread; None before it is started."""
        return self._thread.native_id

    @property
    def moment(self) -> Moment | None:
        """What came of the last frame set.  Any thread may ask."""
        return self._moment

    def counts(self) -> FusionCounts:
        """Return what happened so far.  Any thread may ask."""
        return FusionCounts(
            self._frame_sets,
            self._partial,
            self._skipped,
            self._touches_begun,
            self._touches_now,
            self._faults.count + self._drift_faults.count,
            self._dropped,
            self._turns,
            self._ghosts,
            self._latency.read(),
        )

    @property
    def drift(self) -> Drift | None:
        """The camera that has moved since it was calibrated.  Any thread may ask."""
        return self._drift

    @property
    def dirt(self) -> tuple[Dirt, ...]:
        """What hangs before the strip.  Any thread may ask."""
        return self._dirt

    def _run(self) -> None:
        for sink in self._sinks:
            sink.lift_all(self._clock.now_s())
        while not self._stop.is_set():
            try:
                self._turn()
            except Exception as error:  # noqa: BLE001  a stage that raises costs its touches, no more
                self._faults.fault("a frame set was lost", error, traceback_of=error)
                self._lift(self._clock.now_s())
            self._turns += 1
        for sink in self._sinks:
            sink.close()

    def _turn(self) -> None:
        wanted = self._wanted
        if wanted is self._used:
            self._step(self._longest_wait_s())
            return
        try:
            self._step(0.0)  # what the stages so far have been given is still theirs
        finally:
            self._used = wanted
            self._change_to(wanted)

    def _change_to(self, stages: FusionStages) -> None:
        before = self._sinks
        if stages.pipeline is not self._pipeline:
            self._lift(self._clock.now_s())
        self._use(stages)
        self._cameras = ()  # the new pairing has not been told which live
        self._exchanged.set()
        for sink in before:
            if sink not in stages.sinks:
                sink.close()
        for sink in stages.sinks:
            if sink not in before:
                sink.lift_all(self._clock.now_s())

    def _use(self, stages: FusionStages) -> None:
        self._box = stages.box
        self._pairing = stages.pairing
        self._pipeline = stages.pipeline
        self._sinks = stages.sinks
        if stages.cameras != self._all_cameras:
            self._all_cameras = stages.cameras
            self._roll = CameraRoll(stages.cameras)
        self._dropped_in_box = sum(stages.box.dropped().values())

    def _step(self, longest_wait_s: float) -> None:
        observations = self._box.take(longest_wait_s)
        now_s = self._clock.now_s()
        self._follow_cameras(now_s)
        frame_sets = [
            frame_set
            for observation in observations
            for frame_set in self._pairing.add(observation, now_s)
        ]
        behind = self._fell_behind()
        for frame_set in frame_sets + self._pairing.due(now_s):
            if self._is_believed(frame_set, behind):
                self._fuse(frame_set)
            else:
                self._skip(frame_set)
        if self._last_set_s is not None and now_s - self._last_set_s > SILENCE_S:
            self._lift(now_s)
        for sink in self._sinks:
            sink.tick(now_s)

    def _follow_cameras(self, now_s: float) -> None:
        live = self._live_cameras()
        if live != self._cameras:
            self._cameras = live
            self._pairing.set_live(live)
        said = self._roll.note(live, now_s)
        if said:
            _log.warning("%s", said)

    def _longest_wait_s(self) -> float:
        """Return how long nothing is due: neither a tick nor an incomplete frame set."""
        due_at_s = self._pairing.next_due_at_s
        if due_at_s is None:
            return WAIT_S
        return min(WAIT_S, max(0.0, due_at_s - self._clock.now_s()))

    def _fuse(self, frame_set: FrameSet) -> None:
        contacts, touches = self._pipeline.follow(frame_set)
        self._faults.good()
        self._pictures.good()
        now_s = self._clock.now_s()
        for sink in self._sinks:
            sink.send(TouchFrame(frame_set.captured_at_s, touches), now_s)
        refused, told_at_s = self._pipeline.refused, self._clock.now_s()
        self._moment = Moment(frame_set, contacts, touches, refused, told_at_s)
        self._latency.note(told_at_s - frame_set.captured_at_s)
        self._ghosts += len(refused)
        self._last_set_s = now_s
        self._frame_sets += 1
        self._skipped_in_a_row = 0
        self._partial += self._is_partial(frame_set)
        ids = {touch.id for touch in touches}
        self._touches_begun += len(ids - self._begun)
        self._begun = ids
        self._touches_now = len(ids)
        self._watch_drift(frame_set, contacts, touches)
        self._tell_dirt(self._pipeline.dirt)

    def _watch_drift(
        self, frame_set: FrameSet, contacts: tuple[Contact, ...], touches: tuple[Touch, ...]
    ) -> None:
        try:
            drift = self._pipeline.find_drift(frame_set, contacts, touches)
        except Exception as error:  # noqa: BLE001  touches go on without it
            self._drift_faults.fault("not looked for", error, traceback_of=error)
            return
        self._drift_faults.good()
        self._tell_drift(drift)

    def _tell_drift(self, drift: Drift | None) -> None:
        if drift is self._drift:
            return
        self._drift = drift
        if drift is not None:
            _log.warning("%s", drift)
        else:
            _log.warning("touches fit the calibration again")

    def _tell_dirt(self, dirt: tuple[Dirt, ...]) -> None:
        if dirt is self._dirt:
            return
        before, self._dirt = self._dirt, dirt
        for piece in dirt:
            if piece not in before:
                _log.warning("%s", piece)
        for piece in before:
            if piece not in dirt:
                _log.warning(
                    "camera %s: the strip is clear again at columns %.0f..%.0f",
                    piece.camera,
                    piece.left_px,
                    piece.right_px,
                )

    def _skip(self, frame_set: FrameSet) -> None:
        self._skipped += 1
        self._skipped_in_a_row += 1
        if self._skipped_in_a_row >= SKIPPED_IN_A_ROW:
            seen = ", ".join(one.camera for one in frame_set.observations)
            self._pictures.fault(
                "too few cameras see the same instant, so no touches are told",
                f"the last one was seen by {seen} only; are the others there, and all triggered "
                "together? (pairing.tolerance_ms)",
            )

    def _fell_behind(self) -> bool:
        """Tell whether the box dropped anything since the last step."""
        before, self._dropped_in_box = self._dropped_in_box, sum(self._box.dropped().values())
        self._dropped += self._dropped_in_box - before
        return self._dropped_in_box > before

    def _is_partial(self, frame_set: FrameSet) -> bool:
        return len(frame_set.observations) < len(self._cameras)

    def _is_believed(self, frame_set: FrameSet, behind: bool) -> bool:
        """Tell whether a frame set is worth fusing.

        Not if it lacks what the box dropped: a whole one is on its way.  Not if so many cameras
        are missing that shadows cross without a third view to refuse ghosts; while just two are
        left, a touch that is alone is believed.
        """
        if not is_worth_fusing(frame_set, len(self._all_cameras)) and not (
            len(self._cameras) == CAMERAS_OF_A_SIDE and is_single_touch(frame_set)
        ):
            return False
        return not (behind and self._is_partial(frame_set))

    def _lift(self, now_s: float) -> None:
        """End all touches: what they stood on is gone."""
        self._last_set_s = None
        self._moment = Moment(FrameSet(now_s, ()), (), (), (), now_s)
        self._pipeline.reset()
        self._pairing.reset()
        self._begun = set()
        self._touches_now = 0
        for sink in self._sinks:
            sink.lift_all(now_s)
