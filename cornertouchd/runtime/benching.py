"""How long this machine takes from pictures in memory to datagrams, whole and stage by stage.

The pictures are those of a simulated rig on which fingers move; to make them takes no part in what
is measured.  One thread does all the work, as if a machine had a single core.
"""

import gc
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain, count, cycle
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import Settings
from cornertouchd.fusion.pairing import FrameSetPairing
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import Frame, Touch, TouchFrame
from cornertouchd.pipeline import (
    CameraPipeline,
    SurfacePipeline,
    calibrated_crossing,
    find_tips,
    line_tables,
)
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import TuioSession

STAGES = ("vision", "pairing", "laying", "crossing", "tips", "tracking", "TUIO")
"""What is timed one by one: all cameras' pictures to observations, those to a frame set, shadows to
directing lines, lines to contacts, those to where they touch, contacts to touches, touches to
datagrams."""

BLOCK_SETS, WARM_SETS = 50, 2
"""Paths take turns in blocks of so many frame sets, so that a machine that gets slower or faster
does so for all; the first ones of a block, which find the caches full of another path's work, are
not counted."""

BLOCK_S = 0.5
"""A path so slow that a block would last longer has shorter ones, of `WARM_SETS` and one more."""

SOURCE = "cornertouchd-bench@127.0.0.1"

FrameSets = Sequence[Sequence[Frame]]
Laps = NDArray[np.float64]


class Timed(Protocol):
    """A way to handle frame sets, to be timed."""

    def run(self, frames: Sequence[Frame]) -> tuple[int, tuple[int, ...]]:
        """Handle a frame set.

        Return how many touches (or whatever it looks for) it found, and when its parts but the last
        were done, by `time.perf_counter_ns`.
        """
        ...


@dataclass(frozen=True, slots=True)
class Times:
    """How long N frame sets took: `laps_us` (N, parts), and what was found in each on average."""

    laps_us: Laps
    found: float

    def median_us(self, part: int | None = None) -> float:
        """Return the median of one part, or of all together."""
        return float(np.median(self._of(part)))

    def p99_us(self, part: int | None = None) -> float:
        """Return what one per cent exceeded."""
        return float(np.percentile(self._of(part), 99.0))

    def _of(self, part: int | None) -> Laps:
        laps: Laps = self.laps_us.sum(axis=1) if part is None else self.laps_us[:, part]
        return laps


class WholePath:
    """Everything that the daemon does from pictures to datagrams."""

    def __init__(self, calibration: Calibration, settings: Settings) -> None:
        self._cameras = {
            camera.id: CameraPipeline(camera, settings) for camera in calibration.cameras
        }
        self._pairing = FrameSetPairing(list(self._cameras), settings.pairing)
        self._surface = SurfacePipeline(calibration, settings)
        self._session = _session(calibration)

    def run(self, frames: Sequence[Frame]) -> tuple[int, tuple[int, ...]]:
        """Handle a frame set; return how many touches it has."""
        touches: tuple[Touch, ...] = ()
        # as in the daemon: what the cameras of a rig saw at once waits together for the fusion
        observations = [self._cameras[frame.camera].observe(frame) for frame in frames]
        for observation in observations:
            for frame_set in self._pairing.add(observation, observation.captured_at_s):
                _, touches = self._surface.follow(frame_set)
                self._session.frame(TouchFrame(frame_set.captured_at_s, touches))
        return len(touches), ()


class StagedPath:
    """The same stages, one after the other, with a look at the clock between them.

    What the daemon does between these stages is not in it: dirt, motion between cameras, what
    silent cameras deny, kinds of contacts.
    """

    def __init__(self, calibration: Calibration, settings: Settings) -> None:
        self._cameras = {
            camera.id: CameraPipeline(camera, settings) for camera in calibration.cameras
        }
        self._pairing = FrameSetPairing(list(self._cameras), settings.pairing)
        self._lines = line_tables(calibration)
        self._edge_sigma_px = settings.crossing.edge_sigma_px
        self._crossing = calibrated_crossing(calibration, settings)
        self._tips = find_tips(calibration, settings)
        self._tracker = Tracker(settings.tracking, calibration.surface_mm)
        self._session = _session(calibration)

    def run(self, frames: Sequence[Frame]) -> tuple[int, tuple[int, ...]]:
        """Handle a frame set; return how many touches it has, and when the stages were done."""
        observations = [self._cameras[frame.camera].observe(frame) for frame in frames]
        seen_ns = time.perf_counter_ns()
        (frame_set,) = chain.from_iterable(
            self._pairing.add(observation, observation.captured_at_s)
            for observation in observations
        )
        paired_ns = time.perf_counter_ns()
        lines = [
            self._lines[seen.camera].lay(seen.shadows, self._edge_sigma_px)
            for seen in frame_set.observations
            if len(seen.shadows)
        ]
        laid_ns = time.perf_counter_ns()
        predictions = self._tracker.predict(frame_set.captured_at_s)
        predicted_ns = time.perf_counter_ns()
        crossed = self._crossing.cross(lines, predictions)
        crossed_ns = time.perf_counter_ns()
        tips = None
        if self._tips is not None:
            _, tips = self._tips.find(crossed, lines, frame_set.observations)
        located_ns = time.perf_counter_ns()
        touches = self._tracker.update(frame_set.captured_at_s, crossed, tips=tips)
        tracked_ns = time.perf_counter_ns()
        self._session.frame(TouchFrame(frame_set.captured_at_s, touches))
        # to predict is a part of tracking: its time is moved behind those of crossing and tips
        predicting_ns = predicted_ns - laid_ns
        crossing_done_ns, tips_done_ns = crossed_ns - predicting_ns, located_ns - predicting_ns
        done_ns = (seen_ns, paired_ns, laid_ns, crossing_done_ns, tips_done_ns, tracked_ns)
        return len(touches), done_ns


def _session(calibration: Calibration) -> TuioSession:
    return TuioSession(DisplayMapping(0.0, 0.0, *calibration.surface_mm), SOURCE, 0, 0)


def to_and_fro(frame_sets: FrameSets, rate_hz: float) -> Iterator[tuple[Frame, ...]]:
    """Yield frame sets without end: forth, back, forth; fingers never leap, time goes on.

    The pictures of every set are copied into the same arrays, and so last until the next set: the
    processor finds them in its caches, as it does in the daemon, where each picture has just been
    copied from the camera's memory, or decoded.  To fetch a hundred sets from memory would be timed
    instead.
    """
    shown = [np.empty_like(frame.pixels) for frame in frame_sets[0]]
    order = chain(range(len(frame_sets)), range(len(frame_sets) - 2, 0, -1))
    for number, index in zip(count(), cycle(order), strict=False):
        for pixels, frame in zip(shown, frame_sets[index], strict=True):
            np.copyto(pixels, frame.pixels)
        yield tuple(
            replace(frame, sequence=number, captured_at_s=number / rate_hz, pixels=pixels)
            for pixels, frame in zip(shown, frame_sets[index], strict=True)
        )


def time_in_turns(
    paths: Mapping[str, Timed], frame_sets: FrameSets, rate_hz: float, seconds: float
) -> dict[str, Times]:
    """Return how long each path takes, measured for so many seconds in all.

    Every path has at least one block of frame sets.  The paths are warm when this begins to count.
    """
    feeds = {name: to_and_fro(frame_sets, rate_hz) for name in paths}
    for name, path in paths.items():
        _block(path, feeds[name])
    blocks: dict[str, list[tuple[Laps, float]]] = {name: [] for name in paths}
    with _as_the_daemon_collects_garbage():
        until_s = time.perf_counter() + seconds
        while not all(blocks.values()) or time.perf_counter() < until_s:
            for name, path in paths.items():
                blocks[name].append(_block(path, feeds[name]))
    return {
        name: Times(
            np.concatenate([laps_us for laps_us, _ in timed]),
            float(np.mean([found for _, found in timed])),
        )
        for name, timed in blocks.items()
    }


def _block(path: Timed, feed: Iterator[Sequence[Frame]]) -> tuple[Laps, float]:
    """Return the laps (N, parts) of a block of frame sets, and the mean of what they found."""
    began_s = time.perf_counter()
    laps_ns, found = [], []
    for number in range(BLOCK_SETS):
        frames = next(feed)
        start_ns = time.perf_counter_ns()
        count_found, done_ns = path.run(frames)
        end_ns = time.perf_counter_ns()
        if number >= WARM_SETS:
            laps_ns.append(np.diff([start_ns, *done_ns, end_ns]))
            found.append(count_found)
            if time.perf_counter() - began_s > BLOCK_S:
                break
    return np.array(laps_ns) / 1000.0, float(np.mean(found))


@contextmanager
def _as_the_daemon_collects_garbage() -> Iterator[None]:
    """Leave what exists to itself: only what frame sets leave behind is collected."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
