"""Touches to TUIO clients: over UDP, and over streams by a thread of their own."""

import logging
import socket
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from cornertouchd.devices.stream_hub import StreamHub, StreamLink
from cornertouchd.devices.udp_destination import DestinationStatus, UdpDestination
from cornertouchd.model import TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import TuioSession
from cornertouchd.wire.tuio_blobs import BlobTelling, Profile

log = logging.getLogger(__name__)

# A client may have been started, or may have lost a packet: once a second it is told everything.
FULL_STATE_EVERY_S = 1.0
# "No touches" is told three times within 100 ms, so that one lost packet leaves no touch stuck;
# with a tick at least every 25 ms the repeats leave at 60 and 95 ms at the latest.  Streams, which
# lose nothing, are told once.
REPEATS = 2
REPEAT_EVERY_S = 0.035


@dataclass(frozen=True, slots=True)
class TuioReceiver:
    """Who is told: by which way, where that client's display lies, and which profiles it wants."""

    way: UdpDestination | StreamLink
    mapping: DisplayMapping
    profiles: tuple[Profile, ...] = ("2Dcur",)


class TuioSink:
    """Tells touches to any number of TUIO 1.1 clients; fills `ports.TouchSink`.

    Receivers with the same mapping share one encoding, and their ids.  `source`, `fseq_seed` and
    `id_seed`: see `TuioSession`.  `hub` serves the receivers that are streams; it is started by the
    first tick and closed at the end.  A receiver that cannot be reached neither stops nor delays
    the others.  Raises `ValueError` for one that is given twice.
    """

    def __init__(
        self,
        receivers: Iterable[TuioReceiver],
        source: str,
        fseq_seed: int,
        id_seed: int,
        *,
        hub: StreamHub | None = None,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.source = source
        self._sleep = sleep
        self._closed = False
        self._now_s = float("-inf")
        receivers = tuple(receivers)
        self._ways = [receiver.way for receiver in receivers]
        _refuse_twins(self.destinations)
        self._destinations = [way for way in self._ways if isinstance(way, UdpDestination)]
        self._streams = _Streams(
            hub, [way for way in self._ways if not isinstance(way, UdpDestination)]
        )
        by_mapping: dict[DisplayMapping, list[TuioReceiver]] = {}
        for receiver in receivers:
            by_mapping.setdefault(receiver.mapping, []).append(receiver)
        self._displays = [
            _Display(
                TuioSession(mapping, source, fseq_seed, id_seed), source, shared, self._streams
            )
            for mapping, shared in by_mapping.items()
        ]

    @property
    def destinations(self) -> tuple[DestinationStatus, ...]:
        """How each receiver fares, in the order given; may be read from any thread."""
        return tuple(way.status for way in self._ways)

    @property
    def touches_left_out(self) -> int:
        """How many touches were not told because they were not finite or too many."""
        return sum(display.session.left_out for display in self._displays)

    def send(self, frame: TouchFrame, now_s: float) -> None:
        """Tell the touches of one instant."""
        self.tick(now_s)
        for display in self._displays:
            display.send(frame, now_s)
        self._streams.ring()

    def lift_all(self, now_s: float) -> None:
        """Tell that there are no touches any more, now and twice again by `tick`."""
        self.tick(now_s)
        for display in self._displays:
            display.lift_all(now_s)
        self._streams.ring()

    def tick(self, now_s: float) -> None:
        """Send what is due: the greeting of a start, repeats, the full state once a second."""
        self._now_s = now_s
        self._streams.start()
        for destination in self._destinations:
            destination.tick(now_s)
        for display in self._displays:
            display.tick(now_s)
        self._streams.ring()

    def close(self) -> None:
        """Tell three times within 70 ms that there are no touches any more; free the sockets."""
        if self._closed:
            return
        self._closed = True
        for display in self._displays:
            display.tell_empty(self._now_s)
        self._streams.ring()
        for _ in range(REPEATS if self._destinations else 0):
            self._sleep(REPEAT_EVERY_S)
            for display in self._displays:
                display.repeat(self._now_s)
        self._streams.close()
        for destination in self._destinations:
            destination.close()


def _refuse_twins(destinations: Iterable[DestinationStatus]) -> None:
    seen = set()
    for each in destinations:
        key = (each.transport, each.host, each.port)
        if key in seen:
            raise ValueError(f"TUIO destination {each.host}:{each.port} is given twice; remove one")
        seen.add(key)


class _Streams:
    """The receivers that a thread of its own serves, if there are any."""

    def __init__(self, hub: StreamHub | None, links: Sequence[StreamLink]) -> None:
        self._hub = hub if links else None
        self._links = links
        self._has_news = self._refused = False
        if links and hub is None:
            raise ValueError("TUIO over streams needs a hub; give the one that the links watch by")

    def start(self) -> None:
        """Begin to serve, unless that was done before; again and again if it fails."""
        if self._hub is None or self._hub.was_started:
            return
        try:
            self._hub.start(self._links)
        except (OSError, RuntimeError) as error:  # the process may have no more files or threads
            if not self._refused:
                log.warning("TUIO over streams: %s; tried again until it works", error)
            self._refused = True

    def put(self, link: StreamLink, bundles: Sequence[bytes]) -> None:
        if self._hub is not None and self._hub.was_started:
            self._hub.put(link, bundles)
            self._has_news = True

    def ring(self) -> None:
        """Have told what was put."""
        if self._hub is not None and self._has_news:
            self._has_news = False
            self._hub.ring()

    def close(self) -> None:
        if self._hub is not None:
            self._hub.close()


class _Display:
    """The clients that share a mapping, and when they are to be told what."""

    def __init__(
        self,
        session: TuioSession,
        source: str,
        receivers: Sequence[TuioReceiver],
        streams: _Streams,
    ) -> None:
        self.session = session
        wants_blobs = any("2Dblb" in receiver.profiles for receiver in receivers)
        self._blobs = BlobTelling(receivers[0].mapping, source) if wants_blobs else None
        self._datagrams = [
            (one.way, one.profiles) for one in receivers if isinstance(one.way, UdpDestination)
        ]
        self._links = [
            (one.way, one.profiles) for one in receivers if not isinstance(one.way, UdpDestination)
        ]
        self._streams = streams
        self._greeted = False
        self._told_at_s = float("-inf")
        self._repeats_at_s: tuple[float, ...] = ()

    def send(self, frame: TouchFrame, now_s: float) -> None:
        cursors = self.session.frame(frame)
        if not cursors:
            return
        told: dict[Profile, list[bytes]] = {"2Dcur": cursors}
        if self._blobs is not None:
            told["2Dblb"] = self._blobs.frame(frame, self.session.told, self.session.told_fseq)
        self._tell(told, now_s)
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
            self.repeat(now_s)
        elif now_s - self._told_at_s >= FULL_STATE_EVERY_S:
            self._tell(self._full_state(), now_s)

    def tell_empty(self, now_s: float) -> None:
        told: dict[Profile, list[bytes]] = {"2Dcur": [self.session.empty()]}
        if self._blobs is not None:
            told["2Dblb"] = [self._blobs.empty()]
        self._tell(told, now_s)

    def repeat(self, now_s: float) -> None:
        """Tell once more, where packets may have been lost, what was told last."""
        self._tell_datagrams(self._full_state(), now_s)

    def _full_state(self) -> dict[Profile, list[bytes]]:
        told: dict[Profile, list[bytes]] = {"2Dcur": self.session.full_state()}
        if self._blobs is not None:
            told["2Dblb"] = self._blobs.full_state()
        return told

    def _repeat_from(self, now_s: float) -> None:
        self._repeats_at_s = tuple(
            now_s + REPEAT_EVERY_S * (repeat + 1) for repeat in range(REPEATS)
        )

    def _tell_datagrams(self, told: Mapping[Profile, list[bytes]], now_s: float) -> None:
        self._told_at_s = now_s
        for destination, profiles in self._datagrams:
            for profile in profiles:
                for bundle in told[profile]:
                    destination.send(bundle, now_s)

    def _tell(self, told: Mapping[Profile, list[bytes]], now_s: float) -> None:
        self._tell_datagrams(told, now_s)
        if self._links:
            whole = self._whole(told)
            for link, profiles in self._links:
                self._streams.put(link, [whole[profile] for profile in profiles])

    def _whole(self, told: Mapping[Profile, list[bytes]]) -> dict[Profile, bytes]:
        """Return the same in one bundle a profile: a stream has no packets to fit."""
        whole = {profile: bundles[0] for profile, bundles in told.items()}
        if len(told["2Dcur"]) > 1:
            whole["2Dcur"] = self.session.whole()
        if self._blobs is not None and len(told["2Dblb"]) > 1:
            whole["2Dblb"] = self._blobs.whole()
        return whole


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
