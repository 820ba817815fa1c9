"""Every destination gets the coordinates of its display: as set, else as calibrated."""

from dataclasses import replace
from pathlib import Path

import pytest

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.display import DisplayPlace, save_display
from cornertouchd.config import (
    CamerasSettings,
    DestinationSettings,
    ScreenSettings,
    Settings,
    SurfaceSettings,
    TuioSettings,
)
from cornertouchd.runtime.displays import display_file, display_mapping, find_displays
from cornertouchd.wire.mapping import DisplayMapping

SURFACE_MM = (600.0, 400.0)
PLACE = DisplayPlace(20.0, 30.0, 500.0, 300.0, 90, True, "now", 0.5)
CALIBRATED = DisplayMapping(20.0, 30.0, 500.0, 300.0, 90, True)
SETTINGS = Settings(
    surface=SurfaceSettings(width_mm=600.0, height_mm=400.0),
    cameras=CamerasSettings(source="v4l2"),
)


@pytest.fixture
def calibration(tmp_path: Path) -> Path:
    return tmp_path / "calibration.json"


def test_a_destination_that_says_nothing_gets_what_was_calibrated() -> None:
    elsewhere = DestinationSettings(host="wall.example", port=4444)
    assert display_mapping(SURFACE_MM, elsewhere, {"": PLACE}) == CALIBRATED


def test_without_a_calibration_the_display_is_the_whole_surface() -> None:
    mapping = display_mapping(SURFACE_MM, DestinationSettings())
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
    assert display_mapping(SURFACE_MM, settings, {"": PLACE}) == mapping


def test_it_is_found_where_it_is_kept(calibration: Path) -> None:
    assert find_displays(SETTINGS, calibration) == {}
    save_display(PLACE, display_file(calibration))
    assert find_displays(SETTINGS, calibration) == {"": PLACE}


def test_it_is_kept_beside_the_calibration_that_it_belongs_to(tmp_path: Path) -> None:
    ours, theirs = tmp_path / "calibration.json", tmp_path / "wall" / "cameras.json"
    assert display_file(ours) == tmp_path / "display.json"
    assert display_file(theirs) == tmp_path / "wall" / "display.json"
    save_display(PLACE, display_file(ours))
    assert find_displays(SETTINGS, theirs) == {}


def test_two_displays_of_a_surface_are_kept_by_their_names(calibration: Path) -> None:
    left, right = replace(PLACE, width_mm=250.0), replace(PLACE, left_mm=300.0, width_mm=250.0)
    save_display(left, display_file(calibration, "left"))
    save_display(right, display_file(calibration, "right"))
    to_left = DestinationSettings(display="left")
    on_right = ScreenSettings(display="right", enabled=True)
    settings = SETTINGS.model_copy(
        update={"tuio": TuioSettings(destinations=(to_left,)), "screens": (on_right,)}
    )
    displays = find_displays(settings, calibration)
    assert displays == {"left": left, "right": right}
    assert display_mapping(SURFACE_MM, to_left, displays).left_mm == 20.0
    assert display_mapping(SURFACE_MM, on_right, displays).left_mm == 300.0


def test_a_named_display_that_nobody_has_found_is_refused_with_the_remedy(
    calibration: Path,
) -> None:
    for wanted in (ScreenSettings(display="wall", enabled=True), ScreenSettings(display="wall")):
        settings = SETTINGS.model_copy(update={"screens": (wanted,)})
        if not wanted.enabled:
            assert find_displays(settings, calibration) == {}
            continue
        with pytest.raises(CalibrationError, match=r"`cornertouchd calibrate display --name wall`"):
            find_displays(settings, calibration)


def test_a_named_display_whose_place_is_set_needs_no_calibration(calibration: Path) -> None:
    wanted = ScreenSettings(display="wall", enabled=True, display_width_mm=100.0)
    settings = SETTINGS.model_copy(update={"screens": (wanted,)})
    assert find_displays(settings, calibration) == {}


def test_a_simulated_rig_has_no_display(calibration: Path) -> None:
    save_display(PLACE, display_file(calibration))
    assert find_displays(Settings(cameras=CamerasSettings(source="simulated")), calibration) == {}


def test_a_damaged_one_is_refused_with_the_remedy(calibration: Path) -> None:
    display_file(calibration).write_text("{")
    with pytest.raises(CalibrationError, match=r"display.json: .*`cornertouchd calibrate display`"):
        find_displays(SETTINGS, calibration)


def test_one_of_another_surface_is_refused_with_the_remedy(calibration: Path) -> None:
    save_display(PLACE, display_file(calibration))
    with pytest.raises(CalibrationError, match=r"display.json: .*350x400 mm; run `cornertouchd"):
        find_displays(SETTINGS.model_copy(update={"surface": SurfaceSettings()}), calibration)
