"""What the live page is told, while somebody looks: the answer to "live" at the daemon's socket."""

from collections.abc import Iterator
from math import inf

from cornertouchd.fusion.ghosts import find_ghosts
from cornertouchd.model import Contact, DirectingLines
from cornertouchd.pipeline import PictureError, line_tables
from cornertouchd.ports import Clock
from cornertouchd.runtime.asking import Asker
from cornertouchd.runtime.daemon import Daemon, DaemonStages
from cornertouchd.vision.lighting import Lighting, lighting
from cornertouchd.wire.live import Moment, encode_moment, encode_strip, with_length

MOMENTS_PER_S = 60.0
"""As often as screens draw."""

STRIP_EVERY_S = 0.1
"""Ten strips a second look alive; each is forty kilobytes."""

GHOSTS_EVERY_S = 0.1
"""A look for them takes a millisecond with a handful of touches, and nobody acts on them."""


class MonitorFeed:
    """Answers "live" with moments and, when asked, strips, newest first lost.

    It runs in the thread of whoever asks, and only looks: nothing waits for it.
    """

    def __init__(self, daemon: Daemon, clock: Clock) -> None:
        self._daemon = daemon
        self._clock = clock

    def __call__(self, asker: Asker) -> None:
        """Tell until he has enough; he may send `{"strips": true}` at any time."""
        stream = LiveStream(self._daemon)
        wants_strips = asker.request.get("strips") is True
        due_at_s = self._clock.now_s()
        while not asker.has_enough:
            for request in asker.further():
                wants_strips = request.get("strips") is True
            now_s = self._clock.now_s()
            for message in stream.news(now_s, wants_strips=wants_strips):
                asker.send(with_length(message))
            due_at_s = max(due_at_s + 1.0 / MOMENTS_PER_S, now_s)
            self._clock.sleep_until(due_at_s)


class LiveStream:
    """What one asker has been told, so that he is told what is new.  Owned by one thread."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self._moment: Moment | None = None
        self._ghosts: tuple[Contact, ...] = ()
        self._ghosts_at_s = -inf
        self._strip_due_at_s: dict[str, float] = {}
        self._strip_at_s: dict[str, float] = {}
        self._use(daemon.stages)

    def news(self, now_s: float, *, wants_strips: bool) -> Iterator[bytes]:
        """Yield the messages that are due."""
        stages = self._daemon.stages
        if stages is not self._stages:
            self._use(stages)
        moment = self._daemon.moment
        if moment is not None and moment is not self._moment:
            self._moment = moment
            yield self._encoded(moment)
        if wants_strips:
            yield from self._strips(now_s)

    def _use(self, stages: DaemonStages) -> None:
        self._stages = stages
        self._numbers = {port.id: number for number, port in enumerate(stages.ports)}
        self._lines = line_tables(stages.calibration)
        self._surface_mm = stages.calibration.surface_mm
        self._edge_sigma_px = stages.settings.crossing.edge_sigma_px

    def _encoded(self, moment: Moment) -> bytes:
        lines = dict(self._directing_lines(moment))
        at_s = moment.frame_set.captured_at_s
        if not 0.0 <= at_s - self._ghosts_at_s < GHOSTS_EVERY_S:
            found = find_ghosts(tuple(lines.values()), moment.contacts, self._surface_mm)
            self._ghosts, self._ghosts_at_s = found, at_s
        refused = (*moment.refused, *self._ghosts)
        return encode_moment(moment._replace(refused=refused), tuple(lines.items()))

    def _directing_lines(self, moment: Moment) -> Iterator[tuple[int, DirectingLines]]:
        for seen in moment.frame_set.observations:
            # a camera may just have been taken out
            if len(seen.shadows) and seen.camera in self._numbers:
                lines = self._lines[seen.camera].lay(seen.shadows, self._edge_sigma_px)
                yield self._numbers[seen.camera], lines

    def _strips(self, now_s: float) -> Iterator[bytes]:
        for camera, number in self._numbers.items():
            if now_s < self._strip_due_at_s.get(camera, now_s):
                continue
            frame = self._stages.kept.latest(camera)
            if frame is None or lighting(frame) is not Lighting.LIT:
                continue  # the next one may be
            if frame.captured_at_s == self._strip_at_s.get(camera):
                continue
            try:
                view = self._stages.captures[camera].pipeline.show(frame)
            except PictureError:
                continue  # taken before the configuration changed
            self._strip_at_s[camera] = frame.captured_at_s
            self._strip_due_at_s[camera] = now_s + STRIP_EVERY_S
            yield encode_strip(number, view)
