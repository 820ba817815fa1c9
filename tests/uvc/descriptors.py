"""What a simulated camera says about itself: descriptors of USB 3.2 and USB Video Class 1.1.

One configuration with a control interface (camera terminal, processing unit, output) and a
streaming interface with one bulk endpoint.  Bulk, because USB/IP carries it at any size.
"""

import struct
from dataclasses import dataclass

VENDOR, PRODUCT = 0x1D6B, 0xCA40
CAMERA_TERMINAL, PROCESSING_UNIT, OUTPUT_TERMINAL = 1, 2, 3
BULK_ENDPOINT = 1
CLOCK_HZ = 48_000_000
PAYLOAD_HEADER_BYTES = 12

DEVICE, CONFIGURATION, STRING, INTERFACE, ENDPOINT = 1, 2, 3, 4, 5
ASSOCIATION, STORE, CLASS_INTERFACE, COMPANION = 0x0B, 0x0F, 0x24, 0x30
UNCOMPRESSED, UNCOMPRESSED_FRAME, MJPEG, MJPEG_FRAME = 4, 5, 6, 7
GUID_TAIL = bytes.fromhex("00001000800000aa00389b71")


@dataclass(frozen=True, slots=True)
class Control:
    """A number of the camera that can be set; little-endian in `size` bytes."""

    size: int
    least: int
    most: int
    step: int
    default: int


CONTROLS = {
    (CAMERA_TERMINAL, 2): Control(1, 1, 8, 1 | 8, 8),  # exposure mode; the step lists the modes
    (CAMERA_TERMINAL, 4): Control(4, 1, 10_000, 1, 156),  # exposure time, 100 us
    (PROCESSING_UNIT, 2): Control(2, 0, 255, 1, 128),  # brightness
    (PROCESSING_UNIT, 4): Control(2, 0, 127, 1, 32),  # gain
    (PROCESSING_UNIT, 5): Control(1, 0, 2, 1, 1),  # power line frequency
}
"""By unit and selector; UVC 1.1, tables A-12 and A-13."""
TERMINAL_CONTROLS = 1 << 1 | 1 << 3
UNIT_CONTROLS = 1 << 0 | 1 << 9 | 1 << 10


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """How the camera packs a picture; `guid` is empty for JPEG."""

    name: str
    guid: bytes
    bytes_per_pixel: int


FORMATS = (
    PixelFormat("GREY", b"Y800" + GUID_TAIL, 1),
    PixelFormat("YUYV", b"YUY2" + GUID_TAIL, 2),
    PixelFormat("MJPG", b"", 2),
)
"""In the order of their numbers, from 1."""


@dataclass(frozen=True, slots=True)
class CameraKind:
    """One camera: its serial number, the size of its pictures and the rates that it offers."""

    serial: str
    width_px: int
    height_px: int
    rates_hz: tuple[float, ...]

    @property
    def intervals(self) -> tuple[int, ...]:
        """Times between pictures, in 100 ns."""
        return tuple(round(1e7 / rate_hz) for rate_hz in self.rates_hz)

    def picture_bytes(self, number: int) -> int:
        """Return the size of a whole picture in format `number`; of a JPEG, the largest."""
        return self.width_px * self.height_px * FORMATS[number - 1].bytes_per_pixel

    def descriptor(self, kind: int, number: int) -> bytes | None:
        """Return a descriptor, None for those that the camera does not have."""
        if kind == DEVICE:
            head = struct.pack("<H4BHHH", 0x320, 0xEF, 2, 1, 9, VENDOR, PRODUCT, 0x100)
            return _descriptor(DEVICE, head + bytes([1, 2, 3, 1]))
        if kind == CONFIGURATION:
            return self._configuration()
        if kind == STORE:
            usb2 = _descriptor(0x10, b"\x02" + struct.pack("<I", 2))
            usb3 = _descriptor(0x10, struct.pack("<BBHBBH", 3, 0, 0xC, 3, 0, 0))
            return _descriptor(STORE, struct.pack("<HB", 5 + len(usb2 + usb3), 2)) + usb2 + usb3
        if kind == STRING and number == 0:
            return _descriptor(STRING, struct.pack("<H", 0x409))
        if kind == STRING and number <= 3:
            text = ("cornertouchd", "simulated camera", self.serial)[number - 1]
            return _descriptor(STRING, text.encode("utf-16le"))
        return None

    def _configuration(self) -> bytes:
        body = _descriptor(ASSOCIATION, bytes([0, 2, 0x0E, 3, 0, 0]))
        body += self._control_interface() + self._streaming_interface()
        head = struct.pack("<H5B", 9 + len(body), 2, 1, 0, 0x80, 50)
        return _descriptor(CONFIGURATION, head) + body

    def _control_interface(self) -> bytes:
        terminal = struct.pack("<BBHBBHHHB", 2, CAMERA_TERMINAL, 0x201, 0, 0, 0, 0, 0, 3)
        terminal += TERMINAL_CONTROLS.to_bytes(3, "little")
        unit = struct.pack("<BBBHB", 5, PROCESSING_UNIT, CAMERA_TERMINAL, 0, 2)
        unit += UNIT_CONTROLS.to_bytes(2, "little") + bytes([0, 0])
        output = struct.pack("<BBHBBB", 3, OUTPUT_TERMINAL, 0x101, 0, PROCESSING_UNIT, 0)
        units = b"".join(_descriptor(CLASS_INTERFACE, one) for one in (terminal, unit, output))
        head = struct.pack("<BHHIBB", 1, 0x110, 13 + len(units), CLOCK_HZ, 1, 1)
        interface = _descriptor(INTERFACE, bytes([0, 0, 0, 0x0E, 1, 0, 0]))
        return interface + _descriptor(CLASS_INTERFACE, head) + units

    def _streaming_interface(self) -> bytes:
        formats = b"".join(self._format(number) for number in range(1, len(FORMATS) + 1))
        count, size = len(FORMATS), 13 + len(FORMATS) + len(formats)
        head = struct.pack("<BBHBBBBBBB", 1, count, size, 0x81, 0, OUTPUT_TERMINAL, 0, 0, 0, 1)
        endpoint = struct.pack("<BBHB", 0x80 | BULK_ENDPOINT, 2, 1024, 0)
        return b"".join(
            (
                _descriptor(INTERFACE, bytes([1, 0, 1, 0x0E, 2, 0, 0])),
                _descriptor(CLASS_INTERFACE, head + bytes(count)),
                formats,
                _descriptor(ENDPOINT, endpoint),
                _descriptor(COMPANION, bytes([15, 0, 0, 0])),
            )
        )

    def _format(self, number: int) -> bytes:
        how = FORMATS[number - 1]
        if how.guid:
            tail = bytes([8 * how.bytes_per_pixel, 1, 0, 0, 0, 0])
            described = bytes([UNCOMPRESSED, number, 1]) + how.guid + tail
        else:
            described = bytes([MJPEG, number, 1, 0, 1, 0, 0, 0, 0])
        size = self.picture_bytes(number)
        fastest, slowest = (
            round(8 * size * max(self.rates_hz)),
            round(8 * size * min(self.rates_hz)),
        )
        frame = struct.pack(
            f"<BBBHHIIIIB{len(self.intervals)}I",
            UNCOMPRESSED_FRAME if how.guid else MJPEG_FRAME,
            1,
            0,
            self.width_px,
            self.height_px,
            slowest,
            fastest,
            size,
            self.intervals[0],
            len(self.intervals),
            *self.intervals,
        )
        return _descriptor(CLASS_INTERFACE, described) + _descriptor(CLASS_INTERFACE, frame)

    def negotiated(self, number: int, interval: int) -> bytes:
        """Return what the camera offers in a probe: UVC 1.1, table 4-75."""
        number = number if 1 <= number <= len(FORMATS) else 1
        interval = interval if interval in self.intervals else self.intervals[0]
        size = self.picture_bytes(number)
        payload = size + PAYLOAD_HEADER_BYTES
        return struct.pack(
            "<HBBIHHHHHIIIBBBB", 1, number, 1, interval, 0, 0, 0, 0, 0, size, payload, CLOCK_HZ,
            0, 0, 0, 0,
        )  # fmt: skip


def _descriptor(kind: int, body: bytes) -> bytes:
    return bytes([len(body) + 2, kind]) + body
