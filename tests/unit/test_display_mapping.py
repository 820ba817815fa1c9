"""Every destination gets the coordinates of its display: as set, else as calibrated."""

from pathlib import Path

import pytest

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.display import DisplayPlace, save_display
from cornertouchd.config import (
    CalibrationSettings,
    CamerasSettings,
    DestinationSettings,
    Settings,
    SurfaceSettings,
)
from cornertouchd.runtime.assembly import display_file, display_mapping, find_display
from cornertouchd.wire.mapping import DisplayMapping

SURFACE_MM = (600.0, 400.0)
PLACE = DisplayPlace(20.0, 30.0, 500.0, 300.0, 90, True, "now", 0.5)
CALIBRATED = DisplayMapping(20.0, 30.0, 500.0, 300.0, 90, True)
SETTINGS = Settings(
    surface=SurfaceSettings(width_mm=600.0, height_mm=400.0),
    cameras=CamerasSettings(source="v4l2"),
)


@pytest.fixture
def environ(tmp_path: Path) -> dict[str, str]:
    return {"STATE_DIRECTORY": str(tmp_path)}


def test_a_destination_that_says_nothing_gets_what_was_calibrated() -> None:
    elsewhere = DestinationSettings(host="wall.example", port=4444)
    assert display_mapping(SURFACE_MM, elsewhere, PLACE) == CALIBRATED


def test_without_a_calibration_the_display_is_the_whole_surface() -> None:
    mapping = display_mapping(SURFACE_MM, DestinationSettings(), None)
    assert mapping == DisplayMapping(0.0, 0.0, 600.0, 400.0)


@pytest.mark.parametrize(
    ("settings", "mapping"),
    [
        (DestinationSettings(rotation_deg=180), DisplayMapping(0.0, 0.0, 600.0, 400.0, 180)),
        (DestinationSettings(mirror=True), DisplayMapping(0.0, 0.0, 600.0, 400.0, 0, True)),
        (DestinationSettings(display_left_mm=10.0), DisplayMapping(10.0, 0.0, 590.0, 400.0)),
        (DestinationSettings(display_top_mm=10.0), DisplayMapping(0.0, 10.0, 600.0, 390.0)),
        (DestinationSettings(display_width_mm=99.0), DisplayMapping(0.0, 0.0, 99.0, 400.0)),
        (DestinationSettings(display_height_mm=99.0), DisplayMapping(0.0, 0.0, 600.0, 99.0)),
    ],
)
def test_settings_win(settings: DestinationSettings, mapping: DisplayMapping) -> None:
    assert display_mapping(SURFACE_MM, settings, PLACE) == mapping


def test_it_is_found_where_it_is_kept(environ: dict[str, str]) -> None:
    assert find_display(SETTINGS, environ) is None
    save_display(PLACE, display_file(SETTINGS, environ))
    assert find_display(SETTINGS, environ) == PLACE


def test_it_is_kept_beside_the_calibration_that_it_belongs_to(
    environ: dict[str, str], tmp_path: Path
) -> None:
    theirs = CalibrationSettings(file=str(tmp_path / "wall" / "cameras.json"))
    wall = SETTINGS.model_copy(update={"calibration": theirs})
    assert display_file(SETTINGS, environ) == tmp_path / "display.json"
    assert display_file(wall, environ) == tmp_path / "wall" / "display.json"
    save_display(PLACE, display_file(SETTINGS, environ))
    assert find_display(wall, environ) is None


def test_a_simulated_rig_has_no_display(environ: dict[str, str]) -> None:
    save_display(PLACE, display_file(SETTINGS, environ))
    assert find_display(Settings(cameras=CamerasSettings(source="simulated")), environ) is None


def test_a_damaged_one_is_refused_with_the_remedy(environ: dict[str, str]) -> None:
    display_file(SETTINGS, environ).write_text("{")
    with pytest.raises(CalibrationError, match=r"display.json: .*`cornertouchd calibrate display`"):
        find_display(SETTINGS, environ)


def test_one_of_another_surface_is_refused_with_the_remedy(environ: dict[str, str]) -> None:
    save_display(PLACE, display_file(SETTINGS, environ))
    with pytest.raises(CalibrationError, match=r"display.json: .*350x400 mm; run `cornertouchd"):
        find_display(SETTINGS.model_copy(update={"surface": SurfaceSettings()}), environ)
