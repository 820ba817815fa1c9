"""Heights belong to every calibration, also to files that were written without them."""

import dataclasses
import hashlib
import json
import logging
from pathlib import Path

import numpy as np
import pytest

from cornertouchd.calibration.calibration import Calibration, CameraCalibration
from cornertouchd.calibration.file import load_calibration, save_calibration
from cornertouchd.calibration.heights import height_table, heights_of_empty, what_moved
from cornertouchd.config import Settings, VisionSettings
from cornertouchd.guiding.checking import InForce, check_camera
from cornertouchd.guiding.guide import CheckCameras, Plan
from cornertouchd.guiding.progress import TapStore
from cornertouchd.locating.height_table import Heights
from cornertouchd.model import FloatArray, Frame
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.strip import find_strip

RIG = SimulatedRig()


@pytest.fixture(scope="module")
def calibrated() -> Calibration:
    return calibrate_rig(RIG, Settings())


def heights_of(camera: CameraCalibration) -> Heights:
    assert camera.heights is not None
    return camera.heights


def test_a_calibration_knows_how_high_the_cameras_stand(calibrated: Calibration) -> None:
    for camera in calibrated.cameras:
        heights, truth = heights_of(camera), RIG.truth.cameras[camera.id]
        assert heights.camera_mm == pytest.approx(truth.height_mm, abs=0.3)
        assert heights.shear[0] == pytest.approx(heights.horizon_px[1] / -320.0, abs=0.01)


def test_its_height_table_is_that_of_the_rig(calibrated: Calibration) -> None:
    for camera in calibrated.cameras:
        truth = RIG.truth.cameras[camera.id]
        table = height_table(
            camera.id,
            find_strip(camera.empty),
            camera.model,
            calibrated.surface_mm,
            heights_of(camera),
        )
        assert (table.camera, table.x_mm, table.y_mm) == (camera.id, *camera.model.position_mm)
        columns = np.arange(640) + 0.5
        angles = truth.angles_rad(columns)
        above, below = (
            truth.project(np.stack([np.cos(angles), np.sin(angles), np.full(640, slope)]))[1]
            for slope in (0.01, -0.01)
        )
        seen = table.visible
        assert (below - above)[seen] == pytest.approx(
            0.02 * table.rows_per_slope_px[seen], rel=0.01
        )


def as_version_2(path: Path) -> None:
    content = json.loads(path.read_text())
    del content["checksum"]
    content["version"] = 2
    for camera in content["cameras"]:
        del camera["heights"]
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    content["checksum"] = hashlib.sha256(canonical.encode()).hexdigest()
    path.write_text(json.dumps(content))


def test_a_file_without_heights_has_them_measured(calibrated: Calibration, tmp_path: Path) -> None:
    path = tmp_path / "old.json"
    save_calibration(calibrated, path)
    as_version_2(path)
    loaded = load_calibration(path)
    for ours, theirs in zip(loaded.cameras, calibrated.cameras, strict=True):
        before = heights_of(theirs)
        assert heights_of(ours).camera_mm == pytest.approx(before.camera_mm, abs=0.05)
        assert heights_of(ours).horizon_px == pytest.approx(before.horizon_px, abs=0.05)
        assert (ours.model, ours.id) == (theirs.model, theirs.id)


def test_an_empty_picture_without_a_strip_has_no_heights(calibrated: Calibration) -> None:
    model = calibrated.cameras[0].model
    assert heights_of_empty("C1", np.zeros((64, 640)), model, RIG.surface_mm) is None


def test_a_strip_that_cannot_tell_is_no_obstacle(
    calibrated: Calibration, caplog: pytest.LogCaptureFixture
) -> None:
    camera = calibrated.cameras[0]
    with caplog.at_level(logging.WARNING, "cornertouchd"):
        assert heights_of_empty("C1", stretched(camera.empty), camera.model, (90.0, 90.0)) is None
    assert "camera C1: touches are located without its heights" in caplog.text


def stretched(empty: FloatArray) -> FloatArray:
    """Return the strip of a surface with another shape: narrow in the middle."""
    rows = np.arange(len(empty))
    grow = 1.0 + 3.0 * np.abs(np.linspace(-1, 1, empty.shape[1]))
    columns = [np.interp(25 + (rows - 25) * g, rows, empty[:, u]) for u, g in enumerate(grow)]
    return np.array(columns).T


class TestWhatMoved:
    KEPT = Heights(6.0, 12.6, (24.0, -1.0, 0.3), (0.003, 0.0), 0.03, 0.13, 0.05)

    def moved(self, **changes: object) -> str | None:
        return what_moved(self.KEPT, dataclasses.replace(self.KEPT, **changes), 640)

    def test_nothing(self) -> None:
        assert self.moved(horizon_px=(24.2, -1.1, 0.3), camera_mm=6.3) is None

    def test_a_camera_that_was_tilted(self) -> None:
        said = self.moved(horizon_px=(25.8, -1.0, 0.3))
        assert said is not None
        assert said.startswith("the horizon is 1.8 px lower than calibrated")
        assert "tilted" in said

    def test_a_camera_that_was_rolled(self) -> None:
        said = self.moved(horizon_px=(24.0, 1.0, 0.3))
        assert said is not None
        assert "turned by 0.36 degrees" in said

    def test_a_camera_that_was_raised(self) -> None:
        said = self.moved(camera_mm=8.0)
        assert said is not None
        assert "stands 2.0 mm higher than calibrated" in said


class TestBeforeANewCalibration:
    """Empty pictures are compared with the calibration in force."""

    @staticmethod
    def frame(camera: str, rows_lower: int) -> Frame:
        pixels = np.roll(RIG.render(camera, 0, ()), rows_lower, axis=0)
        return Frame(camera, 0, 0.0, None, pixels)

    def test_cameras_that_stayed_have_nothing_to_say(self, calibrated: Calibration) -> None:
        for camera in calibrated.cameras:
            pictures = [RIG.render(camera.id, index, ()) for index in range(3)]
            before = InForce(camera, calibrated.surface_mm)
            assert check_camera(camera.id, pictures, in_force=before).findings == ()

    @pytest.mark.parametrize(("rows", "way"), [(2, "lower"), (-1, "higher")])
    def test_the_one_that_moved_is_named(
        self, calibrated: Calibration, tmp_path: Path, rows: int, way: str
    ) -> None:
        step = self.checking(calibrated, tmp_path)
        for _ in range(16):
            step.feed([self.frame(one, rows if one == "C3" else 0) for one in RIG.formats])
        told = {check.camera: check.findings for check in step.status.checks}
        (finding,) = told.pop("C3")
        assert (finding.kind, finding.severity) == ("moved", "doubtful")
        assert f"{abs(rows)}.0 px {way} than calibrated: the camera was tilted" in finding.text
        assert set(told.values()) == {()}

    def test_pictures_of_another_format_are_not_compared(
        self, calibrated: Calibration, tmp_path: Path
    ) -> None:
        cameras = tuple(
            dataclasses.replace(
                one,
                format=dataclasses.replace(one.format, row_offset_px=one.format.row_offset_px + 1),
            )
            for one in calibrated.cameras
        )
        step = self.checking(dataclasses.replace(calibrated, cameras=cameras), tmp_path)
        for _ in range(16):
            step.feed([self.frame(camera, 2) for camera in RIG.formats])
        assert all(check.findings == () for check in step.status.checks)

    @staticmethod
    def checking(in_force: Calibration, tmp_path: Path) -> CheckCameras:
        store = TapStore(tmp_path / "taps", RIG.surface_mm, RIG.formats)
        targets_mm = np.array([[100.0, 100.0]])
        plan = Plan(
            "auto", RIG.surface_mm, RIG.formats, targets_mm, 0.5, VisionSettings(), store,
            in_force=in_force,
        )  # fmt: skip
        return CheckCameras(plan)
