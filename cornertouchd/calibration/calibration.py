"""A calibration: what is known about an installed rig, camera by camera."""

from dataclasses import dataclass
from typing import Literal

from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.calibration.same_camera import same_camera
from cornertouchd.errors import ReportedError
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.height_table import Heights
from cornertouchd.locating.lookup_table import LookupTable
from cornertouchd.locating.reconstruction import Reconstruction
from cornertouchd.locating.vanishing_point import Projection
from cornertouchd.model import FloatArray, PictureFormat

Method = Literal["auto", "lookup-table", "vanishing-point", "reconstruction"]
METHODS: tuple[Method, ...] = ("auto", "lookup-table", "vanishing-point", "reconstruction")

Model = AnglePolynomial | LookupTable | Projection | Reconstruction
"""The camera models, one for each method; all fill `locating.camera_model.CameraModel`."""

LONGEST_IDENTITY = 200
"""Characters of a camera's identity that recordings and calibrations keep."""


class CalibrationError(ReportedError):
    """A calibration cannot be made, read or used; the message says what to do."""


class TapsDoNotFitError(CalibrationError):
    """Reference points contradict each other: tapping them again may help, nothing else will."""


@dataclass(frozen=True)
class CameraCalibration:
    """One camera in its place.

    `empty` is the mean of its pictures of the empty surface, (rows_px, width_px); the strip and its
    reference brightness are read from it.  `residual_mm` is the RMS distance of its
    directing lines from the touches at known places, of all touches if none was; NaN where it has
    no line for any of them.  `identity` tells this very camera from others of its kind,
    empty where that is not known.  `heights` are those of the camera and its strip, None where the
    strip does not tell them.
    """

    id: str
    identity: str
    format: PictureFormat
    empty: FloatArray
    model: Model
    residual_mm: float
    heights: Heights | None = None

    def require_camera(self, given: PictureFormat, identity: str) -> None:
        """Raise `CalibrationError` unless this is the camera and its pictures fit.

        An empty identity is not known, and fits.
        """
        if not same_camera(identity, self.identity):
            raise CalibrationError(
                f"camera {self.id}: is another camera ({identity}) than was calibrated "
                f"({self.identity}): cables exchanged? Plug it in where it was, or run "
                "`cornertouchd calibrate` again"
            )
        if given != self.format:
            raise CalibrationError(
                f"camera {self.id}: gives pictures of {given}, calibrated at {self.format}; "
                f"set the camera back or run `cornertouchd calibrate` again"
            )


@dataclass(frozen=True)
class Calibration:
    """All cameras of a rig, and how they were calibrated.

    `created_at` is UTC in ISO 8601.  `reference_points` are touches at known places,
    `scribble_points` those at unknown ones; `dropped` is how many times a camera's view of one of
    them did not fit and was left out.  `residual_mm` is the RMS of all cameras' residuals,
    `expected` the error to expect of a touch, place by place.
    """

    method: Method
    created_at: str
    software: str
    surface_mm: tuple[float, float]
    reference_points: int
    scribble_points: int
    dropped: int
    residual_mm: float
    expected: ErrorMap
    cameras: tuple[CameraCalibration, ...]

    def camera(self, camera_id: str) -> CameraCalibration:
        """Return the calibration of one camera.  Raises `CalibrationError` if it has none."""
        for camera in self.cameras:
            if camera.id == camera_id:
                return camera
        known = ", ".join(camera.id for camera in self.cameras)
        raise CalibrationError(
            f"camera {camera_id}: not in the calibration (it has {known}); calibrate with it"
        )
