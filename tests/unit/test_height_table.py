"""Heights of camera and strip, horizon and shear are read from the strip of simulated rigs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cornertouchd.locating.height_table import (
    Heights,
    HeightsError,
    HeightTable,
    StripRows,
    fit_shear,
    horizon_rows,
    measure_heights,
    tabulate_heights,
)
from cornertouchd.model import FloatArray
from cornertouchd.simulation.border import STRIP_SETBACK_MM
from cornertouchd.simulation.optics import CornerCamera
from cornertouchd.simulation.rig import SMALL_STRIP_MM, SimulatedRig
from cornertouchd.vision.strip import Strip, find_strip

SURFACE_MM = (350.0, 400.0)
WIDTH = 640


class Eye:
    """One simulated camera: the truth, and what its strip looks like."""

    def __init__(self, reflectance: float = 0.93, camera: str = "C1", seed: int = 1) -> None:
        rig = SimulatedRig(SURFACE_MM, seed=seed, reflectance=reflectance)
        empty = np.mean([rig.render(camera, index, ()) for index in range(4)], axis=0)
        self.camera: CornerCamera = rig.truth.cameras[camera]
        self.row_offset_px = rig.formats[camera].row_offset_px
        self.place_mm = (self.camera.x_mm, self.camera.y_mm)
        self.angles_rad = self.camera.angles_rad(np.arange(WIDTH + 1.0))
        self.rows = rows_of(find_strip(empty))

    def measure(self, top_mm: float | None = None) -> Heights:
        return measure_heights(
            self.rows, self.angles_rad, self.place_mm, SURFACE_MM, STRIP_SETBACK_MM, top_mm
        )

    def table(self, heights: Heights) -> HeightTable:
        return tabulate_heights(
            "C1",
            heights,
            self.rows,
            self.angles_rad,
            self.place_mm,
            SURFACE_MM,
            STRIP_SETBACK_MM,
        )


def rows_of(strip: Strip) -> StripRows:
    bottom_px = strip.bottom_px if strip.mirrored else None
    return StripRows(strip.top_px, strip.surface_px, bottom_px, strip.visible)


GLOSSY, MATT = Eye(), Eye(reflectance=0.0)


@pytest.mark.parametrize(("camera", "seed"), [("C1", 1), ("C2", 1), ("C3", 2), ("C4", 3)])
def test_heights_of_camera_and_strip(camera: str, seed: int) -> None:
    eye = Eye(camera=camera, seed=seed)
    heights = eye.measure()
    off_mm = heights.camera_mm - eye.camera.height_mm
    assert abs(off_mm) < 0.3
    assert abs(off_mm) < 3 * heights.camera_sigma_mm
    assert heights.camera_sigma_mm < 0.3
    assert heights.strip_top_mm == pytest.approx(SMALL_STRIP_MM + 0.8, abs=0.4)
    assert heights.residual_px < 0.1


def test_a_matt_screen_will_do() -> None:
    heights = MATT.measure()
    assert heights.camera_mm == pytest.approx(MATT.camera.height_mm, abs=0.5)
    assert heights.strip_top_mm == pytest.approx(SMALL_STRIP_MM + 0.8, abs=0.5)


@pytest.mark.parametrize("eye", [GLOSSY, MATT], ids=["glossy", "matt"])
def test_a_known_height_of_the_strip_is_kept(eye: Eye) -> None:
    heights = eye.measure(top_mm=13.4)
    assert heights.strip_top_mm == pytest.approx(13.4, abs=0.02)
    assert heights.strip_top_sigma_mm < 0.02
    assert heights.camera_mm == pytest.approx(eye.camera.height_mm, abs=0.5)


@settings(max_examples=40)
@given(column=st.floats(40, 600), height_mm=st.floats(-4, 12), away_mm=st.floats(150, 380))
def test_the_table_tells_the_height_of_rays(
    column: float, height_mm: float, away_mm: float
) -> None:
    """A place at a height (below 0: in the mirror) is seen on the row that the table says."""
    eye, table = GLOSSY, GLOSSY.table(GLOSSY.measure())
    angle = float(eye.camera.angles_rad(np.array([column]))[0])
    rise = (height_mm - eye.camera.height_mm) / away_mm
    seen, row = eye.camera.project(np.array([[np.cos(angle)], [np.sin(angle)], [rise]]))
    at = float(seen[0]), float(row[0]) - eye.row_offset_px
    slope = (value(table.horizon_px, at[0]) - at[1]) / value(table.rows_per_slope_px, at[0])
    assert table.camera_mm + away_mm * slope == pytest.approx(height_mm, abs=0.4)
    on_horizon = at[0] - value(table.shear, at[0]) * (at[1] - value(table.horizon_px, at[0]))
    assert on_horizon == pytest.approx(column, abs=0.6)  # barrel bends what shear leaves


def value(by_column: FloatArray, column: float) -> float:
    return float(np.interp(column, np.arange(WIDTH) + 0.5, by_column))


def test_the_table_knows_strip_and_mirror_image() -> None:
    table = GLOSSY.table(GLOSSY.measure())
    seen = table.visible
    middle = int(np.argmax(np.where(seen, table.strip_mm, 0.0)))
    corner_mm = np.hypot(*(np.array(SURFACE_MM) + STRIP_SETBACK_MM - GLOSSY.place_mm))
    assert table.strip_mm[middle] == pytest.approx(corner_mm, rel=0.02)
    assert table.bottom_px is not None
    assert GLOSSY.rows.bottom_px is not None
    assert np.array_equal(table.bottom_px, GLOSSY.rows.bottom_px)
    assert np.array_equal(seen, GLOSSY.rows.visible)
    assert MATT.table(MATT.measure()).bottom_px == pytest.approx(MATT.rows.surface_px)


def test_a_camera_that_hangs_upside_down_tells_the_same_heights() -> None:
    upright, rows = GLOSSY.measure(), GLOSSY.rows
    assert rows.bottom_px is not None
    turned = StripRows(
        64 - rows.bottom_px[::-1],
        64 - rows.surface_px[::-1],
        64 - rows.top_px[::-1],
        rows.visible[::-1],
    )
    arguments = (turned, GLOSSY.angles_rad[::-1], GLOSSY.place_mm, SURFACE_MM)
    hanging = measure_heights(*arguments, STRIP_SETBACK_MM)
    assert hanging.camera_mm == pytest.approx(upright.camera_mm, abs=1e-6)
    assert hanging.strip_top_mm == pytest.approx(upright.strip_top_mm, abs=1e-6)
    table = tabulate_heights("C1", hanging, *arguments, STRIP_SETBACK_MM)
    of_upright = GLOSSY.table(upright)
    assert table.horizon_px == pytest.approx(64 - of_upright.horizon_px[::-1], abs=1e-6)
    assert table.rows_per_slope_px == pytest.approx(-of_upright.rows_per_slope_px[::-1], rel=1e-6)
    assert table.bottom_px == pytest.approx(turned.top_px)


def test_lines_of_the_lookup_table_end_somewhere() -> None:
    angles = GLOSSY.angles_rad.copy()
    angles[:60] = angles[300:310] = np.nan
    arguments = (GLOSSY.rows, angles, GLOSSY.place_mm, SURFACE_MM, STRIP_SETBACK_MM)
    heights = measure_heights(*arguments)
    assert heights.camera_mm == pytest.approx(GLOSSY.camera.height_mm, abs=0.5)


class TestWhatCannotTell:
    def test_a_strip_that_is_equally_far_everywhere(self) -> None:
        flat = np.full(WIDTH, 20.0)
        rows = StripRows(flat, flat, flat, GLOSSY.rows.visible)
        with pytest.raises(HeightsError, match="height comes out at"):
            measure_heights(rows, GLOSSY.angles_rad, GLOSSY.place_mm, SURFACE_MM)

    def test_rows_that_are_no_strip(self) -> None:
        noise = np.random.default_rng(1).uniform(0, 64, (3, WIDTH))
        rows = StripRows(*noise, GLOSSY.rows.visible)
        with pytest.raises(HeightsError, match="px off those of a strip"):
            measure_heights(rows, GLOSSY.angles_rad, GLOSSY.place_mm, SURFACE_MM)

    def test_a_strip_that_is_hardly_seen(self) -> None:
        rows = replace(GLOSSY.rows, visible=np.arange(WIDTH) < 30)
        with pytest.raises(HeightsError, match="30 columns"):
            measure_heights(rows, GLOSSY.angles_rad, GLOSSY.place_mm, SURFACE_MM)

    def test_a_camera_without_lines(self) -> None:
        angles = np.full(WIDTH + 1, np.nan)
        with pytest.raises(HeightsError, match="directing line"):
            measure_heights(GLOSSY.rows, angles, GLOSSY.place_mm, SURFACE_MM)


class TestShear:
    """Lines of upright fingers, drawn as they are seen by a camera that shears."""

    TRUE = (0.03, -0.02)

    def lines(self, lean: float, count: int = 16) -> tuple[FloatArray, FloatArray]:
        rng = np.random.default_rng(4)
        w = rng.uniform(-0.9, 0.9, count)
        rows = np.linspace(10.0, 20.0, 7) + np.zeros((count, 1))
        slopes = self.TRUE[0] + self.TRUE[1] * w + lean * rng.standard_normal(count)
        columns = (w[:, None] + 1) * WIDTH / 2 + slopes[:, None] * (rows - 15.0)
        return columns + 0.02 * rng.standard_normal(columns.shape), rows

    def test_upright_fingers_show_it(self) -> None:
        columns, rows = self.lines(0.0)
        columns[3, 2] = np.nan
        heights = fit_shear(GLOSSY.measure(), WIDTH, columns, rows)
        assert heights.shear == pytest.approx(self.TRUE, abs=0.006)

    def test_leaning_fingers_count_for_little(self) -> None:
        before = GLOSSY.measure()
        heights = fit_shear(before, WIDTH, *self.lines(0.4))
        assert heights.shear == pytest.approx(before.shear, abs=0.02)

    def test_a_finger_that_leans_among_upright_ones_is_left_out(self) -> None:
        columns, rows = self.lines(0.0)
        columns[0] += 0.8 * (rows[0] - 15.0)
        heights = fit_shear(GLOSSY.measure(), WIDTH, columns, rows)
        assert heights.shear == pytest.approx(self.TRUE, abs=0.008)

    def test_without_lines_it_is_that_of_the_roll(self) -> None:
        heights = GLOSSY.measure()
        nothing = np.full((16, 7), np.nan)
        assert fit_shear(heights, WIDTH, nothing, nothing) == heights
        assert heights.shear[0] == pytest.approx(np.tan(GLOSSY.camera.roll_rad), abs=0.002) or (
            heights.shear[0] == pytest.approx(-np.tan(GLOSSY.camera.roll_rad), abs=0.002)
        )


def test_the_horizon_lies_where_rays_run_level() -> None:
    heights = GLOSSY.measure()
    columns = np.arange(WIDTH) + 0.5
    angles = GLOSSY.camera.angles_rad(columns)
    level = np.stack([np.cos(angles), np.sin(angles), np.zeros(WIDTH)])
    true_px = GLOSSY.camera.project(level)[1] - GLOSSY.row_offset_px
    off_px = (horizon_rows(heights, WIDTH) - true_px)[GLOSSY.rows.visible]
    assert np.abs(off_px).max() < 0.25
