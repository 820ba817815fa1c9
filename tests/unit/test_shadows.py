"""Shadows in profiles made by formula, whose edges are known exactly."""

from math import sqrt

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from oracle import shadows as oracle
from scipy.special import erf

from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray, Profile, Shadows
from cornertouchd.vision.shadows import HIDING_PX, find_shadows

SETTINGS = VisionSettings()
WIDTH = 200
EVERYWHERE = np.ones(WIDTH, bool)


def shade(brightness: FloatArray, left_px: float, right_px: float) -> FloatArray:
    """Lay a shadow with blurred edges over a profile, as a lens and pixels of width 1 do."""
    columns = np.arange(len(brightness)) + 0.5
    blur = sqrt(2 * (SETTINGS.edge_blur_px**2 + 1 / 12))
    covered = (erf((columns - left_px) / blur) - erf((columns - right_px) / blur)) / 2
    return brightness * (1 - (1 - SETTINGS.dark_share) * covered)


def profile(*shadows: tuple[float, float], unknown: slice = slice(0, 0)) -> Profile:
    brightness = np.ones(WIDTH)
    for left, right in shadows:
        brightness = shade(brightness, left, right)
    known = np.ones(WIDTH, bool)
    known[unknown] = False
    return Profile(brightness, known)


def test_an_empty_strip_has_no_shadow() -> None:
    assert len(find_shadows(profile(), SETTINGS)) == 0


@given(left=st.floats(20, 150), width=st.floats(1.5, 30))
def test_edges_are_found_to_a_twentieth_of_a_column(left: float, width: float) -> None:
    (shadow,) = find_shadows(profile((left, left + width)), SETTINGS)
    assert shadow.left_px == pytest.approx(left, abs=0.05)
    assert shadow.right_px == pytest.approx(left + width, abs=0.05)
    assert shadow.left_valid
    assert shadow.right_valid


@given(left=st.floats(20, 150), width=st.floats(2, 30), seed=st.integers(0, 2**32 - 1))
def test_noise_of_one_percent_moves_edges_by_less_than_a_quarter_column(
    left: float, width: float, seed: int
) -> None:
    clean = profile((left, left + width))
    noise = 0.01 * np.random.default_rng(seed).standard_normal(WIDTH).clip(-3, 3)
    (shadow,) = find_shadows(Profile(clean.brightness + noise, clean.known), SETTINGS)
    assert shadow.left_px == pytest.approx(left, abs=0.25)
    assert shadow.right_px == pytest.approx(left + width, abs=0.25)


def test_two_fingers_side_by_side_are_two_shadows() -> None:
    shadows = find_shadows(profile((50, 60), (66, 80)), SETTINGS)
    assert [round(shadow.left_px) for shadow in shadows] == [50, 66]
    assert [round(shadow.right_px) for shadow in shadows] == [60, 80]


def test_two_fingers_that_touch_each_other_are_one_shadow() -> None:
    (shadow,) = find_shadows(profile((50, 60), (60, 72)), SETTINGS)
    assert (round(shadow.left_px), round(shadow.right_px)) == (50, 72)


@pytest.mark.parametrize(("left", "right"), [(-20, 30), (-5, 3)])
def test_a_shadow_that_runs_out_on_the_left_has_no_left_edge(left: float, right: float) -> None:
    (shadow,) = find_shadows(profile((left, right)), SETTINGS)
    assert not shadow.left_valid
    assert shadow.right_valid
    assert shadow.right_px == pytest.approx(right, abs=0.1)


def test_a_shadow_that_runs_out_on_the_right_has_no_right_edge() -> None:
    (shadow,) = find_shadows(profile((170, 230)), SETTINGS)
    assert shadow.left_valid
    assert not shadow.right_valid


def test_a_shadow_over_the_whole_view_has_no_edge_at_all() -> None:
    (shadow,) = find_shadows(profile((-50, 250)), SETTINGS)
    assert not shadow.left_valid
    assert not shadow.right_valid


def test_an_edge_beside_an_unknown_column_is_not_believed() -> None:
    (shadow,) = find_shadows(profile((80, 100), unknown=slice(100, 104)), SETTINGS)
    assert shadow.left_valid
    assert not shadow.right_valid


def test_dirt_smaller_than_the_smallest_shadow_is_no_shadow() -> None:
    assert len(find_shadows(profile((100, 100.3)), SETTINGS)) == 0


def test_a_dim_patch_that_never_gets_half_dark_is_no_wide_shadow() -> None:
    brightness = np.ones(WIDTH)
    brightness[60:120] = 0.8
    assert len(find_shadows(Profile(brightness, np.ones(WIDTH, bool)), SETTINGS)) == 0


def test_a_camera_that_sees_nothing_gives_no_shadow() -> None:
    assert len(find_shadows(Profile(np.zeros(WIDTH), np.zeros(WIDTH, bool)), SETTINGS)) == 0


@example([0.0, -1.0, 1.625, 0.25, 1.75, 1.75], [False, True, True, False, False, True])
@example([0.0, -1.0, 1.75, 0.25, 1.75, 1.75], [False, True, True, False, False, True])
@given(
    st.lists(st.floats(-1, 2), min_size=5, max_size=60),
    st.lists(st.booleans(), min_size=60, max_size=60),
)
def test_whatever_the_profile_shadows_are_ordered_and_inside(
    values: list[float], known: list[bool]
) -> None:
    given_profile = Profile(np.array(values), np.array(known[: len(values)]))
    shadows = find_shadows(given_profile, SETTINGS)
    assert_same(shadows, oracle.find_shadows(given_profile, SETTINGS))
    for shadow in shadows:
        assert np.isfinite([shadow.left_px, shadow.right_px]).all()
        assert 0 <= shadow.depth <= 1
        for edge, valid in (
            (shadow.left_px, shadow.left_valid),
            (shadow.right_px, shadow.right_valid),
        ):
            assert not valid or 0 < edge < len(values)


def assert_same(got: Shadows, expected: Shadows) -> None:
    np.testing.assert_allclose(got.edges_px, expected.edges_px, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(got.valid, expected.valid)
    np.testing.assert_allclose(got.depth, expected.depth, rtol=0, atol=1e-12)


edges = st.tuples(st.floats(-10, WIDTH + 10), st.floats(0.5, 60)).map(lambda s: (s[0], s[0] + s[1]))
unknown_runs = st.lists(st.tuples(st.integers(0, WIDTH - 1), st.integers(1, 30)), max_size=4)


@given(
    st.lists(edges, max_size=8),
    unknown_runs,
    st.lists(st.tuples(st.integers(0, WIDTH - 1), st.floats(0.0, 0.9)), max_size=12),
    st.integers(0, 2**32 - 1),
    st.booleans(),
    st.booleans(),
)
@example([(0.0, 18.5)], [], [(18, 0.5)], 0, True, False)  # two shadows, one ends where one begins
def test_compiled_and_readable_ways_agree(
    shadows: list[tuple[float, float]],
    unknown: list[tuple[int, int]],
    glints: list[tuple[int, float]],
    seed: int,
    sunlit: bool,
    hiding: bool,
) -> None:
    clean = profile(*shadows)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(WIDTH)
    brightness, known = clean.brightness + noise, clean.known
    for column, light in glints:
        brightness[column] += light
    for start, length in unknown:
        known[start : start + length] = False
    seen = np.flatnonzero(known)
    if len(seen):
        brightness = np.interp(np.arange(WIDTH), seen, brightness[seen])
    given_profile = Profile(brightness, known)
    places = EVERYWHERE if hiding else None
    assert_same(
        find_shadows(given_profile, SETTINGS, sunlit=sunlit, hiding=places),
        oracle.find_shadows(given_profile, SETTINGS, sunlit=sunlit, hiding=places),
    )


def test_where_columns_tell_nothing_a_shadow_may_hide() -> None:
    given_profile = profile((20, 30), unknown=slice(100, 100 + HIDING_PX))
    assert len(find_shadows(given_profile, SETTINGS)) == 1
    shadow, hidden = find_shadows(given_profile, SETTINGS, hiding=EVERYWHERE)
    assert shadow.right_px == pytest.approx(30, abs=0.05)
    assert (hidden.left_px, hidden.right_px) == (100, 100 + HIDING_PX)
    assert (hidden.left_valid, hidden.right_valid, hidden.depth) == (False, False, 0.0)


@pytest.mark.parametrize("unknown", [slice(100, 99 + HIDING_PX), slice(28, 40), slice(10, 40)])
def test_nothing_hides_in_few_columns_nor_behind_a_shadow_that_is_seen(unknown: slice) -> None:
    given_profile = profile((20, 30), unknown=unknown)
    given_profile.brightness[unknown] = np.minimum(given_profile.brightness[unknown], 1.0)
    assert all(s.depth > 0 for s in find_shadows(given_profile, SETTINGS, hiding=EVERYWHERE))


def test_a_camera_that_sees_no_shadow_hides_none_either() -> None:
    """What it sees would otherwise contradict touches everywhere else."""
    assert len(find_shadows(profile(unknown=slice(100, 120)), SETTINGS, hiding=EVERYWHERE)) == 0


@pytest.mark.parametrize("flank", [0.25, 0.35, 0.45])
def test_the_edge_of_a_sunlit_flank_lies_half_way_between_strip_and_flank(flank: float) -> None:
    dark = profile((80, 100)).brightness
    columns = np.arange(WIDTH) + 0.5
    blur = sqrt(2 * (SETTINGS.edge_blur_px**2 + 1 / 12))
    lit = flank * (erf((columns - 80) / blur) - erf((columns - 90) / blur)) / 2
    given_profile = Profile(dark + lit, np.ones(WIDTH, bool))
    (plain,) = find_shadows(given_profile, SETTINGS)
    (shadow,) = find_shadows(given_profile, SETTINGS, sunlit=True)
    assert shadow.left_px == pytest.approx(80, abs=0.15)
    assert abs(shadow.left_px - 80) < abs(plain.left_px - 80)
    assert shadow.right_px == plain.right_px


def test_where_the_sun_lights_half_a_finger_the_shadow_has_no_edge_on_that_side() -> None:
    brightness = profile((80, 100)).brightness
    brightness[86:100] = np.linspace(0.45, 0.9, 14)  # ever brighter towards its edge
    brightness[100:] = 1.0
    given_profile = Profile(brightness, np.ones(WIDTH, bool))
    (plain,) = find_shadows(given_profile, SETTINGS)
    assert plain.right_valid
    assert plain.right_px < 93  # a pen, it seems
    (shadow,) = find_shadows(given_profile, SETTINGS, sunlit=True)
    assert (shadow.left_px, shadow.left_valid) == (pytest.approx(80, abs=0.1), True)
    assert not shadow.right_valid
    assert shadow.right_px > 96


def test_a_piece_of_a_sunlit_finger_has_no_edges() -> None:
    brightness = np.ones(WIDTH)
    brightness[80:100] = 0.95
    brightness[88:91] = 0.5
    given_profile = Profile(brightness, np.ones(WIDTH, bool))
    (plain,) = find_shadows(given_profile, SETTINGS)
    (glint,) = find_shadows(given_profile, SETTINGS, sunlit=True)
    assert plain.left_valid
    assert plain.right_valid
    assert not glint.left_valid
    assert not glint.right_valid
