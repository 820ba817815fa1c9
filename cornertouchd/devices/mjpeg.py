"""Grey rows out of MJPG pictures.

Where the machine has TurboJPEG 3 only the rows of the strip are decoded, in a third of the time;
otherwise simplejpeg decodes the brightness of the whole picture.  What lost bytes in between still
decodes, its rows shifted: only at the last row is it too short.  That shows touches where none are,
so such pictures are left out.
"""

import ctypes

import numpy as np
import simplejpeg  # type: ignore[import-untyped]  # it has no marker for its types

from cornertouchd.devices.turbojpeg import BandDecoder, TurboJpegError, load_turbojpeg
from cornertouchd.devices.v4l2_device import Layout
from cornertouchd.model import Picture

JPEG_FORMATS = ("MJPG", "JPEG")

_END = b"\xff\xd9"
_LONGEST_PADDING = 4096
"""Cameras round their pictures up to whole USB packets, with whatever bytes."""

_HARMLESS = "extraneous bytes before marker 0xd9"
"""What libjpeg-turbo says when a camera puts bytes between its last row and the end marker."""

_SAME_BYTES = 256
"""Pictures of one scene differ less in length (640x480, noise and moving fingers: 52 in the median,
236 at most with 25 kB; 99 and 486 with 55 kB), and a lost USB packet is 512 and more."""


class MjpegReader:
    """Reads rows `first_row` to `first_row + rows` of JPEG pictures.

    `turbojpeg` is the library that can skip rows, None without it.
    """

    def __init__(
        self, layout: Layout, first_row: int, rows: int, turbojpeg: ctypes.CDLL | None
    ) -> None:
        self._size = (layout.height_px, layout.width_px)
        self._rows = slice(first_row, first_row + rows)
        self._bands = (
            None if turbojpeg is None else _BandReader(turbojpeg, self._size, first_row, rows)
        )
        self._picture = np.empty((*self._size, 1), np.uint8)

    def read(self, buffer: Picture, used_bytes: int) -> Picture | None:
        """Return the rows, None if the picture is damaged or has another size."""
        tail_at = max(0, used_bytes - _LONGEST_PADDING)
        end = buffer[tail_at:used_bytes].tobytes().rfind(_END)
        if end < 0:
            return None
        jpeg = buffer[: tail_at + end + len(_END)]
        return self._read_whole(jpeg) if self._bands is None else self._bands.read(jpeg)

    def _read_whole(self, jpeg: Picture) -> Picture | None:
        try:
            if simplejpeg.decode_jpeg_header(jpeg)[:2] != self._size:
                return None
            simplejpeg.decode_jpeg(jpeg, "GRAY", buffer=self._picture)
        except ValueError as error:
            if _HARMLESS not in str(error):
                return None
        return self._picture[self._rows, :, 0]


class _BandReader:
    """Decodes the rows of the strip, and looks through a whole picture if its length is unusual.

    To look through one, without making pixels of it, takes half as long again as the rows.
    """

    def __init__(
        self, turbojpeg: ctypes.CDLL, size: tuple[int, int], first_row: int, rows: int
    ) -> None:
        self._strip = BandDecoder(turbojpeg, size, first_row, rows)
        self._last_row = BandDecoder(turbojpeg, size, size[0] - 1, 1)
        self._rows = np.empty((rows, size[1]), np.uint8)
        self._row = np.empty((1, size[1]), np.uint8)
        self._whole_bytes = -_SAME_BYTES

    def read(self, jpeg: Picture) -> Picture | None:
        """Return the rows, None if the picture is damaged."""
        unusual = abs(jpeg.size - self._whole_bytes) > _SAME_BYTES
        if unusual and not _decodes(self._last_row, jpeg, self._row):
            return None
        if not _decodes(self._strip, jpeg, self._rows):
            return None
        if unusual:
            self._whole_bytes = jpeg.size
        return self._rows


def _decodes(decoder: BandDecoder, jpeg: Picture, rows: Picture) -> bool:
    try:
        decoder.decode(jpeg, rows)
    except TurboJpegError as error:
        return _HARMLESS in str(error)
    return True


def mjpeg_reader(layout: Layout, first_row: int, rows: int) -> MjpegReader:
    """Return the fastest reader that this machine has."""
    return MjpegReader(layout, first_row, rows, load_turbojpeg())
