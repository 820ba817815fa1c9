"""A camera that is not fit to be calibrated is told so, with what to change."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import recorded
from scipy.ndimage import gaussian_filter

from cornertouchd.guiding.checking import CameraCheck, Finding, check_camera
from cornertouchd.model import FloatArray, Picture
from cornertouchd.simulation.noise import BLACK
from cornertouchd.simulation.rig import SimulatedRig

PICTURES = 6


@pytest.fixture(scope="module")
def pictures() -> Picture:
    """Of the empty small rig, as camera C1 sees it: 74 % of full scale."""
    rig = SimulatedRig()
    return np.array([rig.render("C1", index, ()) for index in range(PICTURES)])


def light_of(pictures: Picture) -> FloatArray:
    return pictures - BLACK


def exposed(light: FloatArray) -> Picture:
    return np.clip(np.rint(light + BLACK), 0, 255).astype(np.uint8)


def check(pictures: Picture, dark: Picture | None = None) -> CameraCheck:
    return check_camera("C1", pictures, dark)


def only(checked: CameraCheck) -> Finding:
    (finding,) = checked.findings
    return finding


@pytest.mark.parametrize(
    "rig",
    [
        SimulatedRig(seed=5),
        SimulatedRig((2400.0, 1350.0), 1280, 800, 96),
        SimulatedRig(reflectance=0.0),
        SimulatedRig(field_rad=2.0),
    ],
    ids=["other seed", "large", "matt screen", "wide lens"],
)
def test_good_rigs_are_good(rig: SimulatedRig) -> None:
    for camera in rig.formats:
        checked = check_camera(camera, [rig.render(camera, index, ()) for index in range(3)])
        assert checked.findings == ()
        assert checked.verdict == "good"


def test_measures_are_those_of_the_rig(pictures: Picture) -> None:
    light = check(pictures).light
    assert light is not None
    assert light.level_share == pytest.approx(0.74, abs=0.02)
    assert light.saturated_share == 0.0
    assert light.ambient_share < 0.01
    assert light.flicker_share < 0.01
    assert light.blur_px == pytest.approx(0.9, abs=0.1)


@settings(max_examples=10)
@given(st.floats(0.05, 0.75))
def test_the_remedy_for_a_dim_strip_makes_it_good(pictures: Picture, exposure: float) -> None:
    checked = check(exposed(exposure * light_of(pictures)))
    finding = only(checked)
    assert finding.kind == "level"
    factor = float(finding.text.split()[-2])
    assert check(exposed(exposure * factor * light_of(pictures))).verdict == "good"


@pytest.mark.parametrize(("exposure", "verdict"), [(0.3, "bad"), (0.4, "doubtful"), (0.9, "good")])
def test_a_dimmer_strip_is_worse(pictures: Picture, exposure: float, verdict: str) -> None:
    assert check(exposed(exposure * light_of(pictures))).verdict == verdict


def test_an_overexposed_strip_is_told_until_it_is_good(pictures: Picture) -> None:
    exposure = 8.0
    while (checked := check(exposed(exposure * light_of(pictures)))).verdict == "bad":
        assert only(checked).kind == "level"
        assert "halve the exposure" in only(checked).text
        exposure /= 2
    assert exposure == 1.0
    assert checked.verdict == "good"


def test_led_ripple_at_full_scale_is_told(pictures: Picture) -> None:
    finding = only(check(exposed(1.2 * light_of(pictures))))
    assert (finding.kind, finding.severity) == ("saturation", "doubtful")
    assert "lower the exposure or the LED current to 84%" in finding.text


@pytest.mark.parametrize("glow", [40.0, 80.0, 160.0])
def test_sun_beside_the_strip_is_bad(pictures: Picture, glow: float) -> None:
    rows, columns = np.mgrid[: pictures.shape[1], : pictures.shape[2]]
    sun = glow * np.exp(-(((columns - 150) / 90) ** 2) - ((rows - 15) / 25) ** 2)
    checked = check(exposed(light_of(pictures) + sun))
    assert checked.verdict == "bad"
    assert [one.severity for one in checked.findings if one.kind == "ambient"] == ["bad"]


def test_light_that_is_everywhere_shows_in_dark_pictures(pictures: Picture) -> None:
    lit = exposed(0.8 * light_of(pictures) + 40.0)
    assert check(lit).verdict == "good"
    told = only(check(lit, exposed(0 * light_of(pictures) + 40.0)))
    assert (told.kind, told.severity) == ("ambient", "bad")
    assert "curtain" in told.text
    assert check(pictures, exposed(0 * light_of(pictures))).verdict == "good"


@pytest.mark.parametrize(
    ("rows", "severity", "remedy"),
    [
        (slice(14, None), "doubtful", "move it up by 8 rows"),
        (slice(16, None), "bad", "move it up by 9 rows"),
        (slice(None, -16), "bad", "move it down by 8 rows"),
    ],
)
def test_a_band_that_cuts_the_strip_is_told_where_to_go(
    pictures: Picture, rows: slice, severity: str, remedy: str
) -> None:
    finding = only(check(pictures[:, rows]))
    assert (finding.kind, finding.severity) == ("band", severity)
    assert remedy in finding.text
    assert "row_offset_px" in finding.text


def test_a_band_too_low_on_both_sides_is_to_be_higher(pictures: Picture) -> None:
    finding = only(check(pictures[:, 13:-14]))
    assert finding.kind == "band"
    assert "rows_px" in finding.text


def test_a_band_without_the_strip_is_told(pictures: Picture) -> None:
    checked = check(pictures[:, 24:])
    assert checked.light is None
    assert only(checked).kind == "strip"
    assert "rows" in only(checked).text


def test_leds_that_are_off_are_told(pictures: Picture) -> None:
    finding = only(check(exposed(0 * light_of(pictures))))
    assert (finding.kind, finding.severity) == ("strip", "bad")
    assert "LED frame" in finding.text
    assert "lens" in finding.text


def test_a_lens_half_covered_is_told(pictures: Picture) -> None:
    covered = pictures.copy()
    covered[:, :, :300] = 3
    finding = only(check(covered))
    assert (finding.kind, finding.severity) == ("dark columns", "bad")
    assert "0 to 299" in finding.text


@pytest.mark.parametrize(("blur_px", "severity"), [(1.6, "doubtful"), (4.0, "bad")])
def test_a_lens_out_of_focus_is_told(pictures: Picture, blur_px: float, severity: str) -> None:
    finding = only(check(exposed(gaussian_filter(light_of(pictures), (0, blur_px, blur_px)))))
    assert (finding.kind, finding.severity) == ("focus", severity)


def test_pictures_in_which_the_leds_are_off_now_and_then_are_told(pictures: Picture) -> None:
    on = np.arange(PICTURES) % 3 > 0
    checked = check(exposed(light_of(pictures) * on[:, None, None]))
    assert "flicker" in [finding.kind for finding in checked.findings]
    assert checked.verdict == "bad"


def test_a_slow_drift_is_doubtful(pictures: Picture) -> None:
    gain = np.linspace(0.95, 1.05, PICTURES)
    finding = only(check(exposed(light_of(pictures) * gain[:, None, None])))
    assert (finding.kind, finding.severity) == ("flicker", "doubtful")


def test_noise_instead_of_pictures_points_to_the_cable() -> None:
    noise = np.random.default_rng(1).integers(0, 256, (PICTURES, 64, 640), np.uint8)
    assert "cable" in only(check(noise)).text


def test_white_pictures_are_overexposed(pictures: Picture) -> None:
    assert "lower the exposure" in only(check(np.full_like(pictures, 255))).text


def test_no_picture_at_all_points_to_the_cable() -> None:
    assert "cable" in only(check_camera("C1", [])).text


def test_one_picture_will_do(pictures: Picture) -> None:
    assert check(pictures[:1]).verdict == "good"


def test_path_traced_cameras_are_good(recordings: Path) -> None:
    for pictures in recorded(recordings / "empty_small", range(16)).values():
        checked = check(pictures)
        assert checked.findings == ()
        assert checked.light is not None
        assert 0.75 < checked.light.level_share < 0.85


def test_cameras_that_look_at_the_sunlit_side_are_bad(whole_recordings: Path) -> None:
    sunlit = whole_recordings / "ambient_small"
    if not sunlit.is_dir():
        pytest.skip("ambient_small does not travel with the repository")
    for sets in (range(4), range(14, 18)):
        checks = {camera: check(stack) for camera, stack in recorded(sunlit, sets).items()}
        verdicts = {camera: one.verdict for camera, one in checks.items()}
        assert verdicts == {"C1": "bad", "C2": "good", "C3": "good", "C4": "bad"}
        kinds = {finding.kind for finding in checks["C1"].findings}
        assert {"ambient", "saturation"} <= kinds
