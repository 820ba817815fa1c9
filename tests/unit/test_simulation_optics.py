"""Lens and camera of the simulation: pixels and directions are inverse, and signs are right."""

from math import pi, radians

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.simulation.optics import CornerCamera, Lens


def corner_camera(yaw_rad: float, pitch_rad: float, roll_rad: float) -> CornerCamera:
    lens = Lens.with_field(radians(97.0), 640, (322.0, 239.0), 0.3)
    return CornerCamera("C1", 0.0, 0.0, 6.0, yaw_rad, pitch_rad, roll_rad, lens)


@settings(deadline=None)
@given(barrel=st.floats(0.0, 0.5), x=st.floats(-1.2, 1.2), y=st.floats(-0.3, 0.3))
def test_a_lens_maps_rays_to_pixels_and_back(barrel: float, x: float, y: float) -> None:
    lens = Lens.with_field(radians(97.0), 640, (322.0, 239.0), barrel)
    back = lens.plane(*lens.pixels(np.array([x]), np.array([y])))
    assert np.ravel(back) == pytest.approx([x, y], abs=1e-9)


@pytest.mark.parametrize("barrel", [0.0, 0.3])
def test_the_field_of_a_lens_fills_the_width_of_the_picture(barrel: float) -> None:
    lens = Lens.with_field(radians(97.0), 640, (320.0, 240.0), barrel)
    columns_px, _ = lens.pixels(np.tan(np.radians([-48.5, 48.5])), np.zeros(2))
    assert columns_px == pytest.approx([0.0, 640.0])


@settings(deadline=None)
@given(
    yaw_rad=st.floats(-pi, pi),
    pitch_rad=st.floats(-0.05, 0.05),
    roll_rad=st.floats(-0.05, 0.05),
    offset_rad=st.floats(-0.85, 0.85),
)
def test_columns_and_angles_of_a_camera_are_inverse(
    yaw_rad: float, pitch_rad: float, roll_rad: float, offset_rad: float
) -> None:
    camera = corner_camera(yaw_rad, pitch_rad, roll_rad)
    angles_rad = np.array([yaw_rad + offset_rad])
    assert camera.angles_rad(camera.columns_px(angles_rad)) == pytest.approx(angles_rad, abs=1e-8)


@settings(deadline=None)
@given(column_px=st.floats(0.0, 640.0), row_px=st.floats(200.0, 280.0))
def test_a_ray_arrives_at_the_pixel_it_came_from(column_px: float, row_px: float) -> None:
    camera = corner_camera(2.4, 0.01, -0.008)
    rays = camera.rays(np.array([column_px]), np.array([row_px]))
    assert np.linalg.norm(rays[:, 0]) == pytest.approx(1.0)
    assert np.ravel(camera.project(rays)) == pytest.approx([column_px, row_px])


@pytest.mark.parametrize("yaw_rad", [pi / 4.0, 3.0 * pi / 4.0, -pi / 4.0])
def test_columns_grow_with_the_angle_from_x_towards_y(yaw_rad: float) -> None:
    angles_rad = corner_camera(yaw_rad, 0.01, 0.01).angles_rad(np.linspace(0.5, 639.5, 640))
    assert np.all(np.diff(angles_rad) > 0.0)
    assert angles_rad[0] < yaw_rad < angles_rad[-1]


def test_rows_grow_towards_the_surface_and_a_rolled_camera_sees_its_right_risen() -> None:
    camera = corner_camera(0.0, 0.0, radians(1.0))
    low, high, right = np.array([[1.0, 0.0, -0.1], [1.0, 0.0, 0.1], [1.0, 0.3, 0.0]])
    assert camera.project(low)[1] > camera.project(high)[1]
    assert camera.project(right)[1] < camera.lens.centre_row_px


def test_pitch_lifts_the_axis_and_sinks_the_picture() -> None:
    ahead = np.array([1.0, 0.0, 0.0])
    level, lifted = corner_camera(0.0, 0.0, 0.0), corner_camera(0.0, radians(1.0), 0.0)
    assert lifted.project(ahead)[1] > level.project(ahead)[1] + 5.0
