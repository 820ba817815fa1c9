"""Places to tap: all over the surface, clear of the cameras' lines of sight to each other."""

import numpy as np
import pytest

from cornertouchd.guiding.targets import (
    FRAME_INSET_MM,
    NEAR_CORNER_MM,
    TAPS,
    VALIDATION_NAMES,
    calibration_targets,
    clear_of_diagonals_mm,
    frame_targets,
    targets_for,
    validation_targets,
)

SURFACES = [(350.0, 400.0), (2400.0, 1350.0), (1000.0, 300.0)]


def beside_diagonals_mm(places: np.ndarray, surface_mm: tuple[float, float]) -> np.ndarray:
    """Distance of each place to the nearer diagonal."""
    width, height = surface_mm
    x, y = places[:, 0], places[:, 1]
    falling = np.abs(x * height - y * width) / np.hypot(width, height)
    rising = np.abs((width - x) * height - y * width) / np.hypot(width, height)
    return np.minimum(falling, rising)


@pytest.mark.parametrize("surface_mm", SURFACES)
def test_the_grid_reaches_from_corner_to_corner(surface_mm: tuple[float, float]) -> None:
    grid = calibration_targets(surface_mm)
    assert grid.shape == (16, 2)
    assert np.array_equal(grid, np.rint(grid))
    assert grid.min(axis=0) == pytest.approx([25.0, 25.0])
    assert grid.max(axis=0) == pytest.approx(np.array(surface_mm) - 25.0)
    assert len(np.unique(grid.round(3), axis=0)) == 16


@pytest.mark.parametrize("surface_mm", SURFACES)
@pytest.mark.parametrize("side", [2, 3, 4, 5])
def test_inner_targets_are_clear_of_the_diagonals(
    surface_mm: tuple[float, float], side: int
) -> None:
    grid = calibration_targets(surface_mm, side, side)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * surface_mm
    to_corner = np.linalg.norm(grid[:, None] - corners, axis=2).min(axis=1)
    inner = to_corner >= NEAR_CORNER_MM
    assert np.all(
        beside_diagonals_mm(grid[inner], surface_mm) > clear_of_diagonals_mm(surface_mm) - 1.0
    )
    assert np.all((grid > 0) & (grid < surface_mm))


@pytest.mark.parametrize("surface_mm", SURFACES)
def test_places_along_the_frame_are_equally_far_apart(surface_mm: tuple[float, float]) -> None:
    places = frame_targets(surface_mm, 225)
    way = 2 * (sum(surface_mm) - 4 * FRAME_INSET_MM)
    steps = np.abs(np.diff(np.vstack([places, places[:1]]), axis=0)).sum(axis=1)
    assert steps == pytest.approx(way / 225, abs=0.2)
    inside = np.minimum(places, np.array(surface_mm) - places).min(axis=1)
    assert inside == pytest.approx(FRAME_INSET_MM, abs=0.051)


def test_every_method_has_its_targets() -> None:
    for method, count in TAPS.items():
        assert len(targets_for(method, SURFACES[0])) == count
    assert len(targets_for("lookup-table", SURFACES[0], 60)) == 60
    assert len(targets_for("auto", SURFACES[0], 25)) == 25
    assert len(targets_for("auto", SURFACES[0], 0)) == 0


def test_a_check_is_made_at_other_places_than_the_taps() -> None:
    for surface_mm in SURFACES:
        checks = validation_targets(surface_mm)
        assert len(checks) == len(VALIDATION_NAMES)
        apart = np.linalg.norm(checks[:, None] - calibration_targets(surface_mm), axis=2)
        assert apart.min() > 15.0
