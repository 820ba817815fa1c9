"""What the daemon needs from the world, as protocols; `devices` and `simulation` fill them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from cornertouchd.errors import ReportedError
from cornertouchd.model import Frame, PictureFormat, TouchFrame
from cornertouchd.wire.ledframe import Request
from cornertouchd.wire.ledframe_reports import ControllerStatus, Identity
from cornertouchd.wire.ledframe_session import Light, Report


class CameraError(ReportedError):
    """A camera cannot be opened or gives no more pictures; `reason` says why and what to do."""

    def __init__(self, camera: str, reason: str) -> None:
        super().__init__(f"camera {camera}: {reason}")
        self.reason = reason


class Camera(Protocol):
    """An opened camera.  Used by one thread."""

    def read(self, timeout_s: float) -> Frame | None:
        """Return the next picture, or None if none came in time.

        Never returns a picture twice.  Raises `CameraError` when the camera is gone or what it
        sends cannot be used; it must then be closed and opened anew.
        """
        ...

    def close(self) -> None:
        """Give the device back.  May be called twice."""
        ...


class CameraPort(Protocol):
    """A place where one camera can be opened, as often as it takes."""

    @property
    def id(self) -> str:
        """Name of the camera: C1, C2, ..."""
        ...

    @property
    def identity(self) -> str:
        """What tells this very camera from others of its kind; empty while that is not known."""
        ...

    @property
    def format(self) -> PictureFormat:
        """Size and rows of the pictures that it gives."""
        ...

    def open(self) -> Camera:
        """Open the camera.  Raises `CameraError` when it is not there or refuses the format."""
        ...


class ResetError(ReportedError):
    """A camera cannot be reset in this way; the text says why and what to do."""


class CameraReset(Protocol):
    """A way to make a camera begin anew.  Used by one thread, while the camera is closed."""

    @property
    def name(self) -> str:
        """What is done, for the log."""
        ...

    def apply(self) -> None:
        """Do it; may take seconds.  Raises `ResetError` if it is not possible."""
        ...


class CameraPlug(Protocol):
    """Where a camera is plugged in.  Used by one thread."""

    @property
    def resets(self) -> Sequence[CameraReset]:
        """The ways to reset it, the gentlest first."""
        ...

    def plugged_in(self) -> str:
        """Return what tells this plugging-in from others; empty while no camera is there.

        It is not opened for that, and the call is cheap enough for four a second.
        """
        ...


class TouchSink(Protocol):
    """Where touches go.  Called from the fusion thread only; never blocks, never raises.

    `now_s` is the time of the call on the same clock for all methods.
    """

    def send(self, frame: TouchFrame, now_s: float) -> None:
        """Tell the touches of one instant."""
        ...

    def lift_all(self, now_s: float) -> None:
        """Tell that there are no touches any more: the cameras are lost, or the daemon stops."""
        ...

    def tick(self, now_s: float) -> None:
        """Do what time demands (repeats, keep-alive); called at least every 25 ms."""
        ...

    def close(self) -> None:
        """Lift all touches, say so for the last time and free what is held; takes <= 0.2 s."""
        ...


class Clock(Protocol):
    """Time, so that tests and replays can bring their own."""

    def now_s(self) -> float:
        """Return CLOCK_MONOTONIC seconds."""
        ...

    def sleep_until(self, time_s: float) -> None:
        """Return when `now_s()` has reached `time_s`."""
        ...


@dataclass(frozen=True, slots=True)
class LedFrameStatus:
    """How the LED frame fares; `identity` and `controller` are None while it is not connected."""

    identity: Identity | None = None
    controller: ControllerStatus | None = None
    connections: int = 0
    bad_messages: int = 0


class LedFrame(Protocol):
    """The LED frame, while the daemon runs.  Methods return at once and never raise.

    What is wanted is kept: it is sent when the frame is connected, and again after it was away or
    has restarted.
    """

    @property
    def status(self) -> LedFrameStatus:
        """How it fares now.  Any thread may ask."""
        ...

    def start(self) -> None:
        """Begin to look for it."""
        ...

    def configure(self, light: Light) -> None:
        """Set levels, timing and pattern."""
        ...

    def arm(self) -> None:
        """Shine, once configured."""
        ...

    def disarm(self) -> None:
        """Be dark."""
        ...

    def ask(self, request: Request) -> None:
        """Send a request once: self test, clearing of faults, restart.

        Lost if the frame is not there; what comes of it is reported.
        """
        ...

    def close(self) -> None:
        """Switch the light off and give the port back; takes <= 1 s.  May be called twice."""
        ...


class LedFrameListener(Protocol):
    """Who hears of the LED frame.  Called from its thread; must return soon."""

    def __call__(self, report: Report, received_at_s: float) -> None:
        """Take what the controller reported, and when it arrived (CLOCK_MONOTONIC)."""
        ...


class FaultReport(Protocol):
    """Where faults go: logged once, counted after that, their end logged, too."""

    def fault(self, kind: str, detail: object = "") -> None:
        """Tell a fault."""
        ...

    def good(self) -> None:
        """Tell that all is well, as often as it is."""
        ...
