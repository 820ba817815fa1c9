"""When a lost camera is opened anew, and when it is reset first.

A ladder: close and open it anew, with growing delays; after some attempts in vain reset it, by the
gentlest way first; then from the beginning.  A camera that is not plugged in is never reset: it is
looked for until it is there.
"""

import logging
import math
import random
from collections import deque
from collections.abc import Callable
from errno import EACCES, EBUSY, ENOSPC, EPERM

from cornertouchd.config import CamerasSettings
from cornertouchd.ports import CameraError, CameraPlug, Clock, ResetError

LOOK_EVERY_S = 0.25
"""How often a missing camera is looked for: it has to work within 2 s of its node, and opening one
takes the greater part of a second.  A look takes 1 ms."""

SETTLING_S = 3.0
"""As long as a camera may settle after it was plugged in or reset: its driver makes the node, udev
sets permissions, some refuse the first attempts.  It is tried at every look."""

JITTER = 0.25
"""Share by which delays are longer at random, so that cameras of one hub are not opened together
again and again."""

HOUR_S = 3600.0
NO_FAULT_OF_THE_DEVICE = (EACCES, EBUSY, ENOSPC, EPERM)

_log = logging.getLogger("cornertouchd")


def may_be_cured_by_reset(error: CameraError) -> bool:
    """Tell whether a reset may help: not if the camera is someone else's, or the bus is full."""
    cause = error.__cause__
    return not (isinstance(cause, OSError) and cause.errno in NO_FAULT_OF_THE_DEVICE)


class Recovery:
    """Waits for the moment to open one camera anew.  Used by its capture thread only.

    `plug` is None where there is nothing to look at or to reset, as with simulated cameras.
    """

    def __init__(
        self,
        camera: str,
        plug: CameraPlug | None,
        settings: CamerasSettings,
        clock: Clock,
        jitter: Callable[[], float] = random.random,
    ) -> None:
        self._camera = camera
        self._plug = plug
        self._settings = settings
        self._clock = clock
        self._jitter = jitter
        self._plugged = "" if plug is None else plug.plugged_in()
        self._settles_until_s = -math.inf
        self._resets_at_s: deque[float] = deque()
        self._told: set[str] = set()
        self._resets = 0
        self._begin_anew()

    @property
    def resets(self) -> int:
        """How often the camera was reset."""
        return self._resets

    def wait_to_reopen(
        self, *, worked: bool, reset_may_help: bool, wait: Callable[[float], bool]
    ) -> None:
        """Return when the camera should be opened anew.

        `worked` tells whether it gave pictures since the last call.  `wait` waits so many seconds
        and tells whether the thread has to end.
        """
        if worked:
            self._begin_anew()
        if not self._is_plugged_in():
            self._wait_for_plug(wait)
        elif self._clock.now_s() < self._settles_until_s:
            wait(LOOK_EVERY_S)
        elif reset_may_help and self._reset_if_due():
            self._settles()
            wait(LOOK_EVERY_S)
        else:
            self._wait_out(self._next_delay_s(), wait)

    def _begin_anew(self) -> None:
        self._delay_s = self._settings.reopen_delay_s
        self._in_vain = 0
        self._rung = 0
        self._told.clear()

    def _next_delay_s(self) -> float:
        delay_s = self._delay_s
        self._delay_s = min(2 * delay_s, self._settings.reopen_delay_max_s)
        return delay_s * (1.0 + JITTER * self._jitter())

    def _wait_out(self, delay_s: float, wait: Callable[[float], bool]) -> None:
        """Wait, but not longer than until a camera is plugged in."""
        until_s = self._clock.now_s() + delay_s
        while (left_s := until_s - self._clock.now_s()) > 0:
            if wait(left_s if self._plug is None else min(left_s, LOOK_EVERY_S)):
                return
            before = self._plugged
            if not self._is_plugged_in():
                self._wait_for_plug(wait)
                return
            if self._plugged != before:
                return

    def _wait_for_plug(self, wait: Callable[[float], bool]) -> None:
        while not self._is_plugged_in():
            if wait(LOOK_EVERY_S):
                return

    def _is_plugged_in(self) -> bool:
        """Look; when the camera was plugged in since the last look, nothing before counts."""
        if self._plug is None:
            return True
        before, self._plugged = self._plugged, self._plug.plugged_in()
        if self._plugged and self._plugged != before:
            self._begin_anew()
            self._settles()
        return bool(self._plugged)

    def _settles(self) -> None:
        self._settles_until_s = self._clock.now_s() + SETTLING_S

    def _reset_if_due(self) -> bool:
        """Count an attempt in vain; reset the camera if it is time, and tell whether it was."""
        self._in_vain += 1
        resets = () if self._plug is None else self._plug.resets
        if self._in_vain < self._settings.failures_before_reset or not self._may_reset_again():
            return False
        for _ in resets:
            reset = resets[self._rung % len(resets)]
            self._rung += 1
            try:
                reset.apply()
            except ResetError as error:
                self._tell_once(f"no {reset.name}: {error}")
            except Exception:  # noqa: BLE001  libusb may raise anything; the next way may work
                _log.exception("camera %s: %s failed", self._camera, reset.name)
            else:
                self._note_reset(reset.name)
                return True
        return False

    def _may_reset_again(self) -> bool:
        now_s, most = self._clock.now_s(), self._settings.resets_per_hour
        while self._resets_at_s and now_s - self._resets_at_s[0] >= HOUR_S:
            self._resets_at_s.popleft()
        if len(self._resets_at_s) < most:
            return True
        if most:
            self._tell_once(
                f"was reset {most} times within an hour (cameras.resets_per_hour) and is only "
                "opened anew for now; check its cable, hub and power"
            )
        return False

    def _note_reset(self, name: str) -> None:
        self._resets += 1
        self._resets_at_s.append(self._clock.now_s())
        _log.warning(
            "camera %s: %s after %d attempts to open it (reset %d of %d this hour)",
            self._camera,
            name,
            self._in_vain,
            len(self._resets_at_s),
            self._settings.resets_per_hour,
        )
        self._in_vain = 0

    def _tell_once(self, text: str) -> None:
        if text not in self._told:
            self._told.add(text)
            _log.warning("camera %s: %s", self._camera, text)
