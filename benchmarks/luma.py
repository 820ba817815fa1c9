"""What it costs to get the strip out of a V4L2 buffer, format by format.

    python benchmarks/luma.py [--rows N] [--pictures N]

Buffers are in memory, as the driver fills them; JPEGs show a strip before a noisy dark surrounding.
"""

import argparse
import time
from collections.abc import Callable

import cv2
import numpy as np

from cornertouchd.devices.luma import PACKINGS, LumaReader
from cornertouchd.devices.mjpeg import MjpegReader
from cornertouchd.devices.turbojpeg import load_turbojpeg
from cornertouchd.devices.v4l2_device import Layout

WIDTH, HEIGHT = 640, 480
QUALITIES = (50, 75, 90)
SHOWN = ("GREY", "Y10", "Y16", "Y10P", "YUYV", "NV12")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rows", type=int, default=64)
    parser.add_argument("--pictures", type=int, default=500)
    given = parser.parse_args()
    first = (HEIGHT - given.rows) // 2
    print(f"{WIDTH}x{HEIGHT}, {given.rows} rows from row {first} on; median of {given.pictures}\n")
    print("| format | bytes | us a picture |")
    print("|---|---:|---:|")
    for name in SHOWN:
        packing = PACKINGS[name]
        line_bytes = WIDTH * packing.bytes // packing.pixels
        buffer = np.zeros(line_bytes * HEIGHT, np.uint8)
        layout = Layout(name, WIDTH, HEIGHT, line_bytes, len(buffer))
        reader = LumaReader(layout, first, given.rows)
        tell(name, len(buffer), given.pictures, lambda r=reader, b=buffer: r.read(b, len(b)))
    for quality in QUALITIES:
        jpeg = picture(quality, first, given.rows)
        layout = Layout("MJPG", WIDTH, HEIGHT, 0, len(jpeg))
        turbojpeg = load_turbojpeg()
        ways = {"TurboJPEG 3": turbojpeg} if turbojpeg else {}
        for way, library in (ways | {"simplejpeg": None}).items():
            reader = MjpegReader(layout, first, given.rows, library)
            name = f"MJPG, quality {quality}, {way}"
            tell(name, len(jpeg), given.pictures, lambda r=reader, j=jpeg: r.read(j, len(j)))


def picture(quality: int, first: int, rows: int) -> np.ndarray:
    """Return a JPEG, 4:2:2 as cameras send it."""
    noise = np.random.default_rng(1)
    grey = np.clip(noise.normal(20, 4, (HEIGHT, WIDTH)), 0, 255).astype(np.uint8)
    strip = 200 - np.abs(np.linspace(-180, 180, rows))[:, None]
    grey[first : first + rows] = np.clip(noise.normal(strip, 4, (rows, WIDTH)), 0, 255)
    options = (cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, 0x211111)
    _, jpeg = cv2.imencode(".jpg", cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), options)
    return jpeg


def tell(name: str, size: int, pictures: int, read: Callable[[], object]) -> None:
    times_s = []
    for _ in range(pictures):
        start_s = time.perf_counter()
        assert read() is not None
        times_s.append(time.perf_counter() - start_s)
    print(f"| {name} | {size} | {1e6 * float(np.median(times_s)):.0f} |")


if __name__ == "__main__":
    cv2.setNumThreads(1)
    main()
