"""The LED frame at the hands of a person: one command's conversation with the controller."""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeVar

from cornertouchd.devices.serial_link import SerialLedFrame
from cornertouchd.errors import ReportedError
from cornertouchd.ports import LedFrameStatus
from cornertouchd.wire.ledframe import Request
from cornertouchd.wire.ledframe_session import Light, Refused, Report

CONNECTED_WITHIN_S = 6.0
"""An Arduino restarts when its port is opened and spends up to two seconds in its bootloader; the
link gives up after four."""

Told = TypeVar("Told", bound=Report)


class LedFrameError(ReportedError):
    """The LED frame is not there, or does not do what is asked; the text says why."""


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
