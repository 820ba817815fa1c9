"""Touches tell when a camera has moved, which one and how far; and say nothing when none has."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import atan2, hypot

import numpy as np
import pytest

from cornertouchd.calibration.calibration import Calibration, CameraCalibration, Method
from cornertouchd.calibration.drift import Drift, DriftWatch
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import Contact, FrameSet, Observation, PictureFormat, Shadow, Shadows, Touch

SURFACE_MM = (350.0, 400.0)
WIDTH_PX = 640
HALF_FIELD_RAD = np.deg2rad(48.0)
CORNERS_MM = {"C1": (0, 0), "C2": (350, 0), "C3": (350, 400), "C4": (0, 400)}
BISECTORS_RAD = {"C1": np.pi / 4, "C2": 3 * np.pi / 4, "C3": 5 * np.pi / 4, "C4": 7 * np.pi / 4}
NOISE_PX = 0.1
CAMERAS_OF_SLEEVES = ("C1", "C2", "C3", "C4")


@dataclass(frozen=True)
class Moved:
    """How a camera stands now, against how it was calibrated."""

    x_mm: float = 0.0
    y_mm: float = 0.0
    turned_rad: float = 0.0


class Bench:
    """A watch on an ideal rig, and the touches that it is shown."""

    def __init__(
        self,
        cameras: tuple[str, ...] = ("C1", "C2", "C3", "C4"),
        expected_mm: float = 0.3,
        residual_mm: float = 0.1,
        method: Method = "auto",
    ) -> None:
        size = PictureFormat(WIDTH_PX, 480, 200, 64)
        calibrated = tuple(
            CameraCalibration(
                camera,
                "",
                size,
                np.zeros((1, 1)),
                AnglePolynomial(
                    CORNERS_MM[camera], (BISECTORS_RAD[camera], HALF_FIELD_RAD), WIDTH_PX
                ),
                0.1,
            )
            for camera in cameras
        )
        expected = ErrorMap(np.array([175.0]), np.array([200.0]), np.array([[expected_mm]]))
        self.watch = DriftWatch(
            Calibration(method, "", "", SURFACE_MM, 16, 0, 0, residual_mm, expected, calibrated)
        )
        self.cameras = cameras
        self.moved: dict[str, Moved] = {}
        self.random = np.random.default_rng(7)
        self.touches = 0

    def shadow(self, camera: str, x_mm: float, y_mm: float, radius_mm: float = 5.0) -> Shadow:
        now = self.moved.get(camera, Moved())
        dx = x_mm - CORNERS_MM[camera][0] - now.x_mm
        dy = y_mm - CORNERS_MM[camera][1] - now.y_mm
        seen_rad = (atan2(dy, dx) - now.turned_rad - BISECTORS_RAD[camera] + np.pi) % (
            2 * np.pi
        ) - np.pi
        half_rad = np.arcsin(radius_mm / hypot(dx, dy))
        columns = (np.array([seen_rad - half_rad, seen_rad + half_rad]) / HALF_FIELD_RAD + 1) * (
            WIDTH_PX / 2
        ) + self.random.normal(0.0, NOISE_PX, 2)
        return Shadow(*columns.tolist(), True, True, 0.9)

    def touch(
        self,
        x_mm: float,
        y_mm: float,
        touch_id: int | None = None,
        *,
        others: tuple[Shadow, ...] = (),
        speed_mm_s: float = 0.0,
        late_s: float = 0.0,
    ) -> None:
        self.touches += 1
        at_s = 0.1 * self.touches
        seen = tuple(
            Observation(
                camera,
                self.touches,
                at_s + late_s * (camera == "C3"),
                Shadows.of([self.shadow(camera, x_mm, y_mm), *others]),
            )
            for camera in self.cameras
        )
        contact = Contact(x_mm, y_mm, 10.0, self.cameras, 1.0, 0.1)
        number = self.touches if touch_id is None else touch_id
        self.watch.follow(
            FrameSet(at_s, seen), (contact,), (Touch(number, x_mm, y_mm, speed_mm_s, 0.0, 0.1),)
        )

    def places(self, count: int) -> Iterator[tuple[float, float]]:
        for _ in range(count):
            x, y = self.random.uniform((20, 20), (330, 380))
            yield float(x), float(y)

    def tap_all_over(self, count: int) -> Drift | None:
        for place in self.places(count):
            self.touch(*place)
        return self.watch.drift


def test_a_rig_that_stands_still_is_never_accused() -> None:
    bench = Bench()
    for place in bench.places(1000):
        bench.touch(*place)
        assert bench.watch.drift is None


@pytest.mark.parametrize("camera", ["C1", "C2", "C3", "C4"])
@pytest.mark.parametrize(
    "moved", [Moved(0.5, -0.6), Moved(2.0, 0.0), Moved(turned_rad=np.deg2rad(0.3))], ids=str
)
def test_the_camera_that_moved_is_named_with_how_far(camera: str, moved: Moved) -> None:
    across = Moved(moved.x_mm, moved.y_mm if camera in {"C1", "C3"} else -moved.y_mm)
    bench = Bench()
    bench.moved[camera] = across if moved.x_mm else moved
    drift = bench.tap_all_over(100)
    assert drift is not None
    assert drift.camera == camera
    assert drift.moved_mm == pytest.approx(hypot(moved.x_mm, moved.y_mm), abs=0.12)
    assert drift.turned_rad == pytest.approx(moved.turned_rad, abs=np.deg2rad(0.03))


@pytest.mark.parametrize(
    ("drift", "told"),
    [
        (Drift("C3", 0.6, 0.8, 0.0001, 0.02), "camera C3 has moved about 0.8 mm; recalibrate"),
        (
            Drift("C3", 1.6, 0.1, -0.00524, 1.5),
            "camera C3 has turned by about 0.30 degrees; recalibrate",
        ),
        (
            Drift("C3", 1.6, 0.8, -0.00524, 1.5),
            "camera C3 has moved about 0.8 mm and turned by about 0.30 degrees; recalibrate",
        ),
        (
            Drift(None, 0.7, 0.0, 0.0, 0.0),
            "cameras have moved, their lines are off by 0.7 mm; recalibrate",
        ),
    ],
)
def test_it_is_told_in_plain_words(drift: Drift, told: str) -> None:
    assert str(drift) == told


def test_a_camera_that_moves_during_the_day_is_told_after_a_hundred_touches_at_most() -> None:
    bench = Bench()
    assert bench.tap_all_over(300) is None
    bench.moved["C3"] = Moved(0.6, -0.6)
    found = [bench.tap_all_over(1) for _ in range(100)]
    assert {drift.camera for drift in found if drift} == {"C3"}
    assert found[-1] is not None


def test_it_is_the_same_drift_until_something_changes_and_is_over_when_it_is_mended() -> None:
    bench = Bench()
    bench.moved["C2"] = Moved(0.8, 0.8)
    drift = bench.tap_all_over(150)
    assert drift is not None
    assert bench.tap_all_over(100) is drift
    bench.moved.clear()
    assert bench.tap_all_over(150) is None


def test_three_cameras_tell_that_something_moved_but_not_what() -> None:
    bench = Bench(("C1", "C2", "C4"))
    bench.moved["C2"] = Moved(1.0, 1.0)
    drift = bench.tap_all_over(200)
    assert drift is not None
    assert drift.camera is None
    assert str(drift).startswith("cameras have moved, their lines are off by ")


def test_two_cameras_that_moved_are_not_blamed_on_one() -> None:
    bench = Bench()
    bench.moved = {"C1": Moved(1.0, -1.0), "C2": Moved(1.0, 1.0)}
    drift = bench.tap_all_over(200)
    assert drift is not None
    assert drift.camera is None


def test_two_cameras_have_nothing_to_compare() -> None:
    bench = Bench(("C1", "C2"))
    bench.moved["C2"] = Moved(5.0, 5.0)
    assert bench.tap_all_over(200) is None


def test_shadows_that_are_there_all_the_time_are_no_hindrance() -> None:
    """A camera that has turned sees the barrels of the others where none used to be."""
    bench = Bench()
    bench.moved["C4"] = Moved(0.8, 0.8)
    stain = Shadow(2.0, 9.0, True, True, 0.5)
    for place in bench.places(200):
        bench.touch(*place, others=(stain,))
    assert bench.watch.drift is not None
    assert bench.watch.drift.camera == "C4"


def test_a_button_that_is_pressed_all_day_decides_nothing() -> None:
    bench = Bench()
    bench.moved["C3"] = Moved(2.0, -2.0)
    for _ in range(500):
        bench.touch(100.0, 120.0)
    assert bench.watch.drift is None


def test_a_finger_that_rests_decides_nothing() -> None:
    bench = Bench()
    bench.moved["C3"] = Moved(2.0, -2.0)
    for place in bench.places(25):
        for _ in range(20):
            bench.touch(*place, touch_id=int(place[0]))
    assert bench.watch.drift is None


def test_pictures_taken_one_after_the_other_while_a_finger_flies_decide_nothing() -> None:
    bench = Bench()
    bench.moved["C3"] = Moved(2.0, -2.0)
    for place in bench.places(200):
        bench.touch(*place, speed_mm_s=500.0, late_s=0.004)
    assert bench.watch.drift is None


def test_several_touches_at_a_time_decide_nothing() -> None:
    bench = Bench()
    seen = tuple(
        Observation(camera, 0, 1.0, Shadows.of([bench.shadow(camera, 100, 100)]))
        for camera in bench.cameras
    )
    contacts = tuple(Contact(x, 100.0, 10.0, bench.cameras, 1.0, 0.1) for x in (100.0, 200.0))
    touches = tuple(Touch(n, 100.0 * n, 100.0, 0.0, 0.0, 0.1) for n in (1, 2))
    for _ in range(100):
        bench.watch.follow(FrameSet(1.0, seen), contacts, touches)
    assert bench.watch.drift is None


def test_a_fifth_of_the_touches_may_be_quite_wrong() -> None:
    """A sleeve before one camera moves the middle of the shadow there."""
    bench = Bench()
    for number, place in enumerate(bench.places(300)):
        sleeve = number % 7 == 0
        bench.moved = {CAMERAS_OF_SLEEVES[number % 4]: Moved(4.0, 4.0)} if sleeve else {}
        bench.touch(*place)
        assert bench.watch.drift is None


def test_a_sleeve_now_and_then_does_not_hide_the_camera_that_moved() -> None:
    bench = Bench()
    for number, place in enumerate(bench.places(200)):
        bench.moved = {"C3": Moved(0.8, -0.8)}
        if number % 7 == 0:
            bench.moved[CAMERAS_OF_SLEEVES[number % 4]] = Moved(4.0, 4.0)
        bench.touch(*place)
    assert bench.watch.drift is not None
    assert bench.watch.drift.camera == "C3"


@pytest.mark.parametrize(("expected_mm", "told"), [(0.3, True), (1.5, False), (np.nan, True)])
def test_what_the_calibration_leads_to_expect_is_no_drift(expected_mm: float, told: bool) -> None:
    bench = Bench(expected_mm=expected_mm)
    bench.moved["C3"] = Moved(0.8, -0.8)
    assert (bench.tap_all_over(200) is not None) == told


@pytest.mark.parametrize(("residual_mm", "told"), [(0.9, True), (1.1, False), (np.nan, False)])
def test_a_calibration_that_does_not_fit_itself_cannot_tell(residual_mm: float, told: bool) -> None:
    bench = Bench(residual_mm=residual_mm, method="vanishing-point")
    bench.moved["C3"] = Moved(2.0, -2.0)
    assert (bench.tap_all_over(200) is not None) == told
