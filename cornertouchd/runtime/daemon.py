"""The daemon: one capture thread per camera, one fusion thread, started and stopped together."""

import gc
import logging
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.drift import Drift
from cornertouchd.config import Settings
from cornertouchd.fusion.dirt import Dirt
from cornertouchd.fusion.pairing import FrameSetPairing
from cornertouchd.model import Observation
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline
from cornertouchd.ports import CameraPlug, CameraPort, Clock, TouchSink
from cornertouchd.runtime.capture import CaptureCounts, CaptureThread
from cornertouchd.runtime.fusing import FusionCounts, FusionThread
from cornertouchd.runtime.latest import Latest
from cornertouchd.runtime.recovery import Recovery
from cornertouchd.vision.background import MaskedColumns
from cornertouchd.vision.strip_shift import StripShift

_log = logging.getLogger("cornertouchd")

NO_PLUGS: Mapping[str, CameraPlug] = MappingProxyType({})

STOP_S = 0.8
"""Time that all threads together get to end; a driver that blocks longer is left behind."""


class Daemon:
    """A rig at work.  Raises `CalibrationError` if a camera does not fit the calibration.

    `plugs` are where cameras are plugged in, by name, as far as they can be looked at.
    """

    def __init__(
        self,
        ports: Sequence[CameraPort],
        calibration: Calibration,
        sinks: Sequence[TouchSink],
        settings: Settings,
        clock: Clock,
        plugs: Mapping[str, CameraPlug] = NO_PLUGS,
    ) -> None:
        box: Latest[Observation] = Latest()
        self._captures = []
        self._pipelines: dict[str, CameraPipeline] = {}
        for port in ports:
            camera = calibration.camera(port.id)
            camera.require_camera(port.format, port.identity)
            pipeline = CameraPipeline(camera, settings)
            for columns in pipeline.blind_columns:
                _log.warning("camera %s: %s", port.id, columns)
            self._pipelines[port.id] = pipeline
            recovery = Recovery(port.id, plugs.get(port.id), settings.cameras, clock)
            self._captures.append(
                CaptureThread(port, camera, pipeline, box, settings.cameras, recovery)
            )
        self._fusion = FusionThread(
            box,
            FrameSetPairing([port.id for port in ports], settings.pairing),
            SurfacePipeline(calibration, settings),
            sinks,
            clock,
            [port.id for port in ports],
            self._live_cameras,
        )
        self._clock = clock

    def start(self) -> None:
        """Start all threads.

        What has been made until now stays: the garbage collection leaves it alone from here on,
        because to look through all of it stops every thread for longer than a picture takes.
        """
        gc.collect()
        gc.freeze()
        self._fusion.start()
        for capture in self._captures:
            capture.start()

    def stop(self) -> None:
        """Stop all threads, touches lifted; takes under a second."""
        self._fusion.stop()
        for capture in self._captures:
            capture.stop()
        until_s = self._clock.now_s() + STOP_S
        self._fusion.join(STOP_S)
        for capture in self._captures:
            capture.join(max(0.0, until_s - self._clock.now_s()))
        gc.unfreeze()

    def camera_counts(self) -> Mapping[str, CaptureCounts]:
        """Return what happened to every camera so far."""
        return {capture.camera: capture.counts() for capture in self._captures}

    def fusion_counts(self) -> FusionCounts:
        """Return what happened in the fusion thread so far."""
        return self._fusion.counts()

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
        return {camera: pipeline.masked_columns for camera, pipeline in self._pipelines.items()}

    def strip_shifts(self) -> Mapping[str, StripShift]:
        """Return the cameras whose strips are not where they were calibrated, and how far off."""
        shifts = {camera: pipeline.strip_shift for camera, pipeline in self._pipelines.items()}
        return {camera: shift for camera, shift in shifts.items() if shift is not None}

    def _live_cameras(self) -> tuple[str, ...]:
        return tuple(capture.camera for capture in self._captures if capture.counts().live)
