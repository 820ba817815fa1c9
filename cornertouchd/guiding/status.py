"""What the steps of a guided calibration have in common, and what each tells whoever shows it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from cornertouchd.guiding.checking import CameraCheck
from cornertouchd.model import BoolArray, Frame

StepName = Literal["boards", "cameras", "empty", "taps", "scribble", "check", "display", "done"]


@dataclass(frozen=True)
class Status:
    """The step, what to do, how far it is: `progress` and `held` are shares, 0..1.

    `target_mm` is the place to tap, target `number` (from 1) `of` so many, called `name` if it has
    one.  `visited` (rows, columns) are the parts of the surface that a scribble has covered.
    """

    step: StepName
    hint: str
    progress: float = 0.0
    checks: tuple[CameraCheck, ...] = ()
    target_mm: tuple[float, float] | None = None
    number: int = 0
    of: int = 0
    name: str = ""
    tapped_mm: tuple[tuple[float, float], ...] = ()
    held: float = 0.0
    visited: BoolArray | None = None
    finger_mm: tuple[float, float] | None = None


class Result:
    """What the last step gave; subclasses say what."""


class Step(Protocol):
    """One step: fed frame sets, it returns what comes next: itself, another step, or the result.

    Without keys, clock or waiting.
    """

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        ...

    def feed(self, frames: Sequence[Frame]) -> "Step | Result":
        """Take a frame set of all cameras; return what the next one goes to, or the result."""
        ...
