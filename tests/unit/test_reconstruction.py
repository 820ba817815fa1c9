"""The paper's 3D reconstruction: from boards before the cameras to located touches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracle.nearest_point import nearest_point_to_lines

from cornertouchd.calibration.board_sights import BoardSight, find_boards
from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.gathering import ReferenceTouches, Taps, gather_touches
from cornertouchd.calibration.lenses import fit_lens, undistorted
from cornertouchd.calibration.reconstruction import fit_reconstruction
from cornertouchd.calibration.touch_columns import TouchColumns
from cornertouchd.config import VisionSettings
from cornertouchd.locating.reconstruction import BoardLens, Reconstruction
from cornertouchd.model import FloatArray, PictureFormat
from cornertouchd.simulation.boards import BoardPose, BoardShow, board_poses
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.optics import CornerCamera, Lens
from cornertouchd.simulation.rig import SimulatedRig

PLAN = BoardPlan()
SURFACE_MM = (350.0, 400.0)
SIZE = PictureFormat(640, 480, 208, 64)
CORNERS_MM = {"C1": (-4, -3), "C2": (353, -5), "C3": (354, 403), "C4": (-5, 404)}
TAPS_MM = np.array([[30.0, 40.0], [320.0, 360.0], [310.0, 50.0], [175.0, 200.0], [40.0, 350.0]])
FISHEYE = BoardLens("fisheye", (300.0, 301.0), (322.0, 238.0), (0.05, -0.02, 0.004, -0.001))
PINHOLE = BoardLens(
    "pinhole", (400.0, 398.0), (318.0, 243.0), (0.1, 0.02, 1e-3, -1e-3, 0, 0.4, 0, 0)
)


def cameras_with(barrel: float) -> dict[str, CornerCamera]:
    rng = np.random.default_rng(4)
    return {
        id_: CornerCamera(
            id=id_,
            x_mm=x,
            y_mm=y,
            height_mm=6.0,
            yaw_rad=np.pi / 4 + number * np.pi / 2 + rng.uniform(-0.03, 0.03),
            pitch_rad=rng.uniform(-0.01, 0.01),
            roll_rad=rng.uniform(-0.01, 0.01),
            lens=Lens.with_field(np.deg2rad(97.0), 640, (322.0, 237.0), barrel),
        )
        for number, (id_, (x, y)) in enumerate(CORNERS_MM.items())
    }


@dataclass(frozen=True)
class Scene:
    """Cameras, boards before them as found to .1 px, and taps."""

    cameras: Mapping[str, CornerCamera]
    sights: tuple[BoardSight, ...]
    formats: Mapping[str, PictureFormat]

    @classmethod
    def of(cls, barrel: float, boards: int = 24) -> "Scene":
        cameras = cameras_with(barrel)
        formats = dict.fromkeys(cameras, SIZE)
        whole = dict.fromkeys(cameras, PictureFormat(640, 480, 0, 480))
        poses = board_poses(PLAN, SURFACE_MM, whole, cameras, boards, seed=1)
        rng = np.random.default_rng(2)
        sights = [
            sight
            for number, pose in enumerate(poses)
            for camera in cameras.values()
            if (sight := seen_by(camera, number, pose, rng)) is not None
        ]
        return cls(cameras, tuple(sights), formats)

    def given(
        self, taps_mm: FloatArray, sights: Sequence[BoardSight] | None = None
    ) -> ReferenceTouches:
        touches = TouchColumns(self.columns(taps_mm), taps_mm, np.full(len(taps_mm), 8.0))
        boards = self.sights if sights is None else sights
        return ReferenceTouches(SURFACE_MM, self.formats, {}, {}, touches, boards)

    def columns(self, points_mm: FloatArray) -> FloatArray:
        middles = np.array(
            [[camera.column_of(x, y) for x, y in points_mm] for camera in self.cameras.values()]
        )
        edges = middles[..., None] + (-5.0, 5.0)
        edges[(edges.min(axis=2) < 0) | (edges.max(axis=2) > SIZE.width_px)] = np.nan
        return edges


def seen_by(
    camera: CornerCamera, number: int, pose: BoardPose, rng: np.random.Generator
) -> BoardSight | None:
    origin = np.array([camera.x_mm, camera.y_mm, camera.height_mm])
    away = pose.places_mm(PLAN, PLAN.corners_mm) - origin
    if np.any(away @ pose.axes[2] < 0.4 * np.linalg.norm(away, axis=1)):
        return None
    columns, rows = camera.project(away.T)
    inside = (columns > 3) & (columns < 637) & (rows > 3) & (rows < 477)
    inside &= away @ camera.axes()[2] > 0
    if np.count_nonzero(inside) < 8:
        return None
    pixels = np.stack([columns, rows], axis=1)[inside]
    return BoardSight(
        number, camera.id, PLAN.corners_mm[inside], pixels + 0.1 * rng.standard_normal(pixels.shape)
    )


@pytest.fixture(scope="module")
def barrel() -> Scene:
    return Scene.of(0.3)


def errors_mm(models: Sequence[object], cameras: Mapping[str, CornerCamera]) -> FloatArray:
    """How far touches all over the surface are located from where they are."""
    points = np.random.default_rng(9).uniform((15, 15), (335, 385), (150, 2))
    errors = []
    for point in points:
        lines = []
        for model, camera in zip(models, cameras.values(), strict=True):
            assert isinstance(model, Reconstruction)
            angle = float(model.angles_rad(np.array(camera.column_of(*point))))
            if np.isfinite(angle):
                lines.append((model.position_mm, angle))
        origins, angles = zip(*lines, strict=True)
        located = nearest_point_to_lines(np.array(origins), np.array(angles))
        errors.append(np.linalg.norm(located - point))
    return np.array(errors)


def rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("lens", [PINHOLE, FISHEYE], ids=["pinhole", "fisheye"])
def test_a_lens_bends_as_opencv_says(lens: BoardLens) -> None:
    places = np.random.default_rng(1).uniform((-0.9, -0.7, 1.0), (0.9, 0.7, 1.0), (40, 3))
    matrix = np.array(
        [
            [lens.focal_px[0], 0, lens.centre_px[0]],
            [0, lens.focal_px[1], lens.centre_px[1]],
            [0, 0, 1],
        ]
    )
    bends, none = np.array(lens.distortion), np.zeros(3)
    if lens.kind == "fisheye":
        theirs, _ = cv2.fisheye.projectPoints(places[None], none, none, matrix, bends)
    else:
        theirs, _ = cv2.projectPoints(places, none, none, matrix, bends)
    ours = np.stack(lens.pixels(places.T), axis=1)
    np.testing.assert_allclose(ours, theirs.reshape(-1, 2), atol=1e-6)
    np.testing.assert_allclose(undistorted(lens, ours), places[:, :2], atol=1e-9)


def test_a_fisheye_sees_at_right_angles_to_its_axis() -> None:
    beside_and_ahead = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    straight = BoardLens("fisheye", (300.0, 300.0), (320.0, 240.0), (0.0,) * 4)
    columns, rows = straight.pixels(beside_and_ahead)
    np.testing.assert_allclose(columns, [320.0 + 300.0 * np.pi / 2, 320.0])
    np.testing.assert_allclose(rows, 240.0)


@given(st.floats(-3.0, 3.0), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05))
def test_the_line_of_a_column_is_the_level_ray_in_it(yaw: float, pitch: float, roll: float) -> None:
    truth = CornerCamera("C1", 3.0, 4.0, 6.0, yaw, pitch, roll, Lens(350.0, 320.0, 240.0, 0.0))
    lens = BoardLens("pinhole", (350.0, 350.0), (320.0, 240.0), (0.0,) * 8)
    model = Reconstruction((3.0, 4.0), into_surface(truth), lens, 640)
    columns = np.linspace(0.0, 640.0, 41)
    off = model.angles_rad(columns) - truth.angles_rad(columns)
    assert np.abs(np.angle(np.exp(1j * off))).max() < 1e-6
    slopes = (model.angles_rad(columns + 0.5) - model.angles_rad(columns - 0.5)) / 1.0
    np.testing.assert_allclose(model.slopes_rad_px(columns), slopes, rtol=1e-4)


def into_surface(camera: CornerCamera) -> tuple[tuple[float, float, float], ...]:
    axes = camera.axes() * (1.0, 1.0, -1.0)
    return tuple(tuple(row) for row in axes.tolist())  # type: ignore[return-value]


def test_a_camera_that_hangs_upside_down_counts_columns_against_the_angle() -> None:
    truth = CornerCamera("C1", 0.0, 0.0, 6.0, 0.8, 0.0, np.pi, Lens(350.0, 320.0, 240.0, 0.0))
    lens = BoardLens("pinhole", (350.0, 350.0), (320.0, 240.0), (0.0,) * 8)
    model = Reconstruction((0.0, 0.0), into_surface(truth), lens, 640)
    angles = model.angles_rad(np.array([100.0, 320.0, 540.0]))
    np.testing.assert_allclose(angles, 0.8 + np.arctan([220 / 350, 0, -220 / 350]), atol=1e-6)
    assert np.all(model.slopes_rad_px(np.array([100.0, 500.0])) < 0)


def test_there_is_no_line_beyond_where_the_lens_model_folds() -> None:
    """A radial k1 of -.3 turns back at a radius of 1 / sqrt(.9)."""
    lens = BoardLens("pinhole", (300.0, 300.0), (320.0, 240.0), (-0.3, 0, 0, 0, 0, 0, 0, 0))
    model = Reconstruction((0.0, 0.0), ((0, 1, 0), (0, 0, 1), (1, 0, 0)), lens, 640)
    fold_px = 320 + 300 * (2 / 3) / np.sqrt(0.9)
    assert np.isfinite(model.angles_rad(np.array([641 - fold_px, fold_px - 1]))).all()
    assert np.isnan(model.angles_rad(np.array([639 - fold_px, fold_px + 1]))).all()
    assert np.isnan(model.slopes_rad_px(np.array([fold_px + 1]))).all()


@pytest.mark.parametrize("bend", [0.0, 0.3], ids=["pinhole", "barrel"])
def test_boards_and_two_taps_locate_touches(bend: float) -> None:
    scene = Scene.of(bend)
    fitted = fit_reconstruction(scene.given(TAPS_MM[:2]))
    assert rms(errors_mm(fitted.models, scene.cameras)) < 0.35
    for model, camera in zip(fitted.models, scene.cameras.values(), strict=True):
        assert isinstance(model, Reconstruction)
        assert model.position_mm == pytest.approx((camera.x_mm, camera.y_mm), abs=2.0)
        np.testing.assert_allclose(model.rotation, into_surface(camera), atol=0.02)
    assert not fitted.dropped.any()
    assert fitted.residuals_mm.shape == (4, 2)
    assert 0.0 < fitted.expected.rms_mm < 1.0


def test_a_tap_that_was_missed_is_dropped(barrel: Scene) -> None:
    given = barrel.given(TAPS_MM)
    wrong = TAPS_MM.copy()
    wrong[3] += (8.0, -5.0)
    fitted = fit_reconstruction(replace(given, touches=replace(given.touches, points_mm=wrong)))
    np.testing.assert_array_equal(fitted.dropped, np.arange(5) == np.full((4, 1), 3))
    assert rms(errors_mm(fitted.models, barrel.cameras)) < 0.35


def test_a_board_that_was_moved_between_the_cameras_is_left_out(barrel: Scene) -> None:
    moved = [
        replace(sight, pixels_px=sight.pixels_px + np.array([25.0, -12.0]))
        if (sight.camera, sight.set) in {("C2", 0), ("C2", 4)}
        else sight
        for sight in barrel.sights
    ]
    fitted = fit_reconstruction(barrel.given(TAPS_MM, moved))
    assert rms(errors_mm(fitted.models, barrel.cameras)) < 0.5


def test_touches_at_unknown_places_count_by_how_well_their_lines_meet(barrel: Scene) -> None:
    nowhere = TAPS_MM.copy()
    nowhere[2:] = np.nan
    given = barrel.given(TAPS_MM)
    fitted = fit_reconstruction(replace(given, touches=replace(given.touches, points_mm=nowhere)))
    assert np.isfinite(fitted.residuals_mm[:, 3]).all()
    assert rms(fitted.residuals_mm[:, 2:]) < 0.3
    assert not fitted.dropped.any()


def test_a_lens_wider_than_a_pinhole_can_show_gets_the_fisheye_model() -> None:
    lens = BoardLens("fisheye", (210.0, 210.0), (321.0, 239.0), (0.02, 0.0, 0.0, 0.0))
    rng = np.random.default_rng(3)
    views = []
    for number in range(20):
        turn, _ = cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))
        shift = rng.uniform((-160, -110, 60), (160, 110, 120))
        corners = PLAN.corners_mm - np.array(PLAN.size_mm) / 2
        places = turn @ np.column_stack([corners, np.zeros(len(corners))]).T + shift[:, None]
        seen = np.stack(lens.pixels(places), axis=1)
        inside = (places[2] > 0) & np.all((seen > 3) & (seen < (637, 477)), axis=1)
        if np.count_nonzero(inside) >= 12:
            noise = 0.05 * rng.standard_normal((np.count_nonzero(inside), 2))
            views.append(BoardSight(number, "C1", PLAN.corners_mm[inside], seen[inside] + noise))
    found = fit_lens("C1", views, SIZE)
    assert found.lens.kind == "fisheye"
    assert found.residual_px < 0.12
    assert found.lens.focal_px == pytest.approx((210.0, 210.0), abs=1.0)


def still_board(scene: Scene) -> list[BoardSight]:
    return [replace(scene.sights[0], set=number) for number in range(12)]


def test_what_does_not_fix_the_cameras_is_refused_by_name(barrel: Scene) -> None:
    with pytest.raises(CalibrationError, match=r"needs pictures of a board: .*--print-board"):
        fit_reconstruction(barrel.given(TAPS_MM, []))
    few = [s for s in barrel.sights if s.camera != "C2"] + [
        s for s in barrel.sights if s.camera == "C2"
    ][:3]
    with pytest.raises(CalibrationError, match="camera C2: 3 pictures of the board, 8 are needed"):
        fit_reconstruction(barrel.given(TAPS_MM, few))
    camera = barrel.sights[0].camera
    with pytest.raises(CalibrationError, match=f"camera {camera}: the board was seen in columns"):
        fit_lens(camera, still_board(barrel), SIZE)


def test_a_pair_that_never_saw_the_board_together_is_refused(barrel: Scene) -> None:
    apart = [
        replace(sight, set=sight.set + 1000) if sight.camera == "C3" else sight
        for sight in barrel.sights
    ]
    with pytest.raises(CalibrationError, match=r"C3: 0 pictures show the board to both, 4 are"):
        fit_reconstruction(barrel.given(TAPS_MM, apart))


def test_a_board_that_always_faces_the_same_way_is_refused() -> None:
    lens = BoardLens("pinhole", (320.0, 320.0), (320.0, 240.0), (0.0,) * 8)
    views = []
    for number in range(10):
        shift = np.array([[-250.0 + 40 * number], [-90.0], [300.0]])
        corners = np.column_stack([PLAN.corners_mm, np.zeros(len(PLAN.corners_mm))]).T
        seen = np.stack(lens.pixels(corners + shift), axis=1)
        noise = 0.05 * np.random.default_rng(number).standard_normal(seen.shape)
        views.append(BoardSight(number, "C1", PLAN.corners_mm, seen + noise))
    with pytest.raises(CalibrationError, match="C1: the board was always held the same way"):
        fit_lens("C1", views, SIZE)


def test_a_crumpled_board_is_refused(barrel: Scene) -> None:
    rng = np.random.default_rng(1)
    crumpled = [
        replace(s, pixels_px=s.pixels_px + rng.normal(0, 3.0, s.pixels_px.shape))
        for s in barrel.sights
    ]
    with pytest.raises(CalibrationError, match=r"camera C1: corners of the board are \d.\d px off"):
        fit_reconstruction(barrel.given(TAPS_MM, crumpled))


def test_taps_must_tie_the_cameras_to_the_surface(barrel: Scene) -> None:
    with pytest.raises(CalibrationError, match="1 reference points were seen by two cameras, 2"):
        fit_reconstruction(barrel.given(TAPS_MM[:1]))
    twice = np.array([TAPS_MM[0], TAPS_MM[0]])
    with pytest.raises(CalibrationError, match="all reference points are at one place"):
        fit_reconstruction(barrel.given(twice))


def test_a_board_printed_too_small_is_noticed_by_the_taps(barrel: Scene) -> None:
    shrunk = [replace(s, corners_mm=s.corners_mm / 0.94) for s in barrel.sights]
    with pytest.raises(CalibrationError, match=r"10\d.\d% of what they are.*measure a square"):
        fit_reconstruction(barrel.given(TAPS_MM, shrunk))


def test_two_cameras_do_not_span_a_plane(barrel: Scene) -> None:
    given = barrel.given(TAPS_MM)
    two = dict.fromkeys(("C1", "C2"), SIZE)
    with pytest.raises(CalibrationError, match="needs 3 cameras"):
        fit_reconstruction(replace(given, formats=two))


def test_pictures_of_boards_and_of_taps_give_a_calibration() -> None:
    """The whole way: rendered boards, rendered taps, no truth."""
    whole, rig = SimulatedRig(rows_px=480), SimulatedRig()
    assert dict(whole.truth.cameras) == dict(rig.truth.cameras)
    show = BoardShow(whole, PLAN)
    poses = board_poses(PLAN, rig.surface_mm, whole.formats, whole.truth.cameras, 20, seed=3)
    frame_sets = [show.frame_set(number, pose) for number, pose in enumerate(poses)]
    sights = find_boards(PLAN, frame_sets, whole.formats)
    for sight in sights:  # half a pixel of OpenCV's conventions would show
        camera, pose = whole.truth.cameras[sight.camera], poses[sight.set]
        origin = np.array([camera.x_mm, camera.y_mm, camera.height_mm])
        pixels = camera.project((pose.places_mm(PLAN, sight.corners_mm) - origin).T)
        assert np.abs(np.median(sight.pixels_px.T - pixels, axis=1)).max() < 0.25

    fingers = [Finger(x, y, 8.0) for x, y in TAPS_MM.tolist()]
    given = gather_touches(
        rig.surface_mm,
        rig.formats,
        [rig.frame_set(number, 0.0, ()) for number in range(4)],
        Taps(
            [rig.frame_set(9 + n, 0.0, [finger]) for n, finger in enumerate(fingers)],
            TAPS_MM,
            np.full(len(TAPS_MM), 8.0),
        ),
        [],
        VisionSettings(),
    )
    fitted = fit_reconstruction(replace(given, boards=sights))
    assert rms(errors_mm(fitted.models, rig.truth.cameras)) < 0.5
    assert rms(fitted.residuals_mm[np.isfinite(fitted.residuals_mm)]) < 0.5
