"""How bright the LED frame has to be: each side held at a share of full scale, dimmed when idle.

Pure: times arrive with what was seen.
"""

from collections.abc import Mapping
from statistics import median

from cornertouchd.config import LedFrameSettings

FULL_SCALE_GREY = 255.0
STEP_EVERY_S = 2.0
"""The references of the vision follow a change of a few percent a second."""

LARGEST_STEP = 0.02
"""Share of the level that one step changes."""

CLOSE_ENOUGH = 0.04
"""Share of the target within which nothing is changed."""

FEWEST_SEEN = 5
"""Pictures of a side between two steps; with fewer it stays as it is."""

HEADROOM = 0.92
"""Share of full scale that LEDs and sun together may reach: noise and ripple need the rest."""

LEAST_COMMON = 0.4
"""In the sun all sides are dimmed alike, to this share at most: the vision takes that for another
exposure, while a single side at half of its light would look like dead LEDs."""

Levels = tuple[int, int, int, int]


class LevelControl:
    """Moves the level of every side towards the target.  For one thread.

    `darkness` is what each side shows in dark pictures: the light from outside, 0 while unknown.
    """

    def __init__(self, settings: LedFrameSettings) -> None:
        self._settings = settings
        self._exact = [float(level) for level in settings.levels]
        self._seen: dict[int, dict[str, list[tuple[float, bool]]]] = {}
        self._darkness: dict[int, float] = {}
        self._stepped_at_s: float | None = None

    @property
    def levels(self) -> Levels:
        """The levels to set: top, right, bottom, left."""
        top, right, bottom, left = (round(level) for level in self._exact)
        return top, right, bottom, left

    def see_lit(self, camera: str, side: int, grey: float, *, saturated: bool) -> None:
        """Take the brightness of a side that is lit at its level."""
        self._seen.setdefault(side, {}).setdefault(camera, []).append((grey, saturated))

    def see_dark(self, side: int, grey: float) -> None:
        """Take the brightness of a side in a dark picture."""
        self._darkness[side] = grey

    def step(self, now_s: float) -> bool:
        """Move the levels if it is time to; tell whether they have changed."""
        if self._stepped_at_s is None:
            self._stepped_at_s = now_s
        if now_s - self._stepped_at_s < STEP_EVERY_S:
            return False
        self._stepped_at_s = now_s
        seen, self._seen = self._seen, {}
        before = self.levels
        for side, by_camera in seen.items():
            self._move(side, by_camera)
        return self.levels != before

    def forget(self) -> None:
        """Forget what was seen since the last step: it was at another level."""
        self._seen.clear()

    def _move(self, side: int, by_camera: Mapping[str, list[tuple[float, bool]]]) -> None:
        """Go by the camera that sees the side darkest: the sun dazzles one more than the other."""
        told = [each for each in by_camera.values() if len(each) >= FEWEST_SEEN]
        if not told or self._exact[side] == 0.0:  # a side that is off stays off
            return
        target = self._settings.target_share * self._common_share() * FULL_SCALE_GREY
        darkest = min(told, key=lambda each: median(grey for grey, _ in each))
        grey = median(grey for grey, _ in darkest)
        from_outside = self._darkness.get(side, 0.0)
        saturated = sum(full for _, full in darkest) * 2 > len(darkest)
        share = (target - (grey - from_outside)) / target
        if abs(share) <= CLOSE_ENOUGH or (saturated and share > 0.0):
            return
        step = max(-LARGEST_STEP, min(LARGEST_STEP, share)) * self._exact[side]
        step = step if abs(step) >= 1.0 else (1.0 if step > 0.0 else -1.0)
        limits = self._settings.level_min, self._settings.level_max
        self._exact[side] = min(max(self._exact[side] + step, limits[0]), limits[1])

    def _common_share(self) -> float:
        """Return to which share of the target all sides are dimmed, to leave room for the sun."""
        brightest = max(self._darkness.values(), default=0.0) / FULL_SCALE_GREY
        return min(1.0, max(LEAST_COMMON, (HEADROOM - brightest) / self._settings.target_share))


class IdleWatch:
    """Tells when nobody has touched for a while, by the shadows of all cameras.

    Shadows that stay are dirt, not touches: what counts is more of them in a camera than the fewest
    in the time of waiting.  `see` may be called by any thread.
    """

    def __init__(self, after_s: float) -> None:
        self._after_s = after_s
        self._fewest: dict[str, tuple[int, int, float]] = {}
        self._active_at_s: float | None = None

    def see(self, camera: str, shadows: int, at_s: float) -> bool:
        """Take the number of shadows of one camera; tell whether that is a touch."""
        if self._active_at_s is None:
            self._active_at_s = at_s
        before, lately, since_s = self._fewest.get(camera, (shadows, shadows, at_s))
        if at_s - since_s > self._after_s:
            before, lately, since_s = lately, shadows, at_s
        lately = min(lately, shadows)
        self._fewest[camera] = before, lately, since_s
        active = shadows > min(before, lately)
        if active:
            self._active_at_s = at_s
        return active

    def is_idle(self, now_s: float) -> bool:
        """Tell whether nobody has touched for long enough."""
        return (
            self._after_s > 0.0
            and self._active_at_s is not None
            and now_s - self._active_at_s >= self._after_s
        )
