"""The calibration file: what goes in comes out; what is not whole is refused with the remedy."""

import base64
import dataclasses
import hashlib
import json
import os
import struct
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cornertouchd.calibration import sealed_json
from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    CameraCalibration,
    Model,
)
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.calibration.file import (
    load_calibration,
    rollback_calibration,
    save_calibration,
)
from cornertouchd.calibration.file_schema import calibration_schema
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.height_table import Heights
from cornertouchd.locating.lookup_table import LookupTable
from cornertouchd.locating.reconstruction import BoardLens, Reconstruction
from cornertouchd.locating.vanishing_point import Projection
from cornertouchd.model import PictureFormat

FORMAT = PictureFormat(32, 24, 6, 8)
AXES = ((0.6, 0.8, 0.0), (0.0, 0.0, -1.0), (-0.8, 0.6, 0.0))
MODELS: tuple[Model, ...] = (
    AnglePolynomial((-1.5, 2.25), (0.7853981, 0.9, -0.01), 32),
    Projection(((1.0, 2.0, 3.0), (4.0, 5.5, 6.0)), (175.0, 200.0)),
    LookupTable((350.0, 400.0), ((0.0, 10.0), (0.0, 5.0), (5.0, 0.0)), (3.5, np.nan, 30.25)),
    Reconstruction(
        (0.0, 400.0), AXES, BoardLens("fisheye", (20.0, 21.0), (16.0, 12.0), (0.1, 0, 0, 0)), 32
    ),
)
TABLE = 2
FULL_TABLE = LookupTable((350.0, 400.0), ((0.0, 10.0), (0.0, 5.0), (5.0, 0.0)), (3.5, 15.0, 30.25))
HEIGHTS = Heights(5.9, 12.6, (23.5, -0.9, 0.25), (0.003, 1e-3), 0.03, 0.13, 0.05)
LENS = {"focal_px": [20.0, 21.0], "centre_px": [16.0, 12.0]}


def camera(name: str, model: Model) -> CameraCalibration:
    empty = np.random.default_rng(1).uniform(0, 255, (8, 32))
    identity = f"usb 1234:5678 serial {name}"
    heights = HEIGHTS if name == "C1" else None
    return CameraCalibration(name, identity, FORMAT, empty, model, 0.125, heights)


def calibration(created_at: str = "2026-01-02T03:04:05+00:00") -> Calibration:
    return Calibration(
        "auto",
        created_at,
        "0.1.0",
        (350.0, 400.0),
        16,
        120,
        3,
        0.25,
        ErrorMap(
            np.array([10.0, 340.0]),
            np.array([8.0, 200.0, 392.0]),
            np.array([[0.2, 0.3], [np.nan, 0.25], [0.5, 0.125]]),
        ),
        tuple(camera(f"C{number}", model) for number, model in enumerate(MODELS, start=1)),
    )


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "calibration.json"
    save_calibration(calibration(), path)
    return path


GONE = object()


def edit(path: Path, place: str, value: object, *, sealed: bool = False) -> None:
    """Put a value at a place; if `sealed`, mend the checksum: then only the schema stands guard."""
    content = json.loads(path.read_text())
    inside = content
    *steps, last = (int(step) if step.isdecimal() else step for step in place.split("."))
    for step in steps:
        inside = inside[step]
    inside[last] = value
    if value is GONE:
        del inside[last]
    if sealed:
        rest = {key: value for key, value in content.items() if key != "checksum"}
        canonical = json.dumps(rest, sort_keys=True, separators=(",", ":"))
        content["checksum"] = hashlib.sha256(canonical.encode()).hexdigest()
    path.write_text(json.dumps(content))


class TestWhatIsSavedIsLoaded:
    def test_what_it_is_of(self, saved: Path) -> None:
        loaded, given = load_calibration(saved), calibration()
        for key in dataclasses.fields(Calibration):
            if key.name not in {"expected", "cameras"}:
                assert getattr(loaded, key.name) == getattr(given, key.name), key.name

    def test_the_cameras(self, saved: Path) -> None:
        for ours, theirs in zip(
            load_calibration(saved).cameras, calibration().cameras, strict=True
        ):
            assert (ours.id, ours.identity, ours.format) == (
                theirs.id,
                theirs.identity,
                theirs.format,
            )
            assert ours.empty == pytest.approx(theirs.empty, abs=1 / 500)
            if not isinstance(ours.model, LookupTable):
                assert ours.model == theirs.model

    def test_the_heights_where_the_strip_told_them(self, saved: Path) -> None:
        assert [camera.heights for camera in load_calibration(saved).cameras] == [
            HEIGHTS,
            None,
            None,
            None,
        ]

    def test_models_that_locate_as_before(self, tmp_path: Path) -> None:
        bends = (0.01, 0.0, 1e-3, 1e-3, 0.0, 0.02, 0.0, 0.0)
        lens = BoardLens("pinhole", (20.0, 21.0), (16.0, 12.0), bends)
        pinhole = Reconstruction((350.0, 0.0), AXES, lens, 32)
        models = (*MODELS[:TABLE], FULL_TABLE, *MODELS[TABLE + 1 :], pinhole)
        cameras = tuple(camera(f"C{n}", model) for n, model in enumerate(models, start=1))
        path = tmp_path / "all.json"
        save_calibration(dataclasses.replace(calibration(), cameras=cameras), path)
        columns = np.linspace(6.0, 26.0, 7)
        for ours, theirs in zip(load_calibration(path).cameras, models, strict=True):
            angles, slopes = ours.model.angles_rad(columns), ours.model.slopes_rad_px(columns)
            assert np.isfinite(angles).all()
            assert np.isfinite(slopes).all()
            assert np.array_equal(angles, theirs.angles_rad(columns))
            assert np.array_equal(slopes, theirs.slopes_rad_px(columns))

    def test_residuals_that_nothing_tells(self, tmp_path: Path) -> None:
        unknown = dataclasses.replace(calibration().cameras[0], residual_mm=np.nan)
        cameras = (unknown, *calibration().cameras[1:])
        path = tmp_path / "unknown.json"
        save_calibration(
            dataclasses.replace(calibration(), residual_mm=np.nan, cameras=cameras), path
        )
        loaded = load_calibration(path)
        assert np.isnan(loaded.residual_mm)
        assert np.isnan(loaded.cameras[0].residual_mm)
        assert json.loads(path.read_text())["residual_mm"] is None

    def test_a_table_with_its_gaps(self, saved: Path) -> None:
        model, given = load_calibration(saved).cameras[TABLE].model, MODELS[TABLE]
        assert isinstance(model, LookupTable)
        assert isinstance(given, LookupTable)
        assert (model.position_mm, model.points_mm) == (given.position_mm, given.points_mm)
        assert np.array_equal(model.columns_px, given.columns_px, equal_nan=True)

    def test_the_expected_errors_with_the_places_that_cannot_be_located(self, saved: Path) -> None:
        loaded, given = load_calibration(saved).expected, calibration().expected
        assert np.array_equal(loaded.x_mm, given.x_mm)
        assert np.array_equal(loaded.y_mm, given.y_mm)
        assert np.array_equal(loaded.errors_mm, given.errors_mm, equal_nan=True)

    @given(
        st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=12),
        st.tuples(st.floats(-1e5, 1e5), st.floats(-1e5, 1e5)),
        st.text(max_size=40),
    )
    @settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
    def test_to_the_last_digit(
        self, tmp_path: Path, terms: list[float], place: tuple[float, float], name: str
    ) -> None:
        model = AnglePolynomial(place, tuple(terms), 32)
        one = dataclasses.replace(camera("C1", model), identity=name)
        given = dataclasses.replace(calibration(), cameras=(one, camera("C2", model)))
        save_calibration(given, tmp_path / "exact.json")
        loaded = load_calibration(tmp_path / "exact.json").camera("C1")
        assert (loaded.model, loaded.identity) == (model, name)


class TestSaving:
    def test_keeps_the_one_before(self, saved: Path) -> None:
        save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
        assert load_calibration(saved).created_at.startswith("2027")
        previous = saved.with_name("calibration.json.previous")
        assert load_calibration(previous).created_at.startswith("2026")

    def test_leaves_nothing_else_in_the_directory(self, saved: Path) -> None:
        save_calibration(calibration(), saved)
        assert sorted(path.name for path in saved.parent.iterdir()) == [
            "calibration.json",
            "calibration.json.previous",
        ]

    def test_lets_the_daemon_read_it(self, tmp_path: Path) -> None:
        before = os.umask(0o077)
        try:
            save_calibration(calibration(), tmp_path / "private.json")
        finally:
            os.umask(before)
        assert (tmp_path / "private.json").stat().st_mode & 0o777 == 0o644

    def test_makes_the_directory(self, tmp_path: Path) -> None:
        path = tmp_path / "state" / "touch" / "calibration.json"
        save_calibration(calibration(), path)
        assert load_calibration(path).method == "auto"

    def test_follows_a_symbolic_link(self, saved: Path, tmp_path: Path) -> None:
        link = tmp_path / "links" / "calibration.json"
        link.parent.mkdir()
        link.symlink_to(saved)
        save_calibration(calibration("2027-01-01T00:00:00+00:00"), link)
        assert link.readlink() == saved
        assert load_calibration(saved).created_at.startswith("2027")
        assert rollback_calibration(link).created_at.startswith("2026")
        assert link.readlink() == saved

    def test_leaves_the_old_one_when_the_disk_refuses(
        self, saved: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        before = saved.read_bytes()

        def full(_: int) -> None:
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "fsync", full)
        with pytest.raises(CalibrationError, match="No space left"):
            save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
        assert saved.read_bytes() == before
        assert [path.name for path in saved.parent.iterdir()] == ["calibration.json"]

    def test_refuses_what_could_not_be_loaded(self, saved: Path) -> None:
        broken = dataclasses.replace(calibration(), residual_mm=np.inf)
        before = saved.read_bytes()
        with pytest.raises(CalibrationError, match="residual_mm = inf"):
            save_calibration(broken, saved)
        assert saved.read_bytes() == before


class TestRollingBack:
    def test_puts_the_former_one_in_force_and_again_the_latter(self, saved: Path) -> None:
        save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
        assert rollback_calibration(saved).created_at.startswith("2026")
        assert load_calibration(saved).created_at.startswith("2026")
        assert rollback_calibration(saved).created_at.startswith("2027")

    def test_without_a_former_one_is_refused(self, saved: Path) -> None:
        with pytest.raises(CalibrationError, match=r"previous: no former calibration is there"):
            rollback_calibration(saved)
        assert load_calibration(saved).created_at.startswith("2026")

    def test_mends_a_file_that_was_damaged_or_deleted(self, saved: Path) -> None:
        save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
        saved.write_text("{")
        assert rollback_calibration(saved).created_at.startswith("2026")
        save_calibration(calibration("2027-01-01T00:00:00+00:00"), saved)
        saved.unlink()
        assert rollback_calibration(saved).created_at.startswith("2026")


class TestRefused:
    def test_a_missing_file(self, tmp_path: Path) -> None:
        with pytest.raises(
            CalibrationError, match=r"none.json: no calibration .*cornertouchd calibrate"
        ):
            load_calibration(tmp_path / "none.json")

    def test_a_directory(self, tmp_path: Path) -> None:
        with pytest.raises(CalibrationError, match="is not a file; run"):
            load_calibration(tmp_path)

    @given(st.floats(0.0, 1.0, exclude_max=True))
    @settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])
    def test_a_truncated_file(self, saved: Path, share: float) -> None:
        content = saved.read_bytes().rstrip()
        cut = saved.with_name("cut.json")
        cut.write_bytes(content[: int(share * len(content))])
        with pytest.raises(CalibrationError, match=r"cut.json: is not a whole JSON file.*rollback"):
            load_calibration(cut)

    @pytest.mark.parametrize(
        ("place", "value"),
        [
            ("residual_mm", 0.2),
            ("cameras.0.identity", "another"),
            ("cameras.0.model.coefficients_rad.1", 0.9000001),
            ("cameras.1.model.towards_mm.0", 175),
            ("expected.errors_mm.0.0", 0.1),
        ],
    )
    def test_an_edited_file(self, saved: Path, place: str, value: object) -> None:
        edit(saved, place, value)
        with pytest.raises(
            CalibrationError, match=r"has been changed since it was written; .*--rollback"
        ):
            load_calibration(saved)

    @pytest.mark.parametrize(
        ("place", "value", "message"),
        [
            ("version", 1, "version 1, this software reads 3"),
            ("format", "something", "is not a cornertouchd-calibration file"),
            ("method", "magic", "method = 'magic'"),
            ("surface_mm", ["wide", 400], "surface_mm.0 = 'wide'"),
            ("surface_mm", [350, 1e999], "surface_mm.1 = inf"),
            ("reference_points", "16", "reference_points = '16'"),
            ("dropped", -1, "dropped = -1"),
            ("residual_mm", float("nan"), "residual_mm = nan"),
            ("cameras", [], "cameras"),
            ("extra", 1, "extra = 1"),
            ("expected.x_mm", [1.0], "errors_mm must be 3 rows of 1"),
            ("cameras.1.id", "C1", "two cameras have the same id"),
            ("cameras.0.picture.width_px", 0, "cameras.0.picture.width_px = 0"),
            ("cameras.0.picture.row_offset_px", 20, "rows end at 28"),
            ("cameras.0.model.kind", "oracle", "cameras.0.model"),
            ("cameras.1.model.matrix", [[1, 2, 0], [2, 4, 0]], "is singular"),
            ("cameras.2.model.columns_px", [1, 2], "3 points, 2 columns"),
            (
                "cameras.3.model.rotation.0",
                [1.0, 0.5, 0.0],
                "not three axes at right angles",
            ),
            (
                "cameras.3.model.lens.distortion",
                [0.1],
                "a fisheye lens has 4",
            ),
            (
                "cameras.3.model.lens",
                {**LENS, "kind": "pinhole", "distortion": [0.1, 0.0, 0.0, 0.0, 0.0]},
                "5 distortion terms; a pinhole lens has 8",
            ),
        ],
    )
    def test_what_the_schema_does_not_allow_names_place_and_value(
        self, saved: Path, place: str, value: object, message: str
    ) -> None:
        edit(saved, place, value, sealed=True)
        with pytest.raises(CalibrationError) as refused:
            load_calibration(saved)
        assert message in str(refused.value)
        assert str(refused.value).startswith(f"{saved}: ")
        assert "run `cornertouchd calibrate`" in str(refused.value)

    @pytest.mark.parametrize(
        "damage",
        [
            "",
            "!!!",
            "aGVsbG8=",
            base64.b64encode(
                b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 32, 8)
            ).decode(),
            base64.b64encode(
                b"\x89PNG\r\n\x1a\n" + struct.pack(">I4sII", 13, b"IHDR", 2**31, 2**31)
            ).decode(),
        ],
    )
    def test_a_damaged_empty_picture(self, saved: Path, damage: str) -> None:
        edit(saved, "cameras.1.empty_png", damage, sealed=True)
        with pytest.raises(CalibrationError, match="C2: its empty picture is damaged"):
            load_calibration(saved)

    def test_a_huge_file_without_reading_all_of_it(self, tmp_path: Path) -> None:
        path = tmp_path / "huge.json"
        with path.open("wb") as file:
            file.truncate(2**40)
        with pytest.raises(CalibrationError, match="larger than 64 MiB"):
            load_calibration(path)

    def test_more_values_than_any_rig_has_without_taking_them_in(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        path = tmp_path / "many.json"
        path.write_bytes(b"[" + b"[]," * sealed_json.MOST_VALUES + b"[]]")
        monkeypatch.setattr(json, "loads", None)
        with pytest.raises(CalibrationError, match="more than 1000000 values"):
            load_calibration(path)

    def test_a_file_that_is_nested_deeply(self, tmp_path: Path) -> None:
        path = tmp_path / "deep.json"
        path.write_bytes(b'{"a":' * 100_000)
        with pytest.raises(CalibrationError, match=r"nested too deeply|not a whole JSON file"):
            load_calibration(path)

    @given(st.binary(max_size=200))
    @settings(max_examples=50, suppress_health_check=[HealthCheck.function_scoped_fixture])
    def test_anything_else(self, tmp_path: Path, content: bytes) -> None:
        path = tmp_path / "noise.json"
        path.write_bytes(content)
        with pytest.raises(CalibrationError, match=r"noise.json: .*run `cornertouchd calibrate`"):
            load_calibration(path)


class TestTheSchema:
    VALIDATOR = jsonschema.Draft202012Validator(calibration_schema())

    def test_is_one(self) -> None:
        jsonschema.Draft202012Validator.check_schema(calibration_schema())
        assert calibration_schema()["$schema"] == "https://json-schema.org/draft/2020-12/schema"
        assert calibration_schema()["title"] == "cornertouchd calibration"

    def test_allows_what_is_saved(self, saved: Path) -> None:
        self.VALIDATOR.validate(json.loads(saved.read_text()))

    @pytest.mark.parametrize(
        ("place", "value"),
        [
            ("version", 1),
            ("surface_mm", [350.0]),
            ("surface_mm", [1.0, 400.0]),
            ("reference_points", "16"),
            ("residual_mm", "none"),
            ("extra", 1),
            ("cameras.0.extra", 1),
            ("cameras.0.identity", None),
            ("cameras.0.model.position_mm", [0.0, "left"]),
            ("cameras.0.model.points_mm", []),
            ("cameras.2.model.columns_px.1", "unseen"),
            ("cameras.3.model.lens.focal_px", [0.0, 20.0]),
            ("expected", GONE),
            ("cameras.0.identity", GONE),
            ("cameras.0.heights.camera_mm", "high"),
            ("cameras.0.heights.horizon_px", [1.0, 2.0]),
            ("cameras.0.heights.shear", GONE),
        ],
    )
    def test_what_it_forbids_is_refused(self, saved: Path, place: str, value: object) -> None:
        edit(saved, place, value, sealed=True)
        assert not self.VALIDATOR.is_valid(json.loads(saved.read_text()))
        with pytest.raises(CalibrationError) as refused:
            load_calibration(saved)
        assert "has been changed" not in str(refused.value)


class TestACamera:
    def test_that_gives_another_size_is_refused(self) -> None:
        given = PictureFormat(64, 24, 6, 8)
        with pytest.raises(
            CalibrationError, match=r"C1: gives pictures of 64x24.*calibrated at 32x24"
        ):
            calibration().camera("C1").require_camera(given, "")

    def test_that_is_another_one_is_refused(self) -> None:
        with pytest.raises(
            CalibrationError,
            match=r"C1: is another camera \(usb 1234:5678 serial C3\) than was calibrated "
            r"\(usb 1234:5678 serial C1\): cables exchanged\? .*calibrate",
        ):
            calibration().camera("C1").require_camera(FORMAT, "usb 1234:5678 serial C3")

    @pytest.mark.parametrize("identity", ["", "usb 1234:5678 serial C1"])
    def test_that_is_the_same_or_unknown_is_taken(self, identity: str) -> None:
        calibration().camera("C1").require_camera(FORMAT, identity)

    def test_that_was_not_known_when_calibrated_is_taken(self) -> None:
        unknown = dataclasses.replace(calibration().camera("C1"), identity="")
        unknown.require_camera(FORMAT, "usb 1234:5678 serial C3")

    def test_that_was_not_calibrated_is_refused(self) -> None:
        with pytest.raises(
            CalibrationError, match=r"camera C5: not in the calibration \(it has C1, C2"
        ):
            calibration().camera("C5")
