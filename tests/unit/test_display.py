"""Four taps on the corners of a picture tell where it lies; what is no picture is refused."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.display import (
    DisplayPlace,
    fit_display,
    fit_perspective,
    load_display,
    save_display,
)
from cornertouchd.calibration.sealed_json import seal
from cornertouchd.config import DestinationSettings
from cornertouchd.geometry import homography_between
from cornertouchd.runtime.displays import display_mapping
from cornertouchd.wire.mapping import DisplayMapping

SURFACE_MM = (600.0, 400.0)
PLACE = DisplayPlace(20.0, 30.0, 500.0, 300.0, 0, False, "2026-01-02T03:04:05+00:00", 0.5)
CORNERS_MM = np.array([(20.0, 30.0), (520.0, 30.0), (520.0, 330.0), (20.0, 330.0)])


def fit(points_mm: np.ndarray, inset_share: float = 0.0) -> DisplayPlace:
    return fit_display(points_mm, SURFACE_MM, inset_share, PLACE.created_at)


def turned(points_mm: np.ndarray, degrees: float) -> np.ndarray:
    """Return the points turned clockwise, as seen on a surface whose y runs down."""
    angle, middle = np.deg2rad(degrees), points_mm.mean(axis=0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    return (points_mm - middle) @ turn + middle


class TestFitting:
    def test_a_picture_that_lies_straight(self) -> None:
        assert fit(CORNERS_MM) == dataclasses.replace(PLACE, residual_mm=0.0)

    @given(
        corner_mm=st.tuples(st.floats(0.0, 80.0), st.floats(0.0, 80.0)),
        size_mm=st.tuples(st.floats(100.0, 500.0), st.floats(100.0, 300.0)),
        rotation_deg=st.sampled_from([0, 90, 180, 270]),
        mirror=st.booleans(),
        inset_share=st.floats(0.0, 0.3),
    )
    def test_taps_on_the_targets_come_out_at_the_targets(
        self,
        corner_mm: tuple[float, float],
        size_mm: tuple[float, float],
        rotation_deg: int,
        mirror: bool,
        inset_share: float,
    ) -> None:
        true = DisplayMapping(*corner_mm, *size_mm, rotation_deg, mirror)
        low, high = inset_share, 1 - inset_share
        targets = [(low, low), (high, low), (high, high), (low, high)]
        taps = np.array([_place_of(target, true) for target in targets])
        place = fit_display(taps, SURFACE_MM, inset_share, "now")
        found = DisplayMapping(
            place.left_mm,
            place.top_mm,
            place.width_mm,
            place.height_mm,
            place.rotation_deg,
            place.mirror,
        )
        assert (found.rotation_deg, found.mirror) == (rotation_deg, mirror)
        for tap, target in zip(taps, targets, strict=True):
            assert found.to_display(*tap) == pytest.approx(target, abs=1e-3)

    def test_taps_that_are_not_quite_on_the_corners_are_averaged(self) -> None:
        place = fit(CORNERS_MM + np.array([(2, 0), (0, 0), (0, 0), (-2, 0)]))
        assert (place.left_mm, place.width_mm) == (pytest.approx(20.0), pytest.approx(500.0))
        assert place.residual_mm == 1.41


def _place_of(target: tuple[float, float], mapping: DisplayMapping) -> tuple[float, float]:
    """Return the place that the mapping maps to a target: it is affine, so three places tell."""
    origin = np.array([mapping.left_mm, mapping.top_mm])
    right, down = np.array([mapping.width_mm, 0.0]), np.array([0.0, mapping.height_mm])
    zero = np.array(mapping.to_display(*origin))
    columns = [np.array(mapping.to_display(*(origin + step))) - zero for step in (right, down)]
    x, y = np.linalg.solve(np.stack(columns, axis=1), np.array(target) - zero)
    placed = origin + x * right + y * down
    return float(placed[0]), float(placed[1])


class TestRefused:
    @pytest.mark.parametrize("corner", range(4))
    def test_one_tap_that_missed_by_name_and_distance(self, corner: int) -> None:
        name = ("top-left", "top-right", "bottom-right", "bottom-left")[corner]
        taps = CORNERS_MM.copy()
        taps[corner] += (30.0, -40.0)
        with pytest.raises(CalibrationError, match=rf"the {name} corner is 50 mm from .*again"):
            fit(taps)

    @pytest.mark.parametrize(
        ("degrees", "how"), [(3.0, "clockwise by 3.0"), (-1.4, "anticlockwise by 1.4")]
    )
    def test_a_picture_that_is_turned_by_some_degrees(self, degrees: float, how: str) -> None:
        with pytest.raises(CalibrationError, match=rf"is turned {how} degrees.*straighten"):
            fit(turned(CORNERS_MM, degrees))

    def test_corners_in_a_wrong_order(self) -> None:
        with pytest.raises(
            CalibrationError, match=r"not the corners .* top-left, top-right, bottom-right"
        ):
            fit(CORNERS_MM[[0, 1, 3, 2]])

    def test_four_taps_on_one_corner(self) -> None:
        with pytest.raises(CalibrationError, match="is but 0 mm long, 20 mm at least"):
            fit(np.tile(CORNERS_MM[0], (4, 1)))

    @pytest.mark.parametrize("taps", [CORNERS_MM[:3], CORNERS_MM * np.nan])
    def test_less_than_four_taps(self, taps: np.ndarray) -> None:
        with pytest.raises(CalibrationError, match="four taps are needed"):
            fit(taps)

    def test_a_picture_that_does_not_lie_on_the_surface(self) -> None:
        with pytest.raises(CalibrationError, match=r"the surface is 600x400 mm; run"):
            fit(CORNERS_MM + np.array([100.0, 0.0]))
        with pytest.raises(CalibrationError, match=r"the surface is 350x400 mm; run"):
            PLACE.require_on((350.0, 400.0))


class TestTheFile:
    @pytest.fixture
    def saved(self, tmp_path: Path) -> Path:
        save_display(PLACE, tmp_path / "display.json")
        return tmp_path / "display.json"

    def test_what_is_saved_is_loaded(self, saved: Path) -> None:
        assert load_display(saved) == PLACE

    def test_the_one_before_is_kept(self, saved: Path) -> None:
        save_display(dataclasses.replace(PLACE, mirror=True), saved)
        assert load_display(saved).mirror
        assert load_display(saved.with_name("display.json.previous")) == PLACE

    def test_an_edited_one_is_refused(self, saved: Path) -> None:
        saved.write_text(saved.read_text().replace("500.0", "501.0"))
        with pytest.raises(CalibrationError, match=r"changed since .*`cornertouchd calibrate disp"):
            load_display(saved)

    def test_one_that_is_not_whole_is_refused(self, saved: Path) -> None:
        saved.write_text(saved.read_text()[:-20])
        with pytest.raises(CalibrationError, match=r"display.json: is not a whole JSON file"):
            load_display(saved)

    @pytest.mark.parametrize(
        ("key", "value"),
        [("rotation_deg", 45), ("width_mm", 0.0), ("mirror", 1), ("left_mm", 1e999)],
    )
    def test_impossible_values_are_refused_by_name(
        self, saved: Path, key: str, value: object
    ) -> None:
        saved.write_text(json.dumps(json.loads(saved.read_text()) | {key: value}))
        with pytest.raises(CalibrationError, match=rf"display.json: {key} = "):
            load_display(saved)


TRAPEZIUM = ((40.0, 30.0), (560.0, 45.0), (575.0, 380.0), (22.0, 371.0))


@pytest.mark.parametrize("inset_share", [0.0, 0.1])
def test_a_trapezium_is_found_by_its_corners(tmp_path: Path, inset_share: float) -> None:
    mapping = DisplayMapping(0.0, 0.0, 600.0, 400.0, corners_mm=TRAPEZIUM)
    picture = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    homography = homography_between(picture, np.array(TRAPEZIUM))
    targets = np.column_stack([inset_share + (1 - 2 * inset_share) * picture, np.ones(4)])
    taps = targets @ homography.T
    place = fit_perspective(taps[:, :2] / taps[:, 2:], (600.0, 400.0), inset_share, "now")
    assert place.corners_mm is not None
    assert np.array(place.corners_mm) == pytest.approx(np.array(TRAPEZIUM), abs=0.02)
    save_display(place, tmp_path / "display.json")
    again = load_display(tmp_path / "display.json")
    assert again == place
    found = display_mapping((600.0, 400.0), DestinationSettings(), {"": again})
    for place_mm in ((100.0, 100.0), (300.0, 200.0), (500.0, 350.0)):
        wanted = mapping.to_display(*place_mm)
        assert found.to_display(*place_mm) == pytest.approx(wanted, abs=1e-4)


@pytest.mark.parametrize(
    ("taps", "told"),
    [
        ((TRAPEZIUM[0], TRAPEZIUM[2], TRAPEZIUM[1], TRAPEZIUM[3]), "go around a picture"),
        (((0.0, 0.0), (9.0, 0.0), (9.0, 9.0), (0.0, 9.0)), "too near to each other"),
        (((-30.0, 0.0), (500.0, 0.0), (500.0, 300.0), (0.0, 300.0)), "calibrate display"),
        (TRAPEZIUM[:3], "four taps"),
    ],
)
def test_taps_that_are_of_no_trapezium_on_the_surface_are_refused(
    taps: tuple[tuple[float, float], ...], told: str
) -> None:
    with pytest.raises(CalibrationError, match=told):
        fit_perspective(np.array(taps), (600.0, 400.0), 0.0, "now")


def test_a_file_of_the_first_version_is_read(tmp_path: Path) -> None:
    content = {
        "format": "cornertouchd-display",
        "version": 1,
        "left_mm": 10.0,
        "top_mm": 20.0,
        "width_mm": 300.0,
        "height_mm": 200.0,
        "rotation_deg": 0,
        "mirror": False,
        "created_at": "now",
        "residual_mm": 0.5,
    }
    (tmp_path / "display.json").write_bytes(seal(content))
    place = load_display(tmp_path / "display.json")
    assert (place.width_mm, place.corners_mm) == (300.0, None)
