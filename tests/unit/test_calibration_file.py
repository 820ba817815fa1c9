"""The calibration file: what goes in comes out; what is not whole is refused with the remedy."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    CameraCalibration,
)
from cornertouchd.calibration.file import load_calibration, save_calibration
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.vanishing_point import Projection
from cornertouchd.model import PictureFormat

FORMAT = PictureFormat(32, 24, 6, 8)


def camera(name: str, model: AnglePolynomial | Projection) -> CameraCalibration:
    empty = np.random.default_rng(1).uniform(0, 255, (8, 32))
    return CameraCalibration(name, FORMAT, empty, model, 0.125)


def calibration(created_at: str = "2026-01-02T03:04:05+00:00") -> Calibration:
    return Calibration(
        "auto",
        created_at,
        "0.1.0",
        (350.0, 400.0),
        16,
        0.25,
        (
            camera("C1", AnglePolynomial((-1.5, 2.25), (0.7853981, 0.9, -0.01), 32)),
            camera("C2", Projection(((1.0, 2.0, 3.0), (4.0, 5.5, 6.0)), (175.0, 200.0))),
        ),
    )


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "calibration.json"
    save_calibration(calibration(), path)
    return path


def test_what_is_saved_is_loaded(saved: Path) -> None:
    loaded, given = load_calibration(saved), calibration()
    assert (loaded.method, loaded.created_at, loaded.surface_mm) == (
        given.method,
        given.created_at,
        given.surface_mm,
    )
    for ours, theirs in zip(loaded.cameras, given.cameras, strict=True):
        assert (ours.id, ours.format, ours.model) == (theirs.id, theirs.format, theirs.model)
        assert ours.empty == pytest.approx(theirs.empty, abs=1 / 500)


def test_the_one_before_is_kept(saved: Path) -> None:
    save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
    assert load_calibration(saved).created_at.startswith("2027")
    previous = saved.with_name("calibration.json.previous")
    assert load_calibration(previous).created_at.startswith("2026")


def test_nothing_else_is_left_in_the_directory(saved: Path) -> None:
    save_calibration(calibration(), saved)
    assert sorted(path.name for path in saved.parent.iterdir()) == [
        "calibration.json",
        "calibration.json.previous",
    ]


def test_a_disk_that_refuses_leaves_the_old_one(
    saved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = saved.read_bytes()

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(CalibrationError, match="No space left"):
        save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == ["calibration.json"]


def test_a_missing_file_names_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(
        CalibrationError, match=r"none.json: no calibration .*cornertouchd calibrate"
    ):
        load_calibration(tmp_path / "none.json")


def test_a_truncated_file_is_refused(saved: Path) -> None:
    saved.write_bytes(saved.read_bytes()[:-200])
    with pytest.raises(CalibrationError, match=r"calibration.json: not a whole JSON file"):
        load_calibration(saved)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("version", 99, "version 99, this software reads 1"),
        ("format", "something", "not a cornertouchd calibration"),
        ("method", "magic", "method"),
        ("surface_mm", ["wide", 400], "surface_mm"),
        ("residual_mm", float("nan"), "residual_mm"),
        ("cameras", [], "cameras"),
        ("extra", 1, "extra"),
    ],
)
def test_an_edited_file_is_refused_naming_the_place(
    saved: Path, key: str, value: object, message: str
) -> None:
    content = json.loads(saved.read_text())
    content[key] = value
    saved.write_text(json.dumps(content))
    with pytest.raises(CalibrationError, match=message):
        load_calibration(saved)


@pytest.mark.parametrize("damage", ["", "!!!", "aGVsbG8="])
def test_a_damaged_empty_picture_is_refused(saved: Path, damage: str) -> None:
    content = json.loads(saved.read_text())
    content["cameras"][1]["empty_png"] = damage
    saved.write_text(json.dumps(content))
    with pytest.raises(CalibrationError, match="C2: its empty picture is damaged"):
        load_calibration(saved)


def test_a_camera_that_gives_another_size_is_refused() -> None:
    given = PictureFormat(64, 24, 6, 8)
    with pytest.raises(CalibrationError, match=r"C1: gives pictures of 64x24.*calibrated at 32x24"):
        calibration().camera("C1").require_format(given)


def test_a_camera_that_was_not_calibrated_is_refused() -> None:
    with pytest.raises(
        CalibrationError, match=r"camera C3: not in the calibration \(it has C1, C2"
    ):
        calibration().camera("C3")
