"""Strips light up the fingers beside them; the sun lights strips and fingers, and casts shadows."""

from functools import cache
from math import atan2, cos, hypot, pi, radians, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.model import FloatArray
from cornertouchd.simulation.border import STRIP_SETBACK_MM
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.flanks import Lamp, Sun, glow, strip_lamps
from cornertouchd.simulation.rig import SimulatedRig

SUN = Sun(azimuth_rad=0.3, elevation_rad=radians(25.0), grey=40.0)
"""Shines from the right: on the strip at the left, and a little on that at the top."""

CAMERAS = ["C1", "C2", "C3", "C4"]


@cache
def rig_of(name: str) -> SimulatedRig:
    """A rig without noise."""
    match name:
        case "flanks":
            return SimulatedRig(noise=False, lit_flanks=True)
        case "sun":
            return SimulatedRig(noise=False, sun=SUN)
        case "matt in the sun":
            return SimulatedRig(noise=False, sun=SUN, reflectance=0.0)
        case "blinding sun":
            return SimulatedRig(noise=False, sun=Sun(0.0, radians(20.0), 400.0))
        case _:
            return SimulatedRig(noise=False)


def light(name: str, camera_id: str, *fingers: Finger) -> FloatArray:
    return np.asarray(rig_of(name).light(camera_id, fingers), np.float64)


def pixel_of(camera_id: str, place_mm: tuple[float, float, float]) -> tuple[int, int]:
    """Row and column of the picture in which a place in space appears."""
    camera = rig_of("plain").truth.cameras[camera_id]
    offset = np.subtract(place_mm, (camera.x_mm, camera.y_mm, camera.height_mm))
    column_px, row_px = camera.project(offset)
    return int(row_px - rig_of("plain").formats[camera_id].row_offset_px), int(column_px)


# --- lit flanks ---


@pytest.mark.parametrize(("camera_id", "inner"), [("C1", 1), ("C4", -1)])
def test_beside_a_strip_the_flank_towards_it_is_bright(camera_id: str, inner: int) -> None:
    finger = Finger(6.0, 200.0, 12.0)  # C1 sees the left side on the right, C4 on the left
    row, column = pixel_of(camera_id, (6.0, 200.0, 6.0))
    added = light("flanks", camera_id, finger) - light("plain", camera_id, finger)
    towards, away = added[row, column + 5 * inner], added[row, column - 5 * inner]
    assert towards > 25.0
    assert away < 8.0


def test_its_edge_moves_inwards_by_part_of_a_column_and_that_of_the_other_flank_does_not() -> None:
    finger = Finger(6.0, 200.0, 12.0)
    row, column = pixel_of("C1", (6.0, 200.0, 6.0))
    shares = [
        light(name, "C1", finger)[row] / light("plain", "C1")[row] for name in ("plain", "flanks")
    ]
    edges = []
    for share in shares:
        inside = np.flatnonzero(share[column - 30 : column + 30] < 0.5) + column - 30
        first, last = inside[0], inside[-1]
        left = first - (0.5 - share[first]) / (share[first - 1] - share[first])
        right = last + (0.5 - share[last]) / (share[last + 1] - share[last])
        edges.append((left, right))
    (left, right), (lit_left, lit_right) = edges
    assert abs(lit_left - left) < 0.1
    assert 0.15 < right - lit_right < 2.0


def test_amid_the_surface_strips_light_fingers_up_by_no_more_than_noise_of_a_picture() -> None:
    finger = Finger(175.0, 200.0, 12.0)
    for camera_id in CAMERAS:
        added = light("flanks", camera_id, finger) - light("plain", camera_id, finger)
        assert added.min() >= 0.0
        assert added.max() < 8.0


def test_the_nearer_a_strip_the_brighter() -> None:
    greys = [strip_lamps(Finger(x_mm, 200.0), (350.0, 400.0), 13.4, 195.0) for x_mm in (40, 20, 5)]
    left = [lamps[2].grey for lamps in greys]
    assert left == sorted(left)
    assert left[-1] < 195.0


@given(st.floats(-pi, pi), st.floats(-pi, pi), st.floats(0.0, 200.0))
def test_a_flank_is_never_brighter_than_what_faces_the_lamp_squarely(
    towards_rad: float, bearing_rad: float, grey: float
) -> None:
    beside = np.linspace(-1.5, 1.5, 61, dtype=np.float32)
    bright = glow((Lamp(towards_rad, grey),), bearing_rad, beside)
    assert np.all(bright >= 0.0)
    assert np.all(bright <= grey * 1.0001)


@settings(deadline=None, max_examples=50)
@given(st.floats(0.0, 350.0), st.floats(0.0, 400.0), st.floats(4.0, 20.0), st.floats(0.0, 1.0))
def test_lit_flanks_take_no_light_wherever_the_finger_is(
    x_mm: float, y_mm: float, diameter_mm: float, lean_rad: float
) -> None:
    finger = Finger(x_mm, y_mm, diameter_mm, lean_rad, 1.0)
    added = light("flanks", "C2", finger) - light("plain", "C2", finger)
    assert added.min() >= -1e-3
    assert np.all(np.isfinite(added))


# --- the sun ---


def test_the_sun_lights_the_strip_that_faces_it_and_its_mirror_image() -> None:
    added = light("sun", "C2") - light("plain", "C2")
    at_left = (-STRIP_SETBACK_MM, 200.0)
    direct, mirrored = (added[pixel_of("C2", (*at_left, z_mm))] for z_mm in (7.0, -7.0))
    assert direct == pytest.approx(SUN.grey * cos(SUN.elevation_rad) * cos(0.3), rel=0.2)
    assert 0.6 < mirrored / direct < 1.0
    right = light("sun", "C1") - light("plain", "C1")
    assert right[pixel_of("C1", (350.0 + STRIP_SETBACK_MM, 200.0, 7.0))] == 0.0


def test_a_strong_sun_saturates_columns_of_the_cameras_that_look_away_from_it() -> None:
    blinded = rig_of("blinding sun").render("C2", 0, [])
    row, column = pixel_of("C2", (-STRIP_SETBACK_MM, 200.0, 7.0))
    assert np.all(blinded[row, column - 20 : column + 20] == 255)
    towards = rig_of("blinding sun").render("C1", 0, [])
    row, column = pixel_of("C1", (350.0 + STRIP_SETBACK_MM, 200.0, 7.0))
    assert towards[row, column] < 255


@pytest.mark.parametrize("height_mm", [4.0, 8.0, -8.0])
def test_a_finger_throws_its_sun_shadow_on_the_strip_where_the_sun_points(height_mm: float) -> None:
    away_mm = 10.0
    finger = Finger(away_mm - STRIP_SETBACK_MM, 150.0, 8.0)
    empty, seen = light("sun", "C2"), light("sun", "C2", finger)
    # along the sun's rays, level, the shadow lies so much farther up the side
    y_mm = 150.0 - away_mm * tan(SUN.azimuth_rad)
    place = (-STRIP_SETBACK_MM, y_mm, height_mm)
    added = (empty - light("plain", "C2"))[pixel_of("C2", place)]
    row, column = pixel_of("C2", place)
    hidden_by_finger = light("plain", "C2", finger) / np.maximum(light("plain", "C2"), 1.0)
    assert hidden_by_finger[row, column] > 0.98, "the finger itself is elsewhere in the picture"
    assert empty[row, column] - seen[row, column] == pytest.approx(added, rel=0.1)


def test_where_the_tip_ends_so_does_its_shadow() -> None:
    """From 40 mm away the sun passes below a finger that is 30 mm above the surface."""
    finger = Finger(40.0 - STRIP_SETBACK_MM, 150.0, 8.0, height_mm=30.0)
    y_mm = 150.0 - 40.0 * tan(SUN.azimuth_rad)
    level_mm = hypot(40.0, y_mm - 150.0)
    assert level_mm * tan(SUN.elevation_rad) + 1.0 < 30.0
    place = pixel_of("C2", (-STRIP_SETBACK_MM, y_mm, 7.0))
    assert light("sun", "C2", finger)[place] == pytest.approx(light("sun", "C2")[place], abs=0.5)


def test_the_flank_in_the_sun_is_bright() -> None:
    finger = Finger(150.0, 170.0, 12.0)
    towards_sun, away_from_sun = (
        (light("sun", camera_id, finger) - light("plain", camera_id, finger))[
            pixel_of(camera_id, (150.0, 170.0, 6.0))
        ]
        for camera_id in ("C3", "C1")
    )
    assert towards_sun > 12.0
    assert away_from_sun < 4.0


def test_a_matt_screen_mirrors_neither_sun_nor_lit_fingers() -> None:
    finger = Finger(175.0, 200.0, 12.0)
    row, column = pixel_of("C2", (-STRIP_SETBACK_MM, 200.0, -7.0))
    assert light("matt in the sun", "C2")[row, column] == 0.0
    row, column = pixel_of("C2", (175.0, 200.0, -4.0))
    assert light("matt in the sun", "C2", finger)[row, column] < 0.5


def test_pictures_in_the_sun_are_the_same_in_any_order() -> None:
    fingers = [Finger(60.0, 90.0), Finger(10.0, 200.0)]
    first = [SimulatedRig(sun=SUN, lit_flanks=True).render(c, 3, fingers) for c in CAMERAS]
    again = SimulatedRig(sun=SUN, lit_flanks=True)
    second = {c: again.render(c, 3, fingers) for c in reversed(CAMERAS)}
    assert all(np.array_equal(a, second[c]) for a, c in zip(first, CAMERAS, strict=True))


def test_a_sun_without_light_changes_nothing() -> None:
    dark = SimulatedRig(noise=False, sun=Sun(0.5, 0.5, 0.0))
    for finger in (Finger(60.0, 90.0), Finger(4.0, 200.0)):
        assert np.array_equal(
            dark.render("C1", 0, [finger]), rig_of("plain").render("C1", 0, [finger])
        )


@pytest.mark.parametrize(
    ("elevation_rad", "grey", "names"), [(-0.1, 40.0, "elevation_rad"), (0.4, -1.0, "grey")]
)
def test_a_sun_that_cannot_be_is_refused(elevation_rad: float, grey: float, names: str) -> None:
    with pytest.raises(ValueError, match=names):
        Sun(0.0, elevation_rad, grey)


def test_the_sun_stands_where_it_is_said_to() -> None:
    x, y, z = SUN.direction.tolist()
    assert atan2(y, x) == pytest.approx(0.3)
    assert z == pytest.approx(hypot(x, y) * tan(SUN.elevation_rad))
