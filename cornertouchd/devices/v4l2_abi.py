"""The part of <linux/videodev2.h> that we speak: structures, requests, constants.

Names and numbers are the kernel's: a test compares them with it.
"""

import ctypes
from ctypes import Structure, Union, c_char, c_int32, c_int64, c_long, c_uint8, c_uint32, c_uint64

BUF_TYPE_VIDEO_CAPTURE = 1
MEMORY_MMAP = 1
FIELD_NONE = 1

CAP_VIDEO_CAPTURE = 0x0000_0001
CAP_VIDEO_CAPTURE_MPLANE = 0x0000_1000
CAP_STREAMING = 0x0400_0000
CAP_DEVICE_CAPS = 0x8000_0000
CAP_TIMEPERFRAME = 0x1000

FMT_FLAG_COMPRESSED = 0x0001
FRMSIZE_TYPE_DISCRETE = 1
FRMIVAL_TYPE_DISCRETE = 1

BUF_FLAG_ERROR = 0x0000_0040
BUF_FLAG_TIMESTAMP_MASK = 0x0000_E000
BUF_FLAG_TIMESTAMP_MONOTONIC = 0x0000_2000

SEL_TGT_CROP = 0x0000
SEL_TGT_CROP_DEFAULT = 0x0001

CTRL_FLAG_DISABLED = 0x0001
CTRL_FLAG_GRABBED = 0x0002
CTRL_FLAG_READ_ONLY = 0x0004
CTRL_FLAG_INACTIVE = 0x0010
CTRL_FLAG_WRITE_ONLY = 0x0040
CTRL_FLAG_HAS_PAYLOAD = 0x0100
CTRL_FLAG_NEXT_CTRL = 0x8000_0000
CTRL_WHICH_CUR_VAL = 0

CTRL_TYPE_INTEGER = 1
CTRL_TYPE_BOOLEAN = 2
CTRL_TYPE_MENU = 3
CTRL_TYPE_BUTTON = 4
CTRL_TYPE_INTEGER64 = 5
CTRL_TYPE_CTRL_CLASS = 6
CTRL_TYPE_BITMASK = 8
CTRL_TYPE_INTEGER_MENU = 9

CID_AUTO_WHITE_BALANCE = 0x0098_090C
CID_AUTOGAIN = 0x0098_0912
CID_POWER_LINE_FREQUENCY = 0x0098_0918
CID_HUE_AUTO = 0x0098_0919
CID_EXPOSURE_AUTO = 0x009A_0901
CID_EXPOSURE_AUTO_PRIORITY = 0x009A_0903
CID_FOCUS_AUTO = 0x009A_090C


def fourcc(name: str) -> int:
    """Return the number of a pixel format by its name, the reverse of `fourcc_name`."""
    letters = name.removesuffix("-BE").ljust(4).encode("latin-1")
    return int.from_bytes(letters, "little") | name.endswith("-BE") << 31


def fourcc_name(code: int) -> str:
    """Return the name of a pixel format; big-endian ones end in "-BE", as v4l2-ctl shows them."""
    big_endian = code >> 31
    letters = (code & 0x7FFF_FFFF).to_bytes(4, "little").decode("latin-1").rstrip()
    name = "".join(letter if letter.isprintable() else "?" for letter in letters)
    return f"{name}-BE" if big_endian else name


class Capability(Structure):
    """struct v4l2_capability."""

    _fields_ = (
        ("driver", c_char * 16),
        ("card", c_char * 32),
        ("bus_info", c_char * 32),
        ("version", c_uint32),
        ("capabilities", c_uint32),
        ("device_caps", c_uint32),
        ("reserved", c_uint32 * 3),
    )


class FormatDescription(Structure):
    """struct v4l2_fmtdesc."""

    _fields_ = (
        ("index", c_uint32),
        ("type", c_uint32),
        ("flags", c_uint32),
        ("description", c_char * 32),
        ("pixelformat", c_uint32),
        ("mbus_code", c_uint32),
        ("reserved", c_uint32 * 3),
    )


class Fraction32(Structure):
    """struct v4l2_fract."""

    _fields_ = (("numerator", c_uint32), ("denominator", c_uint32))


class FrameSizeDiscrete(Structure):
    """struct v4l2_frmsize_discrete."""

    _fields_ = (("width", c_uint32), ("height", c_uint32))


class FrameSizeStepwise(Structure):
    """struct v4l2_frmsize_stepwise."""

    _fields_ = (
        ("min_width", c_uint32),
        ("max_width", c_uint32),
        ("step_width", c_uint32),
        ("min_height", c_uint32),
        ("max_height", c_uint32),
        ("step_height", c_uint32),
    )


class _FrameSizeUnion(Union):
    _fields_ = (("discrete", FrameSizeDiscrete), ("stepwise", FrameSizeStepwise))


class FrameSizeEnum(Structure):
    """struct v4l2_frmsizeenum."""

    _anonymous_ = ("size",)
    _fields_ = (
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("type", c_uint32),
        ("size", _FrameSizeUnion),
        ("reserved", c_uint32 * 2),
    )


class FrameIntervalStepwise(Structure):
    """struct v4l2_frmival_stepwise."""

    _fields_ = (("min", Fraction32), ("max", Fraction32), ("step", Fraction32))


class _FrameIntervalUnion(Union):
    _fields_ = (("discrete", Fraction32), ("stepwise", FrameIntervalStepwise))


class FrameIntervalEnum(Structure):
    """struct v4l2_frmivalenum."""

    _anonymous_ = ("interval",)
    _fields_ = (
        ("index", c_uint32),
        ("pixel_format", c_uint32),
        ("width", c_uint32),
        ("height", c_uint32),
        ("type", c_uint32),
        ("interval", _FrameIntervalUnion),
        ("reserved", c_uint32 * 2),
    )


class PixelFormat(Structure):
    """struct v4l2_pix_format."""

    _fields_ = (
        ("width", c_uint32),
        ("height", c_uint32),
        ("pixelformat", c_uint32),
        ("field", c_uint32),
        ("bytesperline", c_uint32),
        ("sizeimage", c_uint32),
        ("colorspace", c_uint32),
        ("priv", c_uint32),
        ("flags", c_uint32),
        ("ycbcr_enc", c_uint32),
        ("quantization", c_uint32),
        ("xfer_func", c_uint32),
    )


class _FormatUnion(Union):
    # The kernel's union holds a pointer (in struct v4l2_window), which gives it its alignment.
    _fields_ = (
        ("pix", PixelFormat),
        ("raw_data", c_uint8 * 200),
        ("_alignment", ctypes.c_void_p),
    )


class Format(Structure):
    """struct v4l2_format."""

    _anonymous_ = ("fmt",)
    _fields_ = (("type", c_uint32), ("fmt", _FormatUnion))


class RequestBuffers(Structure):
    """struct v4l2_requestbuffers."""

    _fields_ = (
        ("count", c_uint32),
        ("type", c_uint32),
        ("memory", c_uint32),
        ("capabilities", c_uint32),
        ("flags", c_uint8),
        ("reserved", c_uint8 * 3),
    )


class Timeval(Structure):
    """struct timeval."""

    _fields_ = (("tv_sec", c_long), ("tv_usec", c_long))


class Timecode(Structure):
    """struct v4l2_timecode."""

    _fields_ = (
        ("type", c_uint32),
        ("flags", c_uint32),
        ("frames", c_uint8),
        ("seconds", c_uint8),
        ("minutes", c_uint8),
        ("hours", c_uint8),
        ("userbits", c_uint8 * 4),
    )


class _BufferPlace(Union):
    _fields_ = (
        ("offset", c_uint32),
        ("userptr", ctypes.c_ulong),
        ("planes", ctypes.c_void_p),
        ("fd", c_int32),
    )


class Buffer(Structure):
    """struct v4l2_buffer."""

    _anonymous_ = ("m",)
    _fields_ = (
        ("index", c_uint32),
        ("type", c_uint32),
        ("bytesused", c_uint32),
        ("flags", c_uint32),
        ("field", c_uint32),
        ("timestamp", Timeval),
        ("timecode", Timecode),
        ("sequence", c_uint32),
        ("memory", c_uint32),
        ("m", _BufferPlace),
        ("length", c_uint32),
        ("reserved2", c_uint32),
        ("request_fd", c_int32),
    )


class CaptureParameters(Structure):
    """struct v4l2_captureparm."""

    _fields_ = (
        ("capability", c_uint32),
        ("capturemode", c_uint32),
        ("timeperframe", Fraction32),
        ("extendedmode", c_uint32),
        ("readbuffers", c_uint32),
        ("reserved", c_uint32 * 4),
    )


class _ParametersUnion(Union):
    _fields_ = (("capture", CaptureParameters), ("raw_data", c_uint8 * 200))


class StreamParameters(Structure):
    """struct v4l2_streamparm."""

    _anonymous_ = ("parm",)
    _fields_ = (("type", c_uint32), ("parm", _ParametersUnion))


class Rectangle(Structure):
    """struct v4l2_rect."""

    _fields_ = (("left", c_int32), ("top", c_int32), ("width", c_uint32), ("height", c_uint32))


class Selection(Structure):
    """struct v4l2_selection."""

    _fields_ = (
        ("type", c_uint32),
        ("target", c_uint32),
        ("flags", c_uint32),
        ("r", Rectangle),
        ("reserved", c_uint32 * 9),
    )


class QueryExtendedControl(Structure):
    """struct v4l2_query_ext_ctrl."""

    _fields_ = (
        ("id", c_uint32),
        ("type", c_uint32),
        ("name", c_char * 32),
        ("minimum", c_int64),
        ("maximum", c_int64),
        ("step", c_uint64),
        ("default_value", c_int64),
        ("flags", c_uint32),
        ("elem_size", c_uint32),
        ("elems", c_uint32),
        ("nr_of_dims", c_uint32),
        ("dims", c_uint32 * 4),
        ("reserved", c_uint32 * 32),
    )


class _MenuUnion(Union):
    _pack_ = 1
    _fields_ = (("name", c_char * 32), ("value", c_int64))


class QueryMenu(Structure):
    """struct v4l2_querymenu."""

    _pack_ = 1
    _anonymous_ = ("item",)
    _fields_ = (
        ("id", c_uint32),
        ("index", c_uint32),
        ("item", _MenuUnion),
        ("reserved", c_uint32),
    )


class _ControlValue(Union):
    _pack_ = 1
    _fields_ = (("value", c_int32), ("value64", c_int64), ("pointer", ctypes.c_void_p))


class ExtendedControl(Structure):
    """struct v4l2_ext_control."""

    _pack_ = 1
    _anonymous_ = ("content",)
    _fields_ = (
        ("id", c_uint32),
        ("size", c_uint32),
        ("reserved2", c_uint32),
        ("content", _ControlValue),
    )


class ExtendedControls(Structure):
    """struct v4l2_ext_controls."""

    _fields_ = (
        ("which", c_uint32),
        ("count", c_uint32),
        ("error_idx", c_uint32),
        ("request_fd", c_int32),
        ("reserved", c_uint32),
        ("controls", ctypes.POINTER(ExtendedControl)),
    )


_WRITE, _READ = 1, 2


def _request(direction: int, number: int, argument: type) -> int:
    """Return the number of an ioctl.  <asm-generic/ioctl.h>."""
    return direction << 30 | ctypes.sizeof(argument) << 16 | ord("V") << 8 | number


VIDIOC_QUERYCAP = _request(_READ, 0, Capability)
VIDIOC_ENUM_FMT = _request(_READ | _WRITE, 2, FormatDescription)
VIDIOC_S_FMT = _request(_READ | _WRITE, 5, Format)
VIDIOC_REQBUFS = _request(_READ | _WRITE, 8, RequestBuffers)
VIDIOC_QUERYBUF = _request(_READ | _WRITE, 9, Buffer)
VIDIOC_QBUF = _request(_READ | _WRITE, 15, Buffer)
VIDIOC_DQBUF = _request(_READ | _WRITE, 17, Buffer)
VIDIOC_STREAMON = _request(_WRITE, 18, c_int32)
VIDIOC_STREAMOFF = _request(_WRITE, 19, c_int32)
VIDIOC_S_PARM = _request(_READ | _WRITE, 22, StreamParameters)
VIDIOC_QUERYMENU = _request(_READ | _WRITE, 37, QueryMenu)
VIDIOC_G_EXT_CTRLS = _request(_READ | _WRITE, 71, ExtendedControls)
VIDIOC_S_EXT_CTRLS = _request(_READ | _WRITE, 72, ExtendedControls)
VIDIOC_ENUM_FRAMESIZES = _request(_READ | _WRITE, 74, FrameSizeEnum)
VIDIOC_ENUM_FRAMEINTERVALS = _request(_READ | _WRITE, 75, FrameIntervalEnum)
VIDIOC_G_SELECTION = _request(_READ | _WRITE, 94, Selection)
VIDIOC_S_SELECTION = _request(_READ | _WRITE, 95, Selection)
VIDIOC_QUERY_EXT_CTRL = _request(_READ | _WRITE, 103, QueryExtendedControl)
