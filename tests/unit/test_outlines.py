"""Outlines lie on the fingers' true outlines, up and down the strip and its mirror image."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracle import outlines as oracle

from cornertouchd.calibration.calibration import CameraCalibration
from cornertouchd.config import MotionSettings, PaperVisionSettings, Settings, VisionSettings
from cornertouchd.fusion.motion import CommonTime
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.model import FloatArray, Frame, FrameSet, Outlines, Picture, Shadows
from cornertouchd.pipeline import CameraPipeline
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.optics import CornerCamera
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.finder import ProfileFinder
from cornertouchd.vision.outlines import LEVELS, OutlineTracer, level_rows
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import Strip, find_strip
from cornertouchd.vision.waist import WAIST_ABOVE_PX

VISION = VisionSettings()


@dataclass(frozen=True)
class Eye:
    """One camera of a rig that knows its empty picture."""

    rig: SimulatedRig
    camera: CornerCamera
    empty: FloatArray
    strip: Strip
    finder: ProfileFinder
    tracer: OutlineTracer

    @property
    def reference(self) -> Reference:
        return self.finder.sampler.reference

    def picture(self, fingers: Sequence[Finger], index: int = 99) -> Picture:
        return self.rig.render(self.camera.id, index, fingers)

    def look(self, picture: Picture) -> tuple[Shadows, Outlines]:
        shadows, gain = self.finder.find_with_hidden(picture)
        return shadows, self.tracer.trace(picture, shadows, self.reference, gain)

    def off_outline_px(self, finger: Finger, columns: FloatArray, rows: FloatArray) -> FloatArray:
        """Return by how many columns rays pass the true surface of a finger, mirrored or not."""
        offset = self.rig.formats[self.camera.id].row_offset_px
        rays = self.camera.rays(columns, rows + offset)
        eye = np.array([self.camera.x_mm, self.camera.y_mm, self.camera.height_mm])
        tip = np.array([finger.x_mm, finger.y_mm, finger.tip_height_mm])
        passed = np.minimum(
            distance_to_axis(rays.T, tip - eye, np.array(finger.axis)),
            distance_to_axis((rays.T * [1, 1, -1]), tip - eye * [1, 1, -1], np.array(finger.axis)),
        )
        away_mm = float(np.hypot(*(tip - eye)[:2]))
        px_rad = 1.0 / np.median(np.diff(self.camera.angles_rad(columns.mean() + np.arange(-1, 2))))
        off_px: FloatArray = (passed - finger.diameter_mm / 2) / away_mm * px_rad
        return off_px


def distance_to_axis(rays: FloatArray, tip: FloatArray, axis: FloatArray) -> FloatArray:
    """Return how far rays (N, 3) from the origin pass by the half-line from a tip upwards."""
    along, of_tip, at_tip = rays @ axis, rays @ tip, float(axis @ tip)
    beyond = np.maximum((along * of_tip - at_tip) / (1 - along**2), 0.0)
    nearest = tip + beyond[:, None] * axis
    forward = np.sum(nearest * rays, axis=1)
    return np.asarray(np.sqrt(np.sum(nearest**2, axis=1) - forward**2))


def make_eye(rig: SimulatedRig, camera: str = "C2") -> Eye:
    empty = np.mean([rig.render(camera, index, ()) for index in range(8)], axis=0)
    strip = find_strip(empty)
    finder = ProfileFinder(strip, empty, VISION)
    tracer = OutlineTracer(strip, empty, finder.sampler.reference, VISION)
    return Eye(rig, rig.truth.cameras[camera], empty, strip, finder, tracer)


GLOSSY = make_eye(SimulatedRig())
MATT = make_eye(SimulatedRig(reflectance=0.0))

LEANING = st.builds(
    Finger,
    st.floats(60, 300),
    st.floats(60, 340),
    st.floats(8, 14),
    st.floats(0, 0.8),
    st.floats(0, 6.28),
    st.sampled_from([0.0, 0.0, 1.5]),
)


@settings(max_examples=40)
@given(finger=LEANING, glossy=st.booleans())
def test_outlines_lie_on_the_finger_and_its_mirror_image(finger: Finger, glossy: bool) -> None:
    eye = GLOSSY if glossy else MATT
    shadows, outlines = eye.look(eye.picture([finger]))
    assert outlines.columns_px.shape == (len(shadows), 2, len(LEVELS) * (2 if glossy else 1))
    met = np.isfinite(outlines.columns_px)
    assert np.array_equal(met, np.isfinite(outlines.rows_px))
    if finger.height_mm == 0.0:  # otherwise there is light in between
        whole = shadows.valid.all(axis=1)  # others run into what hides the strip
        assert (met.sum(axis=2)[whole] >= 0.8 * met.shape[2]).all()
    if met.any():
        off_px = eye.off_outline_px(finger, outlines.columns_px[met], outlines.rows_px[met])
        assert np.sqrt(np.mean(off_px**2)) < 0.2
        assert np.percentile(np.abs(off_px), 80) < 0.25


@settings(max_examples=25)
@given(
    fingers=st.lists(LEANING, max_size=8),
    exposure=st.floats(0.7, 1.1),
    dimmed=st.integers(0, 600),
)
def test_the_compiled_tracer_does_what_the_oracle_does(
    fingers: list[Finger], exposure: float, dimmed: int
) -> None:
    """Also when the exposure has changed, and a part of the strip since the calibration."""
    eye = GLOSSY
    light = eye.rig.light(eye.camera.id, fingers) * exposure
    light[:, dimmed : dimmed + 40] *= 0.8
    picture = eye.rig.expose(eye.camera.id, 7, light)
    dimmer = eye.reference.light.copy()
    dimmer[dimmed : dimmed + 40] *= 0.8
    calibrated = eye.reference
    now = Reference.of(calibrated.black, dimmer, calibrated.peak, calibrated.least_light, 250.0)
    shadows, gain = eye.finder.find_with_hidden(picture)
    outlines = eye.tracer.trace(picture, shadows, now, gain)
    levels = oracle.Levels(eye.strip, eye.empty, calibrated, now, VISION)
    columns, rows = oracle.trace(levels, levels.values(picture, gain), shadows, VISION.edge_level)
    assert outlines.columns_px == pytest.approx(columns, abs=1e-6, nan_ok=True)
    assert outlines.rows_px == pytest.approx(rows, abs=1e-6, nan_ok=True)


def test_a_tracer_goes_along_when_the_strip_changes_and_changes_back() -> None:
    """What it keeps of a strip is not taken for that of another one."""
    eye, usual = GLOSSY, GLOSSY.reference
    picture = eye.picture([Finger(150.0, 200.0, 10.0, 0.3, 1.0, 0.0)])
    shadows, gain = eye.finder.find_with_hidden(picture)
    dim = Reference.of(usual.black, 0.7 * usual.light, usual.peak, usual.least_light, 250.0)
    seen = {}
    for now in (usual, dim, usual, dim):
        fresh = OutlineTracer(eye.strip, eye.empty, usual, VISION)
        kept = eye.tracer.trace(picture, shadows, now, gain)
        alone = fresh.trace(picture, shadows, now, gain)
        assert np.array_equal(kept.light, alone.light, equal_nan=True)
        assert np.array_equal(kept.columns_px, alone.columns_px, equal_nan=True)
        seen[id(now)] = kept.light
    assert seen[id(dim)] == pytest.approx(seen[id(usual)] / 0.7, rel=1e-5, nan_ok=True)


def test_levels_run_from_the_top_down_on_either_side_of_the_surface_line() -> None:
    rows, strip = level_rows(GLOSSY.strip), GLOSSY.strip
    assert (np.diff(rows, axis=0) > 0).all()
    assert (rows[0] > strip.top_px).all()
    assert (rows[len(LEVELS) - 1] < strip.surface_px).all()
    assert (rows[len(LEVELS)] > strip.surface_px).all()
    assert (rows[-1] < strip.bottom_px).all()
    assert len(level_rows(MATT.strip)) == len(LEVELS)


def waist(eye: Eye, finger: Finger, outlines: Outlines) -> FloatArray:
    """Return the light in the middle of a finger's shadow, row by row."""
    column = int(eye.camera.column_of(finger.x_mm, finger.y_mm))
    assert outlines.light_at[column] >= 0
    return outlines.light[:, outlines.light_at[column]]


class TestWaist:
    TOUCHING = Finger(180.0, 200.0)

    def test_a_touching_finger_leaves_no_light(self) -> None:
        _, outlines = GLOSSY.look(GLOSSY.picture([self.TOUCHING]))
        assert np.nanmax(waist(GLOSSY, self.TOUCHING, outlines)) < 0.35

    def test_light_shines_under_a_hovering_finger(self) -> None:
        hovering = replace(self.TOUCHING, height_mm=2.0)
        _, outlines = GLOSSY.look(GLOSSY.picture([hovering]))
        assert np.nanmax(waist(GLOSSY, hovering, outlines)) > 0.7

    def test_light_is_that_of_the_empty_strip_beside_the_shadow(self) -> None:
        shadows, outlines = GLOSSY.look(GLOSSY.picture([self.TOUCHING]))
        outside = int(shadows.edges_px[0, 0]) - 3
        light = outlines.light[:, outlines.light_at[outside]]
        assert np.nanmedian(light) == pytest.approx(1.0, abs=0.05)

    def test_rows_reach_from_above_the_surface_line_to_the_end_of_the_mirror_image(self) -> None:
        shadows, outlines = GLOSSY.look(GLOSSY.picture([self.TOUCHING]))
        column = int(shadows.edges_px.mean())
        first = outlines.light_row_px[column]
        assert first == int(GLOSSY.strip.surface_px[column]) - WAIST_ABOVE_PX
        told = np.flatnonzero(np.isfinite(outlines.light[:, outlines.light_at[column]]))
        last_px = first + told[-1] + 0.5
        assert abs(last_px - GLOSSY.strip.bottom_px[column]) < 2.0

    def test_only_columns_around_shadows_are_kept(self) -> None:
        shadows, outlines = GLOSSY.look(GLOSSY.picture([self.TOUCHING]))
        left, right = shadows.edges_px[0]
        kept = np.flatnonzero(outlines.light_at >= 0)
        assert kept[0] == int(left) - 3
        assert kept[-1] == int(right) + 3
        assert outlines.light.shape[1] == len(kept)

    def test_a_matt_screen_keeps_no_light(self) -> None:
        _, outlines = MATT.look(MATT.picture([self.TOUCHING]))
        assert outlines.light.size == 0
        assert (outlines.light_at == -1).all()


def test_nothing_touches() -> None:
    shadows, outlines = GLOSSY.look(GLOSSY.picture([]))
    assert len(shadows) == 0
    assert outlines.columns_px.shape == (0, 2, 2 * len(LEVELS))
    assert outlines.light.shape[1] == 0
    assert (outlines.light_at == -1).all()


def test_edges_that_are_not_valid_are_not_traced() -> None:
    picture = GLOSSY.picture([Finger(180.0, 200.0)])
    shadows, gain = GLOSSY.finder.find_with_hidden(picture)
    left_only = Shadows(shadows.edges_px, np.array([[True, False]]), shadows.depth)
    outlines = GLOSSY.tracer.trace(picture, left_only, GLOSSY.reference, gain)
    assert np.isfinite(outlines.columns_px[0, 0]).all()
    assert np.isnan(outlines.columns_px[0, 1]).all()


@pytest.mark.parametrize("edges", [(0.0, 20.0), (630.0, 640.0), (0.0, 640.0), (319.5, 319.5)])
def test_shadows_at_the_border_and_all_over_do_no_harm(edges: tuple[float, float]) -> None:
    shadows = Shadows(np.array([edges]), np.array([[True, True]]), np.array([1.0]))
    for picture in (GLOSSY.picture([]), np.zeros_like(GLOSSY.picture([]))):
        outlines = GLOSSY.tracer.trace(picture, shadows, GLOSSY.reference, 1.0)
        met = outlines.columns_px[np.isfinite(outlines.columns_px)]
        assert ((met >= 0.0) & (met <= 640.0)).all()


def test_the_light_of_a_palm_is_not_kept() -> None:
    shadows = Shadows(np.array([[100.0, 500.0]]), np.array([[True, True]]), np.array([1.0]))
    outlines = GLOSSY.tracer.trace(GLOSSY.picture([]), shadows, GLOSSY.reference, 1.0)
    assert outlines.light.shape[1] == 0


@pytest.mark.parametrize("grey", [0, 128, 255])
def test_pictures_without_a_strip_have_no_outlines(grey: int) -> None:
    picture = np.full_like(GLOSSY.picture([]), grey)
    shadows = Shadows(np.array([[200.0, 230.0]]), np.array([[True, True]]), np.array([1.0]))
    outlines = GLOSSY.tracer.trace(picture, shadows, GLOSSY.reference, 1.0)
    assert np.isnan(outlines.columns_px).all()


def test_noise_does_no_harm() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        picture = rng.integers(0, 256, GLOSSY.empty.shape, np.uint8)
        edges = np.sort(rng.uniform(-20, 660, (30, 2)), axis=1)
        shadows = Shadows(edges, np.ones((30, 2), bool), np.ones(30))
        outlines = GLOSSY.tracer.trace(picture, shadows, GLOSSY.reference, 1.0)
        met = outlines.columns_px[np.isfinite(outlines.columns_px)]
        assert ((met >= 0.0) & (met <= 640.0)).all()


def test_a_camera_that_hangs_upside_down_traces_the_same() -> None:
    rig, camera = GLOSSY.rig, GLOSSY.camera.id
    turned = np.ascontiguousarray(GLOSSY.empty[::-1, ::-1])
    strip = find_strip(turned)
    assert strip.upside_down
    assert not GLOSSY.strip.upside_down
    finder = ProfileFinder(strip, turned, VISION)
    tracer = OutlineTracer(strip, turned, finder.sampler.reference, VISION)
    finger = Finger(150.0, 250.0, lean_rad=0.5)
    picture = rig.render(camera, 5, [finger])
    _, upright = GLOSSY.look(picture)
    hanging = np.ascontiguousarray(picture[::-1, ::-1])
    shadows, gain = finder.find_with_hidden(hanging)
    outlines = tracer.trace(hanging, shadows, finder.sampler.reference, gain)
    mirrored = 640.0 - outlines.columns_px[:, ::-1, ::-1]
    assert np.isfinite(mirrored).all()
    assert mirrored == pytest.approx(upright.columns_px, abs=0.2)
    column = int(shadows.edges_px.mean())
    light = outlines.light[:, outlines.light_at[column]]
    assert np.nanmax(light) < 0.35
    assert outlines.light_row_px[column] < strip.top_px[column]


class TestObserved:
    FINGER = Finger(150.0, 250.0, lean_rad=0.4)

    def pipeline(self, settings: Settings) -> CameraPipeline:
        camera = GLOSSY.camera.id
        model = AnglePolynomial((0.0, 0.0), (0.8, 0.8), 640)
        calibration = CameraCalibration(
            camera, "", GLOSSY.rig.formats[camera], GLOSSY.empty, model, 0.1
        )
        return CameraPipeline(calibration, settings)

    def frame(self, at_s: float = 0.0, x_mm: float = 150.0) -> Frame:
        picture = GLOSSY.picture([replace(self.FINGER, x_mm=x_mm)], int(at_s * 1000))
        return Frame(GLOSSY.camera.id, 1, at_s, 15, picture)

    def test_every_observation_has_the_outlines_of_its_shadows(self) -> None:
        pipeline = self.pipeline(Settings())
        _, expected = GLOSSY.look(self.frame().pixels)
        for seen in (pipeline.find(self.frame()), pipeline.observe(self.frame())):
            assert seen.outlines is not None
            assert seen.outlines.columns_px == pytest.approx(expected.columns_px, abs=0.02)

    def test_they_are_measured_against_the_strip_as_it_is_now(self) -> None:
        """A strip that fades to .6 over minutes leaves the waist of a finger as it was."""
        pipeline = self.pipeline(Settings())
        camera = GLOSSY.camera.id
        side = np.linspace(1.0, 0.6, 640).astype(np.float32)
        lit, touched = GLOSSY.rig.light(camera), GLOSSY.rig.light(camera, [self.FINGER])
        for second in range(240):
            dimmed = lit * (1 + (side - 1) * min(second / 120, 1))
            picture = GLOSSY.rig.expose(camera, second, dimmed)
            pipeline.observe(Frame(camera, second, float(second), 15, picture))
        picture = GLOSSY.rig.expose(camera, 999, touched * side)
        seen = pipeline.observe(Frame(camera, 240, 240.0, 15, picture))
        _, expected = GLOSSY.look(GLOSSY.picture([self.FINGER]))
        assert seen.outlines is not None
        assert seen.outlines.columns_px == pytest.approx(expected.columns_px, abs=0.1, nan_ok=True)

    def test_the_papers_finder_knows_no_rows(self) -> None:
        vision = VisionSettings(edges="paper", paper=PaperVisionSettings())
        assert self.pipeline(Settings(vision=vision)).find(self.frame()).outlines is None

    def test_they_move_with_their_edges_to_the_common_time(self) -> None:
        pipeline = self.pipeline(Settings())
        carried = CommonTime(MotionSettings(), {GLOSSY.camera.id: 640})
        carried.carry(FrameSet(0.0, (pipeline.find(self.frame()),)))
        seen = pipeline.find(self.frame(0.01, x_mm=155.0))
        (moved,) = carried.carry(FrameSet(0.012, (seen,))).observations
        off_px = moved.shadows.edges_px - seen.shadows.edges_px
        assert np.abs(off_px).max() > 0.3
        assert moved.outlines is not None
        assert seen.outlines is not None
        went_px = moved.outlines.columns_px - seen.outlines.columns_px
        assert went_px == pytest.approx(off_px[:, :, None] + np.zeros(14), abs=1e-9)
