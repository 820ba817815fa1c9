"""A guided calibration on the simulated rig, with people who do not always do as they are told."""

import itertools
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cornertouchd.calibration.calibration import CalibrationError, Method
from cornertouchd.calibration.methods import Stamp, make_calibration
from cornertouchd.config import Settings, VisionSettings
from cornertouchd.guiding.empty_surface import EmptyLearner, EmptySurface
from cornertouchd.guiding.finger_watch import FingerWatch
from cornertouchd.guiding.guide import CheckCameras, Done, Plan, TapTargets
from cornertouchd.guiding.progress import TapStore
from cornertouchd.guiding.status import Result, Step
from cornertouchd.guiding.targets import calibration_targets
from cornertouchd.guiding.validation import Validated, Validation
from cornertouchd.model import Frame
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.hand import Hand, Person, place_on_rows
from cornertouchd.simulation.rig import SimulatedRig

SURFACE_MM = (350.0, 400.0)
PERIOD_S = 0.04


@pytest.fixture(scope="module")
def simulated() -> SimulatedRig:
    return SimulatedRig(SURFACE_MM, seed=3)


@cache
def empty_surface(simulated: SimulatedRig) -> EmptySurface:
    """What every session learns at first, learned once."""
    learner = EmptyLearner(VisionSettings())
    pictures = itertools.count()
    while (learned := learner.feed(simulated.frame_set(next(pictures), 0.0, ()))) is None:
        pass
    return learned


@pytest.fixture
def store(simulated: SimulatedRig, tmp_path: Path) -> TapStore:
    return TapStore(tmp_path / "taps", SURFACE_MM, simulated.formats)


class Session:
    """A step that is fed what the simulated rig shows, and the time that passes."""

    def __init__(
        self, simulated: SimulatedRig, store: TapStore, side: int = 4, method: Method = "auto"
    ) -> None:
        self.targets = calibration_targets(SURFACE_MM, side, side)
        plan = Plan(
            method, SURFACE_MM, simulated.formats, self.targets, 0.5, VisionSettings(), store
        )  # fmt: skip
        self._plan = plan
        self.step: Step = CheckCameras(plan)
        self.result: Result | None = None
        self._simulated = simulated
        self._pictures = 0
        self.hints: list[str] = []

    @property
    def now_s(self) -> float:
        return self._pictures * PERIOD_S

    def see(self, *fingers: Finger, for_s: float = PERIOD_S) -> None:
        for _ in range(round(for_s / PERIOD_S)):
            frames = self._simulated.frame_set(self._pictures, self.now_s, fingers)
            self.feed(frames)

    def feed(self, frames: Sequence[Frame]) -> None:
        self._pictures += 1
        following = self.step.feed(frames)
        if isinstance(following, Result):
            self.result = following
            return
        self.step = following
        hint = self.step.status.hint
        if not self.hints or self.hints[-1] != hint:
            self.hints.append(hint)

    def until(self, name: str, act: Callable[[], None], patience_s: float = 60.0) -> None:
        while self.step.status.step != name:
            assert self.now_s < patience_s, self.hints[-5:]
            act()

    def to_the_end(self, act: Callable[[], None], patience_s: float = 60.0) -> Done:
        until_s = self.now_s + patience_s
        while self.result is None:
            assert self.now_s < until_s, self.hints[-5:]
            act()
        assert isinstance(self.result, Done)
        return self.result

    def to_the_taps(self) -> None:
        self.until("taps", self.see)

    def begin_with_taps(self) -> None:
        """Go on as if the cameras had been checked and the empty surface learned."""
        self._pictures += 100
        step = TapTargets(self._plan, empty_surface(self._simulated), ()).next_step()
        assert not isinstance(step, Result)
        self.step = step

    def tap(self, off_mm: tuple[float, float] = (0.0, 0.0), for_s: float = 0.4) -> None:
        """Tap beside the marked place by so much, and lift."""
        assert self.step.status.target_mm is not None
        x_mm, y_mm = np.add(self.step.status.target_mm, off_mm).tolist()
        self.see(Finger(x_mm, y_mm), for_s=for_s)
        self.see(for_s=0.14)

    def scribble(self) -> None:
        self.see(Finger(*place_on_rows(SURFACE_MM, 800.0 * self.now_s)))

    def errors_mm(self) -> np.ndarray:
        """How far off fresh fingers are located."""
        assert isinstance(self.result, Done)
        watch = FingerWatch(self.result.empty.finders, self.result.fitted.models)
        errors = []
        for x_mm, y_mm in np.random.default_rng(7).uniform([20, 20], [330, 380], (60, 2)):
            self._pictures += 1
            frames = self._simulated.frame_set(self._pictures, 0.0, [Finger(x_mm, y_mm)])
            place = watch.look(frames).place_mm
            assert place is not None
            errors.append(np.hypot(*(place - (x_mm, y_mm))))
        return np.array(errors)


def test_a_careful_person_calibrates_in_a_minute(simulated: SimulatedRig, store: TapStore) -> None:
    session, hand = Session(simulated, store), Hand()
    person = Person(hand, SURFACE_MM, 1)

    def act() -> None:
        status = session.step.status
        if status.step == "taps":
            person.tap(status.target_mm, session.now_s)
        elif status.step == "scribble":
            person.scribble(session.now_s)
        else:
            person.rest()
        session.see(*(timed.finger for timed in hand.fingers_at(session.now_s)))

    done = session.to_the_end(act)
    assert session.now_s < 30.0
    errors = session.errors_mm()
    assert np.sqrt(np.mean(errors**2)) < 0.35
    assert np.percentile(errors, 95) < 0.7

    watch = FingerWatch(done.empty.finders, done.fitted.models)
    calibration = make_calibration("auto", done.given, done.fitted, Stamp("", ""))
    session.step, session.result = Validation(watch, calibration, Settings()), None
    while session.result is None:
        session.tap()
    assert isinstance(session.result, Validated)
    assert len(session.result.places) == 5
    assert session.result.worst_mm < 1.0


def test_one_who_misses_taps_too_fast_and_pauses_is_told(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    session.tap(off_mm=(140.0, 120.0))
    assert "mm off: tap the marked place" in session.step.status.hint
    assert session.step.status.number == 1
    session.tap(for_s=0.1)
    session.tap(for_s=0.1)
    assert session.step.status.hint == "too short: hold still a moment longer"
    session.tap()
    assert session.step.status.number == 2
    session.see(for_s=3.0)
    assert session.step.status.number == 2
    session.see(Finger(100.0, 100.0), Finger(250.0, 200.0), for_s=1.0)
    assert session.step.status.hint == "only one finger, please"
    assert session.step.status.number == 2


def test_a_tap_beside_its_place_is_repeated_alone(simulated: SimulatedRig, store: TapStore) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    for number in range(16):
        session.tap(off_mm=(15.0, -10.0) if number == 6 else (0.0, 0.0))
    assert session.step.status.number == 7
    assert len(session.step.status.tapped_mm) == 15
    assert session.step.status.hint == "1 tap was beside the marked place: tap again"
    session.tap()
    assert session.step.status.step == "scribble"


def test_taps_outlive_an_interruption(simulated: SimulatedRig, store: TapStore) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    for _ in range(5):
        session.tap()
    again = Session(simulated, store)
    again.begin_with_taps()
    assert again.step.status.number == 6
    assert "5 taps are kept from before" in again.step.status.hint
    for _ in range(11):
        again.tap()
    again.to_the_end(again.scribble)
    assert np.percentile(again.errors_mm(), 95) < 0.5


def test_a_hand_before_the_strip_is_not_learned(simulated: SimulatedRig, store: TapStore) -> None:
    session = Session(simulated, store)
    session.until("empty", session.see)
    for step in range(100):
        session.see(Finger(50.0 + 2.0 * step, 200.0))
    assert session.step.status.hint == "something moved: hands off the surface"
    session.to_the_taps()


def test_a_dark_camera_is_told_and_waited_for(simulated: SimulatedRig, store: TapStore) -> None:
    session = Session(simulated, store)
    for index in range(20):
        c1, c2, c3, c4 = simulated.frame_set(index, index * PERIOD_S, ())
        dark = Frame("C2", index, c2.captured_at_s, 15, np.zeros_like(c2.pixels))
        session.feed((c1, dark, c3, c4))
    assert session.step.status.hint == "see to C2"
    (told,) = [check for check in session.step.status.checks if check.camera == "C2"]
    assert told.verdict == "bad"
    session.to_the_taps()


def test_taps_that_fit_nothing_are_all_asked_for_again(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    rng = np.random.default_rng(2)
    for _ in range(30):
        session.tap(off_mm=tuple(rng.uniform(-20.0, 20.0, 2)))
        if session.step.status.hint.startswith("all taps are needed again"):
            break
    assert session.step.status.hint.startswith("all taps are needed again")
    assert session.step.status.number == 1
    assert session.step.status.tapped_mm == ()
    assert isinstance(session.step, TapTargets)


def test_four_taps_and_a_scribble_will_do(simulated: SimulatedRig, store: TapStore) -> None:
    session = Session(simulated, store, side=2)
    session.begin_with_taps()
    for _ in range(4):
        session.tap()
    session.to_the_end(session.scribble)
    assert np.sqrt(np.mean(session.errors_mm() ** 2)) < 0.8


def test_an_error_that_tapping_cannot_mend_leaves_the_taps(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store, side=2, method="vanishing-point")
    session.begin_with_taps()
    for _ in range(3):
        session.tap()
    with pytest.raises(CalibrationError, match="5 are needed"):
        session.tap()
    assert len(store.load(session.targets)) == 4


def test_taps_that_a_scribble_contradicts_are_asked_for_again(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store, side=3)
    session.begin_with_taps()
    rng = np.random.default_rng(4)
    while session.step.status.step != "scribble":
        session.tap(off_mm=tuple(rng.uniform(-25.0, 25.0, 2)))
    session.until("taps", session.scribble)
    assert session.step.status.hint.startswith("all taps are needed again")
    assert store.load(session.targets) == {}


def test_a_scribble_that_two_cameras_see_does_not_count(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    for _ in range(16):
        session.tap()
    before = session.step.status.progress  # the last tap may be held a moment longer
    empty = simulated.frame_set(10_000, 0.0, ())
    for step in range(200):
        finger = Finger(*place_on_rows(SURFACE_MM, 16.0 * step))
        seen = simulated.frame_set(20_000 + step, session.now_s, [finger])
        session.feed((*seen[:2], *empty[2:]))
        if step == 100:
            assert session.step.status.finger_mm is not None
    assert session.step.status.progress == before


def test_one_picture_without_the_finger_is_no_lift(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    x_mm, y_mm = session.targets[0].tolist()
    session.see(Finger(x_mm, y_mm), for_s=0.4)
    assert session.step.status.number == 2
    session.see(for_s=PERIOD_S)
    session.see(Finger(x_mm, y_mm), for_s=0.6)
    assert session.step.status.number == 2
    assert session.step.status.hint == "lift the finger"


def test_without_taps_the_cameras_are_taken_to_be_in_their_corners(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store, side=0)
    session.until("scribble", session.see)
    done = session.to_the_end(session.scribble)
    assert 3.0 < done.fitted.expected.rms_mm < 8.0
    assert np.sqrt(np.mean(session.errors_mm() ** 2)) < 8.0


def test_a_place_that_is_hidden_three_times_is_left_out(
    simulated: SimulatedRig, store: TapStore
) -> None:
    session = Session(simulated, store)
    session.begin_with_taps()
    x_mm, y_mm = session.targets[0].tolist()
    empty = simulated.frame_set(10_000, 0.0, ())
    for attempt in range(3):
        for picture in range(30):
            index = 20_000 + 100 * attempt + picture
            fingers = [Finger(x_mm, y_mm)] if picture < 20 else []
            seen = simulated.frame_set(index, session.now_s, fingers)
            session.feed((*seen[:2], *empty[2:]))
    assert session.step.status.number == 2
    assert "place 1 is hidden" in session.step.status.hint
    for _ in range(15):
        session.tap()
    assert session.step.status.step == "scribble"
