"""Which of a camera's formats is used, and how its pictures are cut to the rows of the strip."""

from collections.abc import Sequence

from cornertouchd.devices.mjpeg import JPEG_FORMATS
from cornertouchd.devices.v4l2_device import Area, Layout, Mode, V4l2Device
from cornertouchd.model import PictureFormat

AUTOMATIC = "auto"

PREFERRED = (
    *("GREY", "Y10", "Y12", "Y14", "Y16", "Y16-BE", "Y10P", "Y12P"),
    *("YUYV", "UYVY", "YVYU", "VYUY", "NV12", "NV21", "YU12", "YV12"),
    *("NV16", "NV61", "422P", "NV24", "NV42", *JPEG_FORMATS),
)
"""From what costs nothing to read, over what fills the bus with chroma, to what must be decoded."""

RATE_TOLERANCE = 0.01
"""Drivers round intervals: 30 Hz may be told as 29.97."""


class FormatError(Exception):
    """The camera does not give what is configured; the text says what it has."""


def choose_format(
    device: V4l2Device, wanted: str, width_px: int, height_px: int, rate_hz: float
) -> str:
    """Return the pixel format to use.  Raises `FormatError`, with what the camera has.

    Of those that we read and that have the size, the first in order of `PREFERRED` that reaches the
    rate; if none does, the fastest.
    """
    modes = device.modes()
    known = [mode for mode in modes if mode.pixel_format in PREFERRED]
    named = [mode for mode in known if wanted in (AUTOMATIC, mode.pixel_format)]
    fitting = [mode for mode in named if mode.has_size(width_px, height_px)]
    if fitting:
        names = sorted({mode.pixel_format for mode in fitting}, key=PREFERRED.index)
        return _fastest(device, names, width_px, height_px, rate_hz)
    enumerates_sizes = {mode.pixel_format for mode in modes}
    silent = [
        name
        for name, _ in device.pixel_formats()
        if name not in enumerates_sizes and name in PREFERRED and wanted in (AUTOMATIC, name)
    ]
    if silent:  # the driver tells no sizes; it will tell what it makes of ours
        return min(silent, key=PREFERRED.index)
    configured = f"{width_px}x{height_px}" + ("" if wanted == AUTOMATIC else f" {wanted}")
    raise FormatError(f"has no {configured}; {_what_there_is(modes, known, wanted)}")


def _fastest(
    device: V4l2Device, names: Sequence[str], width_px: int, height_px: int, rate_hz: float
) -> str:
    fastest = {}
    for name in names:
        rates, _ = device.rates_at(name, width_px, height_px)
        if not rates or rates[0] >= rate_hz * (1.0 - RATE_TOLERANCE):
            return name
        fastest[name] = rates[0]
    return max(fastest, key=fastest.__getitem__)


def _what_there_is(modes: Sequence[Mode], known: Sequence[Mode], wanted: str) -> str:
    if not known:
        others = ", ".join(dict.fromkeys(mode.pixel_format for mode in modes)) or "none"
        return f"its pixel formats ({others}) cannot be read here: use another camera"
    here = [mode for mode in known if mode.pixel_format == wanted] or known
    return f"it has {', '.join(map(str, here))}: choose one of these"


def set_rows(device: V4l2Device, pixel_format: str, picture: PictureFormat) -> tuple[Layout, int]:
    """Set format and size; return the layout, and the row of it at which the strip begins.

    Where the driver crops without scaling, only the rows of the strip travel.  Raises `FormatError`
    if it makes something else of format or size.
    """
    whole = device.default_area()
    if whole is not None:
        device.crop(whole)  # whoever used the camera before may have left it cropped
    layout = _set(device, pixel_format, picture.width_px, picture.height_px)
    same_pixels = whole is not None and (whole.width_px, whole.height_px) == (
        picture.width_px,
        picture.height_px,
    )
    if whole is None or not same_pixels or picture.rows_px == picture.height_px:
        return layout, picture.row_offset_px
    top_px = whole.top_px + picture.row_offset_px
    strip = Area(whole.left_px, top_px, whole.width_px, picture.rows_px)
    given = device.crop(strip)
    if given is not None and _holds(given, strip):
        narrow = device.set_layout(pixel_format, given.width_px, given.height_px)
        kept = (narrow.pixel_format, narrow.width_px, narrow.height_px) == (
            pixel_format,
            given.width_px,
            given.height_px,
        )
        if kept and device.crop(given) == given:
            return narrow, strip.top_px - given.top_px
    device.crop(whole)
    return _set(device, pixel_format, picture.width_px, picture.height_px), picture.row_offset_px


def _set(device: V4l2Device, pixel_format: str, width_px: int, height_px: int) -> Layout:
    layout = device.set_layout(pixel_format, width_px, height_px)
    if (layout.pixel_format, layout.width_px, layout.height_px) != (
        pixel_format,
        width_px,
        height_px,
    ):
        modes = device.modes()
        known = [mode for mode in modes if mode.pixel_format in PREFERRED]
        raise FormatError(
            f"gives {layout.width_px}x{layout.height_px} {layout.pixel_format} when asked for "
            f"{width_px}x{height_px} {pixel_format}; {_what_there_is(modes, known, pixel_format)}"
        )
    return layout


def _holds(given: Area, strip: Area) -> bool:
    """Tell whether a cropped picture shows the strip whole, in the columns of the full picture."""
    same_columns = (given.left_px, given.width_px) == (strip.left_px, strip.width_px)
    above = given.top_px <= strip.top_px
    below = given.top_px + given.height_px >= strip.top_px + strip.height_px
    return same_columns and above and below
