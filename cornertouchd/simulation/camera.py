"""Simulated cameras behind the camera port, paced by a clock, with faults at will."""

from collections.abc import Mapping
from enum import Enum, auto
from math import ceil, floor

import numpy as np

from cornertouchd.model import Frame, Picture, PictureFormat
from cornertouchd.ports import CameraError, Clock
from cornertouchd.simulation.painting import Paint, painter
from cornertouchd.simulation.rig import ALL_SIDES_LIT, SimulatedRig
from cornertouchd.simulation.scripts import Script

# Counting pictures by dividing times must not lose one to rounding: a millionth of a period.
ROUNDING = 1e-6


class Fault(Enum):
    """What is wrong with a camera."""

    NONE = auto()
    UNPLUGGED = auto()
    """It cannot be opened, and reading it raises `CameraError`."""
    STALLED = auto()
    """It sends nothing."""
    GARBLED = auto()
    """It sends pictures of the right size that show nothing but noise."""


class SimulatedCameraPort:
    """One camera of a simulated rig, showing what a script does.

    Picture k of every camera of the rig is captured at `start_s` + k / `rate_hz`, and shows the
    script at `speed` x k / `rate_hz`.  Set `fault` at any time and from any thread.
    """

    def __init__(
        self,
        camera_id: str,
        picture_format: PictureFormat,
        paint: Paint,
        clock: Clock,
        start_s: float,
        rate_hz: float = 100.0,
        speed: float = 1.0,
        identity: str = "",
    ) -> None:
        if not rate_hz > 0.0:
            raise ValueError(f"camera {camera_id}: rate_hz is {rate_hz:g}; give one above 0")
        self.fault = Fault.NONE
        self._id = camera_id
        self._format = picture_format
        self._paint = paint
        self._clock = clock
        self._start_s = start_s
        self._rate_hz = rate_hz
        self._speed = speed
        self._identity = identity

    @property
    def id(self) -> str:
        """Name of the camera: C1, C2, ..."""
        return self._id

    @property
    def identity(self) -> str:
        """What tells it from cameras of other rigs; empty if nobody said."""
        return self._identity

    @property
    def format(self) -> PictureFormat:
        """Size and rows of the pictures that it gives."""
        return self._format

    def open(self) -> "SimulatedCamera":
        """Open the camera.  Raises `CameraError` while it is unplugged."""
        self._check_plugged()
        return SimulatedCamera(self, self._clock)

    def newest_at(self, now_s: float) -> int:
        """Return the index of the last picture captured by now; below 0 before the first."""
        return floor((now_s - self._start_s) * self._rate_hz + ROUNDING)

    def next_from(self, now_s: float) -> int:
        """Return the index of the first picture captured now or later."""
        return max(0, ceil((now_s - self._start_s) * self._rate_hz - ROUNDING))

    def captured_at_s(self, index: int) -> float:
        """Return when a picture is captured."""
        return self._start_s + index / self._rate_hz

    def is_silent(self) -> bool:
        """Return whether no picture arrives.  Raises `CameraError` while unplugged."""
        self._check_plugged()
        return self.fault is Fault.STALLED

    def frame(self, index: int) -> Frame:
        """Return picture `index` as a frame."""
        return Frame(
            self._id, index, self.captured_at_s(index), ALL_SIDES_LIT, self._picture(index)
        )

    def _picture(self, index: int) -> Picture:
        if self.fault is Fault.GARBLED:
            size = (self.format.rows_px, self.format.width_px)
            return np.random.default_rng(index).integers(0, 256, size, np.uint8)
        return self._paint(index, index / self._rate_hz * self._speed)

    def _check_plugged(self) -> None:
        if self.fault is Fault.UNPLUGGED:
            raise CameraError(self._id, "unplugged; plug it in and open it again")


class SimulatedCamera:
    """An opened simulated camera.  Used by one thread."""

    def __init__(self, port: SimulatedCameraPort, clock: Clock) -> None:
        self._port = port
        self._clock = clock
        self._next = port.next_from(clock.now_s())
        self._closed = False

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest picture that was not read before, or None if none came in time.

        A late reader misses pictures; gaps in the sequence numbers show how many.  Raises
        `CameraError` when the camera is unplugged or closed.
        """
        if self._closed:
            raise CameraError(self._port.id, "closed; open it again before reading")
        deadline_s = self._clock.now_s() + timeout_s
        due_s = self._port.captured_at_s(self._next)
        self._clock.sleep_until(min(due_s, deadline_s))
        if self._port.is_silent():
            self._clock.sleep_until(deadline_s)
            return None
        if due_s > deadline_s:
            return None
        index = max(self._next, self._port.newest_at(self._clock.now_s()))
        self._next = index + 1
        return self._port.frame(index)

    def close(self) -> None:
        """Give the camera back.  May be called twice."""
        self._closed = True


def rig_ports(
    rig: SimulatedRig, script: Script, clock: Clock, rate_hz: float = 100.0, speed: float = 1.0
) -> tuple[SimulatedCameraPort, ...]:
    """Return the ports of all cameras of a rig; their first picture is captured now."""
    paints = {camera_id: painter(rig, script, camera_id) for camera_id in rig.formats}
    return painted_ports(rig.formats, paints, clock, rate_hz, speed)


def painted_ports(
    formats: Mapping[str, PictureFormat],
    paints: Mapping[str, Paint],
    clock: Clock,
    rate_hz: float = 100.0,
    speed: float = 1.0,
    rig_name: str = "",
) -> tuple[SimulatedCameraPort, ...]:
    """Return the ports of cameras whose pictures are painted so; the first is captured now.

    Cameras of a rig that has a name have an identity.
    """
    start_s = clock.now_s()
    return tuple(
        SimulatedCameraPort(
            camera_id,
            form,
            paints[camera_id],
            clock,
            start_s,
            rate_hz,
            speed,
            f"{rig_name} {camera_id}" if rig_name else "",
        )
        for camera_id, form in formats.items()
    )
