"""A guided calibration: cameras, empty strip, taps, scribble, result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.auto import FEWEST_TOUCHES, starting_point
from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    Method,
    TapsDoNotFitError,
)
from cornertouchd.calibration.fitted import Fitted
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.methods import fit
from cornertouchd.calibration.touch_columns import TouchColumns
from cornertouchd.config import VisionSettings
from cornertouchd.guiding.checking import CameraCheck, InForce, check_camera
from cornertouchd.guiding.coverage import ScribbleCoverage
from cornertouchd.guiding.empty_surface import EmptyLearner, EmptySurface
from cornertouchd.guiding.finger_watch import FingerWatch
from cornertouchd.guiding.progress import TapStore
from cornertouchd.guiding.status import Result, Status, Step
from cornertouchd.guiding.tapping import FEWEST_CAMERAS
from cornertouchd.guiding.target_taps import TargetTaps
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.camera_model import CameraModel
from cornertouchd.model import FloatArray, Frame, Picture, PictureFormat

CHECK_PICTURES = 16
"""Pictures of a camera that are looked at together: their mean has a quarter of the noise."""

FAR_OFF_MM = 60.0
FAR_OFF_SHARE = 0.15
"""Before anything is calibrated a tap is located to so many millimetres, or to this share of the
surface's diagonal: lens and mounting are not known yet."""

BAD_IN_CAMERAS = 2
"""A tap that does not fit in so many cameras was beside its place; in one, the view was blocked."""

FEWEST_TO_CHECK = FEWEST_TOUCHES + 4
"""With fewer taps cameras cannot be fitted, or nothing is left over to tell a bad one by."""

MOST_ROUNDS = 3
"""Times that bad taps are asked for again; then the fit goes without them."""


@dataclass(frozen=True)
class Plan:
    """What is to be calibrated, and how; `store` keeps the taps.

    `in_force` is the calibration that is to be replaced, if there is one.
    """

    method: Method
    surface_mm: tuple[float, float]
    formats: Mapping[str, PictureFormat]
    targets_mm: FloatArray
    tap_sigma_mm: float
    vision: VisionSettings
    store: TapStore
    boards: Sequence[BoardSight] = ()
    in_force: Calibration | None = None


class CheckCameras:
    """First: is every camera fit for it?  Looks on until none has a bad finding."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._pictures: dict[str, list[Picture]] = {camera: [] for camera in plan.formats}
        self._checks: tuple[CameraCheck, ...] = ()

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        unfit = [check.camera for check in self._checks if check.verdict == "bad"]
        hint = f"see to {', '.join(unfit)}" if unfit else "looking at the cameras"
        seen = min(len(pictures) for pictures in self._pictures.values())
        return Status("cameras", hint, seen / CHECK_PICTURES, self._checks)

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set; go on when all cameras are fit."""
        for frame in frames:
            self._pictures[frame.camera].append(frame.pixels)
        if min(len(pictures) for pictures in self._pictures.values()) < CHECK_PICTURES:
            return self
        self._checks = tuple(
            check_camera(camera, pictures, in_force=_in_force(self._plan, camera))
            for camera, pictures in self._pictures.items()
        )
        self._pictures = {camera: [] for camera in self._pictures}
        fit = all(check.verdict != "bad" for check in self._checks)
        return LearnEmpty(self._plan, self._checks) if fit else self


def _in_force(plan: Plan, camera: str) -> InForce | None:
    """Return how a camera was calibrated before, None if its pictures were others then."""
    before = plan.in_force
    if before is None:
        return None
    return next(
        (
            InForce(one, before.surface_mm)
            for one in before.cameras
            if one.id == camera and one.format == plan.formats[camera]
        ),
        None,
    )


class LearnEmpty:
    """Second: the empty strip."""

    def __init__(self, plan: Plan, checks: tuple[CameraCheck, ...]) -> None:
        self._plan = plan
        self._checks = checks
        self._learner = EmptyLearner(plan.vision)
        self._trouble = ""

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        hint = "hands off the surface"
        if self._learner.disturbed:
            hint = f"something moved: {hint}"
        return Status("empty", self._trouble or hint, self._learner.share, self._checks)

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set; go on when the empty surface is known."""
        try:
            empty = self._learner.feed(frames)
        except CalibrationError as error:
            self._trouble = str(error)
            return self
        self._trouble = ""
        return self if empty is None else TapTargets(self._plan, empty, self._checks).next_step()


class TapTargets:
    """Third: a tap at each target.  Taps that do not fit the others are asked for again."""

    def __init__(self, plan: Plan, empty: EmptySurface, checks: tuple[CameraCheck, ...]) -> None:
        self._plan = plan
        self._empty = empty
        self._checks = checks
        self._rounds = 0
        start = starting_point(reference_touches(plan, empty, {}, ()))
        self._rough = [
            AnglePolynomial((float(x), float(y)), (float(a_0), float(a_1)), form.width_px)
            for (x, y), (a_0, a_1), form in zip(
                start.positions_mm, start.angles_rad, plan.formats.values(), strict=True
            )
        ]
        far_off_mm = max(FAR_OFF_MM, FAR_OFF_SHARE * float(np.hypot(*plan.surface_mm)))
        self._taps = TargetTaps(
            FingerWatch(empty.finders, self._rough),
            plan.targets_mm,
            far_off_mm,
            needed=2 if plan.method == "lookup-table" else FEWEST_CAMERAS,
        )
        self._taps.taps.update(plan.store.load(plan.targets_mm))
        if self._taps.taps:
            kept = len(self._taps.taps)
            self._taps.say(f"{kept} taps are kept from before: go on with the marked place")

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        return self._taps.status("taps")

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set; keep every tap; go on when all are there and fit."""
        if not self._taps.feed(frames):
            return self
        self._keep()
        return self.next_step()

    def next_step(self) -> Step | Result:
        """Return what follows when all taps are there and fit, until then this step."""
        if self._taps.target is not None:
            return self
        given = reference_touches(self._plan, self._empty, self._taps.taps, ())
        if self._plan.method == "auto" and len(self._taps.taps) < FEWEST_TO_CHECK:
            return self._scribble(self._rough)
        try:
            fitted = fit(self._plan.method, given, self._plan.tap_sigma_mm)
        except TapsDoNotFitError as error:
            return self.begin_again(error)
        numbers = np.array(sorted(self._taps.taps))
        off = numbers[fitted.dropped.sum(axis=0) >= BAD_IN_CAMERAS].tolist()
        if off and self._rounds < MOST_ROUNDS:
            text = "1 tap was" if len(off) == 1 else f"{len(off)} taps were"
            self._ask_again(off, f"{text} beside the marked place: tap again")
            return self
        if self._plan.method == "auto":
            return self._scribble(fitted.models)
        return Done(self._empty, self._checks, given, fitted)

    def begin_again(self, error: TapsDoNotFitError) -> Step:
        """Ask for all taps again.  Raises the error when that has been done often enough."""
        if self._rounds >= MOST_ROUNDS:
            raise error
        self._ask_again(list(self._taps.taps), f"all taps are needed again: {error}")
        return self

    def _scribble(self, models: Sequence[CameraModel]) -> Step:
        return Scribble(self._plan, self._empty, self._checks, self, models)

    @property
    def taps(self) -> Mapping[int, FloatArray]:
        """The taps that are there, by the number of their target."""
        return self._taps.taps

    def _ask_again(self, numbers: Sequence[int], text: str) -> None:
        self._rounds += 1
        self._taps.ask_again(numbers)
        self._taps.say(text)
        self._keep()

    def _keep(self) -> None:
        self._plan.store.save(self._plan.targets_mm, self._taps.taps)


class Scribble:
    """Fourth: a finger moved all over the surface, located by what is known so far."""

    def __init__(
        self,
        plan: Plan,
        empty: EmptySurface,
        checks: tuple[CameraCheck, ...],
        taps: TapTargets,
        models: Sequence[CameraModel],
    ) -> None:
        self._plan = plan
        self._empty = empty
        self._checks = checks
        self._taps = taps
        self._watch = FingerWatch(empty.finders, models)
        self._needed = min(FEWEST_CAMERAS, len(plan.formats))
        self._coverage = ScribbleCoverage(plan.surface_mm)
        self._touches: list[FloatArray] = []
        self._several = False
        self._finger_mm: tuple[float, float] | None = None

    @property
    def status(self) -> Status:
        """What to do, and how far it is."""
        return Status(
            "scribble",
            "only one finger, please"
            if self._several
            else "move one finger slowly all over the surface, until the plan is full",
            self._coverage.share,
            visited=self._coverage.visited,
            finger_mm=self._finger_mm,
        )

    def feed(self, frames: Sequence[Frame]) -> Step | Result:
        """Take a frame set; fit everything when the scribble suffices.

        A touch counts when three cameras see it: two lines meet wherever the cameras stand.
        """
        sight = self._watch.look(frames)
        self._several, self._finger_mm = sight.several, None
        if sight.place_mm is not None:
            self._finger_mm = float(sight.place_mm[0]), float(sight.place_mm[1])
            if sight.seen_by >= self._needed and self._coverage.wants(sight.place_mm):
                self._touches.append(sight.columns_px)
        if not self._coverage.is_enough:
            return self
        given = reference_touches(self._plan, self._empty, self._taps.taps, self._touches)
        try:
            fitted = fit(self._plan.method, given, self._plan.tap_sigma_mm)
        except TapsDoNotFitError as error:
            return self._taps.begin_again(error)
        return Done(self._empty, self._checks, given, fitted)


@dataclass(frozen=True)
class Done(Result):
    """Last: what was found, given and fitted."""

    empty: EmptySurface
    checks: tuple[CameraCheck, ...]
    given: ReferenceTouches
    fitted: Fitted


def reference_touches(
    plan: Plan,
    empty: EmptySurface,
    taps: Mapping[int, FloatArray],
    scribble: Sequence[FloatArray],
) -> ReferenceTouches:
    """Put together taps by the number of their target and a scribble, (cameras, 2) edges each."""
    numbers = sorted(taps)
    columns = [taps[number] for number in numbers] + list(scribble)
    places = np.full((len(columns), 2), np.nan)
    places[: len(numbers)] = plan.targets_mm[numbers]
    shape = (len(columns), len(plan.formats), 2)
    touches = TouchColumns(
        np.array(columns, np.float64).reshape(shape).transpose(1, 0, 2),
        places,
        np.full(len(columns), np.nan),
    )
    return ReferenceTouches(
        plan.surface_mm,
        plan.formats,
        empty.empties,
        empty.strips,
        touches,
        plan.boards,
    )
