"""A calibration: what is known about an installed rig, camera by camera."""

from dataclasses import dataclass
from typing import Literal

from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.vanishing_point import Projection
from cornertouchd.model import FloatArray, PictureFormat

Method = Literal["auto", "vanishing-point"]


class CalibrationError(Exception):
    """A calibration cannot be made, read or used; the message says what to do."""


@dataclass(frozen=True)
class CameraCalibration:
    """One camera in its place.

    `empty` is the mean of its pictures of the empty surface, (rows_px, width_px); the strip and its
    reference brightness are read from it.  `residual_mm` is the RMS distance of the reference
    points from their directing lines.
    """

    id: str
    format: PictureFormat
    empty: FloatArray
    model: AnglePolynomial | Projection
    residual_mm: float

    def require_format(self, given: PictureFormat) -> None:
        """Raise `CalibrationError` unless pictures of this format fit the calibration."""
        if given != self.format:
            raise CalibrationError(
                f"camera {self.id}: gives pictures of {given}, calibrated at {self.format}; "
                f"set the camera back or run `cornertouchd calibrate` again"
            )


@dataclass(frozen=True)
class Calibration:
    """All cameras of a rig, and how they were calibrated.

    `created_at` is UTC in ISO 8601; `residual_mm` the RMS over all cameras and reference points.
    """

    method: Method
    created_at: str
    software: str
    surface_mm: tuple[float, float]
    reference_points: int
    residual_mm: float
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
