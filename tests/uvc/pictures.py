"""The pictures that simulated cameras show, and how USB cameras pack them."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]


class PictureLoop:
    """Pictures (N, height_px, width_px) of one camera, from a .npy file, again and again."""

    def __init__(self, path: Path) -> None:
        self._pictures = np.load(path, mmap_mode="r")
        self._first, self._count = 0, len(self._pictures)
        self._packed = _unpacked_jpegs(path)

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        _, height_px, width_px = self._pictures.shape
        return width_px, height_px

    def picture(self, number: int) -> Picture:
        """Return a picture of the loop."""
        return np.asarray(self._pictures[self._place(number)])

    def packed(self, number: int, form: str) -> bytes:
        """Return a picture of the loop as this format has it."""
        if form == "MJPG" and self._packed:
            return self._packed[self._place(number)]
        return PACKERS[form](self.picture(number))

    def _place(self, number: int) -> int:
        return self._first + number % self._count

    def show_only(self, first: int, count: int) -> None:
        """Let these pictures be the loop."""
        self._first, self._count = first, count


def save_jpegs(path: Path) -> None:
    """Compress the pictures of a .npy file ahead of time: it would take a slow guest too long."""
    jpegs = [packed_mjpg(picture) for picture in np.load(path, mmap_mode="r")]
    np.savez(
        path.with_suffix(".npz"),
        ends=np.cumsum([len(one) for one in jpegs]),
        data=np.frombuffer(b"".join(jpegs), np.uint8),
    )


def _unpacked_jpegs(path: Path) -> list[bytes]:
    """Return what `save_jpegs` saved; nothing if it did not."""
    saved = path.with_suffix(".npz")
    if not saved.exists():
        return []
    with np.load(saved) as jpegs:
        return [one.tobytes() for one in np.split(jpegs["data"], jpegs["ends"][:-1])]


def noise(shape: tuple[int, ...], number: int) -> Picture:
    """Return a picture that shows nothing but noise."""
    return np.random.default_rng(number).integers(0, 256, shape, np.uint8)


def packed_grey(picture: Picture) -> bytes:
    """Return a picture as the format GREY has it."""
    return picture.tobytes()


def packed_yuyv(picture: Picture) -> bytes:
    """Return a picture as YUYV has it: brightness and, in between, no colour."""
    packed = np.full((*picture.shape, 2), 128, np.uint8)
    packed[..., 0] = picture
    return packed.tobytes()


def packed_mjpg(picture: Picture) -> bytes:
    """Return a picture as a JPEG of its own, good enough to see edges in."""
    done, coded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 90])
    assert done
    return coded.tobytes()


PACKERS: dict[str, Callable[[Picture], bytes]] = {
    "GREY": packed_grey,
    "YUYV": packed_yuyv,
    "MJPG": packed_mjpg,
}
