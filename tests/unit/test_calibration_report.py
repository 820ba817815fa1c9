"""What a terminal and a picture tell about a calibration, and about the one before it."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from oracle.nearest_point import nearest_point_to_lines
from rich.console import Console, RenderableType

from cornertouchd.calibration.calibration import Calibration, CameraCalibration, Model
from cornertouchd.calibration.comparison import CameraShift, Comparison, compare
from cornertouchd.calibration.error_map import ErrorMap, map_from_line_sigmas
from cornertouchd.calibration.error_picture import draw_error_map
from cornertouchd.calibration.fitted import Fitted
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.touch_columns import TouchColumns
from cornertouchd.cli.calibration_report import (
    MOST_TAPS,
    calibration_report,
    camera_table,
    comparison_table,
    error_table,
    light_table,
    residual_table,
    tap_table,
)
from cornertouchd.guiding.checking import check_camera
from cornertouchd.guiding.light_statistics import measure_light_statistics
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.vanishing_point import Projection, solve_projection
from cornertouchd.model import FloatArray, PictureFormat
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.strip import find_strip

SURFACE_MM = (350.0, 400.0)
SIZE = PictureFormat(640, 480, 200, 64)
CORNERS = {"C1": (0.0, 0.0), "C2": (350.0, 0.0), "C3": (350.0, 400.0), "C4": (0.0, 400.0)}


def camera(name: str, turned_deg: float = 0.0, moved_mm: tuple[float, float] = (0.0, 0.0)) -> Model:
    """An angle polynomial that spans 97 degrees around the diagonal of its corner."""
    yaw = np.deg2rad(45.0 + 90.0 * list(CORNERS).index(name) + turned_deg)
    x, y = CORNERS[name]
    place = (x + moved_mm[0], y + moved_mm[1])
    return AnglePolynomial(place, (float(yaw), float(np.deg2rad(48.5))), SIZE.width_px)


def calibration(expected_mm: float = 0.1, **changes: Any) -> Calibration:
    """A calibration in which models of cameras may be given by name."""
    models: dict[str, Model] = {name: changes.pop(name, camera(name)) for name in CORNERS}
    cameras = tuple(
        CameraCalibration(name, f"serial {name}", SIZE, np.zeros((64, 640)), model, 0.05)
        for name, model in models.items()
    )
    expected = map_from_line_sigmas(SURFACE_MM, list(models.values()), np.full(4, expected_mm))
    made = Calibration(
        "auto", "2026-03-04T05:06:07+00:00", "0.1", SURFACE_MM, 16, 120, 1, 0.05, expected, cameras
    )
    return replace(made, **changes)


def touches(taps: int = 16, scribble: int = 2) -> tuple[ReferenceTouches, Fitted]:
    side = round(taps**0.5)
    grid = np.stack(np.meshgrid(np.linspace(40, 310, side), np.linspace(50, 350, side)), -1)
    places = np.concatenate([grid.reshape(-1, 2), np.full((scribble, 2), np.nan)])
    columns = np.full((4, len(places), 2), 300.0)
    columns[1, 2] = np.nan
    seen = TouchColumns(columns, places, np.full(len(places), np.nan))
    residuals = np.full((4, len(places)), 0.1)
    residuals[1, 2] = np.nan
    residuals[2, 5] = -0.9
    dropped = np.zeros(residuals.shape, bool)
    dropped[2, 5] = True
    given = ReferenceTouches(SURFACE_MM, dict.fromkeys(CORNERS, SIZE), {}, {}, seen)
    made = calibration()
    fitted = Fitted(tuple(each.model for each in made.cameras), residuals, dropped, made.expected)
    return given, fitted


def printed(renderable: RenderableType, width: int = 80) -> str:
    console = Console(width=width, force_terminal=False)
    with console.capture() as captured:
        console.print(renderable)
    text = captured.get()
    assert max(len(line) for line in text.splitlines()) <= width
    return text


def row(text: str, start: str) -> list[str]:
    """Return the cells of the one row that starts so."""
    (line,) = [line for line in text.splitlines() if line.startswith(f"│ {start} ")]
    return [cell.strip() for cell in line.strip("│").split("│")]


def test_the_same_calibration_stands_where_it_stood() -> None:
    result = compare(calibration(), calibration())
    assert result.apart_worst_mm < 0.01
    assert result.verdict.startswith("the cameras stand where they stood")


def test_a_camera_that_moved_is_named_with_how_far() -> None:
    result = compare(calibration(), calibration(C3=camera("C3", moved_mm=(1.5, -1.5))))
    # along some lines the move is not seen: on the whole by 1 / sqrt(2) or more
    third = result.cameras[2]
    assert third.moved_mm == pytest.approx((1.5, -1.5))
    assert 1.5 < third.lines_mm < 2.2
    assert [shift.camera for shift in result.cameras if shift.moved] == ["C3"]
    assert result.verdict == f"C3 has moved by about {third.lines_mm:.1f} mm"
    assert 0.4 < result.apart_rms_mm <= result.apart_worst_mm < 2.2


def test_a_camera_that_turned_is_told_by_its_angle() -> None:
    result = compare(calibration(), calibration(C2=camera("C2", turned_deg=0.3)))
    assert [shift.turned_deg for shift in result.cameras] == pytest.approx([0, 0.3, 0, 0], abs=1e-6)
    assert result.verdict.startswith("C2 has moved")


def test_places_apart_are_those_of_the_same_columns() -> None:
    """All cameras moved together: every touch moves along, and by as much."""
    moved = {name: camera(name, moved_mm=(0.6, 0.8)) for name in CORNERS}
    result = compare(calibration(), calibration(**moved))
    assert result.apart_rms_mm == pytest.approx(1.0, abs=0.01)
    assert result.apart_worst_mm == pytest.approx(1.0, abs=0.01)


def test_exact_calibrations_tell_smaller_moves_than_rough_ones() -> None:
    after = {"C1": camera("C1", turned_deg=0.15)}
    assert compare(calibration(0.05), calibration(0.05, **after)).verdict.startswith("C1 has moved")
    rough = compare(calibration(1.0), calibration(1.0, **after))
    assert rough.verdict.startswith("the cameras stand")


def projection(name: str) -> Projection:
    """The paper's projection of the same camera, whose lens it does not know."""
    points = np.stack(np.meshgrid(np.linspace(20, 330, 6), np.linspace(20, 380, 6)), -1)
    away = points.reshape(-1, 2) - CORNERS[name]
    yaw = np.deg2rad(45.0 + 90.0 * list(CORNERS).index(name))
    off = (np.arctan2(away[:, 1], away[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi
    return solve_projection(points.reshape(-1, 2), 320 + off / np.deg2rad(48.5) * 320)


def test_methods_that_disagree_are_not_taken_for_a_move() -> None:
    other = {name: projection(name) for name in CORNERS}
    result = compare(calibration(), calibration(method="vanishing-point", **other))
    assert result.apart_rms_mm > 1.0
    assert "or the methods disagree (auto, vanishing-point)" in result.verdict


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (calibration(surface_mm=(2400.0, 1350.0)), "the surface was 350 x 400 mm, now it is 2400"),
        (calibration(cameras=calibration().cameras[:3]), "now they are C1, C2, C3"),
        (
            calibration(C1=camera("C3"), C2=camera("C4"), C3=camera("C1"), C4=camera("C2")),
            "the lines of C1, C2, C3, C4 run elsewhere",
        ),
        (
            calibration(
                cameras=tuple(
                    replace(each, format=replace(SIZE, width_px=1280))
                    for each in calibration().cameras
                )
            ),
            "C1 gave pictures of 640x480",
        ),
    ],
)
def test_another_rig_is_told_and_why(other: Calibration, reason: str) -> None:
    verdict = compare(calibration(), other).verdict
    assert verdict.startswith("another rig: ")
    assert reason in verdict


def test_a_camera_that_was_exchanged_is_named() -> None:
    old = calibration()
    new = replace(old, cameras=(replace(old.cameras[0], identity="serial 9"), *old.cameras[1:]))
    assert compare(old, new).verdict == "other cameras than before: C1"
    unknown = replace(old, cameras=tuple(replace(each, identity="") for each in old.cameras))
    assert compare(unknown, new).verdict.startswith("the cameras stand")


def test_calibrations_without_a_camera_in_common_can_be_compared() -> None:
    old = calibration()
    renamed = replace(old, cameras=tuple(replace(c, id=f"X{c.id}") for c in old.cameras))
    result = compare(old, renamed)
    assert result.cameras == ()
    assert result.verdict.startswith("another rig")
    assert "another rig" in printed(comparison_table(result))


def test_the_comparison_is_printed() -> None:
    text = printed(comparison_table(compare(calibration(), calibration(C3=camera("C3", 0.3)))))
    assert row(text, "C3")[2] == "+0.300"
    assert row(text, "C1")[1:] == ["+0.00, +0.00", "+0.000", "0.00"]
    assert "C3 has moved by about" in text
    assert "before" in text


def test_what_cannot_be_compared_is_printed_as_unknown() -> None:
    nan = float("nan")
    shift = CameraShift("C1", (0.0, 0.0), nan, nan, 0.3, exchanged=False)
    text = printed(
        comparison_table(
            Comparison((shift,), nan, nan, (nan, nan), (nan, 0.2), ("auto", "lookup-table"), "")
        )
    )
    assert row(text, "C1")[2:] == ["?", "?"]


def test_residuals_are_told_camera_by_camera() -> None:
    text = printed(residual_table(*touches()))
    assert row(text, "C2") == ["C2", "350.0, 0.0", "17 of 18", "0", "0.100"]
    assert row(text, "C3")[3:] == ["1", "0.233"]


def test_taps_are_numbered_and_the_dropped_are_marked() -> None:
    text = printed(tap_table(*touches()))
    assert row(text, "1") == ["1", "40, 50", "0.100", "C1 +0.10", ""]
    assert row(text, "6") == ["6", "130, 150", "0.458", "C3 -0.90", "C3"]
    assert "│ 17 " not in text


def test_of_many_taps_the_worst_are_listed_first() -> None:
    given, fitted = touches(taps=225)
    fitted.residuals_mm[:, 100] = 2.0
    fitted.residuals_mm[:, 7] = np.nan
    lines = printed(tap_table(given, fitted)).splitlines()[3:-1]
    assert len(lines) == MOST_TAPS
    assert "not seen" in lines[0]
    assert lines[1].startswith("│ 101 ")
    assert lines[2].startswith("│ 6 ")


def test_expected_errors_are_told_place_by_place() -> None:
    errors = np.add.outer(np.arange(13.0), np.zeros(13))
    errors[:, 12] = np.nan
    expected = ErrorMap(np.linspace(0, 300, 13), np.linspace(0, 400, 13), errors)
    text = printed(error_table(expected))
    assert row(text, "y 0")[1:] == ["0.00"] * 4 + ["?"]
    assert row(text, "y 200")[1:] == ["6.00"] * 4 + ["?"]
    assert row(text, "y 400")[1:] == ["12.00"] * 4 + ["?"]
    assert "worst 12.00 mm" in text


def test_places_that_cannot_be_located_are_told() -> None:
    errors = np.full((13, 13), 0.2)
    errors[:6] = np.nan
    text = printed(error_table(ErrorMap(np.arange(13.0), np.arange(13.0), errors)))
    assert text.count("?") == 10


def test_a_whole_report_fits_a_narrow_terminal() -> None:
    given, fitted = touches()
    text = printed(calibration_report(calibration(), given, fitted))
    assert "method auto: 16 taps, 120 scribbled; residual 0.050 mm" in text
    untapped = replace(calibration(), reference_points=0)
    assert "place mm" not in printed(calibration_report(untapped, given, fitted))


def test_cameras_and_what_to_change_are_told() -> None:
    rig = SimulatedRig()
    pictures = [rig.render("C1", index, ()) for index in range(2)]
    dim = [(picture * 0.5).astype(np.uint8) for picture in pictures]
    checks = [check_camera("C1", pictures), check_camera("C2", dim), check_camera("C3", [])]
    text = printed(camera_table(checks))
    assert row(text, "C1")[1:4] == ["good", "74%", "0.0%"]
    assert row(text, "C2")[1] == "doubtful"
    assert row(text, "C3")[1:] == ["bad", "-", "-", "-", "-", "-"]
    assert "C2 doubtful: the strip is at" in text
    assert "raise the exposure" in text.replace("\n", " ")
    assert "C3 bad: no picture came" in text
    assert "C1 " not in text.split("┘")[1]


def test_the_empty_strip_is_told() -> None:
    rig = SimulatedRig()
    pictures = np.array([rig.render("C3", index, ()) for index in range(4)])
    pictures[:, :, 150:170] = pictures[:, :, 150:170] // 8
    strip = find_strip(pictures.mean(axis=0))
    text = printed(light_table([measure_light_statistics("C3", pictures, strip)]))
    assert row(text, "C3")[-1] == "none"
    assert "C3: dim LEDs at columns 149-170 (12%)" in text
    assert 'vision.edges at "profile"' in text.replace("\n", "")


def decoded(png: bytes) -> FloatArray:
    image = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    assert image is not None
    return image.astype(np.float64)


def test_the_error_map_is_a_small_picture_to_scale() -> None:
    png = draw_error_map(calibration())
    assert png.startswith(b"\x89PNG")
    assert len(png) < 100_000
    tall = decoded(png)
    wide_rig = replace(calibration(), surface_mm=(2400.0, 1350.0))
    assert tall.shape[0] > tall.shape[1]
    wide = decoded(draw_error_map(wide_rig))
    assert wide.shape[0] < wide.shape[1]


def test_larger_errors_are_brighter_and_unknown_places_grey() -> None:
    made = calibration()
    errors = np.add.outer(np.zeros(13), np.linspace(0.1, 1.0, 13))
    drawn = replace(made, expected=replace(made.expected, errors_mm=errors))
    image = decoded(draw_error_map(drawn))
    line = image[400].mean(axis=1)
    assert line[60:100].mean() < line[300:340].mean() < line[560:600].mean()
    errors = errors.copy()
    errors[:, 6:] = np.nan
    image = decoded(
        draw_error_map(replace(made, expected=replace(made.expected, errors_mm=errors)))
    )
    assert (np.ptp(image[400, 450:590], axis=1) < 1).all()
    assert (np.ptp(image[400, 60:250], axis=1) > 20).any()


def test_a_camera_far_outside_is_drawn_at_the_border() -> None:
    far = camera("C1", moved_mm=(-500.0, -500.0))
    assert decoded(draw_error_map(calibration(C1=far))).any()


def test_locating_agrees_with_the_crossing_of_lines() -> None:
    """A camera turned by a little moves a touch as the least squares of four lines do."""
    after = calibration(C1=camera("C1", turned_deg=0.2))
    result = compare(calibration(), after)
    x, y = result.worst_at_mm
    angles = [np.arctan2(y - cy, x - cx) for cx, cy in CORNERS.values()]
    angles[0] += np.deg2rad(0.2)
    point = nearest_point_to_lines(np.array(list(CORNERS.values())), np.array(angles))
    assert np.hypot(*(point - (x, y))) == pytest.approx(result.apart_worst_mm, rel=0.01)
