"""libjpeg-turbo's TurboJPEG interface, as far as it decodes a band of rows in grey.

Version 3 is needed, of the distribution: the Python packages hide or lack the one call that
matters.  <turbojpeg.h>, tj3SetCroppingRegion.
"""

import ctypes
from ctypes import c_char_p, c_int, c_size_t, c_void_p
from functools import cache

from cornertouchd.model import Picture

LIBRARY = "libturbojpeg.so.0"
"""Its name to the dynamic loader; versions 1 to 3 share it."""

_DECOMPRESS = 1
_WIDTH, _HEIGHT = 5, 6
_GREY = 6


class _Region(ctypes.Structure):
    _fields_ = (("x", c_int), ("y", c_int), ("w", c_int), ("h", c_int))


class TurboJpegError(Exception):
    """A picture is damaged, or none that the library decodes."""


class BandDecoder:
    """Decodes rows `first_row` to `first_row + rows` of pictures of one size.

    The rows above are skipped and those below not looked at.  For one thread.
    """

    def __init__(
        self, library: ctypes.CDLL, size: tuple[int, int], first_row: int, rows: int
    ) -> None:
        self._library = library
        self._size = size
        self._region = _Region(0, first_row, size[1], rows)
        self._handle = library.tj3Init(_DECOMPRESS)
        if not self._handle:
            raise MemoryError("libturbojpeg makes no decoder")

    def decode(self, jpeg: Picture, band: Picture) -> None:
        """Decode `jpeg` (bytes,) into `band` (rows, width_px).  Raises `TurboJpegError`."""
        library, handle = self._library, self._handle
        self._require(library.tj3DecompressHeader(handle, jpeg.ctypes.data, jpeg.size))
        size = library.tj3Get(handle, _HEIGHT), library.tj3Get(handle, _WIDTH)
        if size != self._size:
            raise TurboJpegError(f"{size[1]}x{size[0]} instead of {self._size[1]}x{self._size[0]}")
        self._require(library.tj3SetCroppingRegion(handle, self._region))
        self._require(
            library.tj3Decompress8(
                handle, jpeg.ctypes.data, jpeg.size, band.ctypes.data, band.strides[0], _GREY
            )
        )

    def _require(self, result: int) -> None:
        if result:
            told: bytes = self._library.tj3GetErrorStr(self._handle)
            raise TurboJpegError(told.decode("utf-8", errors="replace"))

    def __del__(self) -> None:
        if getattr(self, "_handle", None):
            self._library.tj3Destroy(self._handle)


@cache
def load_turbojpeg(path: str = LIBRARY) -> ctypes.CDLL | None:
    """Return the library, None if it is not there or older than version 3."""
    try:
        library = ctypes.CDLL(path)
        library.tj3Init.argtypes, library.tj3Init.restype = [c_int], c_void_p
        library.tj3Destroy.argtypes, library.tj3Destroy.restype = [c_void_p], None
        library.tj3Get.argtypes = [c_void_p, c_int]
        library.tj3GetErrorStr.argtypes = [c_void_p]
        library.tj3GetErrorStr.restype = c_char_p
        library.tj3SetCroppingRegion.argtypes = [c_void_p, _Region]
        library.tj3DecompressHeader.argtypes = [c_void_p, c_void_p, c_size_t]
        library.tj3Decompress8.argtypes = [c_void_p, c_void_p, c_size_t, c_void_p, c_int, c_int]
    except (OSError, AttributeError):
        return None
    return library
