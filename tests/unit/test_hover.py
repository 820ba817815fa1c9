"""Light below a finger tells that it hovers; who cannot see it says nothing."""

from dataclasses import replace

import numpy as np
import pytest
from grazed import CAMERA_MM, HORIZON_PX, WIDTH_PX, CornerSight, corner_sight, own
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.fusion.leaning import LIFTED_GAP
from cornertouchd.fusion.tips import GAP_AT_THE_SURFACE
from cornertouchd.fusion.touch_point import TouchPointFinder, TouchPoints
from cornertouchd.model import Outlines

SIGHTS = [corner_sight(number) for number in range(4)]
AMID = (175.0, 200.0, 6.0)
ROWS = 64
SKIN = 0.05


def column_and_row(sight: CornerSight, x_mm: float, y_mm: float) -> tuple[float, float, float]:
    """Return where a place on the surface is seen, and the pixels of a millimetre there."""
    angle = np.arctan2(y_mm - sight.y_mm, x_mm - sight.x_mm)
    angle += 2.0 * np.pi * np.round((sight.angles_rad[WIDTH_PX // 2] - angle) / (2.0 * np.pi))
    column = float(np.interp(angle, sight.angles_rad, np.arange(WIDTH_PX + 1)))
    away = float(np.hypot(x_mm - sight.x_mm, y_mm - sight.y_mm))
    per_mm = 1.0 / (abs(np.diff(sight.angles_rad)[int(column)]) * away)
    row = HORIZON_PX + CAMERA_MM * sight.rows_per_slope_px[int(column)] / away
    return column, float(row), float(per_mm)


def waist(sight: CornerSight, disc: tuple[float, float, float], gap_px: float) -> Outlines:
    """Return the light beside a finger, with a lit gap of so many rows at its waist."""
    light = np.ones((ROWS, WIDTH_PX), np.float32)
    column, row, per_mm = column_and_row(sight, *disc[:2])
    half = disc[2] * per_mm
    inside = slice(int(column - half), int(column + half) + 1)
    hidden = np.abs(np.arange(ROWS) + 0.5 - row) >= gap_px / 2.0
    light[hidden, inside] = SKIN
    first = int(column - half) - 3
    last = int(column + half) + 4
    light_at = np.full(WIDTH_PX, -1, np.int32)
    light_at[first:last] = np.arange(last - first)
    kept = np.ascontiguousarray(light[10:, first:last])
    nothing = np.empty((0, 2, 0))
    return Outlines(nothing, nothing, kept, light_at, np.full(WIDTH_PX, 10, np.int32))


def gap(
    seen: list[Outlines | None],
    disc: tuple[float, float, float] = AMID,
    sights: list[CornerSight] = SIGHTS,
) -> TouchPoints:
    finder = TouchPointFinder(sights)
    return finder.find(np.array([disc]), np.array([0.2]), own((), len(sights)), seen)


def test_a_finger_that_touches_is_dark_at_the_waist() -> None:
    points = gap([waist(sight, AMID, 0.0) for sight in SIGHTS])
    assert points.gap_cameras[0] == 4
    assert 0.0 < points.gaps[0] < 1.0


@given(st.floats(120.0, 230.0), st.floats(140.0, 260.0), st.floats(3.5, 9.0))
def test_a_finger_that_hovers_is_bright_there(x_mm: float, y_mm: float, radius_mm: float) -> None:
    disc = (x_mm, y_mm, radius_mm)
    wide = gap([waist(sight, disc, 4.0) for sight in SIGHTS], disc)
    assert wide.gap_cameras[0] >= 3
    assert wide.gaps[0] > 4.0
    none = gap([waist(sight, disc, 0.0) for sight in SIGHTS], disc)
    assert none.gaps[0] < 1.0


def test_the_wider_the_gap_the_surer() -> None:
    gaps = [gap([waist(s, AMID, px) for s in SIGHTS]).gaps[0] for px in (0.0, 1.0, 2.0)]
    assert gaps[0] < gaps[1] < gaps[2]


def test_light_is_looked_for_where_the_finger_is() -> None:
    seen: list[Outlines | None] = [waist(sight, AMID, 0.0) for sight in SIGHTS]
    assert gap(seen, (195.0, 200.0, 6.0)).gap_cameras[0] == 0  # nothing was kept there


@pytest.mark.parametrize("blind", ["missing", "dark", "not a number", "too high", "notch"])
def test_cameras_that_cannot_tell_abstain(blind: str) -> None:
    seen: list[Outlines | None] = [waist(sight, AMID, 0.0) for sight in SIGHTS]
    sights = list(SIGHTS)
    bright = waist(SIGHTS[2], AMID, 9.0)
    column, row, _ = column_and_row(SIGHTS[2], *AMID[:2])
    if blind == "missing":
        seen[2] = None
    elif blind == "dark":
        seen[2] = replace(bright, light_at=np.full(WIDTH_PX, -1, np.int32))
    elif blind == "not a number":
        seen[2] = replace(bright, light=np.full_like(bright.light, np.nan))
    elif blind == "too high":
        seen[2] = bright
        sights[2] = replace(SIGHTS[2], bottom_px=np.full(WIDTH_PX, row + 1.0))
    else:
        seen[2] = bright
        visible = np.ones(WIDTH_PX, np.bool_)
        visible[int(column) - 1 : int(column) + 2] = False
        sights[2] = replace(SIGHTS[2], visible=visible)
    points = gap(seen, AMID, sights)
    assert points.gap_cameras[0] == 3
    assert points.gaps[0] < 1.0


def test_who_asks_nobody_learns_nothing() -> None:
    points = gap([None] * 4)
    assert points.gap_cameras[0] == 0
    assert np.isnan(points.gaps[0])


def test_a_place_beside_the_pictures_is_seen_by_no_camera() -> None:
    seen = [waist(sight, AMID, 0.0) for sight in SIGHTS]
    assert gap(list(seen), (-100.0, 100.0, 6.0)).gap_cameras[0] == 0


def test_pens_may_let_light_pass() -> None:
    disc = (175.0, 200.0, 2.0)
    halves = []
    for sight in SIGHTS:
        seen = waist(sight, disc, 0.0)
        halves.append(replace(seen, light=np.full_like(seen.light, 0.5)))
    assert gap(list(halves), disc).gaps[0] < GAP_AT_THE_SURFACE
    bright = [replace(one, light=np.ones_like(one.light)) for one in halves]
    assert gap(bright, disc).gaps[0] > LIFTED_GAP * GAP_AT_THE_SURFACE
