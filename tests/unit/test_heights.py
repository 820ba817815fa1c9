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
from cornertouchd.config import Settings
from cornertouchd.locating.height_table import Heights
from cornertouchd.model import FloatArray
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
        return what_moved("C2", self.KEPT, dataclasses.replace(self.KEPT, **changes), 640)

    def test_nothing(self) -> None:
        assert self.moved(horizon_px=(24.2, -1.1, 0.3), camera_mm=6.3) is None

    def test_a_camera_that_was_tilted(self) -> None:
        said = self.moved(horizon_px=(25.8, -1.0, 0.3))
        assert said is not None
        assert said.startswith("camera C2: its horizon is 1.8 px lower than calibrated")
        assert "cornertouchd calibrate" in said

    def test_a_camera_that_was_rolled(self) -> None:
        said = self.moved(horizon_px=(24.0, 1.0, 0.3))
        assert said is not None
        assert "turned by 0.36 degrees" in said

    def test_a_camera_that_was_raised(self) -> None:
        said = self.moved(camera_mm=8.0)
        assert said is not None
        assert "stands 2.0 mm higher than calibrated" in said
