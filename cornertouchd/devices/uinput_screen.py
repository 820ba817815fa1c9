"""Touches as a touchscreen of this machine, for every program that knows native touch."""

import logging
import queue
import threading
from dataclasses import dataclass

from cornertouchd.devices.uinput_device import OpenScreen, ScreenDevice, ScreenError, open_screen
from cornertouchd.model import TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.touchscreen import TouchscreenSession

log = logging.getLogger(__name__)

RETRY_AFTER_S = 10.0
"""What keeps a screen from being made is mended by a person."""


@dataclass(frozen=True, slots=True)
class ScreenStatus:
    """How a touchscreen fares; `fault` is None while nothing is wrong."""

    name: str
    is_there: bool
    reports_sent: int
    errors: int
    touches_left_out: int
    fault: str | None


class UinputScreen:
    """Moves a touchscreen that the kernel makes for us; fills `ports.TouchSink`.

    The screen is made by a thread of its own, again every 10 s while that fails, and stays until
    `close`, whatever becomes of the programs that read it.  Should this process die, the kernel
    takes the screen away and ends the touches on it.
    """

    def __init__(
        self,
        name: str,
        mapping: DisplayMapping,
        slots: int,
        *,
        open_device: OpenScreen = open_screen,
    ) -> None:
        self._name = name
        self._session = TouchscreenSession(mapping, slots)
        self._open_device = open_device
        self._answers: queue.SimpleQueue[ScreenDevice | Exception] = queue.SimpleQueue()
        self._device: ScreenDevice | None = None
        self._opening: threading.Thread | None = None
        self._closed = False
        self._retry_at_s = float("-inf")
        self._reports_sent = 0
        self._errors = 0
        self._fault: str | None = None

    @property
    def screens(self) -> tuple[ScreenStatus, ...]:
        """How the screen fares; may be read from any thread."""
        return (
            ScreenStatus(
                self._name,
                self._device is not None,
                self._reports_sent,
                self._errors,
                self._session.touches_left_out,
                self._fault,
            ),
        )

    def send(self, frame: TouchFrame, now_s: float) -> None:
        """Tell the touches of one instant."""
        self.tick(now_s)
        if self._device is not None:
            self._write(self._session.frame(frame), now_s)

    def lift_all(self, now_s: float) -> None:
        """Lift all touches."""
        self.tick(now_s)
        self._write(self._session.lift_all(now_s), now_s)

    def tick(self, now_s: float) -> None:
        """Go on with making the screen, if there is none."""
        if self._device is not None or self._closed:
            return
        if self._opening is not None:
            self._take_answer(now_s)
        elif now_s >= self._retry_at_s:
            self._ask(now_s)

    def close(self) -> None:
        """Lift all touches and take the screen away."""
        if self._closed:
            return
        self._closed = True
        if self._device is not None:
            self._write(self._session.lift_all(0.0), 0.0)
        self._take_away()
        self._discard_answer()

    def _write(self, events: bytes, now_s: float) -> None:
        if self._device is None or not events:
            return
        try:
            self._device.write(events)
        except OSError as error:
            self._take_away()
            self._note_fault(f"refuses events: {error.strerror or error}", now_s)
        else:
            self._reports_sent += 1

    def _ask(self, now_s: float) -> None:
        self._opening = threading.Thread(target=self._open, name="touchscreen", daemon=True)
        try:
            self._opening.start()
        except RuntimeError as error:  # the process may have no more threads
            self._opening = None
            self._note_fault(str(error), now_s)

    def _open(self) -> None:
        """Make the screen, on a thread of its own."""
        try:
            answer: ScreenDevice | Exception = self._open_device(self._name, self._session.axes)
        except Exception as error:  # noqa: BLE001  whatever it is, it costs the screen only
            answer = error
        self._answers.put(answer)
        if self._closed:
            self._discard_answer()

    def _take_answer(self, now_s: float) -> None:
        try:
            answer = self._answers.get_nowait()
        except queue.Empty:
            return
        self._opening = None
        if isinstance(answer, Exception):
            self._note_fault(
                str(answer) if isinstance(answer, ScreenError) else repr(answer), now_s
            )
            return
        self._device = answer
        self._session.forget()
        if self._fault is not None:
            log.info("touchscreen %s: is there", self._name)
            self._fault = None

    def _discard_answer(self) -> None:
        """Take away a screen that came too late; closing and opening thread both look for it."""
        try:
            answer = self._answers.get_nowait()
        except queue.Empty:
            return
        if not isinstance(answer, Exception):
            answer.close()

    def _take_away(self) -> None:
        device, self._device = self._device, None
        if device is None:
            return
        try:
            device.close()
        except OSError as error:
            log.warning("touchscreen %s: cannot be taken away: %s", self._name, error)

    def _note_fault(self, what: str, now_s: float) -> None:
        self._errors += 1
        self._retry_at_s = now_s + RETRY_AFTER_S
        if self._fault is None:
            log.warning("touchscreen %s: %s", self._name, what)
        self._fault = what
