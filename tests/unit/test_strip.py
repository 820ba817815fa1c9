"""The strip is found from empty pictures, whatever its row, tilt, curve and ripple."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erf

from cornertouchd.model import FloatArray
from cornertouchd.vision.strip import Strip, StripNotFoundError, find_strip

ROWS, WIDTH, CORNER = 64, 640, 330


def heights() -> FloatArray:
    """Height of the direct strip: farthest at the corner, so lowest there."""
    return 15 - 7 * np.clip(1 - np.abs(np.arange(WIDTH) - CORNER) / 300, 0, 1)


def edge(rows: FloatArray, at: FloatArray) -> FloatArray:
    return (1 + erf((rows - at) / (0.8 * np.sqrt(2)))) / 2


def draw(
    row: float, tilt: float, curve: float, ripple: float, mirror: float, notch: bool = True
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a picture, and the rows of the strip's top and of the surface."""
    w = np.linspace(-1, 1, WIDTH)
    height = heights()
    surface = row + tilt * w + curve * w * w + 0.5 * height
    top = surface - height
    level = 180 * (1 + ripple * np.sin(np.arange(WIDTH) / 3.0))
    rows = np.arange(ROWS)[:, None] + 0.5
    direct = edge(rows, top) - edge(rows, surface - 0.8)
    mirrored = edge(rows, surface + 0.8) - edge(rows, surface + height)
    picture = 3 + level * (direct + mirror * mirrored)
    if notch:
        picture[:, CORNER - 2 : CORNER + 3] = 5
    return picture, top, surface


def worst(strip: Strip, top: FloatArray, surface: FloatArray) -> tuple[float, float]:
    seen = strip.visible
    return (
        float(np.abs(strip.top_px - top)[seen].max()),
        float(np.abs(strip.surface_px - surface)[seen].max()),
    )


@settings(max_examples=15, deadline=None)
@given(
    row=st.floats(26, 34),
    tilt=st.floats(-4, 4),
    curve=st.floats(-4, 4),
    ripple=st.floats(0, 0.25),
    mirror=st.floats(0.45, 1.0),
)
def test_strip_and_surface_line_are_found(
    row: float, tilt: float, curve: float, ripple: float, mirror: float
) -> None:
    picture, top, surface = draw(row, tilt, curve, ripple, mirror)
    strip = find_strip(picture)
    assert strip.mirrored
    assert strip.visible.sum() > 0.95 * WIDTH
    top_off, surface_off = worst(strip, top, surface)
    assert top_off < 0.6
    assert surface_off < 0.4


def test_the_mirror_image_is_not_part_of_the_strip() -> None:
    picture, _, surface = draw(30, 0, 0, 0.1, 0.9)
    strip = find_strip(picture)
    assert (strip.surface_px[strip.visible] < surface[strip.visible] + 0.5).all()
    assert np.allclose(strip.height_px[strip.visible], heights()[strip.visible], atol=0.7)


def test_a_matt_screen_without_mirror_image_will_do() -> None:
    picture, top, surface = draw(30, 2, -2, 0.1, 0.0)
    strip = find_strip(picture)
    assert not strip.mirrored
    top_off, surface_off = worst(strip, top, surface)
    assert top_off < 0.6
    assert surface_off < 1.2


def test_the_camera_in_the_far_corner_is_not_strip() -> None:
    picture, _, _ = draw(30, 0, 0, 0.1, 0.8)
    strip = find_strip(picture)
    assert not strip.visible[CORNER - 2 : CORNER + 3].any()
    assert strip.visible[[CORNER - 12, CORNER + 12]].all()


def test_a_dark_led_elsewhere_is_still_strip() -> None:
    picture, _, _ = draw(30, 0, 0, 0.1, 0.8)
    picture[:, 150:160] = 3 + 0.5 * (picture[:, 150:160] - 3)
    assert find_strip(picture).visible[140:170].all()


def test_the_own_strips_beside_the_camera_are_not_strip() -> None:
    picture, _, _ = draw(30, 0, 0, 0.1, 0.8)
    picture[:, :10] = 5
    picture[:, 630:] = 5
    picture[:40, :8] = 220
    picture[:, 634:] = 220
    strip = find_strip(picture)
    assert not strip.visible[:8].any()
    assert not strip.visible[634:].any()
    assert strip.visible[15:300].all()


def test_own_strips_that_end_inside_a_whole_picture_are_not_strip_either() -> None:
    """Without a band cut out, the strips next to the camera begin and end in the picture too."""
    picture, top, surface = draw(30, 0, 0, 0.1, 0.8)
    whole = np.full((200, WIDTH), 3.0)
    whole[68 : 68 + ROWS] = picture
    for column in range(40):
        tall = 30 + 2 * (40 - column)
        for u in (column, WIDTH - 1 - column):
            whole[:, u] = 3
            if column < 34:
                whole[98 - tall : 98, u] = 200
                whole[99 : 99 + tall, u] = 170
    strip = find_strip(whole)
    assert not strip.visible[:34].any()
    assert not strip.visible[-34:].any()
    assert strip.visible[45:300].all()
    assert np.abs((strip.top_px - top - 68)[strip.visible]).max() < 0.6
    assert np.abs((strip.surface_px - surface - 68)[strip.visible]).max() < 0.4


def test_the_horizon_lies_at_the_height_of_the_camera() -> None:
    picture, top, surface = draw(30, 3, -2, 0.1, 0.8)
    strip = find_strip(picture)
    off = strip.horizon_px - (top + surface) / 2
    assert np.abs(off[strip.visible]).max() < 0.8


def test_a_dark_picture_says_so() -> None:
    with pytest.raises(StripNotFoundError, match="dark"):
        find_strip(np.full((ROWS, WIDTH), 3.0))


def test_a_picture_without_a_whole_strip_says_so() -> None:
    picture, _, _ = draw(30, 0, 0, 0.1, 0.8)
    with pytest.raises(StripNotFoundError, match="columns"):
        find_strip(picture[28:])
