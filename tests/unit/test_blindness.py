"""Columns that go blind are told once, with what to do, and again when they see."""

import numpy as np
import pytest

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.config import Settings
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import FloatArray, Frame, PictureFormat
from cornertouchd.pipeline import CameraPipeline
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.background import LESS_LIGHT, MEND_THE_LED, MaskedColumns
from cornertouchd.vision.blindness import LOOK_EVERY_S, BlindnessWatch

GLARE = MaskedColumns(200, 260, "at full scale", LESS_LIGHT)
DEAD = MaskedColumns(210, 220, "dead LED", MEND_THE_LED)


def look(watch: BlindnessWatch, from_s: float, until_s: float, *masked: MaskedColumns) -> None:
    for at_s in np.arange(from_s, until_s, LOOK_EVERY_S).tolist():
        watch.look(masked, at_s)


def test_what_is_blind_from_the_start_is_known() -> None:
    watch = BlindnessWatch([DEAD])
    known = watch.blind
    assert known == (DEAD,)
    look(watch, 0.0, 60.0, DEAD)
    assert watch.blind is known


def test_it_is_told_when_it_lasts_and_when_it_is_over() -> None:
    watch = BlindnessWatch([])
    look(watch, 0.0, 1.0, GLARE)
    assert watch.blind == ()
    look(watch, 1.0, 3.0, GLARE)
    told = watch.blind
    assert told == (GLARE,)
    look(watch, 3.0, 6.0)  # a hand before it
    look(watch, 6.0, 9.0, GLARE)
    assert watch.blind is told
    look(watch, 9.0, 20.0)
    assert watch.blind == ()


def test_light_that_only_flashes_is_not_told() -> None:
    watch = BlindnessWatch([])
    for at_s in np.arange(0.0, 60.0, LOOK_EVERY_S).tolist():
        watch.look([GLARE] if at_s % 2.0 < 1.0 else [], at_s)
        assert watch.blind == ()


def test_what_creeps_and_breaks_up_is_told_once() -> None:
    watch = BlindnessWatch([])
    told = set()
    for step in range(40):
        crests = [
            MaskedColumns(first, first + 5, GLARE.why, GLARE.remedy)
            for first in range(200 - step, 260, 15)
        ]
        watch.look(crests, step * LOOK_EVERY_S)
        told.add(watch.blind)
    assert len(told) == 2
    (glare,) = watch.blind
    assert glare.last_px >= 255


def test_a_dead_led_in_the_glare_is_another_thing() -> None:
    watch = BlindnessWatch([])
    look(watch, 0.0, 3.0, GLARE, DEAD)
    assert watch.blind == (GLARE, DEAD)
    look(watch, 3.0, 10.0, DEAD)
    assert watch.blind == (DEAD,)


def test_looks_are_due_twice_a_second_and_when_a_recording_begins_anew() -> None:
    watch = BlindnessWatch([])
    assert watch.is_due(5.0)
    watch.look([], 5.0)
    assert not watch.is_due(5.4)
    assert watch.is_due(5.5)
    assert watch.is_due(0.0)


@pytest.fixture
def camera() -> tuple[CameraPipeline, FloatArray]:
    rig = SimulatedRig()
    empty = np.mean([rig.render("C1", index, ()) for index in range(4)], axis=0)
    rows, width = empty.shape
    calibration = CameraCalibration(
        "C1",
        "",
        PictureFormat(width, rows, 0, rows),
        empty,
        AnglePolynomial((0.0, 0.0), (0.8, 0.8), width),
        0.1,
    )
    return CameraPipeline(calibration, Settings()), empty


def test_a_camera_says_what_the_sun_takes_from_it(
    camera: tuple[CameraPipeline, FloatArray],
) -> None:
    pipeline, empty = camera
    assert pipeline.blind_columns == ()
    columns = np.arange(empty.shape[1])
    sun = 1.0 + 3.0 * ((columns > 250) & (columns < 330))
    for light, expected in ((sun, 1), (np.ones_like(sun), 0)):
        for index in range(100):
            at_s = 0.1 * index + (0.0 if expected else 10.0)
            pixels = np.clip(np.rint(empty * light), 0, 255).astype(np.uint8)
            frame = Frame("C1", index, at_s, None, pixels)
            pipeline.observe(frame)
            blind = pipeline.find_blind_columns(frame)
        assert len(blind) == expected
        for one in blind:
            assert one.first_px == pytest.approx(251, abs=3)
            assert one.last_px == pytest.approx(329, abs=3)
            assert str(one).endswith(
                "at full scale, by light from outside; lower the exposure, shade the sun, or let "
                "the LED frame send dark frames"
            )


@pytest.mark.parametrize("share", [1 / 64, 1 / 20])
def test_a_camera_whose_lens_is_covered_says_so(
    camera: tuple[CameraPipeline, FloatArray], share: float
) -> None:
    pipeline, empty = camera
    for index in range(200):
        light = share if index < 100 else 1.0
        pixels = np.rint(empty * light).astype(np.uint8)
        frame = Frame("C1", index, 0.1 * index, None, pixels)
        pipeline.observe(frame)
        blind = pipeline.find_blind_columns(frame)
        if index == 99:
            (covered,) = blind
            assert str(covered).endswith(
                "see little or nothing: all of the strip is dark; uncover the lens, and see "
                "whether the LED frame shines and the exposure is set"
            )
    assert blind == ()


def test_a_hand_before_much_of_the_strip_is_no_cover(
    camera: tuple[CameraPipeline, FloatArray],
) -> None:
    pipeline, empty = camera
    hand = np.ones(empty.shape[1])
    hand[60:480] = 0.05
    for index in range(100):
        frame = Frame("C1", index, 0.1 * index, None, np.rint(empty * hand).astype(np.uint8))
        pipeline.observe(frame)
        assert pipeline.find_blind_columns(frame) == ()
