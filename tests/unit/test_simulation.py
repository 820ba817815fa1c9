"""The simulated rig: its pictures agree with its truth, and the same seed gives the same."""

from concurrent.futures import ThreadPoolExecutor
from functools import cache
from math import asin, atan2, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.model import FloatArray
from cornertouchd.simulation.border import STRIP_SETBACK_MM
from cornertouchd.simulation.fingers import Finger, section
from cornertouchd.simulation.noise import BLACK, GAIN, READ_NOISE
from cornertouchd.simulation.rig import SimulatedRig

RIGS = ["small", "large", "pinhole", "matt"]
CAMERAS = ["C1", "C2", "C3", "C4"]
BLACK_LEVEL = round(BLACK)


@cache
def rig_of(name: str) -> SimulatedRig:
    """A rig without noise, except `noisy`."""
    match name:
        case "large":
            return SimulatedRig((2400.0, 1350.0), 1280, 800, seed=2, noise=False)
        case "pinhole":
            return SimulatedRig(barrel=0.0, seed=3, noise=False)
        case "matt":
            return SimulatedRig(reflectance=0.0, seed=1, noise=False)
        case "noisy":
            return SimulatedRig(seed=1)
        case _:
            return SimulatedRig(seed=1, noise=False)


def pixel_of(rig: SimulatedRig, camera_id: str, place_mm: tuple[float, float, float]) -> FloatArray:
    """Column and row of the picture in which a place in space appears."""
    camera = rig.truth.cameras[camera_id]
    offset = np.subtract(place_mm, (camera.x_mm, camera.y_mm, camera.height_mm))
    column_px, row_px = camera.project(offset)
    return np.array([column_px, row_px - rig.formats[camera_id].row_offset_px])


def far_face_mm(camera_id: str) -> float:
    """x of the face of the strip opposite to a camera of a small rig."""
    return 350.0 + STRIP_SETBACK_MM if camera_id in {"C1", "C4"} else -STRIP_SETBACK_MM


def share_left(rig: SimulatedRig, camera_id: str, finger: Finger) -> FloatArray:
    """What a finger leaves of the light, pixel by pixel; NaN where there is none to hide."""
    empty = rig.render(camera_id, 0, []).astype(float) - BLACK
    seen = rig.render(camera_id, 0, [finger]).astype(float) - BLACK
    return np.divide(seen, empty, out=np.full_like(empty, np.nan), where=empty > 20.0)


def shadow_at(
    share: FloatArray, row: int, near_px: float, reach_px: int = 30
) -> tuple[float, float]:
    """Centre and width of a shadow in a row: first moment and area of the light hidden."""
    first = max(0, int(near_px) - reach_px)
    hidden = np.nan_to_num(1.0 - share[row, first : int(near_px) + reach_px], nan=0.0) / 0.95
    columns_px = first + 0.5 + np.arange(len(hidden))
    return float(np.sum(columns_px * hidden) / np.sum(hidden)), float(np.sum(hidden))


# --- the empty picture ---


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("camera_id", CAMERAS)
def test_each_camera_stands_in_its_corner_and_sees_all_of_the_surface(
    name: str, camera_id: str
) -> None:
    rig = rig_of(name)
    camera = rig.truth.cameras[camera_id]
    width_mm, height_mm = rig.surface_mm
    assert (camera.x_mm > width_mm / 2.0) == (camera_id in {"C2", "C3"})
    assert (camera.y_mm > height_mm / 2.0) == (camera_id in {"C3", "C4"})
    assert 1.9 <= max(abs(camera.x_mm - width_mm / 2.0) - width_mm / 2.0, 0.0) <= 6.1
    assert 1.9 <= max(abs(camera.y_mm - height_mm / 2.0) - height_mm / 2.0, 0.0) <= 6.1
    corners = [(0.0, 0.0), (width_mm, 0.0), (width_mm, height_mm), (0.0, height_mm)]
    del corners[CAMERAS.index(camera_id)]
    columns_px = [camera.column_of(*corner) for corner in corners]
    assert all(0.0 < column_px < rig.formats[camera_id].width_px for column_px in columns_px)


@pytest.mark.parametrize("name", ["small", "large", "pinhole"])
@pytest.mark.parametrize("camera_id", CAMERAS)
def test_the_strip_and_its_mirror_image_lie_inside_the_band(name: str, camera_id: str) -> None:
    rig = rig_of(name)
    picture = rig.render(camera_id, 0, [])
    size = rig.formats[camera_id]
    assert picture.shape == (size.rows_px, size.width_px)
    far = picture[:, size.width_px // 6 : -size.width_px // 6]
    assert np.all(far[[0, 1, -2, -1]] == BLACK_LEVEL)
    lit_rows = np.sum(far > 60, axis=0)
    assert np.mean(lit_rows > 5) > 0.97, "dark only where the far camera stands"


@pytest.mark.parametrize("camera_id", CAMERAS)
def test_a_thin_dark_line_parts_the_strip_from_its_dimmer_mirror_image(camera_id: str) -> None:
    rig = rig_of("small")
    empty = rig.render(camera_id, 0, []).astype(float)
    column, row = pixel_of(rig, camera_id, (far_face_mm(camera_id), 200.0, 0.0))
    across = empty[:, int(column) - 3 : int(column) + 4].mean(axis=1)
    line = int(row)
    assert np.min(across[line - 1 : line + 2]) < 0.7 * across[line - 4]
    assert 0.7 < across[line + 5] / across[line - 5] < 0.95


def test_a_matt_screen_shows_no_mirror_image() -> None:
    rig, glossy = rig_of("matt"), rig_of("small")
    for camera_id in CAMERAS:
        column, row = pixel_of(rig, camera_id, (far_face_mm(camera_id), 200.0, 0.0))
        below = slice(int(row) + 3, None)
        assert np.all(rig.render(camera_id, 0, [])[below, int(column)] == BLACK_LEVEL)
        assert glossy.render(camera_id, 0, [])[int(row) + 5, int(column)] > 100
        above = slice(0, int(row) - 3)
        assert np.array_equal(
            rig.render(camera_id, 0, [])[above, int(column)],
            glossy.render(camera_id, 0, [])[above, int(column)],
        )


@pytest.mark.parametrize("name", ["small", "large"])
@pytest.mark.parametrize(("camera_id", "far_id"), [("C1", "C3"), ("C2", "C4"), ("C3", "C1")])
def test_the_camera_in_the_far_corner_is_a_narrow_dark_notch(
    name: str, camera_id: str, far_id: str
) -> None:
    rig = rig_of(name)
    far = rig.truth.cameras[far_id]
    column_px, row_px = pixel_of(rig, camera_id, (far.x_mm, far.y_mm, 6.0))
    line = rig.render(camera_id, 0, [])[int(row_px)].astype(float) - BLACK
    around = line[int(column_px) - 25 : int(column_px) + 26]
    share = around / np.percentile(around, 60)
    assert np.min(share[23:28]) < 0.2
    assert 2.5 <= np.sum(share < 0.5) <= 5.5


@pytest.mark.parametrize("camera_id", CAMERAS)
def test_the_own_strips_flare_at_both_borders(camera_id: str) -> None:
    picture = rig_of("small").render(camera_id, 0, [])
    lit_rows = np.sum(picture > 40, axis=0)
    assert lit_rows[0] > 1.3 * lit_rows[40]
    assert lit_rows[-1] > 1.3 * lit_rows[-40]


def test_noise_has_the_strength_of_photons_and_reading() -> None:
    light = rig_of("small").render("C1", 0, []).astype(float) - BLACK_LEVEL
    rig = rig_of("noisy")
    pictures = np.stack([rig.render("C1", index, []) for index in range(40)]).astype(float)
    for low, high in ((0.0, 1.0), (100.0, 130.0), (170.0, 200.0)):
        there = (light >= low) & (light < high)
        expected = READ_NOISE**2 + GAIN * np.mean(light[there]) + 1.0 / 12.0
        assert np.mean(np.var(pictures, axis=0)[there]) == pytest.approx(expected, rel=0.15)
        assert np.mean(pictures[:, there]) - BLACK_LEVEL == pytest.approx(
            np.mean(light[there]), abs=0.3
        )


# --- fingers ---


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("camera_id", CAMERAS)
@pytest.mark.parametrize("place", [(0.3, 0.4), (0.62, 0.35), (0.45, 0.72)])
def test_the_shadow_of_an_upright_thin_finger_is_where_the_truth_says(
    name: str, camera_id: str, place: tuple[float, float]
) -> None:
    rig = rig_of(name)
    camera = rig.truth.cameras[camera_id]
    x_mm, y_mm = place[0] * rig.surface_mm[0], place[1] * rig.surface_mm[1]
    column_px, row_px = pixel_of(rig, camera_id, (x_mm, y_mm, camera.height_mm))
    assert column_px == pytest.approx(camera.column_of(x_mm, y_mm))
    share = share_left(rig, camera_id, Finger(x_mm, y_mm, diameter_mm=6.0))
    centre_px, width_px = shadow_at(share, int(row_px), column_px)
    assert centre_px == pytest.approx(column_px, abs=0.2)
    distance_mm = hypot(x_mm - camera.x_mm, y_mm - camera.y_mm)
    half_rad = asin(3.0 / distance_mm)
    towards_rad = atan2(y_mm - camera.y_mm, x_mm - camera.x_mm)
    edges_px = camera.columns_px(towards_rad + np.array([-half_rad, half_rad]))
    assert width_px == pytest.approx(edges_px[1] - edges_px[0], rel=0.05, abs=0.1)


@pytest.mark.parametrize("camera_id", CAMERAS)
@pytest.mark.parametrize("azimuth_rad", [0.0, 1.2, 2.9, 4.4])
def test_a_leaning_finger_shows_its_section_at_the_height_of_the_camera_and_its_touch_at_the_waist(
    camera_id: str, azimuth_rad: float
) -> None:
    rig = rig_of("small")
    camera = rig.truth.cameras[camera_id]
    finger = Finger(130.0, 240.0, 9.0, lean_rad=0.5, lean_azimuth_rad=azimuth_rad)
    cut = section(finger, camera.height_mm)
    assert cut is not None
    share = share_left(rig, camera_id, finger)
    _, horizon_px = pixel_of(rig, camera_id, (cut.x_mm, cut.y_mm, camera.height_mm))
    section_px = camera.column_of(cut.x_mm, cut.y_mm)
    # A row is a plane that need not run at the camera's height: half a row is .1 px of lean here.
    assert shadow_at(share, int(horizon_px), section_px)[0] == pytest.approx(section_px, abs=0.4)

    touch_px, waist_px = pixel_of(rig, camera_id, (130.0, 240.0, 0.0))
    assert shadow_at(share, int(waist_px), touch_px)[0] == pytest.approx(touch_px, abs=0.4)


@pytest.mark.parametrize("camera_id", CAMERAS)
def test_the_mirror_image_of_a_finger_hangs_below_it(camera_id: str) -> None:
    rig = rig_of("small")
    share = share_left(rig, camera_id, Finger(170.0, 210.0, 10.0))
    for height_mm in (5.0, -2.5):
        column_px, row_px = pixel_of(rig, camera_id, (170.0, 210.0, height_mm))
        assert share[int(row_px), int(column_px)] < 0.08
    _, waist_px = pixel_of(rig, camera_id, (170.0, 210.0, 0.0))
    widths_px = [shadow_at(share, int(waist_px) + step, column_px)[1] for step in (-4, 0, 4)]
    assert widths_px[1] < 0.85 * min(widths_px[0], widths_px[2])


def test_a_hovering_finger_shows_a_lit_gap_where_a_touching_one_is_dark() -> None:
    rig = rig_of("small")
    for camera_id in CAMERAS:
        column_px, row_px = pixel_of(rig, camera_id, (170.0, 210.0, 0.0))
        waist = (slice(int(row_px) - 1, int(row_px) + 2), int(column_px))
        touching = share_left(rig, camera_id, Finger(170.0, 210.0, 12.0))[waist]
        hovering = share_left(rig, camera_id, Finger(170.0, 210.0, 12.0, height_mm=3.0))[waist]
        assert np.nanmax(touching) < 0.3
        assert np.nanmax(hovering) > 0.8


def test_a_finger_above_the_strip_hides_nothing() -> None:
    rig = rig_of("small")
    for camera_id in CAMERAS:
        high = rig.render(camera_id, 0, [Finger(170.0, 210.0, 12.0, height_mm=30.0)])
        assert np.array_equal(high, rig.render(camera_id, 0, []))


@settings(deadline=None)
@given(
    x_mm=st.floats(-50.0, 450.0),
    y_mm=st.floats(-50.0, 450.0),
    diameter_mm=st.floats(0.5, 120.0),
    lean_rad=st.floats(0.0, 1.2),
    azimuth_rad=st.floats(-pi, pi),
)
def test_a_finger_only_ever_takes_light_wherever_it_is(
    x_mm: float, y_mm: float, diameter_mm: float, lean_rad: float, azimuth_rad: float
) -> None:
    rig = rig_of("small")
    picture = rig.render("C1", 0, [Finger(x_mm, y_mm, diameter_mm, lean_rad, azimuth_rad)])
    assert np.all(picture <= rig.render("C1", 0, []))
    assert np.all(picture >= BLACK_LEVEL)


@settings(deadline=None)
@given(
    diameter_mm=st.floats(2.0, 30.0),
    lean_rad=st.floats(0.0, 1.2),
    azimuth_rad=st.floats(-pi, pi),
    hover_mm=st.floats(0.0, 8.0),
    height_mm=st.floats(0.5, 12.0),
)
def test_the_section_of_a_finger_encloses_what_a_plane_cuts_out_of_it(
    diameter_mm: float, lean_rad: float, azimuth_rad: float, hover_mm: float, height_mm: float
) -> None:
    finger = Finger(50.0, 60.0, diameter_mm, lean_rad, azimuth_rad, hover_mm)
    radius_mm = diameter_mm / 2.0
    along_mm = np.linspace(0.0, 60.0, 6001)
    off_mm = height_mm - finger.tip_height_mm - along_mm * cos(lean_rad)
    disc_mm = np.sqrt(np.maximum(radius_mm**2 - off_mm**2, 0.0))
    cut = np.abs(off_mm) < radius_mm
    found = section(finger, height_mm)
    if found is None:
        assert not np.any(cut)
        return
    if not np.any(cut):
        assert found.diameter_mm < 0.6
        return
    reach_mm = along_mm * sin(lean_rad)
    low_mm, high_mm = np.min((reach_mm - disc_mm)[cut]), np.max((reach_mm + disc_mm)[cut])
    middle_mm = (low_mm + high_mm) / 2.0
    diameter = sqrt((high_mm - low_mm) * 2.0 * np.max(disc_mm[cut]))
    assert found.x_mm == pytest.approx(50.0 + middle_mm * cos(azimuth_rad), abs=0.05)
    assert found.y_mm == pytest.approx(60.0 + middle_mm * sin(azimuth_rad), abs=0.05)
    assert found.diameter_mm == pytest.approx(diameter, abs=0.1)


# --- repeatable, refusing what cannot be ---


def test_the_same_seed_gives_the_same_pictures_in_any_order_and_from_any_thread() -> None:
    rig, again = rig_of("noisy"), SimulatedRig(seed=1)
    fingers = [Finger(100.0, 120.0), Finger(260.0, 300.0, 13.0, 0.4, 1.0)]
    asked = [(camera_id, index) for camera_id in CAMERAS for index in (0, 7, 123_456_789)]
    first = [rig.render(camera_id, index, fingers) for camera_id, index in asked]
    with ThreadPoolExecutor(4) as pool:
        backwards = list(
            pool.map(lambda each: again.render(each[0], each[1], fingers), reversed(asked))
        )
    assert all(np.array_equal(a, b) for a, b in zip(first, reversed(backwards), strict=True))
    assert rig.truth == again.truth


def test_cameras_indices_and_seeds_have_noise_of_their_own() -> None:
    rig = rig_of("noisy")
    quiet = {camera_id: rig_of("small").render(camera_id, 0, []) for camera_id in CAMERAS}
    noise = [
        rig.render(camera_id, index, []).astype(float) - quiet[camera_id]
        for camera_id, index in (("C1", 0), ("C1", 1), ("C2", 0))
    ]
    there = np.min(list(quiet.values()), axis=0) > 100
    assert np.sum(there) > 1000
    apart = np.corrcoef([each[there] for each in noise])
    assert np.all(np.abs(apart - np.eye(3)) < 0.1)
    other = SimulatedRig(seed=2).truth.cameras["C1"]
    assert other.yaw_rad != rig.truth.cameras["C1"].yaw_rad


def test_a_frame_set_is_one_instant_of_all_cameras() -> None:
    rig = rig_of("noisy")
    frames = rig.frame_set(41, 12.5, [Finger(100.0, 120.0)])
    assert [frame.camera for frame in frames] == CAMERAS == list(rig.formats)
    for frame in frames:
        assert (frame.sequence, frame.captured_at_s, frame.lit_mask) == (41, 12.5, 15)
        assert frame.pixels.dtype == np.uint8
        expected = rig.render(frame.camera, 41, [Finger(100.0, 120.0)])
        assert np.array_equal(frame.pixels, expected)


@pytest.mark.parametrize("count", [2, 3, 8])
def test_a_rig_may_have_two_to_eight_cameras(count: int) -> None:
    rig = SimulatedRig(cameras=count, width_px=320, height_px=240, rows_px=32)
    assert list(rig.formats) == [f"C{number + 1}" for number in range(count)]
    assert all(size.rows_px == 32 and size.width_px == 320 for size in rig.formats.values())
    share = share_left(rig, f"C{count}", Finger(175.0, 200.0, 12.0))
    assert np.nanmin(share) < 0.15


def test_what_cannot_be_is_refused_with_value_and_bound() -> None:
    with pytest.raises(ValueError, match="cameras is 9; give 2 to 8"):
        SimulatedRig(cameras=9)
    with pytest.raises(ValueError, match="surface_mm is 350 x 0; give sides of at least 100"):
        SimulatedRig((350.0, 0.0))
    with pytest.raises(ValueError, match="640x48 px with a band of 64 rows"):
        SimulatedRig(height_px=48)
    with pytest.raises(ValueError, match=r"reflectance is 1\.5; give 0"):
        SimulatedRig(reflectance=1.5)
    with pytest.raises(ValueError, match=r"barrel is 0\.9; give 0"):
        SimulatedRig(barrel=0.9)
    with pytest.raises(ValueError, match=r"diameter_mm is 0\.0; give one above 0"):
        Finger(1.0, 2.0, diameter_mm=0.0)
    with pytest.raises(ValueError, match=r"lean_rad is 2\.0; give 0 to 1\.2"):
        Finger(1.0, 2.0, lean_rad=2.0)
