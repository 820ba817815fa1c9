"""Pictures on their way from the daemon to whoever records them: one line of JSON, then records.

Little-endian.  A record is `u8 kind, u8 camera, u8 lit_mask, u8 0, u32 size, i64 sequence,
f64 captured_at_s`, and `size` bytes.  Kind 1 is a picture of the camera with that index in the
first line, its rows from the top; a lit mask of 255 is not known.  Kind 2 is the end: `sequence` is
how many pictures were replaced before they could be sent.  A stream without an end was cut off.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cornertouchd.errors import ReportedError
from cornertouchd.model import Frame, PictureFormat

HEAD = struct.Struct("<BBBxIqd")
PICTURE, END = 1, 2
LIT_UNKNOWN = 255
LONGEST_FIRST_LINE = 65_536

_Pixels = Annotated[int, Field(ge=1, le=65_536)]


class PictureStreamError(ReportedError):
    """What comes is no stream of pictures, or was cut off."""


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", strict=True, allow_inf_nan=False)


class StreamedCamera(_Entry):
    """A camera of the stream; `gives` tells whether it gave pictures of late."""

    id: str = Field(min_length=1)
    width_px: _Pixels
    height_px: _Pixels
    row_offset_px: int = Field(ge=0)
    rows_px: _Pixels
    identity: str = ""
    gives: bool = True

    @property
    def format(self) -> PictureFormat:
        """Size and rows of its pictures."""
        return PictureFormat(self.width_px, self.height_px, self.row_offset_px, self.rows_px)


class StreamHead(_Entry):
    """The first line.  Pictures of one instant differ by at most `tolerance_s`."""

    surface_mm: tuple[float, float]
    rate_hz: float = Field(gt=0.0)
    tolerance_s: float = Field(ge=0.0)
    cameras: tuple[StreamedCamera, ...]

    def encode(self) -> bytes:
        """Return the line."""
        return self.model_dump_json().encode() + b"\n"


@dataclass(frozen=True, slots=True)
class End:
    """The end of a stream; `missing` pictures were replaced before they could be sent."""

    missing: int


def encode_picture(index: int, frame: Frame) -> bytes:
    """Return the record of a picture of the camera with this index."""
    lit_mask = LIT_UNKNOWN if frame.lit_mask is None else frame.lit_mask
    pixels = frame.pixels.tobytes()
    head = HEAD.pack(PICTURE, index, lit_mask, len(pixels), frame.sequence, frame.captured_at_s)
    return head + pixels


def encode_end(missing: int) -> bytes:
    """Return the record that ends a stream."""
    return HEAD.pack(END, 0, LIT_UNKNOWN, 0, missing, 0.0)


def read_head(line: bytes) -> StreamHead:
    """Return what the first line says.  Raises `PictureStreamError`."""
    try:
        return StreamHead.model_validate_json(line)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        raise PictureStreamError(f"no stream of pictures: {where}: {first['msg']}") from error


class PictureDecoder:
    """Takes the bytes behind the first line as they come."""

    def __init__(self, cameras: Mapping[str, PictureFormat]) -> None:
        self._cameras = tuple(cameras.items())
        self._received = bytearray()
        self._ended = False

    def feed(self, data: bytes) -> list[Frame | End]:
        """Return what is whole now.  Raises `PictureStreamError` if that makes no sense."""
        self._received += data
        whole: list[Frame | End] = []
        at = 0
        while len(self._received) - at >= HEAD.size:
            kind, index, lit_mask, size, number, time_s = HEAD.unpack_from(self._received, at)
            if self._ended or kind not in {PICTURE, END}:
                raise PictureStreamError(f"no stream of pictures: a record of kind {kind}")
            if kind == END:
                self._ended = True
                at += HEAD.size
                whole.append(End(number))
                continue
            camera, form = self._camera(index, size)
            if len(self._received) - at < HEAD.size + size:
                break
            pixels = np.frombuffer(self._received, np.uint8, size, at + HEAD.size).copy()
            at += HEAD.size + size
            whole.append(
                Frame(
                    camera,
                    number,
                    time_s,
                    None if lit_mask == LIT_UNKNOWN else lit_mask,
                    pixels.reshape(form.rows_px, form.width_px),
                )
            )
        del self._received[:at]
        return whole

    def finish(self) -> None:
        """Raise `PictureStreamError` unless the stream has come to its end."""
        if not self._ended:
            raise PictureStreamError("the stream of pictures was cut off: the daemon has gone")

    def _camera(self, index: int, size: int) -> tuple[str, PictureFormat]:
        if index >= len(self._cameras):
            raise PictureStreamError(f"no stream of pictures: camera {index} of {self._cameras}")
        camera, form = self._cameras[index]
        if size != form.rows_px * form.width_px:
            raise PictureStreamError(f"camera {camera}: a picture of {size} bytes, not {form}")
        return camera, form
