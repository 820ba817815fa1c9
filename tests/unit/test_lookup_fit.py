"""A lookup table is made from points along the frame, and only from such."""

from dataclasses import replace

import numpy as np
import pytest

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.lookup import fit_lookup_tables
from cornertouchd.calibration.methods import fit
from cornertouchd.calibration.touch_columns import TouchColumns
from cornertouchd.locating.lookup_table import LookupTable
from cornertouchd.model import FloatArray, PictureFormat

SURFACE_MM = (350.0, 400.0)
CAMERAS = ("C1", "C2", "C3", "C4")
POSITIONS_MM = np.array([(-6.0, -5.0), (355.0, -6.0), (356.0, 405.0), (-5.0, 406.0)])
YAWS_RAD = np.deg2rad([45.5, 134.0, 226.0, 314.5])
INSET_MM = 5.0


def along_frame(count: int = 112) -> FloatArray:
    """Places at equal distances along the frame, clockwise from the top-left, (count, 2)."""
    low, (right, bottom) = INSET_MM, np.array(SURFACE_MM) - INSET_MM
    corners = np.array([(low, low), (right, low), (right, bottom), (low, bottom), (low, low)])
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners, axis=0)).sum(axis=1))])
    places = (np.arange(count) + 0.5) / count * way[-1]
    return np.stack([np.interp(places, way, corners[:, axis]) for axis in (0, 1)], axis=1)


def columns_of(points_mm: FloatArray, barrel: float = 0.0) -> FloatArray:
    """Columns in which the cameras see points, (4, P)."""
    away = points_mm - POSITIONS_MM[:, None]
    off = np.arctan2(away[..., 1], away[..., 0]) - YAWS_RAD[:, None]
    x = np.tan((off + np.pi) % (2 * np.pi) - np.pi)
    columns: FloatArray = 320.0 + 600.0 * x / (1.0 + np.sqrt(1.0 + 4.0 * barrel * x * x))
    return columns


def touches(points_mm: FloatArray, barrel: float = 0.0) -> ReferenceTouches:
    columns = columns_of(points_mm, barrel)
    seen = TouchColumns(
        np.stack([columns - 4.0, columns + 4.0], axis=-1), points_mm, np.full(len(points_mm), 8.0)
    )
    size = PictureFormat(640, 480, 200, 64)
    return ReferenceTouches(SURFACE_MM, dict.fromkeys(CAMERAS, size), {}, {}, seen)


def tables(given: ReferenceTouches) -> list[LookupTable]:
    models = [model for model in fit_lookup_tables(given).models if isinstance(model, LookupTable)]
    assert len(models) == len(given.formats)
    return models


def test_lines_run_through_places_that_were_never_touched() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform([20.0, 20.0], [330.0, 380.0], (200, 2))
    for camera, model in enumerate(tables(touches(along_frame(225)))):
        away = points - POSITIONS_MM[camera]
        off = model.angles_rad(columns_of(points)[camera]) - np.arctan2(away[:, 1], away[:, 0])
        distances_mm = np.hypot(*away.T) * np.sin(off)
        # the line across the far corner is the one that eq. 7 gets wrong
        assert np.median(np.abs(distances_mm)) < 0.02
        assert np.nanpercentile(np.abs(distances_mm), 95) < 0.1


def test_a_table_has_the_points_of_the_two_far_sides_in_order() -> None:
    shuffled = np.random.default_rng(1).permutation(along_frame())
    far_from_corner = {"C1": (345.0, 395.0), "C2": (5.0, 395.0), "C3": (5.0, 5.0), "C4": (345.0, 5)}
    for camera, model in zip(CAMERAS, tables(touches(shuffled)), strict=True):
        points, (x, y) = np.array(model.points_mm), far_from_corner[camera]
        assert (np.isclose(points[:, 0], x) | np.isclose(points[:, 1], y)).all()
        assert len(points) == pytest.approx(len(shuffled) / 2, abs=2)
        assert (np.diff(model.columns_px) > 0.0).all()


def test_the_projection_centre_of_a_pinhole_is_found() -> None:
    found = [model.position_mm for model in tables(touches(along_frame()))]
    assert np.array(found) == pytest.approx(POSITIONS_MM, abs=1e-6)


def test_the_method_is_chosen_by_its_name() -> None:
    fitted = fit("lookup-table", touches(along_frame()), 0.5)
    assert all(isinstance(model, LookupTable) for model in fitted.models)


def test_a_camera_that_hangs_upside_down_gets_the_same_lines() -> None:
    given = touches(along_frame())
    given.touches.columns_px[2] = 640.0 - given.touches.columns_px[2]
    upright, hanging = tables(touches(along_frame()))[2], tables(given)[2]
    columns = np.linspace(40.0, 580.0, 50)
    assert hanging.angles_rad(640.0 - columns) == pytest.approx(upright.angles_rad(columns))


def test_a_point_that_is_not_seen_leaves_a_gap() -> None:
    given = touches(along_frame())
    missing = 50  # on the right side, far from C1
    column = given.touches.columns_px[0, missing].mean()
    given.touches.columns_px[0, missing] = np.nan
    assert np.isnan(tables(given)[0].angles_rad(np.array([column]))).all()


def test_a_missed_tap_is_dropped_told_and_leaves_a_gap() -> None:
    given = touches(along_frame())
    missed = 45
    columns = given.touches.columns_px[:, missed].mean(axis=1).copy()
    given.touches.columns_px[:, missed] = columns_of(along_frame()[[missed + 4]])  # 50 mm on
    given.touches.columns_px[:, missed] += [-4.0, 4.0]
    fitted = fit_lookup_tables(given)
    dropped = np.argwhere(fitted.dropped).tolist()
    assert dropped == [[0, missed], [3, missed]]  # C1 and C4 see the right side from afar
    for camera in (0, 3):
        assert np.isnan(fitted.models[camera].angles_rad(columns[[camera]])).all()


def test_points_in_a_wrong_order_are_refused() -> None:
    points = along_frame()
    given = touches(points)
    exchanged = replace(given.touches, points_mm=np.random.default_rng(2).permutation(points))
    with pytest.raises(CalibrationError, match=r"camera C1: only \d+ of the \d+ reference points"):
        fit_lookup_tables(replace(given, touches=exchanged))


def test_points_off_the_frame_are_refused_with_the_remedy() -> None:
    points = np.vstack([along_frame(), [(100.0, 180.0)]])
    with pytest.raises(CalibrationError, match=r"\(100\.0, 180\.0\) mm lies 100\.0 mm .* equal"):
        fit_lookup_tables(touches(points))


@pytest.mark.parametrize(("count", "told"), [(0, "no reference points"), (12, "pairs of neigh")])
def test_too_few_points_are_refused_with_the_remedy(count: int, told: str) -> None:
    with pytest.raises(CalibrationError, match=rf"{told}.*along the frame at equal distances"):
        fit_lookup_tables(touches(along_frame(count)))


def test_points_on_two_sides_only_are_refused() -> None:
    points = along_frame()
    with pytest.raises(CalibrationError, match="camera C3"):
        fit_lookup_tables(touches(points[(points[:, 0] > 340.0) | (points[:, 1] > 390.0)]))


def test_cameras_whose_cables_were_exchanged_are_refused() -> None:
    given = touches(along_frame())
    given.touches.columns_px[[0, 2]] = given.touches.columns_px[[2, 0]]
    with pytest.raises(CalibrationError, match=r"camera C1: .*corner of C3; is it in the corner"):
        fit_lookup_tables(given)


def test_a_camera_without_a_corner_is_refused() -> None:
    given = touches(along_frame())
    formats = dict(zip(("C1", "C2", "C3", "C7"), given.formats.values(), strict=True))
    with pytest.raises(CalibrationError, match="camera C7: no corner"):
        fit_lookup_tables(replace(given, formats=formats))


def test_touches_at_unknown_places_change_nothing() -> None:
    given, somewhere = touches(along_frame()), touches(np.array([(80.0, 90.0), (200.0, 300.0)]))
    both = TouchColumns(
        np.concatenate([given.touches.columns_px, somewhere.touches.columns_px], axis=1),
        np.vstack([given.touches.points_mm, np.full((2, 2), np.nan)]),
        np.concatenate([given.touches.diameters_mm, [np.nan, np.nan]]),
    )
    assert fit_lookup_tables(replace(given, touches=both)).models == tuple(tables(given))


def test_residuals_are_of_the_near_sides_and_tell_a_barrel_lens() -> None:
    points = along_frame()
    near_c1 = np.isclose(points, INSET_MM).any(axis=1)
    pinhole, barrel = (fit_lookup_tables(touches(points, barrel)) for barrel in (0.0, 0.3))
    known = np.isfinite(pinhole.residuals_mm[0])
    assert known[near_c1].mean() > 0.5  # the others appear beside the table, where no line is
    assert not known[~near_c1].any()
    assert np.nanmax(np.abs(pinhole.residuals_mm)) < 0.1
    assert np.sqrt(np.nanmean(barrel.residuals_mm**2)) > 2.0
    assert np.nanmedian(pinhole.expected.errors_mm) < 0.11
    assert np.nanmedian(barrel.expected.errors_mm) > 2.0


def test_no_error_is_expected_where_no_two_cameras_have_a_line() -> None:
    whole = fit_lookup_tables(touches(along_frame())).expected
    assert np.isfinite(whole.errors_mm).mean() > 0.9
    given = touches(along_frame())
    places = along_frame()
    # C2, C3 and C4 see nothing beyond the middle of their view
    for camera in (1, 2, 3):
        given.touches.columns_px[camera, columns_of(places)[camera] > 320.0] = np.nan
    partly = fit_lookup_tables(given).expected
    assert np.isnan(partly.errors_mm).any()
    assert np.isfinite(partly.rms_mm)
