"""The default method: all cameras fitted together, from a few taps and a scribble."""

import numpy as np

from cornertouchd.calibration.calibration import CalibrationError, TapsDoNotFitError
from cornertouchd.calibration.error_map import map_from_covariance
from cornertouchd.calibration.fitted import SMALLEST_SHARE_KEPT, Fitted
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.joint_fit import DEGREE, JointFit, StartingPoint, fit_jointly
from cornertouchd.calibration.rig_corners import corner_mm
from cornertouchd.calibration.touch_columns import EDGE_SIGMA_PX, SHAPE_SIGMA_MM
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.vision.strip import Strip

FEWEST_TAPS = 4
"""Four taps fix the gauge: scribbles alone leave a homography free, and then the nominal places of
the cameras are all there is to go by."""

LOOSE_POSITION_MM = 15.0
"""Cameras sit this near to the corner of the surface."""

NOMINAL_POSITION_MM = 4.0
"""How exactly a frame is built, where it has to be relied on (standard deviation per axis)."""

FEWEST_TOUCHES = DEGREE + 3
"""A camera has two parameters for its place and eight for its angles."""


def fit_auto(given: ReferenceTouches, tap_sigma_mm: float) -> Fitted:
    """Fit all cameras together.  Raises `CalibrationError` naming camera, reason and remedy."""
    touches = given.touches
    _require_enough(given)
    fit = fit_jointly(touches, starting_point(given), tap_sigma_mm)
    _refuse_misfits(given, fit)
    models = tuple(
        AnglePolynomial(
            (float(position[0]), float(position[1])),
            tuple(coefficients.tolist()),
            size.width_px,
        )
        for position, coefficients, size in zip(
            fit.positions_mm, fit.coefficients_rad, given.formats.values(), strict=True
        )
    )
    counted = fit.used | touches.known  # a tap that does not fit is part of the truth
    return Fitted(
        models,
        np.where(counted, fit.residuals_mm, np.nan),
        touches.seen & ~fit.used,
        map_from_covariance(
            given.surface_mm, models, fit.covariance, (SHAPE_SIGMA_MM, EDGE_SIGMA_PX)
        ),
    )


def _require_enough(given: ReferenceTouches) -> None:
    touches = given.touches
    taps = int(np.count_nonzero(touches.known))
    if 0 < taps < FEWEST_TAPS:
        raise CalibrationError(
            f"{taps} reference points, at least {FEWEST_TAPS} are needed: tap more of them, or "
            "none and go by where the cameras are"
        )
    for camera, count in zip(given.formats, touches.seen.sum(axis=1).tolist(), strict=True):
        if count < FEWEST_TOUCHES:
            raise CalibrationError(
                f"camera {camera}: sees {count} of {len(touches.known)} touches, "
                f"{FEWEST_TOUCHES} are needed: tap more points or add a scribble"
            )


def _refuse_misfits(given: ReferenceTouches, fit: JointFit) -> None:
    """Raise `TapsDoNotFitError` when too much had to be dropped: the fit is then of the priors."""
    taps = given.touches.seen & given.touches.known
    kept = int(np.count_nonzero(fit.used & taps)) / max(int(np.count_nonzero(taps)), 1)
    if taps.any() and kept < SMALLEST_SHARE_KEPT:
        raise TapsDoNotFitError(
            f"only {kept:.0%} of the taps fit together, {SMALLEST_SHARE_KEPT:.0%} are needed: "
            "check the reference points (x and y exchanged? millimetres? the right frame sets? "
            "the right diameter?), which camera is in which corner, and that the scribble is of "
            "one finger"
        )
    for camera, count in zip(given.formats, fit.used.sum(axis=1).tolist(), strict=True):
        if count < FEWEST_TOUCHES:
            raise TapsDoNotFitError(
                f"camera {camera}: only {count} of its touches fit the other cameras', "
                f"{FEWEST_TOUCHES} are needed; is it in the corner of its name?"
            )


def starting_point(given: ReferenceTouches) -> StartingPoint:
    """Place every camera in its corner, its strip spanning the sides that meet there.

    Taps tell where the cameras are, so that their nominal places hardly count; without taps these
    are all that fixes where the scribble was.
    """
    width, height = given.surface_mm
    sigma_mm = LOOSE_POSITION_MM if given.touches.known.any() else NOMINAL_POSITION_MM
    positions, angles, widths = [], [], []
    for camera, size in given.formats.items():
        x, y = corner_mm(camera, given.surface_mm)
        positions.append((x, y))
        widths.append(float(size.width_px))
        bisector = np.arctan2(height / 2 - y, width / 2 - x)
        bisector = np.pi / 4 * (2 * np.floor(bisector / (np.pi / 2)) + 1)
        angles.append(_linear_angles(given.strips[camera], float(bisector), size.width_px))
    return StartingPoint(np.array(positions), sigma_mm, np.array(angles), np.array(widths))


def _linear_angles(strip: Strip, bisector_rad: float, width_px: int) -> tuple[float, float]:
    """Return a_0 and a_1 so that the visible strip spans 90 degrees around the bisector."""
    visible = np.flatnonzero(strip.visible)
    first, last = (np.array([visible[0], visible[-1] + 1]) - width_px / 2) / (width_px / 2)
    slope = (np.pi / 2) / (last - first)
    return bisector_rad - slope * (first + last) / 2, slope
