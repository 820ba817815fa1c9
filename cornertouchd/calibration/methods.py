"""From observed reference points to a calibration, by one of the methods."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.auto import fit_auto
from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    CameraCalibration,
    Method,
    Model,
)
from cornertouchd.calibration.fitted import Fitted, rms
from cornertouchd.calibration.gathering import ReferenceTouches
from cornertouchd.calibration.heights import heights_of_camera
from cornertouchd.calibration.lookup import fit_lookup_tables
from cornertouchd.calibration.reconstruction import fit_reconstruction
from cornertouchd.calibration.vanishing import fit_vanishing_points
from cornertouchd.locating.height_table import Heights


@dataclass(frozen=True)
class Stamp:
    """When and by what software a calibration was made."""

    created_at: str
    software: str


def calibrate(
    method: Method, given: ReferenceTouches, tap_sigma_mm: float, stamp: Stamp
) -> Calibration:
    """Return the calibration.  Raises `CalibrationError` naming camera, reason and remedy."""
    return make_calibration(method, given, fit(method, given, tap_sigma_mm), stamp)


def fit(method: Method, given: ReferenceTouches, tap_sigma_mm: float) -> Fitted:
    """Return what the method makes of the reference touches.  Raises `CalibrationError`."""
    if len(given.formats) < 2:
        raise CalibrationError(
            f"only camera {', '.join(given.formats)} was recorded; two cameras at least are needed"
        )
    match method:
        case "auto":
            return fit_auto(given, tap_sigma_mm)
        case "lookup-table":
            return fit_lookup_tables(given)
        case "vanishing-point":
            return fit_vanishing_points(given)
        case "reconstruction":
            return fit_reconstruction(given)


def make_calibration(
    method: Method, given: ReferenceTouches, fitted: Fitted, stamp: Stamp
) -> Calibration:
    """Put together what was given and what was fitted.

    Touches at known places tell how good it is; those at unknown ones only if there are no others.
    """
    known = given.touches.known
    telling_mm = fitted.residuals_mm[:, known] if known.any() else fitted.residuals_mm
    cameras = tuple(
        CameraCalibration(
            camera,
            given.identities.get(camera, ""),
            given.formats[camera],
            given.empties[camera],
            model,
            rms(telling),
            _heights(given, camera, model),
        )
        for camera, model, telling in zip(given.formats, fitted.models, telling_mm, strict=True)
    )
    return Calibration(
        method,
        stamp.created_at,
        stamp.software,
        given.surface_mm,
        int(np.count_nonzero(known)),
        int(np.count_nonzero(~known)),
        int(np.count_nonzero(fitted.dropped)),
        rms(telling_mm),
        fitted.expected,
        cameras,
    )


def _heights(given: ReferenceTouches, camera: str, model: Model) -> Heights | None:
    """Return the heights that the strip of a camera tells, None if it was not seen."""
    if camera not in given.strips:
        return None
    uprights = given.uprights.get(camera, ())
    return heights_of_camera(camera, given.strips[camera], model, given.surface_mm, uprights)
