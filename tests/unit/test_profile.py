"""Profiles: 1 on the empty strip, whatever its ripple and the exposure; less in a shadow."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle.profile import measure_profile, most_frequent

from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray, Picture
from cornertouchd.vision.profile import ProfileSampler
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import Strip

WIDTH, ROWS = 120, 24
RIPPLE = 1 + 0.2 * np.sin(np.arange(WIDTH) / 3)
TOP, SURFACE = np.full(WIDTH, 6.0), np.linspace(15.0, 17.0, WIDTH)
STRIP = Strip(
    TOP,
    SURFACE,
    SURFACE,
    (TOP + SURFACE) / 2,
    np.arange(WIDTH) < 110,
    mirrored=True,
    dark_level=2.0,
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


@given(st.floats(0.35, 1.4))
def test_a_drift_of_the_exposure_is_no_shadow(exposure: float) -> None:
    assert sample(picture(exposure)) == pytest.approx(np.ones(WIDTH), abs=0.03)


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


def expose(light: FloatArray) -> Picture:
    return np.rint(light).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("exposure", [0.35, 0.7, 1.0, 1.3])
def test_half_of_the_strip_under_a_palm_takes_no_gain_along(exposure: float) -> None:
    brightness = sample(picture(exposure, dark_columns=slice(20, 85)))
    assert brightness[90:110] == pytest.approx(np.ones(20), abs=0.03)
    assert brightness[30:80].max() < 0.1


def test_a_brighter_half_is_not_taken_for_the_gain() -> None:
    sunny = picture()
    sunny[:, 60:] = 2 + 1.25 * (sunny[:, 60:] - 2)
    brightness = sample(sunny)
    assert brightness[:55] == pytest.approx(np.ones(55), abs=0.02)
    assert brightness[65:110] == pytest.approx(np.full(45, 1.25), abs=0.02)


def test_a_column_at_full_scale_is_unknown_unless_it_is_so_without_touch() -> None:
    flash = picture()
    flash[:, 50:56] = 255
    profile = SAMPLER.sample(expose(flash))
    assert not profile.known[50:56].any()
    assert profile.known[:50].all()
    assert profile.known[56:110].all()
    assert profile.brightness[50:56] == pytest.approx(np.ones(6), abs=0.02)
    assert ProfileSampler(STRIP, flash, VisionSettings()).sample(expose(flash)).known[:110].all()


def test_sun_that_shines_in_is_reckoned_with_at_once() -> None:
    flash = picture()
    flash[:, 50:56] = 255
    for light, sunlit in ((picture(), False), (flash, True)):
        measured = SAMPLER.measure(expose(light), SAMPLER.reference)
        assert measured.sunlit == sunlit
    dazzled = ProfileSampler(STRIP, flash, VisionSettings())
    measured = dazzled.measure(expose(picture()), dazzled.reference)
    assert measured.sunlit


def test_pictures_that_may_not_be_written_or_lie_apart_are_measured_as_well() -> None:
    whole = expose(picture(dark_columns=slice(40, 50)))
    frozen = whole.copy()
    frozen.flags.writeable = False
    apart = np.repeat(whole, 2, axis=1)[:, ::2]
    assert not apart.flags.c_contiguous
    expected = SAMPLER.sample(whole).brightness.tolist()
    assert SAMPLER.sample(frozen).brightness.tolist() == expected
    assert SAMPLER.sample(apart).brightness.tolist() == expected


def test_where_the_strip_rises_and_falls_each_column_is_measured_in_its_own_rows() -> None:
    bend = 3.0 * np.sin(np.arange(WIDTH) / 4) + np.where(np.arange(WIDTH) % 3 == 0, 1.0, 0.0)
    bent = Strip(
        TOP + 2.0 + bend,
        SURFACE + 2.0 + bend,
        SURFACE + 2.0 + bend,
        STRIP.horizon_px + 2.0 + bend,
        STRIP.visible,
        mirrored=True,
        dark_level=2.0,
    )
    noise = np.random.default_rng(1).uniform(0.0, 255.0, (ROWS, WIDTH))
    sampler = ProfileSampler(bent, noise, VisionSettings())
    assert len(np.unique(sampler.taps.first_rows)) > 4
    taken = expose(noise)
    measured = sampler.measure(taken, sampler.reference)
    np.testing.assert_allclose(measured.light, sampler.taps.light(taken), rtol=1e-12)
    np.testing.assert_array_equal(measured.peak, sampler.taps.peak(taken))


def test_a_reference_tells_what_follows_from_its_light() -> None:
    light = np.array([100.0, 0.5, 20.0, 240.0, 230.0, 90.0])
    peak = np.array([120.0, 3.0, 25.0, 255.0, 240.0, 110.0])
    least = np.array([24.0, 24.0, 24.0, 24.0, 24.0, np.inf])
    told = Reference.of(np.zeros(6), light, peak, least, saturated_grey=250.0)
    assert told.on_strip.tolist() == [True, True, True, True, True, False]
    assert told.usable.tolist() == [True, False, False, True, True, False]
    assert told.clipped.tolist() == [False, False, False, True, True, False]
    assert told.scale.tolist() == [1 / 100, 1.0, 1 / 20, 1 / 240, 1 / 230, 1 / 90]
    assert told.sunlit
    assert not Reference.of(np.zeros(6), light, 0.5 * peak, least, saturated_grey=250.0).sunlit


@given(
    exposure=st.floats(0.1, 4.0),
    shadows=st.lists(st.tuples(st.integers(0, WIDTH), st.integers(1, 70)), max_size=4),
    flash=st.tuples(st.integers(0, WIDTH), st.integers(0, 60)),
    noise=st.floats(0.0, 40.0),
    gain_before=st.floats(0.3, 3.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_compiled_and_readable_ways_agree(
    exposure: float,
    shadows: list[tuple[int, int]],
    flash: tuple[int, int],
    noise: float,
    gain_before: float,
    seed: int,
) -> None:
    light = picture(exposure)
    for start, length in shadows:
        light[:, start : start + length] *= 0.05
    light[:, flash[0] : flash[0] + flash[1]] *= 5
    light += noise * np.random.default_rng(seed).standard_normal(light.shape)
    taken, saturated = expose(light), VisionSettings().saturated_grey
    measured = SAMPLER.measure(taken, SAMPLER.reference, gain_before)
    profile, gain = measure_profile(taken, SAMPLER.taps, SAMPLER.reference, saturated, gain_before)
    assert measured.gain == pytest.approx(gain, abs=1e-12)
    np.testing.assert_array_equal(measured.profile.known, profile.known)
    np.testing.assert_allclose(
        measured.profile.brightness, profile.brightness, rtol=1e-12, atol=1e-12
    )


def test_a_gain_is_kept_while_enough_columns_have_it() -> None:
    before, new = np.full(40, 1.0), np.full(100, 1.5)
    assert most_frequent(np.concatenate([before, new]), 1.0) == pytest.approx(1.0)
    assert most_frequent(np.concatenate([before, new]), 1.5) == pytest.approx(1.5)
    assert most_frequent(np.concatenate([before[:30], new]), 1.0) == pytest.approx(1.5)
