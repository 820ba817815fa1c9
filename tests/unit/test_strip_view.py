"""What people are shown of a picture is what the daemon works with."""

import numpy as np
import pytest

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.config import Settings, VisionSettings
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import FloatArray, Frame, Picture, PictureFormat
from cornertouchd.pipeline import CameraPipeline, PictureError
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.strip import find_strip
from cornertouchd.vision.strip_view import MARGIN_PX, MOST_ROWS, ShownRows, contrast_of, shown_rows

RIG = SimulatedRig()
CAMERA = "C3"


def expose(light: FloatArray, index: int = 0) -> Picture:
    return RIG.expose(CAMERA, index, light.astype(np.float32))


EMPTY = np.mean([expose(RIG.light(CAMERA), index) for index in range(8)], axis=0)
TOUCHED = expose(RIG.light(CAMERA, [Finger(100.0, 200.0), Finger(250.0, 60.0)]))


def pipeline(settings: Settings) -> CameraPipeline:
    rows, width = EMPTY.shape
    calibration = CameraCalibration(
        CAMERA,
        "",
        PictureFormat(width, 480, 200, rows),
        EMPTY,
        AnglePolynomial((0.0, 0.0), (0.0, 1.0), width),
        0.1,
    )
    return CameraPipeline(calibration, settings)


def frame(pixels: Picture, number: int, lit_mask: int = 15) -> Frame:
    return Frame(CAMERA, number, 0.01 * number, lit_mask, pixels)


@pytest.fixture
def camera() -> CameraPipeline:
    return pipeline(Settings())


def test_it_shows_the_edges_that_are_observed_and_learns_nothing(camera: CameraPipeline) -> None:
    observed = camera.observe(frame(TOUCHED, 1))
    shown = camera.show(frame(TOUCHED, 1))
    again = camera.show(frame(TOUCHED, 1))
    depth = observed.shadows.depth > 0.0
    assert len(shown.edges_px) == 4
    assert shown.edges_px == pytest.approx(observed.shadows.edges_px[depth].ravel(), abs=0.01)
    assert (shown.brightness == again.brightness).all()
    assert shown.captured_at_s == 0.01


def test_it_tells_light_and_contrast(camera: CameraPipeline) -> None:
    shown = camera.show(frame(expose(RIG.light(CAMERA)), 1))
    strip = find_strip(EMPTY).visible
    assert shown.brightness[strip] == pytest.approx(1.0, abs=0.15)
    assert shown.level == pytest.approx(float(np.mean(shown.reference[strip])), rel=0.05)
    assert shown.contrast > 0.7
    assert np.isnan(shown.dark_level)
    assert shown.known[strip].mean() > 0.95
    assert not shown.known[~strip].any()


def test_the_level_of_dark_pictures_is_told_once_there_are_some(camera: CameraPipeline) -> None:
    camera.observe(frame(TOUCHED, 1))
    camera.learn_dark(frame(np.full(TOUCHED.shape, 7, np.uint8), 2, lit_mask=0))
    assert camera.show(frame(TOUCHED, 3)).dark_level == pytest.approx(7.0, abs=1.0)


def test_it_shows_the_rows_around_the_strip(camera: CameraPipeline) -> None:
    shown = camera.show(frame(TOUCHED, 1))
    strip = find_strip(EMPTY)
    rows = shown_rows(strip, len(EMPTY))
    assert rows.first <= strip.top_px[strip.visible].min() - MARGIN_PX + 1
    assert rows.stop >= strip.bottom_px[strip.visible].max() + MARGIN_PX - 1
    assert (shown.picture == TOUCHED[rows.first : rows.stop : rows.step]).all()
    assert len(shown.picture) <= MOST_ROWS
    assert not np.shares_memory(shown.picture, TOUCHED)


@pytest.mark.parametrize(("height", "step"), [(64, 1), (65, 2), (129, 3), (480, 8)])
def test_a_high_strip_is_thinned_out(height: int, step: int) -> None:
    rows = ShownRows(0, height, -(-height // MOST_ROWS))
    assert rows.step == step
    assert len(rows.of(np.zeros((height, 3), np.uint8))) <= MOST_ROWS


def test_the_papers_method_has_no_profile_but_edges() -> None:
    paper = pipeline(Settings(vision=VisionSettings(edges="paper")))
    shown = paper.show(frame(TOUCHED, 1))
    observed = paper.observe(frame(TOUCHED, 1))
    assert shown.edges_px == pytest.approx(observed.shadows.edges_px.ravel())
    assert not shown.known.any()


def test_a_picture_of_another_size_is_refused(camera: CameraPipeline) -> None:
    with pytest.raises(PictureError, match="calibrated with"):
        camera.show(frame(TOUCHED[:, :100].copy(), 1))


@pytest.mark.parametrize(
    ("light", "dark", "contrast"), [(100, 0, 1), (30, 10, 0.5), (5, 9, 0), (0, 0, 0)]
)
def test_contrast_runs_from_nothing_to_one(light: float, dark: float, contrast: float) -> None:
    assert contrast_of(light, dark) == pytest.approx(contrast)
