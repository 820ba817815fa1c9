"""The heights of a rig's cameras: measured at the end of a calibration, compared with new ones."""

import logging
from collections.abc import Sequence
from math import atan, degrees

import numpy as np

from cornertouchd.calibration.calibration import Model
from cornertouchd.locating.height_table import (
    Heights,
    HeightsError,
    HeightTable,
    StripRows,
    fit_shear,
    horizon_rows,
    measure_heights,
    tabulate_heights,
)
from cornertouchd.locating.line_table import tabulate
from cornertouchd.model import FloatArray, Outlines
from cornertouchd.vision.outlines import LEVELS
from cornertouchd.vision.strip import Strip, StripNotFoundError, find_strip

MOVED_PX = 0.5
"""Horizons of one camera, measured from other empty pictures, differ by .02 px (path-traced)."""

CHANGED_MM = 1.0
CHANGED_SIGMAS = 4.0
"""A height has changed if it did by more than this, and by more than measuring leaves open."""

_log = logging.getLogger("cornertouchd")


def strip_rows(strip: Strip) -> StripRows:
    """Return the rows of a strip."""
    bottom_px = strip.bottom_px if strip.mirrored else None
    return StripRows(strip.top_px, strip.surface_px, bottom_px, strip.visible)


def heights_of_camera(
    camera: str,
    strip: Strip,
    model: Model,
    surface_mm: tuple[float, float],
    uprights: Sequence[Outlines] = (),
) -> Heights | None:
    """Return the heights that a strip tells; None, and a warning, if it does not tell them.

    `uprights` are the outlines of single upright fingers: they show how the picture is sheared,
    which otherwise is taken from how the camera is rolled.
    """
    width_px = len(strip.visible)
    angles_rad = tabulate(camera, model, width_px).angles_rad
    try:
        heights = measure_heights(strip_rows(strip), angles_rad, model.position_mm, surface_mm)
    except HeightsError as error:
        _log.warning("camera %s: touches are located without its heights: %s", camera, error)
        return None
    columns_px, rows_px = middle_lines(uprights)
    return fit_shear(heights, width_px, columns_px, rows_px)


def heights_of_empty(
    camera: str, empty: FloatArray, model: Model, surface_mm: tuple[float, float]
) -> Heights | None:
    """Return the heights that an empty picture tells, None if it does not."""
    try:
        strip = find_strip(empty)
    except StripNotFoundError:
        return None  # whoever works with the picture will say so
    return heights_of_camera(camera, strip, model, surface_mm)


def height_table(
    camera: str, strip: Strip, model: Model, surface_mm: tuple[float, float], heights: Heights
) -> HeightTable:
    """Return which way the rows of a calibrated camera look."""
    angles_rad = tabulate(camera, model, len(strip.visible)).angles_rad
    return tabulate_heights(
        camera, heights, strip_rows(strip), angles_rad, model.position_mm, surface_mm
    )


def middle_lines(uprights: Sequence[Outlines]) -> tuple[FloatArray, FloatArray]:
    """Return columns and rows (lines, L) of the middles between left and right edges.

    The middle of a finger that stands upright does so too, though it is tapered.  Of the levels
    only the upper half is taken, where finger and mirror image are apart.
    """
    columns, rows = [], []
    for outlines in uprights:
        for edges_px, levels_px in zip(outlines.columns_px, outlines.rows_px, strict=True):
            columns.append(edges_px.mean(axis=0)[: len(LEVELS)])
            rows.append(levels_px.mean(axis=0)[: len(LEVELS)])
    if not columns:
        return np.empty((0, len(LEVELS))), np.empty((0, len(LEVELS)))
    return np.array(columns), np.array(rows)


def what_moved(kept: Heights, found: Heights, width_px: int) -> str | None:
    """Return what has moved since `kept` was measured, None if all is where it was."""
    off_px = horizon_rows(found, width_px) - horizon_rows(kept, width_px)
    middle_px = float(np.median(off_px))
    tilt_rad = atan((found.horizon_px[1] - kept.horizon_px[1]) / (width_px / 2))
    if abs(middle_px) > MOVED_PX:
        where = "lower" if middle_px > 0 else "higher"
        return (
            f"the horizon is {abs(middle_px):.1f} px {where} than calibrated: the camera was tilted"
        )
    if abs(tilt_rad) * width_px / 2 > MOVED_PX:
        return (
            f"the horizon is turned by {abs(degrees(tilt_rad)):.2f} degrees: the camera was rolled"
        )
    sigma_mm = float(np.hypot(found.camera_sigma_mm, kept.camera_sigma_mm))
    raised_mm = found.camera_mm - kept.camera_mm
    if abs(raised_mm) > max(CHANGED_MM, CHANGED_SIGMAS * sigma_mm):
        return (
            f"the camera stands {abs(raised_mm):.1f} mm "
            f"{'higher' if raised_mm > 0 else 'lower'} than calibrated"
        )
    return None
