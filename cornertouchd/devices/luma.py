"""Grey rows out of V4L2 buffers: formats whose pixels lie there as they are, or packed.

The names and the order of the bytes are the kernel's, "Image Formats", luma-only and YUV.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cornertouchd.devices.v4l2_device import Layout
from cornertouchd.model import Picture


class RowReader(Protocol):
    """Turns what a driver has filled into grey rows of the strip."""

    def read(self, buffer: Picture, used_bytes: int) -> Picture | None:
        """Return the rows, None if the picture is damaged.

        `buffer` is a whole buffer, (size_bytes,), of which the driver filled `used_bytes`.  The
        rows may lie in the buffer, or in memory of the reader: they last until its next call.
        """
        ...


@dataclass(frozen=True, slots=True)
class Packing:
    """How grey values lie in a row: `pixels` of them take `bytes`.

    With two bytes a pixel the grey value is the 16-bit number (little-endian) shifted by `shift`;
    with fewer the grey values come first, and what belongs to all of them (chroma, lowest bits)
    comes after.
    """

    pixels: int
    bytes: int
    shift: int = 0


_PLAIN = Packing(1, 1)
PACKINGS: Mapping[str, Packing] = {
    "GREY": _PLAIN,
    "Y10": Packing(1, 2, 2),
    "Y12": Packing(1, 2, 4),
    "Y14": Packing(1, 2, 6),
    "Y16": Packing(1, 2, 8),
    "Y16-BE": Packing(1, 2, 0),
    "Y10P": Packing(4, 5),
    "Y12P": Packing(2, 3),
    "YUYV": Packing(1, 2, 0),
    "YVYU": Packing(1, 2, 0),
    "UYVY": Packing(1, 2, 8),
    "VYUY": Packing(1, 2, 8),
    # whole planes of luma, chroma after them
    "NV12": _PLAIN,
    "NV21": _PLAIN,
    "NV16": _PLAIN,
    "NV61": _PLAIN,
    "NV24": _PLAIN,
    "NV42": _PLAIN,
    "YU12": _PLAIN,
    "YV12": _PLAIN,
    "422P": _PLAIN,
}
"""Formats that we read, by their names."""


class LumaReader:
    """Reads rows `first_row` to `first_row + rows` of uncompressed pictures.

    Where grey values lie side by side nothing is copied.  Raises `ValueError` if the layout cannot
    be: the width does not fit the bytes of a line, or the rows do not fit the buffer.
    """

    def __init__(self, layout: Layout, first_row: int, rows: int) -> None:
        packing = PACKINGS[layout.pixel_format]
        row_bytes = -(-layout.width_px // packing.pixels) * packing.bytes
        line_bytes = layout.bytes_per_line or row_bytes
        self._needed_bytes = line_bytes * (layout.height_px - 1) + row_bytes
        if line_bytes < row_bytes or self._needed_bytes > layout.size_bytes:
            raise ValueError(
                f"{layout.width_px}x{layout.height_px} {layout.pixel_format} needs {row_bytes} "
                f"bytes a line and {self._needed_bytes} in all; the driver has {line_bytes} and "
                f"{layout.size_bytes}"
            )
        self._packing = packing
        self._lines = slice(first_row * line_bytes, (first_row + rows) * line_bytes)
        self._rows, self._line_bytes, self._row_bytes = rows, line_bytes, row_bytes
        self._width_px = layout.width_px
        self._copied = np.empty((rows, layout.width_px), np.uint8)

    def read(self, buffer: Picture, used_bytes: int) -> Picture | None:
        """Return the rows, None if the picture is short."""
        if used_bytes < self._needed_bytes:
            return None
        lines = self._bytes(buffer)
        packing = self._packing
        if packing == _PLAIN:
            if self._line_bytes == self._row_bytes:
                return lines
            np.copyto(self._copied, lines)
        elif packing.pixels == 1:
            numbers = lines.view("<u2")
            np.right_shift(numbers, packing.shift, out=self._copied, casting="unsafe")
        else:
            groups = lines.reshape(self._rows, -1, packing.bytes)[:, :, : packing.pixels]
            self._copied[...] = groups.reshape(self._rows, -1)[:, : self._width_px]
        return self._copied

    def _bytes(self, buffer: Picture) -> Picture:
        """Return the bytes of the rows, (rows, row_bytes); the last line may lack its padding."""
        return np.lib.stride_tricks.as_strided(
            buffer[self._lines],
            (self._rows, self._row_bytes),
            (self._line_bytes, 1),
        )
