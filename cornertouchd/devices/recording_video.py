"""The videos of a recording: FFV1 in Matroska, 8-bit grey, through OpenCV's FFmpeg.

OpenCV 4.10 to 5.0 give a grey picture as (rows, columns) uint8 when CAP_PROP_CONVERT_RGB is 0.
Its writer takes even sizes only: it would cut the last column or row off an odd one.
"""

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from cornertouchd.devices.recording_format import RecordingError
from cornertouchd.model import Picture, PictureFormat

FFV1 = cv2.VideoWriter.fourcc(*"FFV1")
# How OpenCV names FFmpeg's pixel format GRAY8 (libavformat's raw video tag).
GREY = cv2.VideoWriter.fourcc(*"Y800")
# With this value of CAP_PROP_FORMAT, OpenCV hands packets out without decoding them.
UNDECODED = -1

# Where a Matroska file's segment begins, and how far into the file muxers put it at most.
SEGMENT_ID = b"\x18\x53\x80\x67"
LONGEST_EBML_HEADER = 4096


@dataclass(frozen=True, slots=True)
class VideoFacts:
    """What a video holds, found without decoding it."""

    width_px: int
    height_px: int
    grey: bool
    pictures: int


def inspect_video(path: Path) -> VideoFacts | None:
    """Return what a video holds, None if so little of it is there that nothing can be read.

    Counts the packets that are whole, which takes a hundredth of the time of decoding them.
    """
    options = [cv2.CAP_PROP_FORMAT, UNDECODED]
    capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG, options)
    try:
        if not capture.isOpened():
            return None
        pictures = 0
        while capture.grab():
            pictures += 1
        return VideoFacts(
            width_px=int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            height_px=int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
            grey=int(capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)) == GREY,
            pictures=pictures,
        )
    finally:
        capture.release()


def missing_bytes(path: Path) -> int:
    """Return how many bytes a Matroska file lacks of the length that it declares.

    0 if it is whole, and if its muxer never came to declare a length.  RFC 8794, section 4 to 6.
    """
    with path.open("rb") as file:
        head = file.read(LONGEST_EBML_HEADER)
    id_at = head.find(SEGMENT_ID)
    size_at = id_at + len(SEGMENT_ID)
    if id_at < 0 or size_at >= len(head) or head[size_at] == 0:
        return 0
    # The number of leading zero bits tells how many bytes the size has; its other bits count.
    octets = 9 - head[size_at].bit_length()
    mask = (1 << 7 * octets) - 1
    size = int.from_bytes(head[size_at : size_at + octets]) & mask
    if size == mask:
        return 0
    return max(size_at + octets + size - path.stat().st_size, 0)


def read_pictures(path: Path, form: PictureFormat) -> Generator[Picture]:
    """Yield the pictures of a video one by one, (rows_px, width_px) each.

    Ends where decoding ends.  Raises `RecordingError` if a picture is not as `form` says.
    """
    capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
    try:
        capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        while True:
            there, picture = capture.read()
            if not there:
                return
            if picture.dtype != np.uint8 or picture.size != form.rows_px * form.width_px:
                raise RecordingError(
                    f"{path}: a picture is {picture.shape} {picture.dtype}, must be 8-bit grey, "
                    f"{form.width_px}x{form.rows_px}; record anew"
                )
            yield np.asarray(picture, np.uint8).reshape(form.rows_px, form.width_px)
    finally:
        capture.release()


def open_video_writer(path: Path, form: PictureFormat, rate_hz: float) -> cv2.VideoWriter:
    """Return a writer of lossless grey video.

    Until it is released it keeps up to 256 KiB (FFmpeg's file buffer) and twelve pictures (a
    cluster) in memory; OpenCV has no way to flush them, measured with 4.10, 4.14 and 5.0.
    Raises `RecordingError` if it cannot write pictures of this size, or not there.
    """
    if form.width_px % 2 or form.rows_px % 2:
        raise RecordingError(
            f"{path}: pictures of {form.width_px}x{form.rows_px} cannot be recorded; "
            "width and number of rows must be even, set rows_px of the camera accordingly"
        )
    size = (form.width_px, form.rows_px)
    writer = cv2.VideoWriter(str(path.absolute()), cv2.CAP_FFMPEG, FFV1, rate_hz, size, False)
    if not writer.isOpened():
        raise RecordingError(
            f"{path}: no FFV1 video can be written; check permissions, and OpenCV for FFmpeg"
        )
    return writer
