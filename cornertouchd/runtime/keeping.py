"""The pictures of the last moments, kept in memory for whoever asks what just happened."""

import contextlib
import logging
import mmap
from collections.abc import Iterator, Mapping
from math import ceil

import numpy as np

from cornertouchd.model import Frame, PictureFormat

_log = logging.getLogger("cornertouchd")

MARGIN_S = 0.5
"""Kept beyond what is promised: whoever asks for all of it begins while the oldest are replaced."""

FEWEST_PICTURES = 4
"""Kept of each camera in any case: the newest can be looked at while the next one comes."""

LIT_UNKNOWN = 255
"""In place of a lit mask that is not known; masks have four bits."""

MEGABYTE = 2**20


class KeptPictures:
    """A ring of the newest pictures of one camera, numbered from 0 by their coming.

    Guarantees: `put` waits for nobody.  Assumes one thread that puts; any may read, and is told
    when a picture was replaced while he read it.
    """

    def __init__(self, camera: str, form: PictureFormat, pictures: int) -> None:
        self.format = form
        self._camera = camera
        # The system gives a page of it when it is first written.  Huge pages, which numpy asks for,
        # would stop the camera each for as long as 2 MiB take to be cleared.
        memory = mmap.mmap(
            -1, pictures * form.rows_px * form.width_px, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
        )
        with contextlib.suppress(OSError):  # a kernel without them
            memory.madvise(mmap.MADV_NOHUGEPAGE)
        self._pixels = np.frombuffer(memory, np.uint8).reshape(
            pictures, form.rows_px, form.width_px
        )
        self._sequence = np.zeros(pictures, np.int64)
        self._captured_at_s = np.zeros(pictures, np.float64)
        self._lit_mask = np.full(pictures, LIT_UNKNOWN, np.uint8)
        self._count = 0

    @property
    def count(self) -> int:
        """How many came so far; the number of the next one."""
        return self._count

    @property
    def oldest(self) -> int:
        """The number of the oldest picture that is safe: the one before may be replaced now."""
        return max(0, self._count - len(self._pixels) + 1)

    def put(self, frame: Frame) -> None:
        """Keep a copy of a picture, unless it has another size: no recording could hold it."""
        slot = self._count % len(self._pixels)
        if frame.pixels.shape != self._pixels.shape[1:]:
            return
        np.copyto(self._pixels[slot], frame.pixels)
        self._sequence[slot] = frame.sequence
        self._captured_at_s[slot] = frame.captured_at_s
        self._lit_mask[slot] = LIT_UNKNOWN if frame.lit_mask is None else frame.lit_mask
        self._count += 1  # last: what is counted is whole

    def captured_at_s(self, number: int) -> float:
        """Return when a picture was taken; anything if it was replaced meanwhile."""
        return float(self._captured_at_s[number % len(self._pixels)])

    def read(self, number: int) -> Frame | None:
        """Return a copy of a picture; None if it has been replaced, or has not come."""
        if not self.oldest <= number < self._count:
            return None
        slot = number % len(self._pixels)
        lit_mask = int(self._lit_mask[slot])
        frame = Frame(
            self._camera,
            int(self._sequence[slot]),
            float(self._captured_at_s[slot]),
            None if lit_mask == LIT_UNKNOWN else lit_mask,
            self._pixels[slot].copy(),
        )
        return frame if number >= self.oldest else None


class Keeping:
    """Keeps the newest pictures of all cameras: of `keep_s`, but in `keep_mb` megabytes at most.

    `put` is for the capture threads, each with pictures of its own camera; the rest for any.
    """

    def __init__(
        self, formats: Mapping[str, PictureFormat], rate_hz: float, keep_s: float, keep_mb: float
    ) -> None:
        bytes_a_set = sum(form.rows_px * form.width_px for form in formats.values())
        fitting = int(keep_mb * MEGABYTE // max(bytes_a_set, 1))
        wanted = ceil((keep_s + MARGIN_S) * rate_hz) + 1 if keep_s else 0
        pictures = max(FEWEST_PICTURES, min(wanted, fitting))
        self.seconds = max(0.0, min(keep_s, (pictures - 1) / rate_hz - MARGIN_S))
        if wanted > fitting:
            _log.warning(
                "the pictures of the last %.1f s are kept, not of %g s: monitor.keep_mb = %g is "
                "full then",
                self.seconds,
                keep_s,
                keep_mb,
            )
        self._cameras = {
            camera: KeptPictures(camera, form, pictures) for camera, form in formats.items()
        }

    @property
    def cameras(self) -> Mapping[str, KeptPictures]:
        """What is kept of each camera."""
        return self._cameras

    def put(self, frame: Frame) -> None:
        """Keep a copy of a picture, unless it has another size than its camera's pictures."""
        self._cameras[frame.camera].put(frame)

    def latest(self, camera: str) -> Frame | None:
        """Return a copy of the newest picture of a camera; None if it gave none."""
        kept = self._cameras[camera]
        while kept.count:
            frame = kept.read(kept.count - 1)
            if frame is not None:
                return frame
        return None

    def giving(self, seconds: float) -> tuple[str, ...]:
        """Return the cameras that gave a picture in the last seconds."""
        since_s = self.newest_s - seconds
        return tuple(
            camera
            for camera, kept in self._cameras.items()
            if kept.count and kept.captured_at_s(kept.count - 1) >= since_s
        )

    @property
    def newest_s(self) -> float:
        """When the newest picture was taken; 0 if there is none."""
        return max(
            (kept.captured_at_s(kept.count - 1) for kept in self._cameras.values() if kept.count),
            default=0.0,
        )

    def last(self, seconds: float) -> Iterator[Frame]:
        """Yield the pictures of the last seconds that are kept, in the order they were taken."""
        return KeptReader(self, seconds).pending()


class KeptReader:
    """Reads what is kept from `last_s` before the newest picture on, and what comes after that.

    Used by one thread.  Pictures that were replaced before they were read are counted in `missing`.
    """

    def __init__(self, keeping: Keeping, last_s: float) -> None:
        self._cameras = keeping.cameras
        since_s = keeping.newest_s - min(last_s, keeping.seconds)
        self._next = {camera: _first_since(kept, since_s) for camera, kept in self._cameras.items()}
        self.missing = 0

    def pending(self) -> Iterator[Frame]:
        """Yield the pictures that have come until now, in the order they were taken."""
        until = {camera: kept.count for camera, kept in self._cameras.items()}
        while left := [camera for camera, end in until.items() if self._next[camera] < end]:
            camera = min(left, key=self._captured_at_s)
            kept, number = self._cameras[camera], self._next[camera]
            frame = kept.read(number)
            if frame is None:
                self._next[camera] = max(number + 1, kept.oldest)
                self.missing += self._next[camera] - number
            else:
                self._next[camera] = number + 1
                yield frame

    def _captured_at_s(self, camera: str) -> float:
        return self._cameras[camera].captured_at_s(self._next[camera])


def _first_since(kept: KeptPictures, since_s: float) -> int:
    """Return the number of the first picture that was taken at this time or later."""
    number = kept.count
    while number > kept.oldest and kept.captured_at_s(number - 1) >= since_s:
        number -= 1
    return number
