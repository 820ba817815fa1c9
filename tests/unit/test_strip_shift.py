"""A strip that is no longer on its rows is told: a camera that moved shows there first."""

import numpy as np
import pytest
from scipy.ndimage import shift as moved

from cornertouchd.model import FloatArray, Picture
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.strip import find_strip
from cornertouchd.vision.strip_shift import LOOKS, StripShift, StripShiftWatch

RIG = SimulatedRig()
CAMERA = "C3"
EMPTY = RIG.light(CAMERA).astype(np.float64)
TOUCHED = RIG.light(CAMERA, [Finger(100.0, 200.0), Finger(250.0, 60.0)]).astype(np.float64)


def expose(light: FloatArray, index: int = 0) -> Picture:
    return RIG.expose(CAMERA, index, light.astype(np.float32))


def lower(light: FloatArray, rows: float) -> FloatArray:
    return np.asarray(moved(light, (rows, 0.0), order=1))


def tilted(light: FloatArray, at_border: float) -> FloatArray:
    """Move each column by its own share of a row."""
    w = 2.0 * (np.arange(light.shape[1]) + 0.5) / light.shape[1] - 1.0
    rows = np.arange(light.shape[0])
    columns = [np.interp(rows - at_border * w[u], rows, light[:, u]) for u in range(len(w))]
    return np.array(columns).T


@pytest.fixture
def watch() -> StripShiftWatch:
    empty = np.mean([expose(EMPTY, index) for index in range(8)], axis=0)
    return StripShiftWatch(find_strip(empty), empty)


def look(
    watch: StripShiftWatch, light: FloatArray, from_s: float, looks: int = LOOKS
) -> StripShift | None:
    for index in range(looks):
        watch.look(expose(light, 10 + index), from_s + index)
    return watch.shift


@pytest.mark.parametrize("light", [EMPTY, TOUCHED, 0.7 * TOUCHED, lower(TOUCHED, 0.4)])
def test_a_camera_that_stands_still_is_left_in_peace(
    watch: StripShiftWatch, light: FloatArray
) -> None:
    assert look(watch, light, 0.0) is None


@pytest.mark.parametrize("rows", [-3.0, -1.0, 1.8, 4.0])
def test_a_strip_that_is_lower_or_higher_is_told(watch: StripShiftWatch, rows: float) -> None:
    shift = look(watch, lower(TOUCHED, rows), 0.0)
    assert shift is not None
    assert shift.lower_px == pytest.approx(rows, abs=0.1)
    assert abs(shift.tilt_px) < 0.1


def test_a_camera_that_was_rolled_is_told(watch: StripShiftWatch) -> None:
    shift = look(watch, tilted(TOUCHED, -1.5), 0.0)
    assert shift is not None
    assert shift.tilt_px == pytest.approx(-1.5, abs=0.15)
    assert "1.5 px higher at the right border" in str(shift)


def test_it_says_what_to_do() -> None:
    assert str(StripShift(1.83, 0.1)) == (
        "the strip is 1.8 px lower than calibrated: the camera was moved; "
        "run `cornertouchd calibrate`"
    )


def test_one_look_is_not_believed(watch: StripShiftWatch) -> None:
    assert look(watch, lower(EMPTY, 3.0), 0.0, LOOKS - 1) is None
    assert look(watch, EMPTY, 10.0) is None


def test_it_stays_the_same_until_it_changes(watch: StripShiftWatch) -> None:
    first = look(watch, lower(EMPTY, 2.0), 0.0)
    assert look(watch, lower(EMPTY, 2.2), 10.0) is first
    second = look(watch, lower(EMPTY, 4.0), 20.0)
    assert second is not first
    assert second is not None
    assert look(watch, EMPTY, 30.0) is None


def test_a_look_a_second_is_enough(watch: StripShiftWatch) -> None:
    for index in range(50):
        watch.look(expose(lower(EMPTY, 3.0)), index * 0.01)
    assert watch.shift is None


@pytest.mark.parametrize("grey", [0, 120, 255])
def test_pictures_without_a_strip_tell_nothing(watch: StripShiftWatch, grey: int) -> None:
    for index in range(2 * LOOKS):
        watch.look(np.full(EMPTY.shape, grey, np.uint8), float(index))
    assert watch.shift is None


def test_noise_tells_nothing(watch: StripShiftWatch) -> None:
    rng = np.random.default_rng(1)
    for index in range(2 * LOOKS):
        watch.look(rng.integers(0, 256, EMPTY.shape, np.uint8), float(index))
    assert watch.shift is None
