"""A TUIO client in the guest: what it was told, and whether that is true."""

import socket
import threading
import time
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from uvc.rig import UvcRig
from uvc.show import SURFACE_MM, Place, Show, distance_mm

from cornertouchd.wire.tuio_reader import TuioReader

MAX_DATAGRAM_BYTES = 65536
WAKE_S = 0.05
LATE_S = 0.5
"""Ordinary touches are .1 s late at most, those that lost all cameras are lifted after .25 s; one
that lasts longer than its finger is stuck."""
STANDSTILL_S = 0.1
"""A client that wakes so much too late is in a guest that stood still."""
STEP_S = 0.05
"""How often what a client shows is looked at."""

Touches = Mapping[int, Place]


class TuioClient:
    """Listens on a port and keeps what it shows from each datagram on, in millimetres."""

    def __init__(self, port: int = 3333) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(WAKE_S)
        self._socket.bind(("127.0.0.1", port))
        self._reader = TuioReader()
        self._times_s: list[float] = []
        self._shown: list[Touches] = []
        self._standstills: list[tuple[float, float]] = []
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="client", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no longer."""
        self._end.set()
        self._thread.join()
        self._socket.close()

    @property
    def lost_frames(self) -> int:
        """How many frames of the daemon never came."""
        return sum(source.lost_frames for source in self._reader.sources.values())

    def has_shown_since(self, time_s: float) -> bool:
        """Tell whether there was a touch from that time on."""
        first = bisect_right(self._times_s, time_s)
        return any(self._shown[first:])

    @property
    def standstills(self) -> tuple[tuple[float, float], ...]:
        """From when to when the guest stood still: a busy machine gives it no processor."""
        return tuple(self._standstills)

    def shown_at(self, time_s: float) -> Touches:
        """Return what the client showed at a time."""
        number = bisect_right(self._times_s, time_s) - 1
        return self._shown[number] if number >= 0 else {}

    def frames_since(self, time_s: float) -> list[tuple[float, Touches]]:
        """Return what the client showed after each datagram from a time on."""
        first = bisect_right(self._times_s, time_s)
        return list(zip(self._times_s[first:], self._shown[first:], strict=False))

    def shown_between(self, first_s: float, last_s: float) -> Iterator[tuple[float, Touches]]:
        """Yield what the client showed from step to step."""
        time_s = first_s
        while time_s < last_s:
            yield time_s, self.shown_at(time_s)
            time_s += STEP_S

    def _listen(self) -> None:
        before_s = time.monotonic()
        while not self._end.is_set():
            try:
                datagram, sender = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
            except TimeoutError:
                datagram, sender = b"", None
            now_s = time.monotonic()
            if now_s - before_s > WAKE_S + STANDSTILL_S:
                self._standstills.append((before_s, now_s))
            before_s = now_s
            if not datagram:
                continue
            self._reader.feed(datagram, str(sender), now_s)
            width_mm, height_mm = SURFACE_MM
            shown = {
                cursor.id: (cursor.x * width_mm, cursor.y * height_mm)
                for source in self._reader.sources.values()
                for cursor in source.cursors.values()
            }
            self._shown.append(shown)
            self._times_s.append(now_s)


@dataclass(frozen=True, slots=True)
class Seen:
    """What a client saw of the show for a time.

    `errors_mm` are distances to the truth, `wrong` the touches that were nowhere near a finger
    (time, place, how far from any); fingers were down for `down_s` in all, `missing_s` of it not
    shown; `ids` is how many touches there were.
    """

    errors_mm: tuple[float, ...]
    wrong: tuple[tuple[float, Place, float], ...]
    down_s: float
    missing_s: float
    ids: int

    def error_mm(self, share: float) -> float:
        """Return the error that this share of all places stays under."""
        ordered = sorted(self.errors_mm)
        return ordered[int(share * (len(ordered) - 1))]


def compare(
    client: TuioClient, show: Show, rig: UvcRig, span_s: tuple[float, float], near_mm: float
) -> Seen:
    """Compare what a client showed with what the cameras were shown.

    Every touch must be within `near_mm` of where a finger was in the last `LATE_S`, and while
    guest or cameras stood still; a finger that was down all that time must have a touch there.
    """
    errors_mm: list[float] = []
    wrong: list[tuple[float, Place, float]] = []
    ids: set[int] = set()
    down_s = missing_s = 0.0
    standstills = client.standstills, rig.standstills()
    for time_s, touches in client.shown_between(*span_s):
        late_s = LATE_S + max(stood_still_s(each, time_s - LATE_S, time_s) for each in standstills)
        sets = show.between(time_s - rig.start_s - late_s, time_s - rig.start_s)
        ids.update(touches)
        for place in touches.values():
            off_mm = min(
                (distance_mm(place, finger) for places in sets for finger in places),
                default=float("inf"),
            )
            errors_mm.append(off_mm)
            if off_mm > near_mm:
                wrong.append((time_s - span_s[0], place, off_mm))
        for path in _down_all_the_time(sets):
            shown = any(
                distance_mm(place, finger) <= near_mm
                for place in touches.values()
                for finger in path
            )
            down_s += STEP_S
            missing_s += 0.0 if shown else STEP_S
    return Seen(tuple(errors_mm), tuple(wrong), down_s, missing_s, len(ids))


def stood_still_s(
    standstills: Iterable[tuple[float, float]], first_s: float, last_s: float
) -> float:
    """Return how long those standstills were until `last_s` that reach into this time."""
    return sum(
        min(end_s, last_s) - begin_s
        for begin_s, end_s in standstills
        if end_s > first_s and begin_s < last_s
    )


def _down_all_the_time(sets: tuple[tuple[Place, ...], ...]) -> list[tuple[Place, ...]]:
    """Return the paths of the fingers that are down in all sets: they move little in between."""
    paths = [(place,) for place in sets[-1]]
    for places in reversed(sets[:-1]):
        longer = []
        for path in paths:
            nearest = min(places, key=lambda place, path=path: distance_mm(place, path[-1]))
            if distance_mm(nearest, path[-1]) < 10.0:
                longer.append((*path, nearest))
        paths = longer
    return paths


def wait_until(condition: Callable[[], bool], timeout_s: float, what: str) -> float:
    """Return how long it took until the condition held.  Raises `TimeoutError`."""
    began_s = time.monotonic()
    while not condition():
        if time.monotonic() - began_s > timeout_s:
            raise TimeoutError(f"{what} did not happen within {timeout_s:g} s")
        time.sleep(WAKE_S / 2)
    return time.monotonic() - began_s
