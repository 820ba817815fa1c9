"""From observed reference points to a calibration, by one of the methods."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    CameraCalibration,
    Method,
)
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.joint_fit import (
    DEGREE,
    JointFit,
    StartingPoint,
    TouchColumns,
    fit_jointly,
)
from cornertouchd.geometry import distances_to_lines
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.vanishing_point import (
    DegeneratePointsError,
    Projection,
    solve_projection,
)
from cornertouchd.model import BoolArray, FloatArray
from cornertouchd.vision.strip import Strip

_Fitted = tuple[Sequence[AnglePolynomial | Projection], FloatArray]

SMALLEST_SHARE_KEPT = 0.8
"""A person misses one tap in ten at worst; wrong reference points lose more than half."""

SMALLEST_TAPS = 4
"""Four taps fix the gauge: scribbles alone leave a homography free."""


@dataclass(frozen=True)
class Stamp:
    """When and by what software a calibration was made."""

    created_at: str
    software: str


def calibrate(
    method: Method, given: ReferenceTouches, tap_sigma_mm: float, stamp: Stamp
) -> Calibration:
    """Return the calibration.  Raises `CalibrationError` naming camera, reason and remedy."""
    if len(given.formats) < 2:
        raise CalibrationError(
            f"only camera {', '.join(given.formats)} was recorded; two cameras at least are needed"
        )
    models, residuals = _METHODS[method](given, tap_sigma_mm)
    cameras = tuple(
        CameraCalibration(camera, size, given.empties[camera], model, _rms(residuals[index]))
        for index, ((camera, size), model) in enumerate(
            zip(given.formats.items(), models, strict=True)
        )
    )
    return Calibration(
        method,
        stamp.created_at,
        stamp.software,
        given.surface_mm,
        int(np.count_nonzero(_known(given.touches))),
        _rms(residuals),
        cameras,
    )


def _auto(given: ReferenceTouches, tap_sigma_mm: float) -> _Fitted:
    touches = given.touches
    taps = int(np.count_nonzero(_known(touches)))
    if taps < SMALLEST_TAPS:
        raise CalibrationError(
            f"{taps} reference points, at least {SMALLEST_TAPS} are needed: tap more of them"
        )
    seen = np.isfinite(touches.columns_px).all(axis=2).sum(axis=1)
    for camera, count in zip(given.formats, seen.tolist(), strict=True):
        if count < DEGREE + 3:
            raise CalibrationError(
                f"camera {camera}: sees {count} of {touches.columns_px.shape[1]} touches, "
                f"{DEGREE + 3} are needed: tap more points or add a scribble"
            )
    fit = fit_jointly(touches, _starting_point(given), tap_sigma_mm)
    _refuse_misfits(given, fit)
    models = [
        AnglePolynomial(
            (float(position[0]), float(position[1])),
            tuple(coefficients.tolist()),
            size.width_px,
        )
        for position, coefficients, size in zip(
            fit.positions_mm, fit.coefficients_rad, given.formats.values(), strict=True
        )
    ]
    counted = fit.used | _known(touches)  # a tap that does not fit is part of the truth
    return models, np.where(counted, fit.residuals_mm, np.nan)


def _refuse_misfits(given: ReferenceTouches, fit: JointFit) -> None:
    """Raise `CalibrationError` when too much had to be dropped: the fit is then of the priors."""
    seen = np.isfinite(given.touches.columns_px).all(axis=2)
    taps = seen & _known(given.touches)
    kept = int(np.count_nonzero(fit.used & taps)) / max(int(np.count_nonzero(taps)), 1)
    if kept < SMALLEST_SHARE_KEPT:
        raise CalibrationError(
            f"only {kept:.0%} of the taps fit together, {SMALLEST_SHARE_KEPT:.0%} are needed: "
            "check the reference points (x and y exchanged? millimetres? the right frame sets? "
            "the right diameter?) and which camera is in which corner"
        )
    for camera, count in zip(given.formats, fit.used.sum(axis=1).tolist(), strict=True):
        if count < DEGREE + 3:
            raise CalibrationError(
                f"camera {camera}: only {count} of its touches fit the other cameras', "
                f"{DEGREE + 3} are needed; is it in the corner of its name?"
            )


def _vanishing_point(
    given: ReferenceTouches,
    tap_sigma_mm: float,  # noqa: ARG001  the paper weighs all points alike
) -> _Fitted:
    models = []
    residuals = []
    known = _known(given.touches)
    points = given.touches.points_mm
    for camera, columns in zip(given.formats, given.touches.columns_px, strict=True):
        centres = columns.mean(axis=1)
        seen = known & np.isfinite(centres)
        try:
            model = solve_projection(points[seen], centres[seen])
        except DegeneratePointsError as error:
            raise CalibrationError(f"camera {camera}: {error}") from None
        models.append(model)
        residuals.append(_distances(model, points, centres, seen))
    return models, np.array(residuals)


_METHODS: dict[Method, Callable[[ReferenceTouches, float], _Fitted]] = {
    "auto": _auto,
    "vanishing-point": _vanishing_point,
}


def _known(touches: TouchColumns) -> BoolArray:
    return np.asarray(np.isfinite(touches.points_mm).all(axis=1))


def _distances(
    model: Projection, points_mm: FloatArray, columns_px: FloatArray, seen: BoolArray
) -> FloatArray:
    """Return the distance of every point from its directing line, NaN where unseen."""
    off = np.full(len(points_mm), np.nan)
    origins = np.tile(model.position_mm, (int(seen.sum()), 1))
    angles = model.angles_rad(columns_px[seen])
    off[seen] = np.diagonal(distances_to_lines(points_mm[seen], origins, angles))
    return off


def _rms(residuals_mm: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(residuals_mm**2))) if np.isfinite(residuals_mm).any() else 0.0


def _starting_point(given: ReferenceTouches) -> StartingPoint:
    """Place every camera in its corner, its strip spanning the sides that meet there."""
    width, height = given.surface_mm
    corners = {"C1": (0.0, 0.0), "C2": (width, 0.0), "C3": (width, height), "C4": (0.0, height)}
    positions, angles, widths = [], [], []
    for camera, size in given.formats.items():
        if camera not in corners:
            raise CalibrationError(
                f"camera {camera}: no corner belongs to it; the cameras of a frame are C1 to C4"
            )
        x, y = corners[camera]
        positions.append((x, y))
        widths.append(float(size.width_px))
        bisector = np.arctan2(height / 2 - y, width / 2 - x)
        bisector = np.pi / 4 * (2 * np.floor(bisector / (np.pi / 2)) + 1)
        angles.append(_linear_angles(given.strips[camera], float(bisector), size.width_px))
    return StartingPoint(np.array(positions), np.array(angles), np.array(widths))


def _linear_angles(strip: Strip, bisector_rad: float, width_px: int) -> tuple[float, float]:
    """Return a_0 and a_1 so that the visible strip spans 90 degrees around the bisector."""
    visible = np.flatnonzero(strip.visible)
    first, last = (np.array([visible[0], visible[-1] + 1]) - width_px / 2) / (width_px / 2)
    slope = (np.pi / 2) / (last - first)
    return bisector_rad - slope * (first + last) / 2, slope
