"""Cameras read through OpenCV's VideoCapture.

It gives no sequence numbers and no error flags, and blocks up to ten seconds when a camera stalls;
what it hides is made up for as far as can be: pictures are counted, a wrong size is refused.
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from cornertouchd.devices.camera_identity import camera_identity
from cornertouchd.devices.camera_places import PlaceError, device_path
from cornertouchd.devices.usb_sysfs import SYSFS
from cornertouchd.model import Frame, Picture, PictureFormat
from cornertouchd.ports import CameraError

OLDEST_STAMP_S = 1.0
"""A capture time further than this from now is not on our clock: the time of arrival is taken."""


class OpenCvCameraPort:
    """A video device by its path or place; `now_s` reads CLOCK_MONOTONIC, sysfs is at `sysfs`."""

    def __init__(
        self,
        camera_id: str,
        device: str,
        picture_format: PictureFormat,
        rate_hz: float,
        now_s: Callable[[], float],
        sysfs: Path = SYSFS,
    ) -> None:
        self._id = camera_id
        self._device = device
        self._format = picture_format
        self._rate_hz = rate_hz
        self._now_s = now_s
        self._sysfs = sysfs

    @property
    def id(self) -> str:
        """Name of the camera."""
        return self._id

    @property
    def identity(self) -> str:
        """What tells the camera that is plugged in now from others; empty if none is."""
        return camera_identity(self._device, self._sysfs)

    @property
    def format(self) -> PictureFormat:
        """Size and rows of the pictures."""
        return self._format

    def open(self) -> "OpenCvCamera":
        """Open the device.  Raises `CameraError` if it is not there or has another size."""
        device = self._node()
        backend = cv2.CAP_V4L2 if device.startswith("/dev/") else cv2.CAP_ANY
        capture = cv2.VideoCapture(device, backend)
        if not capture.isOpened():
            raise CameraError(
                self._id,
                f"{device} cannot be opened; is it plugged in, and may "
                "this user read it (group video)?",
            )
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, self._format.width_px)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self._format.height_px)
        capture.set(cv2.CAP_PROP_FPS, self._rate_hz)
        size = (
            int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        )
        if size != (self._format.width_px, self._format.height_px):
            capture.release()
            raise CameraError(
                self._id,
                f"{device} gives {size[0]}x{size[1]}, configured "
                f"{self._format.width_px}x{self._format.height_px}; choose a size that it has",
            )
        return OpenCvCamera(self._id, device, self._format, capture, self._now_s)

    def _node(self) -> str:
        try:
            device = device_path(self._device, self._sysfs)
        except PlaceError as error:
            raise CameraError(self._id, str(error)) from error
        if not Path(device).exists():  # else OpenCV writes warnings of its own
            raise CameraError(self._id, f"{device} is not there; is it plugged in?")
        return device


class OpenCvCamera:
    """An opened device."""

    def __init__(
        self,
        camera_id: str,
        device: str,
        picture_format: PictureFormat,
        capture: cv2.VideoCapture,
        now_s: Callable[[], float],
    ) -> None:
        self._id = camera_id
        self._device = device
        self._format = picture_format
        self._capture = capture
        self._now_s = now_s
        self._sequence = 0

    def read(self, timeout_s: float) -> Frame | None:  # noqa: ARG002  OpenCV has its own timeout
        """Return the next picture, None if there is none: OpenCV does not tell why.

        Raises `CameraError` when it has another size.
        """
        ok, picture = self._capture.read()
        if not ok or picture is None:
            return None
        frame = Frame(
            self._id, self._sequence, self._captured_at_s(), None, self._band(_grey(picture))
        )
        self._sequence += 1
        return frame

    def close(self) -> None:
        """Give the device back."""
        self._capture.release()

    def _captured_at_s(self) -> float:
        now_s = self._now_s()
        stamp_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000.0
        return stamp_s if 0.0 <= now_s - stamp_s < OLDEST_STAMP_S else now_s

    def _band(self, picture: Picture) -> Picture:
        if picture.shape != (self._format.height_px, self._format.width_px):
            raise CameraError(
                self._id,
                f"{self._device} sent a picture of "
                f"{picture.shape[1]}x{picture.shape[0]}, configured "
                f"{self._format.width_px}x{self._format.height_px}",
            )
        first = self._format.row_offset_px
        return picture[first : first + self._format.rows_px]


def _grey(picture: np.ndarray) -> Picture:
    grey = cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY) if picture.ndim == 3 else picture
    return np.asarray(grey, np.uint8)
