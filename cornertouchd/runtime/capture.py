"""One thread per camera: open it, read it, find the shadows, put them into the box; never give up.

A camera that fails a set number of times in a row is taken out, closed and opened anew when
`recovery` says so.
"""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass

from cornertouchd.calibration.calibration import CalibrationError, CameraCalibration
from cornertouchd.config import CamerasSettings
from cornertouchd.model import Frame, Observation
from cornertouchd.pipeline import CameraPipeline, PictureError
from cornertouchd.ports import Camera, CameraError, CameraPort
from cornertouchd.runtime.faults import GOOD_TO_RECOVER, FaultLog
from cornertouchd.runtime.keeping import Keeping
from cornertouchd.runtime.latest import Latest
from cornertouchd.runtime.led_light import CameraLight
from cornertouchd.runtime.losses import Losses
from cornertouchd.runtime.recovery import Recovery, may_be_cured_by_reset
from cornertouchd.vision.lighting import Lighting, lighting
from cornertouchd.vision.strip_shift import StripShift

LEFT_OUT_IN_A_ROW = 50
"""Pictures left out one after the other until the camera counts as lost: half a second."""

_log = logging.getLogger("cornertouchd")


@dataclass(frozen=True, slots=True)
class CaptureCounts:
    """What happened to one camera since the start."""

    frames: int
    faults: int
    opened: int
    live: bool
    resets: int
    lost: int = 0
    """Pictures that the driver had no buffer for, or could not receive."""
    damaged: int = 0
    left_out: int = 0
    """Pictures of which it is not known how they were lit."""

    @property
    def reopened(self) -> int:
        """How often it was opened anew."""
        return max(0, self.opened - 1)


@dataclass(frozen=True, slots=True)
class CaptureStages:
    """What the pictures of one camera go through, and where the observations go.

    `light` tells how they were lit; None if they tell themselves, or are always lit.  `kept` is
    where the newest stay.
    """

    calibration: CameraCalibration
    pipeline: CameraPipeline
    box: Latest[Observation]
    light: CameraLight | None = None
    kept: Keeping | None = None


class CaptureThread:
    """Reads one camera, as long as it is the one that was calibrated.

    Guarantees: no exception of the camera or of a stage ends the thread; pixels never leave it, but
    for the copies that are kept.
    Assumes that the pipeline of its stages is used by nobody else.
    """

    def __init__(
        self,
        port: CameraPort,
        stages: CaptureStages,
        settings: CamerasSettings,
        recovery: Recovery,
    ) -> None:
        self._port = port
        self._wanted = stages
        self._settings = settings
        self._recovery = recovery
        self._reset_may_help = False
        self._stop = threading.Event()
        self._faults = FaultLog(f"camera {port.id}")
        self._thread = threading.Thread(target=self._run, name=f"capture-{port.id}", daemon=True)
        self._frames = 0
        self._opened = self._left_out = 0
        self._camera: Camera | None = None
        self._losses = Losses()
        self._live = False
        self._use(self._wanted)

    @property
    def camera(self) -> str:
        """Name of the camera."""
        return self._port.id

    @property
    def port(self) -> CameraPort:
        """Where the camera is opened."""
        return self._port

    @property
    def native_id(self) -> int | None:
        """What the kernel calls the thread; None before it is started."""
        return self._thread.native_id

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def exchange(self, stages: CaptureStages) -> None:
        """Send pictures through other stages from the next one on; the camera stays open."""
        self._wanted = stages

    def stop(self) -> None:
        """Ask the thread to end; returns at once."""
        self._stop.set()

    def join(self, timeout_s: float) -> None:
        """Wait for the end.  A driver that blocks longer is left to the end of the process."""
        self._thread.join(timeout_s)

    def counts(self) -> CaptureCounts:
        """Return what happened so far.  Any thread may ask."""
        return CaptureCounts(
            self._frames,
            self._faults.count,
            self._opened,
            self._live,
            self._recovery.resets,
            *self._losses.of(self._camera),
            self._left_out,
        )

    def _run(self) -> None:
        while not self._stop.is_set():
            frames_before = self._frames
            self._reset_may_help = False
            self._read_until_it_fails()
            self._live = False
            if not self._stop.is_set():
                self._recovery.wait_to_reopen(
                    worked=self._frames - frames_before >= GOOD_TO_RECOVER,
                    reset_may_help=self._reset_may_help,
                    wait=self._stop.wait,
                )

    def _read_until_it_fails(self) -> None:
        try:
            camera = self._port.open()
        except CameraError as error:
            self._reset_may_help = may_be_cured_by_reset(error)
            self._faults.fault("not opened", error.reason)
            return
        except Exception as error:  # noqa: BLE001  a driver may raise anything; the thread lives on
            self._faults.fault("opening failed", error, traceback_of=error)
            return
        self._opened += 1
        self._camera = camera
        try:
            if self._is_calibrated():
                self._reset_may_help = True
                self._read(camera)
        finally:
            self._losses.add(camera)
            self._camera = None
            self._close(camera)

    def _use(self, stages: CaptureStages) -> None:
        self._stages = stages
        self._calibration = stages.calibration
        self._pipeline = stages.pipeline
        self._box = stages.box
        self._light = stages.light
        self._kept = stages.kept
        self._left_out_in_a_row = 0
        self._shift: StripShift | None = None
        self._blind = stages.pipeline.blind_columns  # whoever made the pipeline has told them

    def _follow_exchange(self) -> None:
        wanted = self._wanted
        if wanted is not self._stages:
            self._use(wanted)

    def _is_calibrated(self) -> bool:
        """Tell whether the camera that was just opened fits; it may have been exchanged."""
        self._follow_exchange()
        try:
            self._calibration.require_camera(self._port.format, self._port.identity)
        except CalibrationError as error:
            self._faults.fault("refused", error)
        except Exception as error:  # noqa: BLE001  a driver may raise anything
            self._faults.fault("not identified", error, traceback_of=error)
        else:
            return True
        return False

    def _read(self, camera: Camera) -> None:
        in_a_row = 0
        while in_a_row < self._settings.failures_before_reopen and not self._stop.is_set():
            try:
                frame = camera.read(self._settings.read_timeout_s)
            except CameraError as error:
                self._faults.fault("lost", error.reason)
                return
            except Exception as error:  # noqa: BLE001
                self._faults.fault("reading failed", error, traceback_of=error)
                return
            if frame is not None and self._observe(frame):
                in_a_row = 0
                self._live = self._left_out_in_a_row < LEFT_OUT_IN_A_ROW
            elif not self._stop.is_set():
                in_a_row += 1
                if frame is None:
                    self._live = False
                    self._faults.fault(f"no picture for {self._settings.read_timeout_s:g} s")

    def _observe(self, given: Frame) -> bool:
        self._follow_exchange()
        frame = given if self._light is None else self._light.label(given)
        try:
            return self._understand(frame)
        finally:
            self._watch("picture not kept", self._keep, frame or given)

    def _keep(self, frame: Frame) -> None:
        if self._kept is not None:
            self._kept.put(frame)

    def _understand(self, frame: Frame | None) -> bool:
        """Send a picture through the stages; tell whether it is of use."""
        if frame is None:
            self._leave_out()
            return True  # the camera itself is well
        self._left_out_in_a_row = 0
        lit = lighting(frame)
        if lit is Lighting.PARTLY:
            self._faults.fault("picture not usable", "only some sides of the frame were lit")
            return True  # the camera itself is well
        try:
            if lit is Lighting.DARK:
                self._pipeline.learn_dark(frame)
                return True
            self._suspect_dead_leds()
            observation = self._pipeline.observe(frame)
        except PictureError as error:
            self._faults.fault("picture refused", error)
            return False
        except Exception as error:  # noqa: BLE001  a stage that raises costs a picture, no more
            self._faults.fault("picture not understood", error, traceback_of=error)
            return False
        self._frames += 1
        self._faults.good()
        self._box.put(frame.camera, observation)
        if self._light is not None:
            self._light.note_shadows(len(observation.shadows), frame.captured_at_s)
        self._watch("strip not watched", self._watch_strip, frame)
        self._watch("blind columns not looked for", self._watch_blind_columns, frame)
        return True

    def _suspect_dead_leds(self) -> None:
        """Mask what the controller says is dead, before it is taken for a shadow."""
        suspected = None if self._light is None else self._light.suspected()
        if suspected is not None:
            self._pipeline.suspect_dead_leds(suspected)

    def _leave_out(self) -> None:
        """Count a picture of which it is not known how it was lit."""
        self._left_out += 1
        self._left_out_in_a_row += 1
        if self._left_out_in_a_row >= LEFT_OUT_IN_A_ROW:
            self._faults.fault(
                "no light",
                "the strip is dark, or the LED frame does not tell how it shines: is it connected, "
                "and triggers the camera? See `cornertouchd leds status`",
            )

    def _watch(self, fault: str, watch: Callable[[Frame], None], frame: Frame) -> None:
        """Look for what is told beside the observation, which is on its way."""
        try:
            watch(frame)
        except Exception as error:  # noqa: BLE001  pictures are observed without it
            self._faults.fault(fault, error, traceback_of=error)

    def _watch_strip(self, frame: Frame) -> None:
        """Tell when the strip is no longer on its rows."""
        shift = self._pipeline.find_strip_shift(frame)
        if shift is self._shift:
            return
        self._shift = shift
        _log.warning("camera %s: %s", frame.camera, shift or "the strip is where it was calibrated")

    def _watch_blind_columns(self, frame: Frame) -> None:
        """Tell which columns go blind and which see again."""
        blind = self._pipeline.find_blind_columns(frame)
        if blind is self._blind:
            return
        before, self._blind = self._blind, blind
        for columns in blind:
            if columns not in before:
                said = str(columns) if self._light is None else self._light.masked(columns)
                _log.warning("camera %s: %s", frame.camera, said)
        for columns in before:
            if columns not in blind:
                _log.warning(
                    "camera %s: columns %d..%d see again",
                    frame.camera,
                    columns.first_px,
                    columns.last_px,
                )

    def _close(self, camera: Camera) -> None:
        try:
            camera.close()
        except Exception as error:  # noqa: BLE001
            self._faults.fault("closing failed", error, traceback_of=error)
