"""The daemon: one capture thread per camera, one fusion thread, started and stopped together."""

import gc
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.drift import Drift
from cornertouchd.config import Settings
from cornertouchd.fusion.dirt import Dirt
from cornertouchd.fusion.pairing import FrameSetPairing
from cornertouchd.model import Observation
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline
from cornertouchd.ports import CameraPlug, CameraPort, Clock, TouchSink
from cornertouchd.runtime.capture import CaptureCounts, CaptureStages, CaptureThread
from cornertouchd.runtime.fusing import FusionCounts, FusionStages, FusionThread
from cornertouchd.runtime.keeping import Keeping
from cornertouchd.runtime.latest import Latest
from cornertouchd.runtime.led_light import LedLight, LightState
from cornertouchd.runtime.realtime import prioritise
from cornertouchd.runtime.recovery import Recovery
from cornertouchd.vision.background import MaskedColumns
from cornertouchd.vision.strip_shift import StripShift
from cornertouchd.wire.live import Moment

_log = logging.getLogger("cornertouchd")

NO_PLUGS: Mapping[str, CameraPlug] = MappingProxyType({})

STOP_S = 0.8
"""Time that all threads together get to end; a driver that blocks longer is left behind."""


@dataclass(frozen=True, slots=True)
class DaemonStages:
    """What a daemon works with under one configuration: the ports and all that is behind them."""

    ports: Sequence[CameraPort]
    captures: Mapping[str, CaptureStages]
    fusion: FusionStages
    calibration: Calibration
    settings: Settings
    plugs: Mapping[str, CameraPlug]
    kept: Keeping
    light: LedLight | None = None

    def with_sinks(self, sinks: Sequence[TouchSink], settings: Settings) -> "DaemonStages":
        """Return the same with other sinks: what has been learned and touches go on."""
        return replace(self, fusion=replace(self.fusion, sinks=sinks), settings=settings)


def make_stages(
    ports: Sequence[CameraPort],
    calibration: Calibration,
    sinks: Sequence[TouchSink],
    settings: Settings,
    plugs: Mapping[str, CameraPlug] = NO_PLUGS,
    light: LedLight | None = None,
) -> DaemonStages:
    """Return new stages; takes a while.  `light` is the LED frame, if a controller strobes it.

    Raises `CalibrationError` if a camera does not fit the calibration.
    """
    box: Latest[Observation] = Latest()
    kept = Keeping(
        {port.id: port.format for port in ports},
        settings.cameras.rate_hz,
        settings.monitor.keep_s,
        settings.monitor.keep_mb,
    )
    captures = {}
    for port in ports:
        camera = calibration.camera(port.id)
        camera.require_camera(port.format, port.identity)
        pipeline = CameraPipeline(camera, settings)
        lit_by = None if light is None else light.of(port.id)
        captures[port.id] = CaptureStages(camera, pipeline, box, lit_by, kept)
    for camera_id, stages in captures.items():
        for columns in stages.pipeline.blind_columns:
            _log.warning("camera %s: %s", camera_id, columns)
    pairing = FrameSetPairing([port.id for port in ports], settings.pairing)
    surface = SurfacePipeline(calibration, settings)
    fusion = FusionStages(box, pairing, surface, sinks, tuple(captures))
    return DaemonStages(ports, captures, fusion, calibration, settings, plugs, kept, light)


class Daemon:
    """A rig at work.  Raises `CalibrationError` if a camera does not fit the calibration.

    `plugs` are where cameras are plugged in, by name, as far as they can be looked at; `light` is
    the LED frame, if a controller strobes it.
    """

    def __init__(
        self,
        ports: Sequence[CameraPort],
        calibration: Calibration,
        sinks: Sequence[TouchSink],
        settings: Settings,
        clock: Clock,
        plugs: Mapping[str, CameraPlug] = NO_PLUGS,
        light: LedLight | None = None,
    ) -> None:
        self._stages = make_stages(ports, calibration, sinks, settings, plugs, light)
        self._captures = [_make_capture(self._stages, port, clock) for port in ports]
        self._fusion = FusionThread(self._stages.fusion, clock, self._live_cameras)
        self._clock = clock

    @property
    def stages(self) -> DaemonStages:
        """What it works with at present."""
        return self._stages

    @property
    def kept(self) -> Keeping:
        """The pictures of the last moments."""
        return self._stages.kept

    def start(self) -> None:
        """Start all threads.

        What has been made until now stays: the garbage collection leaves it alone from here on,
        because to look through all of it stops every thread for longer than a picture takes.
        """
        gc.collect()
        gc.freeze()
        if self._stages.light is not None:
            self._stages.light.start()
        self._fusion.start()
        for capture in self._captures:
            capture.start()
        self._prioritise([self._fusion, *self._captures])

    def exchange(self, stages: DaemonStages) -> None:
        """Change to other stages between two frame sets.

        A camera whose port stays the same stays open; one that is new is opened when those that go
        have been closed.  For one thread at a time, between `start` and `stop`.
        """
        # The new stages stay, as those of the start did.  Only what was made since then is looked
        # through: .1 ms.
        gc.collect()
        gc.freeze()
        kept = [one for one in self._captures if one.port in stages.ports]
        gone = [one for one in self._captures if one not in kept]
        for capture in kept:
            capture.exchange(stages.captures[capture.camera])
        self._exchange_light(stages.light)
        self._captures = kept  # the only ones that both pairings know
        if not self._fusion.exchange(stages.fusion, STOP_S):
            _log.warning("the fusion thread is busy; it follows the new configuration later")
        for capture in gone:
            capture.stop()
        self._join(gone)
        stay = {capture.camera: capture for capture in kept}
        new = {
            port.id: _make_capture(stages, port, self._clock)
            for port in stages.ports
            if port.id not in stay
        }
        for capture in new.values():
            capture.start()
        self._stages = stages
        self._captures = [stay.get(port.id) or new[port.id] for port in stages.ports]
        self._prioritise([self._fusion, *self._captures])

    def stop(self) -> None:
        """Stop all threads, touches lifted; takes under a second."""
        self._fusion.stop()
        for capture in self._captures:
            capture.stop()
        self._join([self._fusion, *self._captures])
        if self._stages.light is not None:
            self._stages.light.close()
        gc.unfreeze()

    def _exchange_light(self, light: LedLight | None) -> None:
        """Let another LED frame shine; both may be at the same port."""
        before = self._stages.light
        if light is before:
            return
        if before is not None:
            before.close()
        if light is not None:
            light.start()

    def _join(self, threads: Sequence[CaptureThread | FusionThread]) -> None:
        until_s = self._clock.now_s() + STOP_S
        for thread in threads:
            thread.join(max(0.0, until_s - self._clock.now_s()))

    def _prioritise(self, threads: Sequence[CaptureThread | FusionThread]) -> None:
        ids = [thread.native_id for thread in threads if thread.native_id is not None]
        prioritise(ids, self._stages.settings.runtime.realtime_priority)

    def camera_counts(self) -> Mapping[str, CaptureCounts]:
        """Return what happened to every camera so far."""
        return {capture.camera: capture.counts() for capture in self._captures}

    def fusion_counts(self) -> FusionCounts:
        """Return what happened in the fusion thread so far."""
        return self._fusion.counts()

    @property
    def moment(self) -> Moment | None:
        """What came of the last frame set.  Any thread may ask."""
        return self._fusion.moment

    @property
    def drift(self) -> Drift | None:
        """The camera that has moved since it was calibrated, as far as touches tell."""
        return self._fusion.drift

    @property
    def dirt(self) -> tuple[Dirt, ...]:
        """What hangs before the strip, so that touches go on without it."""
        return self._fusion.dirt

    def masked_columns(self) -> Mapping[str, tuple[MaskedColumns, ...]]:
        """Return the columns of every camera that are blind now: dead LEDs, glare."""
        return {
            camera: stages.pipeline.masked_columns
            for camera, stages in self._stages.captures.items()
        }

    def light_state(self) -> LightState | None:
        """Return how the LED frame does, None if no controller strobes it."""
        light = self._stages.light
        return None if light is None else light.state(self.masked_columns())

    def strip_shifts(self) -> Mapping[str, StripShift]:
        """Return the cameras whose strips are not where they were calibrated, and how far off."""
        captures = self._stages.captures
        shifts = {camera: stages.pipeline.strip_shift for camera, stages in captures.items()}
        return {camera: shift for camera, shift in shifts.items() if shift is not None}

    def _live_cameras(self) -> tuple[str, ...]:
        return tuple(capture.camera for capture in self._captures if capture.counts().live)


def _make_capture(stages: DaemonStages, port: CameraPort, clock: Clock) -> CaptureThread:
    used, settings = stages.captures[port.id], stages.settings.cameras
    recovery = Recovery(port.id, stages.plugs.get(port.id), settings, clock)
    return CaptureThread(port, used, settings, recovery)
