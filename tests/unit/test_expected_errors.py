"""What every method leads to expect is what comes: touches on rigs whose truth is known."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import METHODS, Method
from cornertouchd.calibration.error_map import places_mm
from cornertouchd.calibration.fitted import line_sigma_mm, rms
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.methods import Stamp, fit, make_calibration
from cornertouchd.calibration.touch_columns import EDGE_SIGMA_PX, SHAPE_SIGMA_MM, TouchColumns
from cornertouchd.geometry import nearest_points_to_lines
from cornertouchd.model import FloatArray, PictureFormat
from cornertouchd.simulation.boards import BoardPose, board_poses
from cornertouchd.simulation.optics import CornerCamera, Lens
from cornertouchd.vision.strip import Strip

SURFACE_MM = (350.0, 400.0)
SIZE = PictureFormat(640, 480, 208, 64)
WHOLE = PictureFormat(640, 480, 0, 480)
CORNERS_MM = {"C1": (-4.0, -3.0), "C2": (353.0, -5.0), "C3": (354.0, 403.0), "C4": (-5.0, 404.0)}
TAP_SIGMA_MM = 0.3
PLAN = BoardPlan()
BOARDS = 24
CORNER_SIGMA_PX = 0.1
REPEATS = 3
SEEDS = 3


class Rig:
    """Pinhole cameras, what they see of touches, and of boards."""

    def __init__(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)
        self.cameras = {
            name: CornerCamera(
                id=name,
                x_mm=x,
                y_mm=y,
                height_mm=6.0,
                yaw_rad=np.pi / 4 + number * np.pi / 2 + self.random.uniform(-0.02, 0.02),
                pitch_rad=0.0,
                roll_rad=0.0,
                lens=Lens.with_field(np.deg2rad(99.0), SIZE.width_px, (320.0, 240.0), 0.0),
            )
            for number, (name, (x, y)) in enumerate(CORNERS_MM.items())
        }

    def columns(self, points_mm: FloatArray) -> FloatArray:
        """Middles of shadows (4, points), off by what pictures and fingers leave."""
        rows = []
        for camera in self.cameras.values():
            away_mm = np.linalg.norm(points_mm - (camera.x_mm, camera.y_mm), axis=1)
            sigmas_px = np.hypot(EDGE_SIGMA_PX, SHAPE_SIGMA_MM * camera.lens.focal_px / away_mm)
            seen = np.array([camera.column_of(x, y) for x, y in points_mm])
            rows.append(seen + sigmas_px * self.random.standard_normal(len(seen)))
        columns = np.array(rows)
        columns[(columns < 4.0) | (columns > SIZE.width_px - 4.0)] = np.nan
        return columns

    def given(self, targets_mm: FloatArray, boards: bool) -> ReferenceTouches:
        """Taps that miss their targets a little."""
        tapped = targets_mm + TAP_SIGMA_MM * self.random.standard_normal(targets_mm.shape)
        edges = self.columns(tapped)[..., None] + np.array([-4.0, 4.0])
        touches = TouchColumns(edges, targets_mm, np.full(len(tapped), np.nan))
        names, width = self.cameras, SIZE.width_px
        row = np.zeros(width)
        strip = Strip(row, row, row, row, np.full(width, True), False, 0.0)
        sights = self.boards() if boards else ()
        return ReferenceTouches(
            SURFACE_MM,
            dict.fromkeys(names, SIZE),
            {},
            dict.fromkeys(names, strip),
            touches,
            sights,
        )

    def boards(self) -> tuple[BoardSight, ...]:
        """Boards before the cameras, their corners found to a tenth of a pixel."""
        formats: Mapping[str, PictureFormat] = dict.fromkeys(self.cameras, WHOLE)
        poses = board_poses(PLAN, SURFACE_MM, formats, self.cameras, BOARDS, seed=1)
        sights = [
            self._board(camera, number, pose)
            for number, pose in enumerate(poses)
            for camera in self.cameras.values()
        ]
        return tuple(sight for sight in sights if sight is not None)

    def _board(self, camera: CornerCamera, number: int, pose: BoardPose) -> BoardSight | None:
        away = pose.places_mm(PLAN, PLAN.corners_mm) - (camera.x_mm, camera.y_mm, camera.height_mm)
        if np.any(away @ pose.axes[2] < 0.4 * np.linalg.norm(away, axis=1)):
            return None
        pixels = np.stack(camera.project(away.T), axis=1)
        inside = np.all((pixels > 3) & (pixels < (637, 477)), axis=1)
        inside &= away @ camera.axes()[2] > 0
        if np.count_nonzero(inside) < 8:
            return None
        seen = pixels[inside]
        seen = seen + CORNER_SIGMA_PX * self.random.standard_normal(seen.shape)
        return BoardSight(number, camera.id, PLAN.corners_mm[inside], seen)


def along_frame(count: int) -> FloatArray:
    low, (right, bottom) = 5.0, np.array(SURFACE_MM) - 5.0
    corners = np.array([(low, low), (right, low), (right, bottom), (low, bottom), (low, low)])
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners, axis=0)).sum(axis=1))])
    places = (np.arange(count) + 0.5) / count * way[-1]
    return np.stack([np.interp(places, way, corners[:, axis]) for axis in (0, 1)], axis=1)


GRID = np.stack(np.meshgrid(np.linspace(35, 315, 4), np.linspace(40, 360, 4)), -1).reshape(-1, 2)
TARGETS_MM = {
    "auto": GRID,
    "vanishing-point": GRID,
    "reconstruction": GRID,
    "lookup-table": along_frame(225),
}


@pytest.mark.parametrize("method", METHODS)
def test_errors_are_as_expected(method: Method) -> None:
    """Taps are off by more than lines are, so that methods that cannot tell the two exaggerate.

    Over all of the map's places errors are 0.5 to 0.9 of what is expected, 0.7 to 1.0 if every
    place counts the same; those beside the taps, in the corners, are exaggerated most.
    """
    places = np.repeat(places_mm(SURFACE_MM)[2], REPEATS, axis=0)
    of_all, of_each = [], []
    for seed in range(SEEDS):
        rig = Rig(seed)
        given = rig.given(TARGETS_MM[method], method == "reconstruction")
        fitted = fit(method, given, TAP_SIGMA_MM)
        seen = zip(fitted.models, rig.columns(places), strict=True)
        angles = np.stack([model.angles_rad(columns) for model, columns in seen])
        origins = np.array([model.position_mm for model in fitted.models])
        off_mm = np.linalg.norm(nearest_points_to_lines(origins, angles) - places, axis=1)
        expected_mm = np.repeat(fitted.expected.errors_mm.ravel(), REPEATS)
        of_all.append(rms(off_mm) / fitted.expected.rms_mm)
        of_each.append(rms(off_mm / expected_mm))
    assert 0.4 < rms(np.array(of_all)) < 1.2
    assert 0.6 < rms(np.array(of_each)) < 1.2


def test_lines_that_were_fitted_through_all_of_their_points_tell_nothing() -> None:
    assert np.isnan(line_sigma_mm(np.array([0.1, -0.1, 0.2, 0.0, 0.1, np.nan]), 5))
    rig = Rig(0)
    given = rig.given(GRID[[0, 1, 2, 4, 5]], boards=False)
    fitted = fit("vanishing-point", given, TAP_SIGMA_MM)
    assert np.isnan(fitted.expected.errors_mm).all()


@pytest.mark.parametrize(
    ("residuals_mm", "parameters", "sigma_mm"),
    [([3.0, 4.0, 3.0, 4.0], 0, 12.5**0.5), ([1.0] * 20, 5, (20 / 15) ** 0.5), ([0.0] * 9, 2, 0.1)],
)
def test_lines_pass_by_new_touches_by_more_than_by_those_of_their_fit(
    residuals_mm: list[float], parameters: int, sigma_mm: float
) -> None:
    assert line_sigma_mm(np.array(residuals_mm), parameters) == pytest.approx(sigma_mm)


@pytest.mark.parametrize("known", [True, False])
def test_touches_at_known_places_tell_how_good_a_calibration_is(known: bool) -> None:
    rig = Rig(1)
    given = rig.given(GRID, boards=False)
    points = given.touches.points_mm.copy()
    points[4 if known else 0 :] = np.nan
    given = replace(
        given,
        empties=dict.fromkeys(rig.cameras, np.zeros((2, 2))),
        touches=replace(given.touches, points_mm=points),
    )
    fitted = fit("vanishing-point", rig.given(GRID, boards=False), TAP_SIGMA_MM)
    off_mm = np.full((4, len(GRID)), 0.1)
    off_mm[:, :4] = 0.7
    off_mm[2, :4] = np.nan
    made = make_calibration(
        "auto", given, replace(fitted, residuals_mm=off_mm), Stamp("now", "test")
    )
    if known:
        assert made.residual_mm == pytest.approx(0.7)
        assert np.isnan(made.cameras[2].residual_mm)
    else:
        assert 0.1 < made.residual_mm < 0.7
        assert made.cameras[2].residual_mm == pytest.approx(0.1)
