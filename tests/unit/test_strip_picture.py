"""The picture of the empty strip shows what was measured, and stays small enough to be mailed."""

import cv2
import numpy as np
import pytest

from cornertouchd.guiding.light_statistics import DimRun, LightStatistics
from cornertouchd.guiding.strip_picture import (
    DIM,
    LEFT_PX,
    MAXIMUM,
    MEAN,
    MINIMUM,
    NOISE,
    PANEL_PX,
    draw_strip_statistics,
)
from cornertouchd.model import FloatArray, Picture

FIRST, LAST = 20, 600


def statistics(
    camera: str = "C1", swing: float = 40.0, noise: float = 3.0, width_px: int = 640
) -> LightStatistics:
    """A strip at 128 that once was so much brighter and so much darker."""
    mean: FloatArray = np.full(width_px, np.nan)
    mean[FIRST:LAST] = 128.0
    return LightStatistics(
        camera,
        12,
        mean - swing,
        mean + swing,
        mean,
        np.where(np.isfinite(mean), noise, np.nan),
        strip_gradient=30.0,
        finger_gradient=90.0,
        dim_runs=(DimRun(200, 219, 0.4),),
    )


def panel(png: bytes, number: int = 0) -> Picture:
    """Return the pixels of a camera's curves, found by the ink around them."""
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    frame = np.flatnonzero((image[:, LEFT_PX : LEFT_PX + PANEL_PX[0]] == MEAN).all(axis=(1, 2)))
    top = int(frame[2 * number])
    return np.asarray(image[top + 1 : top + PANEL_PX[1], LEFT_PX : LEFT_PX + PANEL_PX[0]], np.uint8)


def level(pixels: Picture, column: int, colour: tuple[int, int, int]) -> float:
    """Return the grey level at which a curve of this colour crosses a column."""
    rows = np.flatnonzero((pixels[:, column] == colour).all(axis=1))
    assert len(rows)
    return float(256.0 * (1.0 - (rows.mean() + 1.5) / PANEL_PX[1]))


def test_curves_are_where_their_values_are() -> None:
    pixels = panel(draw_strip_statistics([statistics()]))
    for colour, value in ((MINIMUM, 88.0), (MEAN, 128.0), (MAXIMUM, 168.0)):
        assert abs(level(pixels, 400, colour) - value) < 3.0


def test_the_noise_is_drawn_to_one_scale_for_all_cameras() -> None:
    png = draw_strip_statistics([statistics("C1", noise=1.0), statistics("C2", noise=4.0)])
    quiet, loud = (level(panel(png, number), 400, NOISE) for number in (0, 1))
    assert 3.0 < loud / quiet < 5.0


@pytest.mark.parametrize(("width_px", "first", "last"), [(640, 200, 219), (1280, 100, 109)])
def test_dim_leds_are_marked_and_no_others(width_px: int, first: int, last: int) -> None:
    pixels = panel(draw_strip_statistics([statistics(width_px=width_px)]))
    marked = np.flatnonzero((pixels == DIM).all(axis=2).mean(axis=0) > 0.5)
    assert marked.tolist() == list(range(first, last + 1))


def test_columns_without_a_strip_are_grey_and_empty() -> None:
    pixels = panel(draw_strip_statistics([statistics()]))
    for columns in (slice(1, FIRST - 2), slice(LAST + 2, PANEL_PX[0] - 1)):
        assert len(np.unique(pixels[:, columns])) == 1
    assert (pixels[0, 400] == 255).all()


def test_every_camera_has_a_panel_however_wide_its_pictures() -> None:
    one = draw_strip_statistics([statistics()])
    four = draw_strip_statistics([statistics(f"C{k}", width_px=1280) for k in range(1, 5)])
    assert len(panel(four, 3)) == len(panel(one))
    assert abs(level(panel(four, 3), 200, MEAN) - 128.0) < 3.0


def test_four_cameras_of_noise_still_make_a_small_file() -> None:
    rng = np.random.default_rng(5)
    seen = []
    for camera in ("C1", "C2", "C3", "C4"):
        low, middle, high = np.sort(rng.uniform(20.0, 250.0, (3, 1280)), axis=0)
        sigma = rng.uniform(0.0, 50.0, 1280)
        seen.append(LightStatistics(camera, 48, low, high, middle, sigma, 250.0, 90.0, ()))
    assert len(draw_strip_statistics(seen)) < 150_000


def test_a_strip_without_noise_can_be_drawn() -> None:
    assert draw_strip_statistics([statistics(noise=0.0)]).startswith(b"\x89PNG")
