"""TUIO 1.1 out, profile 2Dblb: the same touches, with the size of what touches.

Specification: https://www.tuio.org/?specification.  A blob has the session id of its cursor, and
its bundle the frame number of the cursors' bundle.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from cornertouchd.model import TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import MAX_PAYLOAD_BYTES, REDUNDANT_FSEQ, Cursor
from cornertouchd.wire.tuio_split import split_frame

Profile = Literal["2Dcur", "2Dblb"]

_ADDRESS = b"/tuio/2Dblb\0"
_IMMEDIATELY = b"#bundle\0" + struct.pack(">Q", 1)
_SET_START = struct.pack(">i", 80) + _ADDRESS + b",sifffffffffff\0\0set\0"
_SET = struct.Struct(f">{len(_SET_START)}si11f")
_FSEQ_START = struct.pack(">i", 28) + _ADDRESS + b",si\0fseq\0\0\0\0"
_FSEQ = struct.Struct(f">{len(_FSEQ_START)}si")


class Blob(NamedTuple):
    """One contact on the wire, in the order of a set message.

    `x`, `y` are 0..1; `width` and `height` are shares of the picture's, `area` of its area;
    `angle_rad` is how the ellipse is turned.  Speeds and accelerations as those of `Cursor`.
    """

    id: int
    x: float
    y: float
    angle_rad: float
    width: float
    height: float
    area: float
    x_speed: float
    y_speed: float
    rotation_speed: float
    acceleration: float
    rotation_acceleration: float


class BlobEncoder:
    """Writes the bundles of one source, whose name a `BundleEncoder` has taken."""

    def __init__(self, source: str) -> None:
        name = _osc_string(source.encode("ascii"))
        self._head = _IMMEDIATELY + _element(b",ss\0source\0\0" + name)

    def encode(self, alive: Sequence[int], blobs: Sequence[Blob], fseq: int) -> bytes:
        """Return one bundle."""
        ids = struct.pack(f">{len(alive)}i", *alive)
        return b"".join(
            (
                self._head,
                _element(_osc_string(b",s" + b"i" * len(alive)) + b"alive\0\0\0" + ids),
                *(_SET.pack(_SET_START, *blob) for blob in blobs),
                _FSEQ.pack(_FSEQ_START, fseq),
            )
        )

    def size_bytes(self, alive_count: int, blob_count: int) -> int:
        """Return the length of the bundle that `encode` makes."""
        tags = alive_count + 6 - (alive_count + 2) % 4
        alive = 4 + len(_ADDRESS) + tags + 8 + 4 * alive_count
        return len(self._head) + alive + blob_count * _SET.size + _FSEQ.size


class BlobTelling:
    """What one display's clients are told as blobs, beside what they are told as cursors.

    Where a touch is and how it moves is taken from its cursor, so that both always agree.  Contacts
    are located as circles: their angle is 0.
    """

    def __init__(self, mapping: DisplayMapping, source: str) -> None:
        self._picture_mm = mapping.picture_mm
        self._encoder = BlobEncoder(source)
        self._known: dict[int, Blob] = {}  # what was told last, by the touch's own id
        self._told_fseq = REDUNDANT_FSEQ

    def frame(self, frame: TouchFrame, cursors: Mapping[int, Cursor], fseq: int) -> list[bytes]:
        """Return the bundles that tell `frame`, of which `cursors` were told by touch."""
        before = self._known
        self._told_fseq = fseq
        self._known = {
            touch.id: self._blob(cursors[touch.id], touch.diameter_mm)
            for touch in frame.touches
            if touch.id in cursors
        }
        continuing = [blob for key, blob in self._known.items() if key in before]
        new = [blob for key, blob in self._known.items() if key not in before]
        return self._split(continuing, new)

    def full_state(self) -> list[bytes]:
        """Return bundles that repeat what was told last, marked as redundant."""
        self._told_fseq = REDUNDANT_FSEQ
        return self._split(list(self._known.values()), [])

    def empty(self) -> bytes:
        """Forget all touches and return the bundle that says so."""
        self._known = {}
        self._told_fseq = REDUNDANT_FSEQ
        return self.whole()

    def whole(self) -> bytes:
        """Return what was told last as one bundle, however large: for streams."""
        blobs = tuple(self._known.values())
        return self._encoder.encode([blob.id for blob in blobs], blobs, self._told_fseq)

    def _split(self, continuing: Sequence[Blob], new: Sequence[Blob]) -> list[bytes]:
        return list(split_frame(self._encoder, continuing, new, self._told_fseq, MAX_PAYLOAD_BYTES))

    def _blob(self, cursor: Cursor, diameter_mm: float) -> Blob:
        picture_width_mm, picture_height_mm = self._picture_mm
        size_mm = diameter_mm if math.isfinite(diameter_mm) else 0.0
        width = min(max(size_mm / picture_width_mm, 0.0), 1.0)
        height = min(max(size_mm / picture_height_mm, 0.0), 1.0)
        return Blob(
            cursor.id,
            cursor.x,
            cursor.y,
            0.0,
            width,
            height,
            0.25 * math.pi * width * height,
            cursor.x_speed,
            cursor.y_speed,
            0.0,
            cursor.acceleration,
            0.0,
        )


def _osc_string(text: bytes) -> bytes:
    """Return a string as OSC has it: ended by one to four zeros, a multiple of four bytes."""
    return text + b"\0" * (4 - len(text) % 4)


def _element(arguments: bytes) -> bytes:
    """Return a bundle element: a message of this profile after its length."""
    return struct.pack(">i", len(_ADDRESS) + len(arguments)) + _ADDRESS + arguments
