"""The LED frame at the hands of a person: one command's conversation with the controller."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self, TypeVar

from cornertouchd.config import LedFrameSettings, Settings
from cornertouchd.devices.serial_link import SerialLedFrame
from cornertouchd.errors import ReportedError
from cornertouchd.ports import LedFrameStatus
from cornertouchd.wire.ledframe import Request, SetLevels, SetPattern, SetTiming, State
from cornertouchd.wire.ledframe_faults import explain
from cornertouchd.wire.ledframe_session import Light, Refused, Report

CONNECTED_WITHIN_S = 6.0
"""An Arduino restarts when its port is opened and spends up to two seconds in its bootloader; the
link gives up after four."""

SHINES_WITHIN_S = 2.0

Told = TypeVar("Told", bound=Report)


class LedFrameError(ReportedError):
    """The LED frame is not there, or does not do what is asked; the text says why."""


def light_of(led_frame: LedFrameSettings, cameras_rate_hz: float) -> Light:
    """Return how the LED frame is to shine."""
    return Light(
        SetLevels(led_frame.levels),
        SetTiming(led_frame.period_us(cameras_rate_hz), led_frame.strobe_us, led_frame.lead_us),
        SetPattern(led_frame.masks),
    )


@contextmanager
def shining(settings: Settings) -> Iterator[None]:
    """Let all sides shine in every picture, while a command looks at the cameras.

    Does nothing without a controller, or where the cameras are simulated.  Raises `LedFrameError`.
    """
    led_frame, cameras = settings.led_frame, settings.cameras
    if not led_frame.enabled or cameras.source == "simulated":
        yield
        return
    constant = led_frame.model_copy(update={"pattern": "constant"})
    with LedDesk(led_frame.port, light_of(constant, cameras.rate_hz)) as desk:
        desk.wait_until_it_shines()
        yield


class LedDesk:
    """The LED frame at a port while a command runs.  Use as a context manager.

    With a `light` it shines so, else it is dark.  Entering waits until it answers; that and waiting
    raise `LedFrameError`.  Leaving switches the light off.
    """

    def __init__(self, port: str, light: Light | None = None) -> None:
        self._port = port
        self._light = light
        self._reports: list[Report] = []
        self._lost = ""
        self._changed = threading.Condition()
        self._link = SerialLedFrame(port, self._take, self)

    def __enter__(self) -> Self:
        if self._light is not None:
            self._link.configure(self._light)
            self._link.arm()
        self._link.start()
        try:
            self._wait(lambda: self._link.status.controller is not None, CONNECTED_WITHIN_S)
        except LedFrameError:
            self._link.close()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._link.close()

    @property
    def status(self) -> LedFrameStatus:
        """How it fares."""
        return self._link.status

    def ask(self, request: Request) -> None:
        """Send a request once."""
        self._link.ask(request)

    def wait_for(self, kind: type[Told], timeout_s: float) -> Told:
        """Return the next report of a kind.  Raises `LedFrameError`, also when it is refused."""
        found: list[Told] = []

        def is_told() -> bool:
            for report in self._reports:
                if isinstance(report, kind):
                    found.append(report)
                elif isinstance(report, Refused):
                    raise LedFrameError(
                        f"{self._port}: refused: {report.request} ({report.status.name})"
                    )
            return bool(found)

        self._wait(is_told, timeout_s)
        return found[0]

    def wait_until(self, holds: Callable[[LedFrameStatus], bool], timeout_s: float) -> None:
        """Return when this holds.  Raises `LedFrameError`."""
        self._wait(lambda: holds(self._link.status), timeout_s)

    def wait_until_it_shines(self) -> None:
        """Return when it is armed.  Raises `LedFrameError`, with the faults that keep it dark."""

        def shines(status: LedFrameStatus) -> bool:
            return status.controller is not None and status.controller.state is State.ARMED

        try:
            self.wait_until(shines, SHINES_WITHIN_S)
        except LedFrameError:
            controller = self.status.controller
            faults = explain(controller.faults) if controller else []
            why = "; ".join(faults) or self._lost or "no reason is told"
            raise LedFrameError(f"{self._port}: it stays dark: {why}") from None

    def fault(self, kind: str, detail: object = "") -> None:
        """Take what the link complains of; what the controller found stands in its status."""
        if kind in {"not opened", "lost"}:
            with self._changed:
                self._lost = str(detail)
                self._changed.notify_all()

    def good(self) -> None:
        """All is well."""

    def _take(self, report: Report, received_at_s: float) -> None:  # noqa: ARG002
        with self._changed:
            self._reports.append(report)
            self._changed.notify_all()

    def _wait(self, holds: Callable[[], bool], timeout_s: float) -> None:
        with self._changed:
            done = self._changed.wait_for(lambda: bool(self._lost) or holds(), timeout_s)
            if self._lost:
                raise LedFrameError(who_else(self._lost))
            if not done:
                raise LedFrameError(
                    f"{self._port}: no answer within {timeout_s:g} s; look at its cable"
                )


def who_else(reason: str) -> str:
    """Add to what a port is refused for who probably has it."""
    if "another program uses it" not in reason:
        return reason
    return f"{reason}; if that is the daemon: systemctl stop cornertouchd"
