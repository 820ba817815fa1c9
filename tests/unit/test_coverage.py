"""A scribble suffices when it has been nearly everywhere, and keeps no more than it needs."""

import numpy as np
import pytest

from cornertouchd.guiding.coverage import MOST_IN_CELL, ScribbleCoverage
from cornertouchd.simulation.hand import place_on_rows

SURFACES = [(350.0, 400.0), (2400.0, 1350.0), (400.0, 350.0)]


def place(x_mm: float, y_mm: float) -> np.ndarray:
    return np.array([x_mm, y_mm])


@pytest.mark.parametrize("surface_mm", SURFACES)
def test_a_finger_moved_row_by_row_suffices(surface_mm: tuple[float, float]) -> None:
    coverage = ScribbleCoverage(surface_mm)
    kept = 0
    for step in range(5000):
        kept += coverage.wants(place(*place_on_rows(surface_mm, 15.0 * step)))
        if coverage.is_enough:
            break
    assert coverage.is_enough
    assert coverage.visited.mean() >= 0.9
    assert 60 < kept < 500


def test_one_half_does_not_suffice() -> None:
    coverage = ScribbleCoverage((350.0, 400.0))
    rng = np.random.default_rng(1)
    for _ in range(3000):
        coverage.wants(place(*rng.uniform([0.0, 0.0], [175.0, 400.0])))
    assert coverage.share == pytest.approx(0.5 / 0.9, abs=0.05)


def test_a_finger_that_rests_is_kept_once() -> None:
    coverage = ScribbleCoverage((350.0, 400.0))
    assert sum(coverage.wants(place(100.0, 100.0)) for _ in range(100)) == 1


def test_a_place_is_not_kept_for_ever() -> None:
    coverage = ScribbleCoverage((350.0, 400.0))
    kept = sum(coverage.wants(place(30.0 + 20.0 * (k % 2), 30.0)) for k in range(100))
    assert kept == MOST_IN_CELL


def test_what_is_not_on_the_surface_does_not_count() -> None:
    coverage = ScribbleCoverage((350.0, 400.0))
    assert not coverage.wants(place(-5.0, 100.0))
    assert not coverage.wants(place(100.0, 401.0))
    assert not coverage.wants(np.array([np.nan, 10.0]))
    assert not coverage.visited.any()
