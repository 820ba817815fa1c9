"""TUIO 1.1 in: what any tracker tells of its cursors, as a client sees it.

For `cornertouchd listen`, decoded with python-osc.  Specification: https://www.tuio.org/?specification.
"""

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from pythonosc import osc_message

from cornertouchd.wire.tuio import MAX_SOURCE_BYTES, REDUNDANT_FSEQ, Cursor

# The reference client drops frames up to so many numbers behind the last one; further back means
# that the tracker was started anew.  A jump ahead by more is no loss either.
LATE_WITHIN = 100
# A tracker that says nothing for so long is gone; at work it repeats itself every second.
FORGET_AFTER_S = 60.0

# Frames under way, and contacts in one, that are kept: far more than trackers there are and than
# one datagram can hold, so that a sender who never ends a frame fills no memory.
_MAX_SENDERS = 100
_MAX_PENDING = 2000
_BUNDLE = b"#bundle\0"
_BUNDLE_HEAD_BYTES = 16


class MalformedPacketError(Exception):
    """A datagram that is not OSC, or not TUIO 1.1; the message says what is wrong."""


@dataclass(frozen=True, slots=True)
class TouchEvent:
    """A contact came, changed or went."""

    kind: Literal["add", "update", "remove"]
    source: str
    cursor: Cursor


@dataclass(slots=True)
class TrackedSource:
    """What one tracker told so far.

    `cursors` and `since_s` (when first seen) are by session id; `lost_frames` counts the gaps in
    the frame numbers, `late_frames` those that came after a newer one and were dropped.
    """

    name: str
    cursors: dict[int, Cursor] = field(default_factory=dict)
    since_s: dict[int, float] = field(default_factory=dict)
    fseq: int | None = None
    frames: int = 0
    packets: int = 0
    lost_frames: int = 0
    late_frames: int = 0
    heard_at_s: float = -math.inf


@dataclass(frozen=True, slots=True)
class _Source:
    name: str


@dataclass(frozen=True, slots=True)
class _Alive:
    ids: frozenset[int]


@dataclass(frozen=True, slots=True)
class _FrameEnd:
    fseq: int


_Command = _Source | _Alive | Cursor | _FrameEnd


@dataclass(slots=True)
class _Pending:
    """A sender's frame until its fseq comes; some send every message on its own."""

    source: str
    alive: frozenset[int] | None = None
    cursors: dict[int, Cursor] = field(default_factory=dict)


class TuioReader:
    """Follows the cursors of all trackers that send to one port, each on its own."""

    def __init__(self) -> None:
        self.sources: dict[str, TrackedSource] = {}
        self.packets = 0
        self.malformed = 0
        self.last_malformed = ""
        self._pending: dict[str, _Pending] = {}

    def feed(self, datagram: bytes, sender: str, received_at_s: float) -> list[TouchEvent]:
        """Take a datagram in and return what it changed; a malformed one is counted, no more.

        `sender` names a tracker that does not tell its name.
        """
        self.packets += 1
        try:
            commands = parse_commands(datagram)
        except MalformedPacketError as error:
            self.malformed += 1
            self.last_malformed = str(error)
            return []
        pending = self._pending.setdefault(sender, _Pending(sender))
        events: list[TouchEvent] = []
        for command in commands:
            match command:
                case _Source(name):
                    pending.source = name
                case _Alive(ids):
                    pending.alive = ids
                case Cursor():
                    pending.cursors[command.id] = command
                case _FrameEnd(fseq):
                    events += self._end_frame(pending, fseq, received_at_s)
                    pending.alive, pending.cursors = None, {}
        if commands:
            self._hear(pending.source, received_at_s).packets += 1
        if pending.alive is None and not pending.cursors:
            del self._pending[sender]
        elif len(pending.cursors) > _MAX_PENDING or len(self._pending) > _MAX_SENDERS:
            self._pending.clear()
        return events

    def forget_silent(self, now_s: float) -> list[TouchEvent]:
        """Drop trackers that have said nothing for a minute; return the touches that go."""
        silent = [
            source for source in self.sources.values() if now_s - source.heard_at_s > FORGET_AFTER_S
        ]
        for source in silent:
            del self.sources[source.name]
        return [
            TouchEvent("remove", source.name, cursor)
            for source in silent
            for cursor in source.cursors.values()
        ]

    def _hear(self, name: str, received_at_s: float) -> TrackedSource:
        source = self.sources.setdefault(name, TrackedSource(name))
        source.heard_at_s = received_at_s
        return source

    def _end_frame(self, pending: _Pending, fseq: int, received_at_s: float) -> list[TouchEvent]:
        source = self._hear(pending.source, received_at_s)
        if not _count_frame(source, fseq) or pending.alive is None:
            return []
        gone = [source.cursors.pop(id_) for id_ in list(source.cursors) if id_ not in pending.alive]
        for cursor in gone:
            del source.since_s[cursor.id]
        events = [TouchEvent("remove", source.name, cursor) for cursor in gone]
        for cursor in pending.cursors.values():
            if cursor.id not in pending.alive:
                continue
            before = source.cursors.get(cursor.id)
            source.cursors[cursor.id] = cursor
            source.since_s.setdefault(cursor.id, received_at_s)
            if before is None:
                events.append(TouchEvent("add", source.name, cursor))
            elif before != cursor:
                events.append(TouchEvent("update", source.name, cursor))
        return events


def parse_commands(datagram: bytes) -> list[_Command]:
    """Return what a datagram says about cursors, other profiles left out.

    Raises `MalformedPacketError`.
    """
    return [
        _command(message.params)
        for message in _messages(datagram)
        if message.address == "/tuio/2Dcur"
    ]


def _count_frame(source: TrackedSource, fseq: int) -> bool:
    """Count a frame number; tell whether the frame is to be believed."""
    if fseq == REDUNDANT_FSEQ:
        return True
    last = source.fseq
    if last is not None and last - LATE_WITHIN <= fseq < last:
        source.late_frames += 1
        return False
    if last is not None and last + 1 < fseq <= last + LATE_WITHIN:
        source.lost_frames += fseq - last - 1
    source.frames += fseq != last
    source.fseq = fseq
    return True


def _messages(datagram: bytes) -> list[osc_message.OscMessage]:
    """Take bundles apart here: python-osc loops for ever on an element of negative length."""
    found = []
    waiting = [datagram]
    while waiting:
        element = waiting.pop()
        if element.startswith(_BUNDLE):
            waiting += reversed(_elements(element))
        elif element.startswith(b"/"):
            found.append(_message(element))
        else:
            raise MalformedPacketError("neither an OSC message nor a bundle")
    return found


def _elements(bundle: bytes) -> list[bytes]:
    elements = []
    offset = _BUNDLE_HEAD_BYTES
    if len(bundle) < offset:
        raise MalformedPacketError("a bundle without time tag")
    while offset < len(bundle):
        rest = len(bundle) - offset - 4
        size = struct.unpack_from(">i", bundle, offset)[0] if rest >= 0 else 0
        if size <= 0 or size % 4 or size > rest:
            raise MalformedPacketError(f"a bundle element of {size} bytes with {rest} left")
        elements.append(bundle[offset + 4 : offset + 4 + size])
        offset += 4 + size
    return elements


def _message(element: bytes) -> osc_message.OscMessage:
    try:
        return osc_message.OscMessage(element)
    except (osc_message.ParseError, ValueError, OverflowError) as error:
        raise MalformedPacketError("a message that is not OSC") from error


def _command(arguments: Sequence[Any]) -> _Command:
    match arguments:
        case ["source", str(name)]:
            return _Source(_printable(name))
        case ["alive", *ids] if all(isinstance(id_, int) for id_ in ids):
            return _Alive(frozenset(ids))
        case ["fseq", int(fseq)]:
            return _FrameEnd(fseq)
        case ["set", int(id_), x, y, *rest] if all(map(_is_finite_number, (x, y, *rest))):
            # Some trackers leave out speed and acceleration, some add width and height.
            x_speed, y_speed, acceleration = (*rest, 0.0, 0.0, 0.0)[:3]
            return Cursor(id_, x, y, x_speed, y_speed, acceleration)
    raise MalformedPacketError(f"not a 2Dcur message: {list(arguments)[:8]}")


def _printable(name: str) -> str:
    """Return a name without what could command a terminal, of bounded length."""
    kept = name[:MAX_SOURCE_BYTES]
    return "".join(character if character.isprintable() else "?" for character in kept)


def _is_finite_number(value: object) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)
