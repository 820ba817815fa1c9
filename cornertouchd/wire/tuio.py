"""TUIO 1.1 out: touches become bundles of the 2Dcur profile.

Specification: https://www.tuio.org/?specification.  A bundle is source, alive, set*, fseq with the
time tag "immediately".  Every bundle of a frame is complete in itself: it names all contacts that a
client may keep, and no contact before the bundle that first sets it, so that a client which draws
at every fseq shows neither gaps nor ghosts, whichever packets it lost.
"""

import hashlib
import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from typing import NamedTuple

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio_split import split_frame

# The largest UDP payload that crosses an Ethernet in one piece: 1500 less 40 (IPv6) and 8 (UDP).
MAX_PAYLOAD_BYTES = 1452
# So many ids and one contact fit a bundle with the longest source name; far beyond what is tracked.
MAX_CURSORS = 200
MAX_SOURCE_BYTES = 200
# Marks a bundle that repeats what is known already.
REDUNDANT_FSEQ = -1

_INT32_COUNT = 2**31
_MAX_FLOAT32 = (2.0 - 2.0**-23) * 2.0**127
_ADDRESS = b"/tuio/2Dcur\0"
_IMMEDIATELY = b"#bundle\0" + struct.pack(">Q", 1)
_SET_START = struct.pack(">i", 52) + _ADDRESS + b",sifffff\0\0\0\0set\0"
_SET = f"{len(_SET_START)}sifffff"
_SET_BYTES = struct.calcsize(f">{_SET}")
_FSEQ_START = struct.pack(">i", 28) + _ADDRESS + b",si\0fseq\0\0\0\0"
_FSEQ = struct.Struct(f">{len(_FSEQ_START)}si")


class Cursor(NamedTuple):
    """One contact on the wire, in the order of a set message.

    `x`, `y` are 0..1; `x_speed`, `y_speed` axis lengths per second; `acceleration` the change of
    speed per second.  A tuple, since it is packed as it is, a thousand times a second.
    """

    id: int
    x: float
    y: float
    x_speed: float
    y_speed: float
    acceleration: float


class BundleEncoder:
    """Writes the bundles of one source.

    `source` is name@address, ASCII, at most 200 bytes.  Raises `ValueError` for another.
    """

    def __init__(self, source: str) -> None:
        name, at, address = source.partition("@")
        if not (name and at and address and source.isascii() and source.isprintable()):
            raise ValueError(f"TUIO source {source!r} must be name@address in printable ASCII")
        if len(source) > MAX_SOURCE_BYTES:
            raise ValueError(
                f"TUIO source has {len(source)} bytes, at most {MAX_SOURCE_BYTES}; shorten it"
            )
        self._head = _IMMEDIATELY + _element(b",ss\0source\0\0" + _padded(source.encode("ascii")))

    def encode(self, alive: Sequence[int], cursors: Sequence[Cursor], fseq: int) -> bytes:
        """Return one bundle; ids and `fseq` must fit int32, the floats float32 (NaN is not kept).

        Raises `struct.error` or `OverflowError` for a number that does not fit.
        """
        alive_start, alive_layout = _alive_message(len(alive))
        values: list[bytes | float] = []
        for cursor in cursors:
            values.append(_SET_START)
            values += cursor
        return b"".join(
            (
                self._head,
                alive_start,
                alive_layout.pack(*alive),
                _set_messages(len(cursors)).pack(*values),
                _FSEQ.pack(_FSEQ_START, fseq),
            )
        )

    def size_bytes(self, alive_count: int, cursor_count: int) -> int:
        """Return the length of the bundle that `encode` makes."""
        tags = alive_count + 6 - (alive_count + 2) % 4
        alive = 4 + len(_ADDRESS) + tags + 8 + 4 * alive_count
        return len(self._head) + alive + cursor_count * _SET_BYTES + _FSEQ.size


class TuioSession:
    """What one display's clients are told: mapped contacts, their ids and the frame numbers.

    `fseq_seed` and `id_seed` are taken modulo 2^31; they must move forward from one start of the
    program to the next (`seed_at`), since clients drop frames up to 100 behind the last one.  A
    touch that is not on the display is not told, and has a new id when it comes back.  Touches with
    a coordinate that is not finite, and those beyond 200, are left out and counted.
    """

    def __init__(self, mapping: DisplayMapping, source: str, fseq_seed: int, id_seed: int) -> None:
        self._mapping = mapping
        self._encoder = BundleEncoder(source)
        self._fseq = fseq_seed % _INT32_COUNT
        self._next_id = id_seed % _INT32_COUNT
        self._known: dict[int, Cursor] = {}  # what was told last, by the touch's own id
        self._told_fseq = REDUNDANT_FSEQ
        self._captured_at_s = math.nan
        self._left_out = 0

    @property
    def has_contacts(self) -> bool:
        """Whether clients were last told of any contact."""
        return bool(self._known)

    @property
    def told(self) -> Mapping[int, Cursor]:
        """What clients were told last, by the touch's own id."""
        return self._known

    @property
    def told_fseq(self) -> int:
        """Under which frame number they were told it."""
        return self._told_fseq

    @property
    def left_out(self) -> int:
        """How many touches were not told because they were not finite or too many."""
        return self._left_out

    def frame(self, frame: TouchFrame) -> list[bytes]:
        """Return the bundles that tell `frame`, all under one frame number.

        None at all if there was no contact and is none: a repeat of `full_state` tells that.
        """
        elapsed_s = frame.captured_at_s - self._captured_at_s
        if math.isfinite(frame.captured_at_s):
            self._captured_at_s = frame.captured_at_s
        before = self._known
        shown = self._on_display(frame.touches)
        self._known = {
            touch_id: self._advance(touch, before.get(touch_id), elapsed_s)
            for touch_id, touch in shown.items()
        }
        if not before and not self._known:
            return []
        if self._known.keys() == before.keys():  # as nearly always
            continuing, new = list(self._known.values()), []
        else:
            continuing = [cursor for key, cursor in self._known.items() if key in before]
            new = [cursor for key, cursor in self._known.items() if key not in before]
        fseq = self._fseq
        self._fseq = (fseq + 1) % _INT32_COUNT
        self._told_fseq = fseq
        return list(self._bundles(continuing, new, fseq))

    def full_state(self) -> list[bytes]:
        """Return bundles that repeat what was told last, marked as redundant."""
        self._told_fseq = REDUNDANT_FSEQ
        return list(self._bundles(list(self._known.values()), [], REDUNDANT_FSEQ))

    def empty(self) -> bytes:
        """Forget all touches and return the bundle that says so, never dropped as late."""
        self._known = {}
        self._told_fseq = REDUNDANT_FSEQ
        return self.whole()

    def whole(self) -> bytes:
        """Return what was told last as one bundle, however large: for streams."""
        cursors = tuple(self._known.values())
        return self._encoder.encode([cursor.id for cursor in cursors], cursors, self._told_fseq)

    def _on_display(self, touches: tuple[Touch, ...]) -> dict[int, Touch]:
        """Return the touches to tell by their id; those known already come first if too many."""
        shown = {}
        contains, isfinite = self._mapping.contains, math.isfinite
        for touch in touches:
            touch_id, x_mm, y_mm, vx_mm_s, vy_mm_s = touch[:5]
            # the sum of finite numbers is finite, but for the very largest
            if not isfinite(x_mm + y_mm + vx_mm_s + vy_mm_s) and not all(map(isfinite, touch[1:5])):
                self._left_out += 1
            elif contains(x_mm, y_mm):
                shown[touch_id] = touch
        if len(shown) <= MAX_CURSORS:
            return shown
        self._left_out += len(shown) - MAX_CURSORS
        known_first = sorted(shown, key=lambda touch_id: touch_id not in self._known)
        return {touch_id: shown[touch_id] for touch_id in known_first[:MAX_CURSORS]}

    def _advance(self, touch: Touch, before: Cursor | None, elapsed_s: float) -> Cursor:
        """Return what to tell of a touch, given what was told of it `elapsed_s` ago."""
        _, x_mm, y_mm, vx_mm_s, vy_mm_s = touch[:5]
        x, y = self._mapping.to_display(x_mm, y_mm)
        x_speed, y_speed = self._mapping.velocity_to_display(vx_mm_s, vy_mm_s, x_mm, y_mm)
        if abs(x_speed) + abs(y_speed) > _MAX_FLOAT32:
            x_speed, y_speed = _to_float32(x_speed), _to_float32(y_speed)
        if before is None:
            session_id = self._next_id
            self._next_id = (session_id + 1) % _INT32_COUNT
            return Cursor(session_id, x, y, x_speed, y_speed, 0.0)
        acceleration = 0.0
        if elapsed_s > 0.0:
            faster = math.hypot(x_speed, y_speed) - math.hypot(before.x_speed, before.y_speed)
            acceleration = faster / elapsed_s
            if abs(acceleration) > _MAX_FLOAT32:
                acceleration = _to_float32(acceleration)
        return Cursor(before.id, x, y, x_speed, y_speed, acceleration)

    def _bundles(
        self, continuing: Sequence[Cursor], new: Sequence[Cursor], fseq: int
    ) -> Iterator[bytes]:
        return split_frame(self._encoder, continuing, new, fseq, MAX_PAYLOAD_BYTES)


def seed_at(unix_time_s: float) -> int:
    """Return a seed for frame numbers and ids that a later start exceeds.

    It gains a thousand a second, more than a second can have frames or new touches.
    """
    return int(unix_time_s * 1000.0) % _INT32_COUNT


def default_source_name(host_name: str, configuration_path: str, address: str) -> str:
    """Return cornertouchd-<6 hex digits>@<address>.

    The digits stand for host and configuration: each instance has its own, at every start the same.
    """
    instance = f"{host_name}\0{configuration_path}".encode("utf-8", "surrogateescape")
    return f"cornertouchd-{hashlib.sha256(instance).hexdigest()[:6]}@{address}"


def _to_float32(value: float) -> float:
    return min(max(value, -_MAX_FLOAT32), _MAX_FLOAT32)


def _padded(text: bytes) -> bytes:
    """Return an OSC string: ended by one to four zeros, a multiple of four bytes."""
    return text + b"\0" * (4 - len(text) % 4)


@lru_cache(maxsize=2 * MAX_CURSORS)
def _alive_message(count: int) -> tuple[bytes, struct.Struct]:
    """Return how the alive message of so many ids begins, and how the ids follow."""
    ids = struct.Struct(f">{count}i")
    start = _ADDRESS + _padded(b",s" + b"i" * count) + b"alive\0\0\0"
    return struct.pack(">i", len(start) + ids.size) + start, ids


@lru_cache(maxsize=2 * MAX_CURSORS)
def _set_messages(count: int) -> struct.Struct:
    """Return how so many set messages follow each other."""
    return struct.Struct(">" + _SET * count)


def _element(arguments: bytes) -> bytes:
    """Return a bundle element: a 2Dcur message after its length."""
    return struct.pack(">i", len(_ADDRESS) + len(arguments)) + _ADDRESS + arguments
