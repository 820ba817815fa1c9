"""Profiles: 1 on the empty strip, whatever its ripple and the exposure; less in a shadow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray
from cornertouchd.vision.profile import ProfileSampler
from cornertouchd.vision.strip import Strip

WIDTH, ROWS = 120, 24
RIPPLE = 1 + 0.2 * np.sin(np.arange(WIDTH) / 3)
TOP, SURFACE = np.full(WIDTH, 6.0), np.linspace(15.0, 17.0, WIDTH)
STRIP = Strip(
    TOP, SURFACE, (TOP + SURFACE) / 2, np.arange(WIDTH) < 110, mirrored=True, dark_level=2.0
)


def picture(exposure: float = 1.0, dark_columns: slice = slice(0, 0)) -> FloatArray:
    rows = np.arange(ROWS)[:, None] + 0.5
    lit = (rows > TOP) & (rows < SURFACE)
    light = 150 * RIPPLE * exposure * lit
    light[:, dark_columns] *= 0.04
    return 2 + light


SAMPLER = ProfileSampler(STRIP, picture(), VisionSettings())


def sample(values: FloatArray) -> FloatArray:
    return SAMPLER.sample(np.rint(values).astype(np.uint8)).brightness


def test_the_empty_strip_is_one_everywhere() -> None:
    assert sample(picture()) == pytest.approx(np.ones(WIDTH), abs=0.01)


@given(st.floats(0.92, 1.08))
def test_a_drift_of_the_exposure_is_no_shadow(exposure: float) -> None:
    assert sample(picture(exposure)) == pytest.approx(np.ones(WIDTH), abs=0.02)


def test_a_shadow_is_as_dark_as_the_light_that_is_missing() -> None:
    brightness = sample(picture(dark_columns=slice(40, 50)))
    assert brightness[40:50] == pytest.approx(np.full(10, 0.04), abs=0.02)
    assert brightness[:38] == pytest.approx(np.ones(38), abs=0.01)


def test_columns_that_show_no_strip_are_interpolated() -> None:
    profile = SAMPLER.sample(np.rint(picture(dark_columns=slice(112, 120))).astype(np.uint8))
    assert not profile.known[110:].any()
    assert profile.brightness[110:] == pytest.approx(np.ones(10), abs=0.02)


def test_a_dead_led_whose_columns_are_dark_even_when_empty_is_unknown() -> None:
    sampler = ProfileSampler(STRIP, picture(dark_columns=slice(30, 36)), VisionSettings())
    assert not sampler.known[30:36].any()
    assert sampler.known[:30].all()


def test_a_strip_that_is_dark_altogether_gives_no_false_gain() -> None:
    brightness = sample(picture(dark_columns=slice(0, WIDTH)))
    assert brightness.max() < 0.1


def test_rows_away_from_the_horizon_do_not_count() -> None:
    changed = picture()
    changed[:7] = 255
    changed[15:] = 0
    assert sample(changed) == pytest.approx(sample(picture()), abs=0.01)
