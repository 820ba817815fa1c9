"""Four taps on the corners of a picture, on the simulated rig: where the display lies."""

from collections.abc import Sequence

import numpy as np
import pytest

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.display import fit_display
from cornertouchd.calibration.gathering import Taps, gather_touches
from cornertouchd.calibration.methods import Stamp, calibrate
from cornertouchd.config import DestinationSettings, VisionSettings
from cornertouchd.guiding.display_taps import DisplayTaps, TappedCorners, watch_with
from cornertouchd.guiding.finger_watch import FingerWatch
from cornertouchd.guiding.status import Result, Step
from cornertouchd.guiding.tapping import LIFTED_S
from cornertouchd.runtime.displays import display_mapping
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

SURFACE_MM = (350.0, 400.0)
PERIOD_S = 0.04
EMPTY_SETS = 8
LEFT, TOP, WIDTH, HEIGHT = 20.0, 60.0, 300.0, 250.0
CORNERS = (
    (LEFT, TOP),
    (LEFT + WIDTH, TOP),
    (LEFT + WIDTH, TOP + HEIGHT),
    (LEFT, TOP + HEIGHT),
)
"""Clockwise on the surface, from its top left."""


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig(SURFACE_MM, seed=4)


@pytest.fixture(scope="module")
def calibration(rig: SimulatedRig) -> Calibration:
    """From 25 exact taps: enough for half a millimetre, and ten times faster than a scribble."""
    x_mm, y_mm = np.linspace(10.0, 340.0, 5), np.linspace(10.0, 390.0, 5)
    places = np.stack(np.meshgrid(x_mm, y_mm), axis=-1).reshape(-1, 2)
    given = gather_touches(
        SURFACE_MM,
        rig.formats,
        (rig.frame_set(index, 0.0, ()) for index in range(EMPTY_SETS)),
        Taps(
            (
                rig.frame_set(EMPTY_SETS + index, 0.0, [Finger(x, y, 8.0)])
                for index, (x, y) in enumerate(places.tolist())
            ),
            places,
            np.full(len(places), 8.0),
        ),
        (),
        VisionSettings(),
    )
    return calibrate("auto", given, 0.1, Stamp("2026-01-01T00:00:00+00:00", "0"))


@pytest.fixture(scope="module")
def watch(calibration: Calibration) -> FingerWatch:
    return watch_with(calibration, ("C1", "C2", "C3", "C4"), VisionSettings())


class Session:
    """The step, and one who taps."""

    def __init__(self, rig: SimulatedRig, watch: FingerWatch) -> None:
        self.step: Step = DisplayTaps(watch)
        self.result: Result | None = None
        self._rig = rig
        self._pictures = 0

    @property
    def hint(self) -> str:
        return self.step.status.hint

    def see(self, *fingers: Finger, for_s: float) -> None:
        for _ in range(round(for_s / PERIOD_S)):
            self._pictures += 1
            now_s = self._pictures * PERIOD_S
            following = self.step.feed(self._rig.frame_set(self._pictures, now_s, fingers))
            if isinstance(following, Result):
                self.result = following
                return
            self.step = following

    def tap(self, place_mm: tuple[float, float]) -> None:
        self.see(Finger(*place_mm), for_s=0.4)
        self.see(for_s=LIFTED_S + 2 * PERIOD_S)

    def tap_all(self, places_mm: Sequence[tuple[float, float]]) -> TappedCorners:
        for place_mm in places_mm:
            self.tap(place_mm)
        assert isinstance(self.result, TappedCorners)
        return self.result


@pytest.fixture
def session(rig: SimulatedRig, watch: FingerWatch) -> Session:
    return Session(rig, watch)


def test_the_corners_are_asked_for_in_order_and_located(session: Session) -> None:
    asked = []
    for place_mm in CORNERS:
        status = session.step.status
        asked.append((status.number, status.of, status.name, status.progress))
        session.tap(place_mm)
    assert asked == [
        (1, 4, "top-left of the picture", 0.0),
        (2, 4, "top-right of the picture", 0.25),
        (3, 4, "bottom-right of the picture", 0.5),
        (4, 4, "bottom-left of the picture", 0.75),
    ]
    assert isinstance(session.result, TappedCorners)
    off_mm = np.linalg.norm(session.result.places_mm - np.array(CORNERS), axis=1)
    assert off_mm.max() < 0.5


@pytest.mark.parametrize(
    ("order", "rotation_deg", "mirror"),
    [
        ((0, 1, 2, 3), 0, False),
        ((1, 2, 3, 0), 90, False),
        ((2, 3, 0, 1), 180, False),
        ((3, 0, 1, 2), 270, False),
        ((1, 0, 3, 2), 0, True),
        ((2, 1, 0, 3), 90, True),
    ],
)
def test_a_turned_or_mirrored_picture_is_recognised(
    session: Session, order: tuple[int, ...], rotation_deg: int, mirror: bool
) -> None:
    """The picture's own corners, in its order, lie elsewhere on the surface then."""
    tapped = session.tap_all([CORNERS[corner] for corner in order])
    place = fit_display(tapped.places_mm, SURFACE_MM, 0.0, "now")
    assert (place.rotation_deg, place.mirror) == (rotation_deg, mirror)
    found = (place.left_mm, place.top_mm, place.width_mm, place.height_mm)
    assert found == pytest.approx((LEFT, TOP, WIDTH, HEIGHT), abs=0.5)
    assert place.residual_mm < 0.5
    mapping = display_mapping(SURFACE_MM, DestinationSettings(), {"": place})
    for corner, wanted in zip(order, ((0, 0), (1, 0), (1, 1), (0, 1)), strict=True):
        assert mapping.to_display(*CORNERS[corner]) == pytest.approx(wanted, abs=0.005)


def test_the_same_corner_twice_is_told_and_not_taken(session: Session) -> None:
    session.tap(CORNERS[0])
    session.tap((LEFT + 5.0, TOP + 5.0))
    assert session.hint == "that corner has been tapped before: tap the next one"
    assert session.step.status.number == 2
    assert len(session.step.status.tapped_mm) == 1
    session.tap(CORNERS[1])
    assert session.step.status.number == 3
    assert "tapped before" not in session.hint


def test_a_finger_that_rests_on_a_corner_is_one_tap(session: Session) -> None:
    session.see(Finger(*CORNERS[0]), for_s=2.0)
    assert session.step.status.number == 2
    assert session.hint == "lift the finger"


def test_two_fingers_and_a_touch_too_short_are_told_and_not_taken(session: Session) -> None:
    session.see(Finger(*CORNERS[0]), Finger(*CORNERS[2]), for_s=0.6)
    assert session.hint == "only one finger, please"
    session.see(for_s=LIFTED_S + 2 * PERIOD_S)
    session.see(Finger(*CORNERS[0]), for_s=0.12)
    session.see(for_s=LIFTED_S + 2 * PERIOD_S)
    assert session.hint == "too short: hold still a moment longer"
    assert session.step.status.number == 1
