"""Whether the pictures of all cameras fit the USB buses that they hang on.

An isochronous endpoint reserves its packets for as long as it streams, whether they are full or
not; a bulk endpoint takes what is left.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.devices.usb_sysfs import read_number

HIGH_SPEED_MBIT_S, SUPER_SPEED_MBIT_S = 480.0, 5000.0
MICROFRAMES_HZ, FRAMES_HZ = 8000.0, 1000.0
MICROFRAME_BYTES, FRAME_BYTES = 7500.0, 1500.0
"""What 125 us carry at 480 Mbit/s, and 1 ms at 12 Mbit/s (USB 2.0, 5.5.4)."""

ISOCHRONOUS_SHARE = 0.8
"""The most of a bus that isochronous transfers may take together (USB 2.0, 5.6.4); Linux refuses
more (ENOSPC).  Two cameras that each reserve the most, 3 x 1024 bytes, do not fit."""

PACKET_OVERHEAD_BYTES = 38.0
"""Of an isochronous packet at high speed (USB 2.0, table 5-5)."""

BIT_STUFFING = 7.0 / 6.0
"""The longest that bytes may become on the wire, which is what is reckoned with (5.11.3)."""

HIGH_SPEED_BULK_BYTES_S = 40e6
"""Ten packets of 512 bytes a microframe: what host controllers reach of the 13 that fit (5.8.4)."""

SUPER_SPEED_BYTES_S = 400e6
"""At 5 Gbit/s: coding takes a fifth, packets and acknowledgements as much again."""

LARGEST_PACKET_BYTES = 1024

PACKET_HEADER_BYTES = 12
"""What UVC puts before the pixels of every payload (UVC 1.5, 2.4.3.3)."""

JPEG_BITS_PER_PIXEL = 2.0
"""Of infrared strips as cameras compress them; a noisy picture takes up to twice as much."""

_DESCRIPTOR_INTERFACE, _DESCRIPTOR_ENDPOINT = 4, 5
_VIDEO_CLASS, _STREAMING_SUBCLASS = 0x0E, 2
_TRANSFER_TYPE, _ISOCHRONOUS, _DIRECTION_IN = 3, 1, 0x80

BITS_PER_PIXEL = {
    "GREY": 8.0,
    "Y10": 16.0,
    "Y12": 16.0,
    "Y14": 16.0,
    "Y16": 16.0,
    "Y16-BE": 16.0,
    "Y10P": 10.0,
    "Y12P": 12.0,
    "NV12": 12.0,
    "NV21": 12.0,
    "YU12": 12.0,
    "YV12": 12.0,
    "NV24": 24.0,
    "NV42": 24.0,
    "MJPG": JPEG_BITS_PER_PIXEL,
    "JPEG": JPEG_BITS_PER_PIXEL,
}
"""By the names of V4L2; others are packed 4:2:2."""
OTHER_BITS_PER_PIXEL = 16.0


@dataclass(frozen=True, slots=True)
class Streaming:
    """How a camera sends: the payload bytes of each alternate setting in a (micro)frame.

    Empty for a camera that sends in bulk.
    """

    packet_bytes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Demand:
    """What the pictures of one camera take of its bus.

    `bytes_s` are the pictures, `share` is the part of the bus that is taken or reserved for them.
    `fits_alone` is False if none of the camera's alternate settings carries them.
    """

    node: str
    bus: int
    speed_mbit_s: float
    bytes_s: float
    share: float
    isochronous: bool
    fits_alone: bool


@dataclass(frozen=True, slots=True)
class BusLoad:
    """What all cameras of a bus take together, as a share of it."""

    bus: int
    speed_mbit_s: float
    nodes: tuple[str, ...]
    bytes_s: float
    share: float
    limit: float
    fits: bool

    @property
    def remedy(self) -> str:
        """What to change when they do not fit; empty if they do."""
        if self.fits:
            return ""
        return (
            f"the cameras of bus {self.bus} ({', '.join(self.nodes)}) need {self.share:.0%} of it, "
            f"at most {self.limit:.0%} are theirs: lower cameras.rate_hz or the size of the "
            "pictures, choose MJPG or GREY (cameras.pixel_format), or plug some of them into "
            "another bus: USB 3, or another host controller"
        )


def streaming_of(usb_device: Path) -> Streaming:
    """Return how a camera sends, by the descriptors that the kernel keeps of it."""
    try:
        descriptors = (usb_device / "descriptors").read_bytes()
    except OSError:
        return Streaming(())
    return Streaming(tuple(sorted(set(_isochronous_packets(descriptors)))))


def demand(
    node: str,
    usb_device: Path,
    pixel_format: str,
    width_px: int,
    height_px: int,
    rate_hz: float,
) -> Demand:
    """Return what pictures of this format, size and rate take of the bus."""
    speed = read_number(usb_device / "speed")
    bits = BITS_PER_PIXEL.get(pixel_format, OTHER_BITS_PER_PIXEL)
    bytes_s = width_px * height_px * rate_hz * bits / 8.0
    packets = streaming_of(usb_device).packet_bytes
    needed_bytes = bytes_s / _frames_hz(speed) + PACKET_HEADER_BYTES
    enough = [packet for packet in packets if packet >= needed_bytes]
    reserved = enough[0] if enough else max(packets, default=0)
    return Demand(
        node,
        int(read_number(usb_device / "busnum")),
        speed,
        bytes_s,
        _reserved_share(reserved, speed) if packets else _bulk_share(bytes_s, speed),
        bool(packets),
        fits_alone=bool(enough) or not packets,
    )


def bus_loads(demands: Sequence[Demand]) -> tuple[BusLoad, ...]:
    """Return the load of every bus that has a camera; USB 2 and USB 3 have buses of their own."""
    return tuple(
        _load(bus, [one for one in demands if one.bus == bus])
        for bus in sorted({one.bus for one in demands})
    )


def _load(bus: int, demands: Sequence[Demand]) -> BusLoad:
    share = sum(one.share for one in demands)
    reserved = sum(one.share for one in demands if one.isochronous)
    limit = ISOCHRONOUS_SHARE if reserved else 1.0
    fits = share <= 1.0 and reserved <= ISOCHRONOUS_SHARE
    return BusLoad(
        bus,
        max(one.speed_mbit_s for one in demands),
        tuple(one.node for one in demands),
        sum(one.bytes_s for one in demands),
        share,
        limit,
        fits and all(one.fits_alone for one in demands),
    )


def _frames_hz(speed_mbit_s: float) -> float:
    return MICROFRAMES_HZ if speed_mbit_s >= HIGH_SPEED_MBIT_S else FRAMES_HZ


def _reserved_share(packet_bytes: int, speed_mbit_s: float) -> float:
    """Return the share of a bus that payloads of so many bytes a (micro)frame reserve."""
    if speed_mbit_s >= SUPER_SPEED_MBIT_S:
        return _bulk_share(packet_bytes * MICROFRAMES_HZ, speed_mbit_s)
    packets = -(-packet_bytes // LARGEST_PACKET_BYTES)
    on_the_wire = packet_bytes * BIT_STUFFING + packets * PACKET_OVERHEAD_BYTES
    return on_the_wire / (MICROFRAME_BYTES if speed_mbit_s >= HIGH_SPEED_MBIT_S else FRAME_BYTES)


def _bulk_share(bytes_s: float, speed_mbit_s: float) -> float:
    if speed_mbit_s >= SUPER_SPEED_MBIT_S:
        return bytes_s / (SUPER_SPEED_BYTES_S * speed_mbit_s / SUPER_SPEED_MBIT_S)
    if speed_mbit_s >= HIGH_SPEED_MBIT_S:
        return bytes_s / HIGH_SPEED_BULK_BYTES_S
    return bytes_s / (FRAMES_HZ * FRAME_BYTES)


def _isochronous_packets(descriptors: bytes) -> Iterator[int]:
    """Yield the payload of every isochronous endpoint of the streaming interfaces."""
    streams = False
    for kind, body in _each(descriptors):
        if kind == _DESCRIPTOR_INTERFACE and len(body) >= 9:
            streams = (body[5], body[6]) == (_VIDEO_CLASS, _STREAMING_SUBCLASS)
        elif kind == _DESCRIPTOR_ENDPOINT and streams and len(body) >= 7:
            arrives, transfer = body[2] & _DIRECTION_IN, body[3] & _TRANSFER_TYPE
            if arrives and transfer == _ISOCHRONOUS:
                packet = body[4] | body[5] << 8
                # Bits 12..11 are the further packets in a microframe (USB 2.0, 9.6.6).
                yield (packet & 0x7FF) * (1 + (packet >> 11 & 3))


def _each(descriptors: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield type and bytes of every descriptor; one that is cut off ends them."""
    at = 0
    while at + 2 <= len(descriptors) and descriptors[at] >= 2:
        body = descriptors[at : at + descriptors[at]]
        if len(body) == descriptors[at]:
            yield body[1], body
        at += descriptors[at]
