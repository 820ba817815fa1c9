"""What the empty strip shows over time: range, noise, dim LEDs, and a T1 that holds."""

from pathlib import Path

import numpy as np
import pytest
from recorded import recorded

from cornertouchd.config import PaperVisionSettings, VisionSettings
from cornertouchd.guiding.light_statistics import (
    FINGER_SHARE,
    LightStatistics,
    measure_light_statistics,
)
from cornertouchd.model import Picture
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.finder import make_finder
from cornertouchd.vision.paper_edges import PaperFinder
from cornertouchd.vision.strip import find_strip

CAMERA = "C3"
LONE_LEDS = {
    "C1": [(146, 158), (253, 261), (422, 429), (519, 540)],
    "C2": [(149, 157), (236, 250), (334, 339), (556, 571)],
    "C3": [(134, 143), (456, 465)],
    "C4": [(185, 195), (364, 372), (461, 472)],
}
"""Where deadled_small is dim to the eye, camera by camera."""

RIG = SimulatedRig()
EMPTY = np.array([RIG.render(CAMERA, index, ()) for index in range(8)])


def measure(pictures: Picture) -> LightStatistics:
    return measure_light_statistics(CAMERA, pictures, find_strip(pictures.mean(axis=0)))


def dimmed(pictures: Picture, columns: slice, share: float) -> Picture:
    changed = pictures.astype(np.float64)
    changed[:, :, columns] = 3 + share * (changed[:, :, columns] - 3)
    return changed.astype(np.uint8)


def test_brightness_stays_between_minimum_and_maximum() -> None:
    statistics = measure(EMPTY)
    seen = np.isfinite(statistics.mean)
    assert statistics.pictures == len(EMPTY)
    assert seen.mean() > 0.85
    assert (statistics.minimum[seen] <= statistics.mean[seen]).all()
    assert (statistics.mean[seen] <= statistics.maximum[seen]).all()


def test_noise_is_that_of_the_pictures() -> None:
    rng = np.random.default_rng(1)
    quiet = np.broadcast_to(EMPTY[0] * 0.7, (60, *EMPTY.shape[1:]))
    noisy = np.rint(quiet + 6.0 * rng.standard_normal(quiet.shape)).clip(0, 255).astype(np.uint8)
    statistics = measure(noisy)
    # a mean of nine pixels
    assert np.nanmedian(statistics.noise_sigma) == pytest.approx(2.0, rel=0.1)
    level = float(np.nanmedian(statistics.mean))
    assert statistics.signal_to_noise == pytest.approx(level / 2.0, rel=0.1)


def test_a_picture_repeated_has_no_noise() -> None:
    assert measure(EMPTY[[0, 0, 0]]).signal_to_noise == float("inf")


def test_flicker_widens_the_range() -> None:
    gain = np.array([0.8, 1.0])[:, None, None]
    statistics = measure((EMPTY[:2] * gain).astype(np.uint8))
    seen = np.isfinite(statistics.mean)
    assert np.median((statistics.minimum / statistics.maximum)[seen]) == pytest.approx(
        0.8, abs=0.02
    )


@pytest.mark.parametrize("share", [0.1, 0.4, 0.65])
def test_a_dim_led_is_found_where_it_is(share: float) -> None:
    (run,) = measure(dimmed(EMPTY, slice(150, 170), share)).dim_runs
    assert abs(run.first_px - 150) <= 1
    assert abs(run.last_px - 169) <= 1
    assert run.share == pytest.approx(share, abs=0.1)


def test_ordinary_leds_are_not_dim() -> None:
    assert measure(dimmed(EMPTY, slice(150, 170), 0.9)).dim_runs == ()
    for seed in (2,):
        rig = SimulatedRig(seed=seed)
        for camera in rig.formats:
            pictures = np.array([rig.render(camera, index, ()) for index in range(3)])
            assert measure(pictures).dim_runs == ()


def test_the_suggested_t1_finds_a_finger_and_nothing_else() -> None:
    t1 = measure(EMPTY).suggested_t1
    assert t1 is not None
    finder = PaperFinder(find_strip(EMPTY.mean(axis=0)), 64, PaperVisionSettings(t1=t1))
    assert not any(len(finder.find(picture)) for picture in EMPTY)
    for x_mm in (60.0, 200.0, 290.0):
        assert len(finder.find(RIG.render(CAMERA, 9, [Finger(x_mm, 180.0)]))) == 1


def test_a_strip_as_steep_as_a_finger_has_no_t1() -> None:
    statistics = measure(dimmed(EMPTY, slice(150, 170), 0.1))
    assert statistics.strip_gradient > statistics.finger_gradient / 1.2
    assert statistics.suggested_t1 is None


def test_a_dimmer_strip_needs_a_lower_t1() -> None:
    whole, half = measure(EMPTY).suggested_t1, measure(dimmed(EMPTY, slice(None), 0.5)).suggested_t1
    assert whole is not None
    assert half == pytest.approx(whole / 2, rel=0.1)


def test_path_traced_strips_have_a_t1_below_fingers(recordings: Path) -> None:
    for pictures in recorded(recordings / "empty_small", range(16)).values():
        statistics = measure(pictures)
        assert statistics.dim_runs == ()
        assert statistics.finger_gradient == pytest.approx(157, abs=8)
        assert statistics.suggested_t1 == pytest.approx(100, abs=10)


def test_path_traced_fingers_are_as_steep_as_expected(recordings: Path) -> None:
    empties = recorded(recordings / "empty_small", range(16))
    steep = []
    for camera, pictures in recorded(recordings / "single_small", range(100)).items():
        empty = empties[camera].mean(axis=0)
        strip = find_strip(empty)
        usual = measure_light_statistics(camera, empties[camera], strip).mean
        paper = PaperFinder(strip, 64, PaperVisionSettings())
        finder = make_finder(strip, empty, VisionSettings())
        for picture in pictures:
            values = paper.mean_values(picture)
            for shadow in finder.find(picture):
                if shadow.left_valid and shadow.right_valid:
                    left = slice(int(shadow.left_px) - 3, int(shadow.left_px) + 4)
                    fall = 2 * np.nanmax(values[left][:-2] - values[left][2:])
                    steep.append(fall / np.nanmean(usual[left]))
    assert len(steep) > 40
    assert np.mean(np.array(steep) > FINGER_SHARE) > 0.9


def test_path_traced_dim_leds_are_listed_and_cast_no_shadow(whole_recordings: Path) -> None:
    directory = whole_recordings / "deadled_small"
    if not directory.is_dir():
        pytest.skip("deadled_small does not travel with the repository")
    for camera, pictures in recorded(directory, range(8)).items():
        empty = pictures.mean(axis=0)
        strip = find_strip(empty)
        statistics = measure_light_statistics(camera, pictures, strip)
        found = [(run.first_px, run.last_px) for run in statistics.dim_runs]
        assert np.abs(np.subtract(found, LONE_LEDS[camera])).max() <= 2
        finder = make_finder(strip, empty, VisionSettings())
        assert not any(len(finder.find(picture)) for picture in pictures)


def test_a_shadow_on_a_dead_led_stays_one() -> None:
    """A finger throws a tenth of the light back, as much as a dead LED gives."""
    pictures = dimmed(EMPTY, slice(150, 170), 0.12)
    empty = pictures.mean(axis=0)
    strip = find_strip(empty)
    touched = pictures[0].copy()
    touched[:, 130:190] = np.minimum(touched[:, 130:190], 22)
    (shadow,) = make_finder(strip, empty, VisionSettings()).find(touched)
    assert (shadow.left_px, shadow.right_px) == pytest.approx((130, 190), abs=1)
