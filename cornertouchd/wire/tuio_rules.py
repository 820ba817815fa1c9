"""The rules of TUIO 1.1, held against what a tracker sends.

Specification: https://www.tuio.org/?specification.  What a rule finds is wrong by itself, or makes
a client show touches that are not there, miss some, or keep them for ever.  Lost packets are
counted, and are no violation; packets that a network brought out of order look like violations of
`fseq`.
"""

import math
from collections.abc import Iterator, Mapping
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field
from typing import Literal

from cornertouchd.wire.osc import OscError, OscMessage, is_bundle, read_bundle
from cornertouchd.wire.tuio import REDUNDANT_FSEQ
from cornertouchd.wire.tuio_reader import LATE_WITHIN
from cornertouchd.wire.tuio_stream import MAX_BUNDLE_BYTES

Transport = Literal["udp", "tcp", "websocket"]
Rule = Literal[
    "size", "osc", "bundle", "profile", "order", "source", "alive", "set", "range", "id", "fseq"
]

# What crosses an Ethernet in one piece over IPv4: 1500 less 20 and 8 (UDP).
MAX_DATAGRAM_BYTES = 1472

# What a set message tells, in the specification's letters: s, i whole numbers; x y z positions and
# w h d f v sizes, 0..1; a b c angles; capitals, m and r speeds and accelerations.
PROFILES = {
    "2Dobj": "sixyaXYAmr",
    "2Dcur": "sxyXYm",
    "2Dblb": "sxyawhfXYAmr",
    "25Dobj": "sixyzaXYZAmr",
    "25Dcur": "sxyzXYZm",
    "25Dblb": "sxyzawhfXYZAmr",
    "3Dobj": "sixyzabcXYZABCmr",
    "3Dcur": "sxyzXYZm",
    "3Dblb": "sxyzabcwhdvXYZABCmr",
}
_WHOLE = "si"
_SHARES = "xyzwhdfv"
_ANGLES = "abc"
# A float32 just above 2 pi is what some trackers make of it.
_LARGEST_ANGLE = 2.0 * math.pi + 1e-6

# So many ids that have gone are remembered of each source: an hour of a crowd's touches.
_MOST_GONE = 20_000
_MOST_SOURCES = 100


@dataclass(frozen=True, slots=True)
class Violation:
    """What breaks a rule: in which packet (from 1), at which of its bytes (from 0)."""

    rule: Rule
    packet: int
    offset: int
    what: str


@dataclass(slots=True)
class _Profile:
    """What a source told of one profile: ids now, ids that were told where they are, ids gone."""

    fseq: int | None = None
    alive: frozenset[int] | None = None
    told: set[int] = field(default_factory=set)
    gone: dict[int, None] = field(default_factory=dict)  # in the order in which they went


@dataclass(slots=True)
class _Source:
    fseq: int | None = None
    profiles: dict[str, _Profile] = field(default_factory=dict)


@dataclass(slots=True)
class _Bundle:
    """What a bundle says, as far as it can be read."""

    profile: str = ""
    source: str = ""
    alive: OscMessage | None = None
    sets: list[OscMessage] = field(default_factory=list)
    fseq: OscMessage | None = None
    is_foreign: bool = False

    @property
    def alive_ids(self) -> tuple[int, ...]:
        """The ids that alive names."""
        ids = self.alive.arguments[1:] if self.alive else ()
        return tuple(id_ for id_ in ids if isinstance(id_, int))

    @property
    def set_ids(self) -> frozenset[int]:
        """The ids that are told where they are."""
        return frozenset(id_ for each in self.sets if (id_ := _session_id(each)) is not None)


class TuioCheck:
    """Holds a stream against the rules, packet by packet, whoever sends."""

    def __init__(self, transport: Transport = "udp") -> None:
        self._max_bytes = MAX_DATAGRAM_BYTES if transport == "udp" else MAX_BUNDLE_BYTES
        self.packets = 0
        self.lost_frames = 0
        self._sources: dict[str, _Source] = {}

    def feed(self, packet: bytes, sender: str) -> list[Violation]:
        """Return what is wrong with the next packet; `sender` stands for a source without name."""
        self.packets += 1
        return [
            Violation(rule, self.packets, offset, what)
            for rule, offset, what in self._found(packet, sender)
        ]

    def _found(self, packet: bytes, sender: str) -> Iterator[tuple[Rule, int, str]]:
        if len(packet) > self._max_bytes:
            yield "size", self._max_bytes, f"{len(packet)} bytes, at most {self._max_bytes}"
        if not is_bundle(packet):
            if packet.startswith(b"/"):
                yield "bundle", 0, "a message that is not in a bundle"
            else:
                yield "osc", 0, "neither an OSC bundle nor a message"
            return
        bundle = _Bundle()
        try:
            for message in read_bundle(packet):
                yield from _take(bundle, message)
        except OscError as error:
            yield "osc", error.offset, str(error)
            return
        if bundle.is_foreign and not bundle.profile:
            return  # that has been said; it is no bundle of TUIO that lacks messages
        if bundle.alive is None:
            yield "order", len(packet), "no alive message"
        if bundle.fseq is None:
            yield "order", len(packet), "no fseq message"
        yield from _within(bundle)
        yield from self._follow(bundle, bundle.source or sender)

    def _follow(self, bundle: _Bundle, name: str) -> Iterator[tuple[Rule, int, str]]:
        """Hold a bundle against those before it, and remember it."""
        if bundle.alive is None or bundle.fseq is None:
            return
        fseq = bundle.fseq.arguments[1] if len(bundle.fseq.arguments) > 1 else None
        if not isinstance(fseq, int):
            return
        if name not in self._sources and len(self._sources) >= _MOST_SOURCES:
            self._sources.clear()  # a sender that makes up names fills no memory
        source = self._sources.setdefault(name, _Source())
        last = source.fseq
        if fseq < REDUNDANT_FSEQ:
            yield "fseq", bundle.fseq.offsets[1], f"frame {fseq}, must be -1 or from 0"
            return
        if last is not None and last - LATE_WITHIN <= fseq < last and fseq != REDUNDANT_FSEQ:
            yield (
                "fseq",
                bundle.fseq.offsets[1],
                f"frame {fseq} after frame {last}: dropped as late",
            )
            return
        is_gap = last is not None and last + 1 < fseq <= last + LATE_WITHIN
        if is_gap and last is not None:
            self.lost_frames += fseq - last - 1
        if fseq != REDUNDANT_FSEQ:
            if last is not None and fseq < last:
                source.profiles.clear()  # so far back: the tracker was started anew
            source.fseq = fseq
        profile = source.profiles.setdefault(bundle.profile, _Profile())
        ids = dict(zip(bundle.alive_ids, bundle.alive.offsets[1:], strict=False))
        if profile.alive is not None and fseq == last == profile.fseq:
            missing = profile.alive - ids.keys()
            if missing:
                what = f"frame {fseq} once more, without id {min(missing)}"
                yield "fseq", bundle.fseq.offsets[1], f"{what}: clients lift it at the first"
        follows = profile.alive is not None and not is_gap and fseq != REDUNDANT_FSEQ
        yield from _follow_ids(profile, ids, bundle.set_ids, follows=follows)
        profile.fseq = fseq


def _follow_ids(
    profile: _Profile, ids: Mapping[int, int], told: AbstractSet[int], *, follows: bool
) -> Iterator[tuple[Rule, int, str]]:
    """Hold the ids that are alive, by id the offset, against those before; remember them.

    `follows` if no bundle before was missed: else ids may have been told where they are in one
    that was.
    """
    for id_, offset in ids.items():
        if id_ in profile.gone:
            yield "id", offset, f"id {id_} is alive again after it had gone"
        elif follows and id_ not in profile.told and id_ not in told:
            yield "alive", offset, f"id {id_} is alive, and no set ever told where it is"
    for id_ in (profile.alive or frozenset()) - ids.keys():
        profile.gone[id_] = None
    for id_ in ids:
        profile.gone.pop(id_, None)  # said once
    while len(profile.gone) > _MOST_GONE:
        del profile.gone[next(iter(profile.gone))]
    profile.alive = frozenset(ids)
    profile.told = ((profile.told | told) & ids.keys()) if follows else set(ids)


def _take(bundle: _Bundle, message: OscMessage) -> Iterator[tuple[Rule, int, str]]:
    """Put a message where it belongs in the bundle."""
    prefix, _, profile = message.address.rpartition("/")
    if prefix != "/tuio" or not (profile in PROFILES or profile.startswith("_")):
        if not bundle.is_foreign:
            yield "profile", message.offset, f"{message.address} is no profile of TUIO 1.1"
        bundle.is_foreign = True
        return
    if bundle.profile and profile != bundle.profile:
        yield (
            "profile",
            message.offset,
            f"{message.address} in a bundle of /tuio/{bundle.profile}; each needs its own",
        )
        return
    bundle.profile = profile
    command = message.arguments[0] if message.arguments else None
    match command:
        case "source":
            yield from _take_source(bundle, message)
        case "alive":
            yield from _take_alive(bundle, message)
        case "set":
            yield from _take_set(bundle, message)
        case "fseq":
            yield from _take_fseq(bundle, message)
        case _:
            yield "order", message.offset, f"{command!r}, must be source, alive, set or fseq"


def _take_source(bundle: _Bundle, message: OscMessage) -> Iterator[tuple[Rule, int, str]]:
    if bundle.source:
        yield "source", message.offset, "source twice"
    if bundle.alive is not None or bundle.sets or bundle.fseq is not None:
        yield "order", message.offset, "source must come first"
    if message.tags != "ss":
        yield "source", message.offset, f"source has types {message.tags}, must be ss"
        return
    bundle.source = str(message.arguments[1])
    name, at, address = bundle.source.partition("@")
    if not (name and at and address):
        yield "source", message.offsets[1], f"source {bundle.source!r}, must be name@address"


def _take_alive(bundle: _Bundle, message: OscMessage) -> Iterator[tuple[Rule, int, str]]:
    if bundle.alive is not None:
        yield "order", message.offset, "alive twice"
    if bundle.fseq is not None:
        yield "order", message.offset, "alive after fseq"
    if message.tags.strip("i") != "s":
        yield "alive", message.offset, f"alive has types {message.tags}, must be s and an i each"
    bundle.alive = message
    seen = set()
    for id_, offset in zip(message.arguments[1:], message.offsets[1:], strict=True):
        if id_ in seen:
            yield "alive", offset, f"id {id_} twice"
        seen.add(id_)


def _take_set(bundle: _Bundle, message: OscMessage) -> Iterator[tuple[Rule, int, str]]:
    if bundle.alive is None:
        yield "order", message.offset, "set before alive"
    if bundle.fseq is not None:
        yield "order", message.offset, "set after fseq"
    bundle.sets.append(message)
    if bundle.profile in PROFILES:
        yield from _values_of(message, PROFILES[bundle.profile])


def _take_fseq(bundle: _Bundle, message: OscMessage) -> Iterator[tuple[Rule, int, str]]:
    if bundle.fseq is not None:
        yield "order", message.offset, "fseq twice"
    if message.tags != "si":
        yield "fseq", message.offset, f"fseq has types {message.tags}, must be si"
    bundle.fseq = message


def _values_of(message: OscMessage, letters: str) -> Iterator[tuple[Rule, int, str]]:
    """Hold the values of a set message against what the specification says of each."""
    wanted = "s" + "".join("i" if letter in _WHOLE else "f" for letter in letters)
    if message.tags != wanted:
        yield "set", message.offset, f"set has types {message.tags}, must be {wanted}"
        return
    for letter, value, offset in zip(
        letters, message.arguments[1:], message.offsets[1:], strict=True
    ):
        number = float(value)
        if not math.isfinite(number):
            yield "range", offset, f"{letter} = {value}, must be finite"
        elif letter in _SHARES and not 0.0 <= number <= 1.0:
            yield "range", offset, f"{letter} = {number:.9g}, must be 0..1"
        elif letter in _ANGLES and not 0.0 <= number <= _LARGEST_ANGLE:
            yield "range", offset, f"{letter} = {number:.9g}, must be 0..2 pi"


def _within(bundle: _Bundle) -> Iterator[tuple[Rule, int, str]]:
    """Hold the ids of a bundle against each other."""
    alive, told = set(bundle.alive_ids), set()
    for each in bundle.sets:
        id_ = _session_id(each)
        if id_ is None:
            continue
        if bundle.alive is not None and id_ not in alive:
            yield "set", each.offset, f"set of id {id_}, which alive does not name"
        if id_ in told:
            yield "set", each.offset, f"set of id {id_} twice"
        told.add(id_)


def _session_id(message: OscMessage) -> int | None:
    id_ = message.arguments[1] if len(message.arguments) > 1 else None
    return id_ if isinstance(id_, int) else None
