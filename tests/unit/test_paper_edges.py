"""The paper's finder, equation by equation."""

import numpy as np
import pytest

from cornertouchd.config import PaperVisionSettings
from cornertouchd.model import FloatArray
from cornertouchd.vision.paper_edges import (
    PaperFinder,
    find_edges,
    gradient,
    merge_edges,
    strip_line,
    strip_mask,
)
from cornertouchd.vision.strip import Strip

WIDTH, ROWS = 80, 12


def flat_strip(visible: slice = slice(0, WIDTH)) -> Strip:
    seen = np.zeros(WIDTH, bool)
    seen[visible] = True
    top, surface = np.full(WIDTH, 3.0), np.full(WIDTH, 8.0)
    return Strip(top, surface, surface, (top + surface) / 2, seen, mirrored=True, dark_level=2.0)


def picture_with_shadow(left: int, right: int) -> np.ndarray:
    picture = np.full((ROWS, WIDTH), 2, np.uint8)
    picture[3:8] = 200
    picture[:, left : right + 1] = 10
    return picture


def test_mask_holds_the_strip_and_nothing_else() -> None:
    mask = strip_mask(flat_strip(slice(5, 70)), ROWS)
    assert mask[3:8, 7:68].all()
    assert mask.sum() == 5 * 61  # two half-shaded columns at either end are left out


def test_line_is_the_nearest_row_to_the_middle_of_the_mask() -> None:
    line = strip_line(strip_mask(flat_strip(slice(5, 70)), ROWS))
    assert (line[7:68] == 5).all()
    assert (line[:7] == -1).all()


def test_mean_is_that_of_nine_pixels_of_the_mask() -> None:
    picture = np.arange(ROWS * WIDTH).reshape(ROWS, WIDTH).astype(np.uint8)
    means = PaperFinder(flat_strip(), ROWS, PaperVisionSettings()).mean_values(picture)
    assert means[20] == pytest.approx(picture[4:7, 19:22].mean())


def test_mean_is_unknown_outside_the_mask() -> None:
    finder = PaperFinder(flat_strip(slice(5, 70)), ROWS, PaperVisionSettings())
    means = finder.mean_values(picture_with_shadow(30, 40))
    assert np.isnan(means[:7]).all()
    assert np.isfinite(means[7:68]).all()


def test_gradient_is_positive_where_brightness_falls() -> None:
    values: FloatArray = np.array([100.0, 100, 60, 20, 20])
    assert gradient(values).tolist() == [0, 80, 160, 80, 0]


def test_only_gradients_beyond_t1_are_edges() -> None:
    slope = np.array([0.0, 5, 30, 5, 0, -4, -9, -4, 0, -40, 0])
    assert find_edges(slope, 20.0) == ([2], [9])


def test_only_widths_between_t2_and_t3_merge() -> None:
    assert merge_edges([10, 50], [11, 40, 95], t2_px=1, t3_px=35) == [(10, 40)]


def test_an_isolated_edge_is_dropped() -> None:
    assert merge_edges([10], [], t2_px=1, t3_px=35) == []
    assert merge_edges([], [10], t2_px=1, t3_px=35) == []


def test_a_finger_is_found_at_its_middle() -> None:
    finder = PaperFinder(flat_strip(), ROWS, PaperVisionSettings())
    (shadow,) = finder.find(picture_with_shadow(30, 40))
    assert (shadow.left_px + shadow.right_px) / 2 == pytest.approx(35.5, abs=0.5)
