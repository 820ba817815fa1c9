"""Cameras read through V4L2: the newest picture, its true time and number, no damaged ones."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.devices.camera_identity import camera_identity
from cornertouchd.devices.camera_places import PlaceError, device_path
from cornertouchd.devices.luma import LumaReader, RowReader
from cornertouchd.devices.mjpeg import JPEG_FORMATS, mjpeg_reader
from cornertouchd.devices.usb_sysfs import SYSFS
from cornertouchd.devices.v4l2_choice import (
    AUTOMATIC,
    RATE_TOLERANCE,
    FormatError,
    choose_format,
    set_rows,
)
from cornertouchd.devices.v4l2_controls import Controls, ControlValue
from cornertouchd.devices.v4l2_device import Capability, Layout, V4l2Device
from cornertouchd.devices.v4l2_faults import explain
from cornertouchd.devices.v4l2_node import DeviceNode, Node
from cornertouchd.devices.v4l2_stream import Filled, StreamCounts, StreamError, V4l2Stream
from cornertouchd.model import Frame, Picture, PictureFormat
from cornertouchd.ports import CameraError

_log = logging.getLogger("cornertouchd")

TOO_MANY_DAMAGED = 3
"""Damaged pictures and no good one within one timeout: the stream does not mend by itself.

One or two are what a camera leaves behind when it merely stalls.
"""


@dataclass(frozen=True, slots=True)
class PictureCounts:
    """What became of the pictures since the camera was opened.

    `marked_bad` were called damaged by the driver; `damaged` are short, or no JPEG that decodes.
    """

    stream: StreamCounts
    marked_bad: int
    damaged: int


class V4l2CameraPort:
    """A video device by its path or place; `now_s` reads CLOCK_MONOTONIC, `sysfs` is mounted there.

    `pixel_format` is "auto" or the name of a V4L2 format; `controls` are set at every opening.
    """

    def __init__(
        self,
        camera_id: str,
        device: str,
        picture_format: PictureFormat,
        rate_hz: float,
        now_s: Callable[[], float],
        pixel_format: str = AUTOMATIC,
        controls: Mapping[str, ControlValue] | None = None,
        sysfs: Path = SYSFS,
        open_node: Callable[[str], Node] = DeviceNode,
    ) -> None:
        self._id = camera_id
        self._device = device
        self._format = picture_format
        self._rate_hz = rate_hz
        self._now_s = now_s
        self._pixel_format = pixel_format
        self._controls = dict(controls or {})
        self._sysfs = sysfs
        self._open_node = open_node
        self._complaints: tuple[str, ...] = ()

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

    @property
    def complaints(self) -> tuple[str, ...]:
        """What was not as configured at the last opening; the camera works all the same."""
        return self._complaints

    def open(self) -> "V4l2Camera":
        """Open the device and set it up.

        Raises `CameraError` if it is not there, is held by another program, or does not give what
        is configured.
        """
        path = self._path()
        try:
            node = self._open_node(path)
        except OSError as error:
            raise CameraError(self._id, explain(error, path, self._asked())) from error
        try:
            return self._set_up(node, path)
        except OSError as error:
            node.close()
            raise CameraError(self._id, explain(error, path, self._asked())) from error
        except (FormatError, ValueError) as error:
            node.close()
            raise CameraError(self._id, f"{path} {error}") from error

    def _path(self) -> str:
        """Return the node of the device now."""
        try:
            return device_path(self._device, self._sysfs)
        except PlaceError as error:
            raise CameraError(self._id, str(error)) from error

    def _asked(self) -> str:
        """Return the pictures that are asked for, in words."""
        width_px, height_px = self._format.width_px, self._format.height_px
        kind = "" if self._pixel_format == AUTOMATIC else f"{self._pixel_format} "
        return f"{kind}{width_px}x{height_px} at {self._rate_hz:g} Hz"

    def _set_up(self, node: Node, path: str) -> "V4l2Camera":
        device = V4l2Device(node)
        _require_capture(device.capability())
        width_px, height_px = self._format.width_px, self._format.height_px
        chosen = choose_format(device, self._pixel_format, width_px, height_px, self._rate_hz)
        layout, first_row = set_rows(device, chosen, self._format)
        reader = row_reader(layout, first_row, self._format.rows_px)
        slow = self._slow(device.set_rate(self._rate_hz), layout)
        self._tell((*slow, *Controls(node).apply(self._controls)))
        stream = V4l2Stream(node, self._now_s)
        return V4l2Camera(self._id, path, layout, node, stream, reader, self._now_s)

    def _slow(self, rate_hz: float | None, layout: Layout) -> tuple[str, ...]:
        if rate_hz is None or rate_hz >= self._rate_hz * (1.0 - RATE_TOLERANCE):
            return ()
        complaint = (
            f"gives {layout} at {rate_hz:.4g} Hz, configured {self._rate_hz:g} Hz; lower "
            "cameras.rate_hz, or choose another size or cameras.pixel_format"
        )
        return (complaint,)

    def _tell(self, complaints: tuple[str, ...]) -> None:
        """Log what is not as configured, once for as long as it stays so."""
        for complaint in complaints:
            if complaint not in self._complaints:
                _log.warning("camera %s: %s", self._id, complaint)
        self._complaints = complaints


class V4l2Camera:
    """An opened device.

    The pixels of a `Frame` lie in the driver's buffer or in one of ours: they last until the next
    `read` or `close`.
    """

    def __init__(
        self,
        camera_id: str,
        path: str,
        layout: Layout,
        node: Node,
        stream: V4l2Stream,
        reader: RowReader,
        now_s: Callable[[], float],
    ) -> None:
        self._id = camera_id
        self._path = path
        self._layout = layout
        self._node = node
        self._stream = stream
        self._reader = reader
        self._now_s = now_s
        self._marked_bad = self._damaged = 0
        self._closed = False

    @property
    def layout(self) -> Layout:
        """How pictures come from the driver."""
        return self._layout

    def counts(self) -> PictureCounts:
        """Return what became of the pictures so far.  Any thread may ask."""
        return PictureCounts(self._stream.counts, self._marked_bad, self._damaged)

    def read(self, timeout_s: float) -> Frame | None:
        """Return the newest picture that has not been returned, None if none came in time.

        Raises `CameraError` when the device is gone, reports an error, or sends only damage.
        """
        until_s = self._now_s() + timeout_s
        left_out = 0
        try:
            while True:
                filled = self._stream.newest(max(0.0, until_s - self._now_s()))
                if filled is None:
                    break
                rows = self._rows(filled)
                if rows is not None:
                    return Frame(self._id, filled.sequence, filled.captured_at_s, None, rows)
                left_out += 1
        except OSError as error:
            raise CameraError(self._id, explain(error, self._path, str(self._layout))) from error
        except StreamError as error:
            raise CameraError(self._id, f"{self._path}: {error}") from error
        if left_out >= TOO_MANY_DAMAGED:
            raise CameraError(
                self._id,
                f"{self._path}: all {left_out} pictures within {timeout_s:g} s were damaged; look "
                "at cable and hub, or lower cameras.rate_hz",
            )
        return None

    def close(self) -> None:
        """Stop the camera and give the device back."""
        if not self._closed:
            self._closed = True
            self._stream.close()
            self._node.close()

    def _rows(self, filled: Filled) -> Picture | None:
        """Return the rows of a picture, None if it is damaged; the first one is told."""
        if filled.marked_bad:
            self._marked_bad += 1
            self._tell_first("the driver marks it so")
            return None
        rows = self._reader.read(filled.bytes, filled.used_bytes)
        if rows is None:
            self._damaged += 1
            self._tell_first(f"{filled.used_bytes} bytes that are no whole picture")
        return rows

    def _tell_first(self, how: str) -> None:
        if self._marked_bad + self._damaged == 1:
            _log.warning(
                "camera %s: a damaged picture is left out (%s); more are only counted",
                self._id,
                how,
            )


def row_reader(layout: Layout, first_row: int, rows: int) -> RowReader:
    """Return what reads rows of pictures of this layout.  Raises `ValueError` if it cannot be."""
    if layout.pixel_format in JPEG_FORMATS:
        return mjpeg_reader(layout, first_row, rows)
    return LumaReader(layout, first_row, rows)


def _require_capture(capability: Capability) -> None:
    if capability.captures and capability.streams:
        return
    if capability.multiplanar:
        raise FormatError(
            f"({capability.card}, driver {capability.driver}) only has the multi-planar interface, "
            'which is not read here; try cameras.source = "opencv"'
        )
    raise FormatError(
        f"({capability.card}, driver {capability.driver}) gives no pictures; a camera often has a "
        "second node for them"
    )
