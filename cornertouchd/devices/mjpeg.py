"""Grey rows out of MJPG pictures.

Where the machine has TurboJPEG 3 only the rows of the strip are decoded, in a third of the time.
It stops there, so that bytes lost in between go unnoticed; a cut-off picture does not.  Otherwise
simplejpeg decodes the brightness of the whole picture and notices lost packets; where there is no
wheel of it OpenCV does, which notices little.
"""

import ctypes

import cv2
import numpy as np

from cornertouchd.devices.turbojpeg import BandDecoder, TurboJpegError, load_turbojpeg
from cornertouchd.devices.v4l2_device import Layout
from cornertouchd.model import Picture

try:
    import simplejpeg  # type: ignore[import-untyped]  # it has no marker for its types
except ImportError:  # no wheel for this processor
    simplejpeg = None

JPEG_FORMATS = ("MJPG", "JPEG")

_END = b"\xff\xd9"
_LONGEST_PADDING = 4096
"""Cameras round their pictures up to whole USB packets, with whatever bytes."""

_HARMLESS = "extraneous bytes before marker 0xd9"
"""What libjpeg-turbo says when a camera puts bytes between its last row and the end marker."""


class MjpegReader:
    """Reads rows `first_row` to `first_row + rows` of JPEG pictures.

    `turbojpeg` is the library that can skip rows, None without it.
    """

    def __init__(
        self, layout: Layout, first_row: int, rows: int, turbojpeg: ctypes.CDLL | None
    ) -> None:
        self._size = (layout.height_px, layout.width_px)
        self._rows = slice(first_row, first_row + rows)
        self._decoder = (
            None if turbojpeg is None else BandDecoder(turbojpeg, self._size, first_row, rows)
        )
        self._band = np.empty((rows, layout.width_px), np.uint8)
        self._picture = np.empty((*self._size, 1), np.uint8)

    def read(self, buffer: Picture, used_bytes: int) -> Picture | None:
        """Return the rows, None if the picture is damaged or has another size."""
        jpeg = buffer[:used_bytes]
        if _END not in jpeg[-_LONGEST_PADDING:].tobytes():
            return None
        if self._decoder is not None:
            return self._read_band(self._decoder, jpeg)
        return self._read_whole(jpeg)

    def _read_band(self, decoder: BandDecoder, jpeg: Picture) -> Picture | None:
        try:
            decoder.decode(jpeg, self._band)
        except TurboJpegError:
            return None
        return self._band

    def _read_whole(self, jpeg: Picture) -> Picture | None:
        if simplejpeg is None:
            picture = cv2.imdecode(jpeg, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
            if picture is None or picture.shape != self._size:
                return None
            return np.asarray(picture, np.uint8)[self._rows]
        try:
            if simplejpeg.decode_jpeg_header(jpeg)[:2] != self._size:
                return None
            simplejpeg.decode_jpeg(jpeg, "GRAY", buffer=self._picture)
        except ValueError as error:
            if _HARMLESS not in str(error):
                return None
        return self._picture[self._rows, :, 0]


def mjpeg_reader(layout: Layout, first_row: int, rows: int) -> MjpegReader:
    """Return the fastest reader that this machine has."""
    return MjpegReader(layout, first_row, rows, load_turbojpeg())
