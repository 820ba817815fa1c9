"""Which cameras see, said in one line whenever that changes."""

from collections.abc import Sequence

from cornertouchd.fusion.pairing import CAMERAS_TO_REFUSE_GHOSTS, tell_single_touches

FIRST_PAUSE_S, LONGEST_PAUSE_S = 2.0, 600.0
"""Cameras take a second to start, and all begin to see together.  One with a loose contact comes
and goes: then the state is told ever more rarely, but never a wrong one for good."""

STEADY_S = 60.0
"""As long without a change, and the next one is told at once again."""


class CameraRoll:
    """Knows which of the rig's cameras see, and when to speak about it.  Used by one thread."""

    def __init__(self, cameras: Sequence[str]) -> None:
        self._cameras = tuple(cameras)
        self._told = self._live = self._cameras
        self._told_at_s: float | None = None
        self._changed_at_s = 0.0
        self._pause_s = FIRST_PAUSE_S

    def note(self, live: Sequence[str], now_s: float) -> str:
        """Take the cameras that see now; return what should be said, empty if nothing."""
        seeing = tuple(live)
        if self._told_at_s is None:
            self._told_at_s = self._changed_at_s = now_s
        if seeing != self._live:
            if now_s - self._changed_at_s >= STEADY_S:
                self._pause_s = FIRST_PAUSE_S
            self._live, self._changed_at_s = seeing, now_s
        if seeing == self._told or now_s - self._told_at_s < self._pause_s:
            return ""
        before, self._told, self._told_at_s = self._told, seeing, now_s
        self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)
        return f"{self._change(before, seeing)}: {self._consequence(seeing)}"

    def _change(self, before: tuple[str, ...], now: tuple[str, ...]) -> str:
        lost = [camera for camera in before if camera not in now]
        back = [camera for camera in now if camera not in before]
        parts = [_named(lost, "lost")] if lost else []
        return ", ".join([*parts, _named(back, "back")] if back else parts)

    def _consequence(self, live: tuple[str, ...]) -> str:
        names = ", ".join(live)
        if len(live) >= min(CAMERAS_TO_REFUSE_GHOSTS, len(self._cameras)):
            return f"touches go on with {names}"
        if tell_single_touches(live):
            return f"single touches go on with {names}"
        return f"no touches; {names} cannot tell fingers from ghosts" if live else "no touches"


def _named(cameras: Sequence[str], what: str) -> str:
    return f"camera{'s' if len(cameras) > 1 else ''} {', '.join(cameras)} {what}"
