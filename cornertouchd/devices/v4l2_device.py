"""A V4L2 capture device: what it is, what it can, and how it is set up.

Requests that a driver does not know fail with ENOTTY or EINVAL; what is merely told by them is then
empty.  All else raises `OSError`.
"""

import errno
from collections.abc import Iterator
from dataclasses import dataclass

from cornertouchd.devices import v4l2_abi as abi
from cornertouchd.devices.v4l2_node import Argument, Node

MOST_LISTED = 1000
"""Entries of one list; a driver that never ends it is broken."""

_UNKNOWN_REQUEST = (errno.ENOTTY, errno.EINVAL, errno.ENODATA, errno.EOPNOTSUPP)


@dataclass(frozen=True, slots=True)
class Capability:
    """Who the device is and what it does."""

    driver: str
    card: str
    bus: str
    captures: bool
    multiplanar: bool
    streams: bool


@dataclass(frozen=True, slots=True)
class Steps:
    """Numbers from `lowest` to `highest`, `step` apart; often just one."""

    lowest: int
    highest: int
    step: int = 1

    def __contains__(self, number: int) -> bool:
        inside = self.lowest <= number <= self.highest
        return inside and (number - self.lowest) % max(1, self.step) == 0

    def __str__(self) -> str:
        if self.lowest == self.highest:
            return str(self.lowest)
        return f"{self.lowest}..{self.highest}"


@dataclass(frozen=True, slots=True)
class Mode:
    """One pixel format at one size or range of sizes.

    `rates_hz` are the rates it has there, from the fastest down, empty if the driver does not tell;
    with `any_rate` those between the fastest and the slowest as well.  Of a range of sizes they are
    the rates at its largest.
    """

    pixel_format: str
    compressed: bool
    width_px: Steps
    height_px: Steps
    rates_hz: tuple[float, ...]
    any_rate: bool = False

    def has_size(self, width_px: int, height_px: int) -> bool:
        """Tell whether it gives pictures of this size."""
        return width_px in self.width_px and height_px in self.height_px

    def __str__(self) -> str:
        rates = ", ".join(f"{rate:.4g}" for rate in self.rates_hz)
        if self.any_rate:
            rates = f"{self.rates_hz[-1]:.4g}..{self.rates_hz[0]:.4g}"
        size = f"{self.pixel_format} {self.width_px}x{self.height_px}"
        return f"{size} at {rates} Hz" if rates else size


@dataclass(frozen=True, slots=True)
class Layout:
    """How pictures lie in a buffer, as the driver has set it."""

    pixel_format: str
    width_px: int
    height_px: int
    bytes_per_line: int
    size_bytes: int

    def __str__(self) -> str:
        return f"{self.pixel_format} {self.width_px}x{self.height_px}"


@dataclass(frozen=True, slots=True)
class Area:
    """A rectangle of the sensor, in its own pixels."""

    left_px: int
    top_px: int
    width_px: int
    height_px: int


class V4l2Device:
    """A node that captures; `node` stays the caller's to close."""

    def __init__(self, node: Node) -> None:
        self._node = node

    def capability(self) -> Capability:
        """Return who the device is.  A file that is no video device raises `OSError` (ENOTTY)."""
        told = abi.Capability()
        self._node.ioctl(abi.VIDIOC_QUERYCAP, told)
        every, own = told.capabilities, told.device_caps
        can = own if every & abi.CAP_DEVICE_CAPS else every
        return Capability(
            _text(told.driver),
            _text(told.card),
            _text(told.bus_info),
            captures=bool(can & abi.CAP_VIDEO_CAPTURE),
            multiplanar=bool(can & abi.CAP_VIDEO_CAPTURE_MPLANE),
            streams=bool(can & abi.CAP_STREAMING),
        )

    def modes(self) -> tuple[Mode, ...]:
        """Return all formats, sizes and rates, in the order of the driver."""
        return tuple(
            mode
            for name, compressed in self.pixel_formats()
            for mode in self._modes_of(name, compressed=compressed)
        )

    def pixel_formats(self) -> tuple[tuple[str, bool], ...]:
        """Return the names of the formats, and which are compressed."""
        found = []
        for index in range(MOST_LISTED):
            entry = abi.FormatDescription(index=index, type=abi.BUF_TYPE_VIDEO_CAPTURE)
            if not self._tells(abi.VIDIOC_ENUM_FMT, entry):
                break
            name = abi.fourcc_name(entry.pixelformat)
            found.append((name, bool(entry.flags & abi.FMT_FLAG_COMPRESSED)))
        return tuple(found)

    def rates_at(
        self, pixel_format: str, width_px: int, height_px: int
    ) -> tuple[tuple[float, ...], bool]:
        """Return the rates at one size as `Mode` has them: `rates_hz` and `any_rate`."""
        rates: set[float] = set()
        for index in range(MOST_LISTED):
            entry = abi.FrameIntervalEnum(
                index=index,
                pixel_format=abi.fourcc(pixel_format),
                width=width_px,
                height=height_px,
            )
            if not self._tells(abi.VIDIOC_ENUM_FRAMEINTERVALS, entry):
                break
            if entry.type != abi.FRMIVAL_TYPE_DISCRETE:
                ends = (_rate_hz(entry.stepwise.min), _rate_hz(entry.stepwise.max))
                return tuple(sorted((end for end in ends if end), reverse=True)), all(ends)
            rates.add(_rate_hz(entry.discrete))
        return tuple(sorted(rates - {0.0}, reverse=True)), False

    def set_layout(self, pixel_format: str, width_px: int, height_px: int) -> Layout:
        """Ask for a format and size; return what the driver made of it."""
        request = abi.Format(type=abi.BUF_TYPE_VIDEO_CAPTURE)
        request.pix.width, request.pix.height = width_px, height_px
        request.pix.pixelformat = abi.fourcc(pixel_format)
        request.pix.field = abi.FIELD_NONE
        self._node.ioctl(abi.VIDIOC_S_FMT, request)
        pix = request.pix
        return Layout(
            abi.fourcc_name(pix.pixelformat),
            pix.width,
            pix.height,
            pix.bytesperline,
            pix.sizeimage,
        )

    def set_rate(self, rate_hz: float) -> float | None:
        """Ask for a rate; return the one that the driver set, None if it knows no rates."""
        request = abi.StreamParameters(type=abi.BUF_TYPE_VIDEO_CAPTURE)
        request.capture.timeperframe = abi.Fraction32(1000, max(1, round(1000 * rate_hz)))
        if not self._tells(abi.VIDIOC_S_PARM, request):
            return None
        if not request.capture.capability & abi.CAP_TIMEPERFRAME:
            return None
        return _rate_hz(request.capture.timeperframe) or None

    def default_area(self) -> Area | None:
        """Return the part of the sensor that whole pictures show, None without cropping."""
        return self._area(abi.SEL_TGT_CROP_DEFAULT)

    def crop(self, area: Area) -> Area | None:
        """Ask that pictures show only a part; return which one they show, None if refused."""
        request = abi.Selection(type=abi.BUF_TYPE_VIDEO_CAPTURE, target=abi.SEL_TGT_CROP)
        request.r = abi.Rectangle(area.left_px, area.top_px, area.width_px, area.height_px)
        if not self._tells(abi.VIDIOC_S_SELECTION, request, also=(errno.EBUSY, errno.ERANGE)):
            return None
        return self._area(abi.SEL_TGT_CROP)

    def _area(self, target: int) -> Area | None:
        asked = abi.Selection(type=abi.BUF_TYPE_VIDEO_CAPTURE, target=target)
        if not self._tells(abi.VIDIOC_G_SELECTION, asked):
            return None
        return Area(asked.r.left, asked.r.top, asked.r.width, asked.r.height)

    def _modes_of(self, name: str, *, compressed: bool) -> Iterator[Mode]:
        for index in range(MOST_LISTED):
            entry = abi.FrameSizeEnum(index=index, pixel_format=abi.fourcc(name))
            if not self._tells(abi.VIDIOC_ENUM_FRAMESIZES, entry):
                return
            if entry.type == abi.FRMSIZE_TYPE_DISCRETE:
                width, height = (
                    Steps(*[entry.discrete.width] * 2),
                    Steps(*[entry.discrete.height] * 2),
                )
            else:
                size = entry.stepwise
                width = Steps(size.min_width, size.max_width, size.step_width)
                height = Steps(size.min_height, size.max_height, size.step_height)
            rates, any_rate = self.rates_at(name, width.highest, height.highest)
            yield Mode(name, compressed, width, height, rates, any_rate)
            if entry.type != abi.FRMSIZE_TYPE_DISCRETE:
                return

    def _tells(self, request: int, argument: Argument, also: tuple[int, ...] = ()) -> bool:
        """Do a request; return False if the driver does not know it or has no such entry."""
        try:
            self._node.ioctl(request, argument)
        except OSError as error:
            if error.errno in (*_UNKNOWN_REQUEST, *also):
                return False
            raise
        return True


def _text(field: bytes) -> str:
    shown = field.decode("utf-8", errors="replace")
    return "".join(letter if letter.isprintable() else "?" for letter in shown)


def _rate_hz(interval: abi.Fraction32) -> float:
    return interval.denominator / interval.numerator if interval.numerator else 0.0
