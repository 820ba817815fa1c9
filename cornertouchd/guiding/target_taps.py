"""One tap at each of several targets, in order; a tap that went elsewhere is asked for again."""

from collections.abc import Iterable, Sequence

import numpy as np

from cornertouchd.guiding.finger_watch import FingerWatch, TapWatch, place_mm
from cornertouchd.guiding.status import Status, StepName
from cornertouchd.guiding.tapping import FEWEST_CAMERAS, TapState
from cornertouchd.model import FloatArray, Frame

HIDDEN_TIMES = 3
"""A person tries again twice; then it is the place that cannot be seen."""


class TargetTaps:
    """Waits for a tap at each target; `far_off_mm` is how far from it a tap is refused.

    `needed` cameras have to see a tap; a target that too few see three times is left out.  `names`
    are those of the targets, if they have some.
    """

    def __init__(
        self,
        watch: FingerWatch,
        targets_mm: FloatArray,
        far_off_mm: float,
        names: Sequence[str] = (),
        needed: int = FEWEST_CAMERAS,
    ) -> None:
        self.targets_mm = targets_mm
        self._names = names
        self.taps: dict[int, FloatArray] = {}
        self._watch = watch
        self._tap_watch = TapWatch(watch, needed)
        self._left_out: set[int] = set()
        self._far_off_mm = far_off_mm
        self._said = ""

    @property
    def target(self) -> int | None:
        """Number of the target to tap; None when all are, or are left out."""
        done = self.taps.keys() | self._left_out
        missing = (number for number in range(len(self.targets_mm)) if number not in done)
        return next(missing, None)

    def status(self, step: StepName) -> Status:
        """Return what to do; after a tap that was refused, why."""
        quiet = self._tap_watch.state in (TapState.AWAY, TapState.TAPPED)
        number = self.target
        return Status(
            step,
            self._said if self._said and quiet else self._tap_watch.hint,
            len(self.taps) / len(self.targets_mm),
            target_mm=None if number is None else _pair(self.targets_mm[number]),
            number=0 if number is None else number + 1,
            of=len(self.targets_mm),
            name="" if number is None or not self._names else self._names[number],
            tapped_mm=tuple(_pair(self.targets_mm[tapped]) for tapped in self.taps),
            held=self._tap_watch.held_share,
        )

    def say(self, text: str) -> None:
        """Say this until the next tap."""
        self._said = text

    def ask_again(self, numbers: Iterable[int]) -> None:
        """Forget these taps, so that their targets come again."""
        for number in list(numbers):
            del self.taps[number]

    def feed(self, frames: Sequence[Frame]) -> bool:
        """Take a frame set; tell whether the target is done: tapped, or left out."""
        number = self.target
        tap = self._tap_watch.feed(frames)
        if number is None:
            return False
        if self._tap_watch.hidden >= HIDDEN_TIMES:
            self._left_out.add(number)
            self._tap_watch.forget_hidden()
            self._said = f"place {number + 1} is hidden from too many cameras and left out: go on"
            return True
        if tap is None:
            return False
        place = place_mm(self._watch.models, tap)
        off_mm = np.inf if place is None else float(np.linalg.norm(place - self.targets_mm[number]))
        if off_mm > self._far_off_mm:
            self._said = f"that was about {off_mm:.0f} mm off: tap the marked place"
            return False
        self._said = ""
        self.taps[number] = tap
        return True


def _pair(place_mm: FloatArray) -> tuple[float, float]:
    return float(place_mm[0]), float(place_mm[1])
