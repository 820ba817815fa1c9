"""Touches to TUIO clients over UDP."""

import socket
import time
from collections.abc import Callable, Iterable

from cornertouchd.devices.udp_destination import (
    DestinationStatus,
    Resolve,
    UdpDestination,
    resolve_name,
)
from cornertouchd.model import TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import TuioSession

# A client may have been started, or may have lost a packet: once a second it is told everything.
FULL_STATE_EVERY_S = 1.0
# "No touches" is told three times within 100 ms, so that one lost packet leaves no touch stuck;
# with a tick at least every 25 ms the repeats leave at 60 and 95 ms at the latest.
REPEATS = 2
REPEAT_EVERY_S = 0.035


class UdpTuioSink:
    """Tells touches to any number of TUIO 1.1 clients; fills `ports.TouchSink`.

    `destinations` are host, port and where that client's display lies on the surface; those with
    the same mapping share one encoding.  `source`, `fseq_seed` and `id_seed`: see `TuioSession`.
    A destination that cannot be reached neither stops nor delays the others.  Raises `ValueError`
    for a destination that cannot exist or is given twice.
    """

    def __init__(
        self,
        destinations: Iterable[tuple[str, int, DisplayMapping]],
        source: str,
        fseq_seed: int,
        id_seed: int,
        *,
        resolve: Resolve = resolve_name,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.source = source
        self._sleep = sleep
        self._closed = False
        self._now_s = float("-inf")
        self._destinations: list[UdpDestination] = []
        by_mapping: dict[DisplayMapping, list[UdpDestination]] = {}
        seen: set[tuple[str, int]] = set()
        for host, port, mapping in destinations:
            if (host, port) in seen:
                raise ValueError(f"TUIO destination {host}:{port} is given twice; remove one")
            seen.add((host, port))
            destination = UdpDestination(host, port, resolve)
            self._destinations.append(destination)
            by_mapping.setdefault(mapping, []).append(destination)
        self._displays = [
            _Display(TuioSession(mapping, source, fseq_seed, id_seed), shared)
            for mapping, shared in by_mapping.items()
        ]

    @property
    def destinations(self) -> tuple[DestinationStatus, ...]:
        """How each destination fares, in the order given; may be read from any thread."""
        return tuple(destination.status for destination in self._destinations)

    @property
    def touches_left_out(self) -> int:
        """How many touches were not told because they were not finite or too many."""
        return sum(display.session.left_out for display in self._displays)

    def send(self, frame: TouchFrame, now_s: float) -> None:
        """Tell the touches of one instant."""
        self.tick(now_s)
        for display in self._displays:
            display.send(frame, now_s)

    def lift_all(self, now_s: float) -> None:
        """Tell that there are no touches any more, now and twice again by `tick`."""
        self.tick(now_s)
        for display in self._displays:
            display.lift_all(now_s)

    def tick(self, now_s: float) -> None:
        """Send what is due: the greeting of a start, repeats, the full state once a second."""
        self._now_s = now_s
        for destination in self._destinations:
            destination.tick(now_s)
        for display in self._displays:
            display.tick(now_s)

    def close(self) -> None:
        """Tell three times within 70 ms that there are no touches any more; free the sockets."""
        if self._closed:
            return
        self._closed = True
        self._tell_empty()
        for _ in range(REPEATS):
            self._sleep(REPEAT_EVERY_S)
            self._tell_empty()
        for destination in self._destinations:
            destination.close()

    def _tell_empty(self) -> None:
        for display in self._displays:
            display.tell_empty(self._now_s)


class _Display:
    """The clients that share a mapping, and when they are to be told what."""

    def __init__(self, session: TuioSession, destinations: list[UdpDestination]) -> None:
        self.session = session
        self._destinations = destinations
        self._greeted = False
        self._told_at_s = float("-inf")
        self._repeats_at_s: tuple[float, ...] = ()

    def send(self, frame: TouchFrame, now_s: float) -> None:
        bundles = self.session.frame(frame)
        if not bundles:
            return
        self._tell(bundles, now_s)
        if self.session.has_contacts:
            self._repeats_at_s = ()
        else:
            self._repeat_from(now_s)

    def lift_all(self, now_s: float) -> None:
        # Called over and over while cameras are away, the repeats must not start over and over.
        if self.session.has_contacts or not self._repeats_at_s:
            self.tell_empty(now_s)
            self._repeat_from(now_s)

    def tick(self, now_s: float) -> None:
        if not self._greeted:
            # Whoever listens may hold touches of a daemon that died without a farewell.
            self._greeted = True
            self.tell_empty(now_s)
            self._repeat_from(now_s)
        elif self._repeats_at_s and now_s >= self._repeats_at_s[0]:
            self._repeats_at_s = self._repeats_at_s[1:]
            self._tell(self.session.full_state(), now_s)
        elif now_s - self._told_at_s >= FULL_STATE_EVERY_S:
            self._tell(self.session.full_state(), now_s)

    def tell_empty(self, now_s: float) -> None:
        self._tell([self.session.empty()], now_s)

    def _repeat_from(self, now_s: float) -> None:
        self._repeats_at_s = tuple(
            now_s + REPEAT_EVERY_S * (repeat + 1) for repeat in range(REPEATS)
        )

    def _tell(self, bundles: list[bytes], now_s: float) -> None:
        self._told_at_s = now_s
        for destination in self._destinations:
            for bundle in bundles:
                destination.send(bundle, now_s)


def local_address(host: str) -> str:
    """Return the address of this machine from which datagrams to `host` leave.

    For a name, which is not resolved here, that of the default route; 127.0.0.1 if there is none.
    """
    for target in (host, "192.0.2.1"):  # 192.0.2.1 is for documentation: nobody has it
        try:
            family, kind, _, _, address = socket.getaddrinfo(
                target, 9, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST
            )[0]
            with socket.socket(family, kind) as probe:
                probe.connect(address)  # sends nothing
                return str(probe.getsockname()[0])
        except (OSError, ValueError):
            continue
    return "127.0.0.1"
