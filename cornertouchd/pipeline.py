"""From pictures to touches: the stages in order.  Read this first.

CameraPipeline, one per capture thread:   Frame -> shadows -> Observation
SurfacePipeline, in the fusion thread:    FrameSet -> directing lines -> contacts -> touches
"""

from cornertouchd.calibration.calibration import Calibration, CalibrationError, CameraCalibration
from cornertouchd.calibration.drift import Drift, DriftWatch
from cornertouchd.config import Settings
from cornertouchd.fusion.crossing import make_crossing
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.locating.line_table import tabulate
from cornertouchd.model import (
    Contact,
    DirectingLines,
    FloatArray,
    Frame,
    FrameSet,
    Observation,
    Touch,
)
from cornertouchd.vision.finder import make_finder
from cornertouchd.vision.profile import shows_strip
from cornertouchd.vision.strip import StripNotFoundError, find_strip

MOST_SHADOWS = 64
"""A picture with more shadows is garbage: twenty fingers throw at most twenty."""


class PictureError(Exception):
    """A picture has another size than the calibration expects, or does not show the strip."""


class CameraPipeline:
    """One camera: pictures in, shadows out.  Owned by its capture thread."""

    def __init__(self, calibration: CameraCalibration, settings: Settings) -> None:
        self._camera = calibration.id
        self._shape = (calibration.format.rows_px, calibration.format.width_px)
        try:
            self._strip = find_strip(calibration.empty)
        except StripNotFoundError as error:
            raise CalibrationError(f"camera {calibration.id}: no strip found: {error}") from None
        self._settings = settings.vision
        self.learn_background(calibration.empty)

    def learn_background(self, empty: FloatArray) -> None:
        """Measure from now on against `empty`, the mean of empty pictures (rows_px, width_px).

        Raises `CalibrationError` if they have another size or do not show the strip.
        """
        if empty.shape != self._shape:
            raise CalibrationError(
                f"camera {self._camera}: empty pictures of {empty.shape[1]}x{empty.shape[0]} "
                f"pixels, calibrated with {self._shape[1]}x{self._shape[0]}"
            )
        if not shows_strip(self._strip, empty, self._settings):
            raise CalibrationError(
                f"camera {self._camera}: the strip is dark in the empty pictures: was the LED "
                "frame off, or the lens covered? Record them anew"
            )
        self._finder = make_finder(self._strip, empty, self._settings)

    def observe(self, frame: Frame) -> Observation:
        """Return the shadows in a picture.  Raises `PictureError`."""
        if frame.pixels.shape != self._shape:
            rows, width = frame.pixels.shape[:2]
            raise PictureError(
                f"picture of {width}x{rows} pixels, calibrated with "
                f"{self._shape[1]}x{self._shape[0]}"
            )
        shadows = self._finder.find(frame.pixels)
        if len(shadows) > MOST_SHADOWS:
            raise PictureError(
                f"{len(shadows)} shadows in one picture, {MOST_SHADOWS} are believed: "
                "noise, or the LED frame flickers"
            )
        return Observation(frame.camera, frame.sequence, frame.captured_at_s, shadows)


class SurfacePipeline:
    """All cameras: frame sets in, contacts and touches out.  Owned by the fusion thread."""

    def __init__(self, calibration: Calibration, settings: Settings) -> None:
        self._lines = {
            camera.id: tabulate(camera.id, camera.model, camera.format.width_px)
            for camera in calibration.cameras
        }
        self._edge_sigma_px = settings.crossing.edge_sigma_px
        self._crossing = make_crossing(
            settings.crossing,
            calibration.surface_mm,
            reconstructed=calibration.method == "reconstruction",
        )
        self._tracker = Tracker(settings.tracking)
        self._drift = DriftWatch(calibration)

    def cross(self, frame_set: FrameSet) -> tuple[Contact, ...]:
        """Return what touches the surface in one frame set, whatever was before."""
        return self._crossing.cross(self._directing_lines(frame_set)).contacts

    def follow(self, frame_set: FrameSet) -> tuple[tuple[Contact, ...], tuple[Touch, ...]]:
        """Return what touches the surface now, and the touches that it continues or begins."""
        predictions = self._tracker.predict(frame_set.captured_at_s)
        crossed = self._crossing.cross(self._directing_lines(frame_set), predictions)
        return crossed.contacts, self._tracker.update(frame_set.captured_at_s, crossed)

    def _directing_lines(self, frame_set: FrameSet) -> list[DirectingLines]:
        return [
            self._lines[seen.camera].lay(seen.shadows, self._edge_sigma_px)
            for seen in frame_set.observations
            if len(seen.shadows)
        ]

    def find_drift(
        self, frame_set: FrameSet, contacts: tuple[Contact, ...], touches: tuple[Touch, ...]
    ) -> Drift | None:
        """Return what has moved since it was calibrated, as far as touches up to these tell.

        The same object until something changes.  Every tenth new place of a touch costs half a
        millisecond (median; some milliseconds at worst), so it is for after they have been told.
        """
        self._drift.follow(frame_set, contacts, touches)
        return self._drift.drift

    def reset(self) -> None:
        """Forget all touches; the next ones get new ids."""
        self._tracker.reset()
