"""The rules of TUIO 1.1: every planted violation is found, none is seen in what is right."""

import math
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st
from osc_bytes import bundle, message

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import TuioSession
from cornertouchd.wire.tuio_blobs import BlobTelling
from cornertouchd.wire.tuio_rules import PROFILES, Rule, TuioCheck, Violation

CURSOR = "/tuio/2Dcur"
BLOB = "/tuio/2Dblb"
SENDER = "127.0.0.1:40000"
SOURCE = message(CURSOR, "source", "table@10.0.0.5")


def alive(*ids: int, profile: str = CURSOR) -> bytes:
    return message(profile, "alive", *ids)


def placed(id_: int, x: float = 0.25, y: float = 0.5, *more: float) -> bytes:
    return message(CURSOR, "set", id_, x, y, *(more or (0.0, 0.0, 0.0)))


def fseq(number: int, profile: str = CURSOR) -> bytes:
    return message(profile, "fseq", number)


def frame(number: int, *ids: int) -> bytes:
    return bundle(SOURCE, alive(*ids), *map(placed, ids), fseq(number))


def found(*packets: bytes, transport: str = "udp") -> list[Violation]:
    check = TuioCheck(transport)
    return [violation for packet in packets for violation in check.feed(packet, SENDER)]


def blob(*values: float) -> bytes:
    return bundle(alive(1, profile=BLOB), message(BLOB, "set", 1, *values), fseq(1, BLOB))


ROUND = (0.5, 0.5, 0.0, 0.02, 0.03, 0.0005, 0.0, 0.0, 0.0, 0.0, 0.0)
GOOD = frame(1, 7)
LARGE = frame(1, *range(40))
WHOLE = bundle(SOURCE, alive(7), placed(7), fseq(1))

# What is planted, the packets, and what must be found: rule, packet, byte.  Bytes: a bundle begins
# with 16, each element with 4; the source message has 40, so alive begins at 16 + 4 + 40 + 4.
CORPUS = {
    "nothing at all": ([b""], ("osc", 1, 0)),
    "no OSC": ([b"hello, table"], ("osc", 1, 0)),
    "a bundle cut off in its time tag": ([GOOD[:12]], ("osc", 1, 12)),
    "an element longer than the packet": ([GOOD[:-4]], ("osc", 1, len(GOOD) - 32)),
    "an element of no length": ([bundle(b"") + GOOD[16:]], ("osc", 1, 16)),
    "an element of negative length": ([bundle()[:16] + b"\xff\xff\xff\xf0"], ("osc", 1, 16)),
    "an element of five bytes": ([bundle(b"/a\0\0,")], ("osc", 1, 16)),
    "bytes after the last element": ([GOOD + b"\0\0"], ("osc", 1, len(GOOD))),
    "a bundle in a bundle": ([bundle(GOOD)], ("osc", 1, 20)),
    "an address without slash": ([bundle(b"tuio\0\0\0\0,\0\0\0")], ("osc", 1, 20)),
    "no type tags": ([bundle(b"/tuio/2Dcur\0")], ("osc", 1, 32)),
    "type tags without comma": ([bundle(b"/tuio/2Dcur\0s\0\0\0")], ("osc", 1, 32)),
    "a type that TUIO has not": ([bundle(b"/tuio/2Dcur\0,b\0\0")], ("osc", 1, 32)),
    "fewer arguments than tags": ([bundle(b"/tuio/2Dcur\0,i\0\0")], ("osc", 1, 36)),
    "more bytes than arguments": ([bundle(alive() + b"\0\0\0\0")], ("osc", 1, 20 + 24)),
    "a string without end": ([bundle(b"/tuio/2Dcur\0,s\0\0abcd")], ("osc", 1, 36)),
    "a string filled up with letters": ([bundle(b"/tuio/2Dcur\0,s\0\0a\0b\0")], ("osc", 1, 37)),
    "a string that is not ASCII": ([bundle(message(CURSOR, "b\xe4r"))], ("osc", 1, 36)),
    "a message without bundle": ([alive()], ("bundle", 1, 0)),
    "too large for one Ethernet packet": ([LARGE], ("size", 1, 1472)),
    "an address of something else": ([bundle(message("/mouse", 1))], ("profile", 1, 20)),
    "a profile that there is not": (
        [bundle(alive(profile="/tuio/4Dcur"), fseq(1, "/tuio/4Dcur"))],
        ("profile", 1, 20),
    ),
    "two profiles in one bundle": (
        [bundle(alive(), fseq(1, BLOB), fseq(1))],
        ("profile", 1, 16 + 4 + 24 + 4),
    ),
    "no alive": ([bundle(SOURCE, fseq(1))], ("order", 1, 16 + 4 + 40 + 4 + 28)),
    "no fseq": ([bundle(SOURCE, alive())], ("order", 1, 16 + 4 + 40 + 4 + 24)),
    "set before alive": ([bundle(placed(7), alive(7), fseq(1))], ("order", 1, 20)),
    "set after fseq": ([bundle(alive(7, 8), placed(7), fseq(1), placed(8))], ("order", 1, 148)),
    "alive twice": ([bundle(alive(), alive(), fseq(1))], ("order", 1, 48)),
    "alive after fseq": ([bundle(fseq(1), alive())], ("order", 1, 52)),
    "fseq twice": ([bundle(alive(), fseq(1), fseq(2))], ("order", 1, 80)),
    "source after alive": ([bundle(alive(), SOURCE, fseq(1))], ("order", 1, 48)),
    "a command that there is not": (
        [bundle(alive(), message(CURSOR, "move", 7), fseq(1))],
        ("order", 1, 48),
    ),
    "no command": ([bundle(message(CURSOR, 3), alive(), fseq(1))], ("order", 1, 20)),
    "source twice": ([bundle(SOURCE, SOURCE, alive(), fseq(1))], ("source", 1, 64)),
    "source without address": (
        [bundle(message(CURSOR, "source", "table"), alive(), fseq(1))],
        ("source", 1, 44),
    ),
    "source that is a number": (
        [bundle(message(CURSOR, "source", 3), alive(), fseq(1))],
        ("source", 1, 20),
    ),
    "alive with a wide id": (
        [bundle(message(CURSOR, "alive", 7, tags="sh"), fseq(1))],
        ("alive", 1, 20),
    ),
    "an id twice in alive": (
        [bundle(alive(7, 7), placed(7), fseq(1))],
        ("alive", 1, 20 + 12 + 8 + 8 + 4),
    ),
    "a set of an id that is not alive": (
        [bundle(alive(7), placed(7), placed(8), fseq(1))],
        ("set", 1, 108),
    ),
    "an id set twice": ([bundle(alive(7), placed(7), placed(7), fseq(1))], ("set", 1, 108)),
    "a set without acceleration": (
        [bundle(alive(7), message(CURSOR, "set", 7, 0.5, 0.5, 0.0, 0.0), fseq(1))],
        ("set", 1, 52),
    ),
    "a set in double precision": (
        [
            bundle(
                alive(7),
                message(CURSOR, "set", 7, 0.5, 0.5, 0.0, 0.0, 0.0, tags="siddfff"),
                fseq(1),
            )
        ],
        ("set", 1, 52),
    ),
    "x beyond the surface": ([bundle(alive(7), placed(7, 1.01), fseq(1))], ("range", 1, 84)),
    "y beyond the surface": ([bundle(alive(7), placed(7, 0.5, -0.01), fseq(1))], ("range", 1, 88)),
    "x that is no number": ([bundle(alive(7), placed(7, math.nan), fseq(1))], ("range", 1, 84)),
    "a speed without bound": (
        [bundle(alive(7), placed(7, 0.5, 0.5, math.inf, 0.0, 0.0), fseq(1))],
        ("range", 1, 92),
    ),
    "a blob wider than the surface": (
        [blob(0.5, 0.5, 0.0, 1.5, *ROUND[4:])],
        ("range", 1, 100),
    ),
    "a blob turned more than once": ([blob(0.5, 0.5, 6.4, *ROUND[3:])], ("range", 1, 96)),
    "a frame that goes back": ([frame(5), frame(4)], ("fseq", 2, len(frame(4)) - 4)),
    "a frame below -1": ([frame(-2)], ("fseq", 1, len(frame(0)) - 4)),
    "a frame number that is a float": (
        [bundle(alive(), message(CURSOR, "fseq", 1.0))],
        ("fseq", 1, 48),
    ),
    "a frame split so that alive loses an id": (
        [frame(1, 7, 8), frame(1, 8)],
        ("fseq", 2, len(frame(1, 8)) - 4),
    ),
    "an id that is used again": ([frame(1, 7), frame(2), frame(3, 7)], ("id", 3, 88)),
    "an id that is never told where it is": (
        [frame(1), bundle(SOURCE, alive(7), fseq(2))],
        ("alive", 2, 88),
    ),
}


@pytest.mark.parametrize("planted", CORPUS)
def test_a_planted_violation_is_found_where_it_is(planted: str) -> None:
    packets, (rule, packet, offset) = CORPUS[planted]
    violations = found(*packets)
    assert [(each.rule, each.packet, each.offset) for each in violations] == [
        (rule, packet, offset)
    ], violations
    assert violations[0].what


def test_every_rule_has_a_planted_violation() -> None:
    rules = {rule for _, (rule, _, _) in CORPUS.values()}
    assert rules == set(get_args(Rule))


@pytest.mark.parametrize(
    "packets",
    [
        pytest.param([frame(0), frame(1, 7), frame(2, 7, 8), frame(3)], id="touches come and go"),
        pytest.param([bundle(alive(), fseq(1))], id="no source"),
        pytest.param([frame(5), frame(-1), frame(6)], id="repeats"),
        pytest.param([bundle(SOURCE, alive(7), fseq(9))], id="told before we listened"),
        pytest.param([frame(1, 7), bundle(SOURCE, alive(7), fseq(2))], id="a finger at rest"),
        pytest.param([frame(1), bundle(SOURCE, alive(7), fseq(5))], id="told in a lost packet"),
        pytest.param([frame(1000, 7), frame(3, 7)], id="started anew"),
        pytest.param([frame(1, 7), frame(1, 7, 8)], id="split"),
        pytest.param([frame(1, 7), blob(*ROUND)], id="blobs beside cursors, the same frame number"),
        pytest.param([bundle(alive(profile="/tuio/_sifff"), fseq(1, "/tuio/_sifff"))], id="free"),
    ],
)
def test_what_is_right_is_right(packets: list[bytes]) -> None:
    assert found(*packets) == []


def test_lost_frames_are_counted_and_no_violation() -> None:
    check = TuioCheck()
    for number in (1, 2, 5, 6, -1, 9):
        assert check.feed(frame(number), SENDER) == []
    assert (check.packets, check.lost_frames) == (6, 4)


def test_sources_do_not_disturb_each_other() -> None:
    check = TuioCheck()
    other = bundle(message(CURSOR, "source", "wall@10.0.0.6"), alive(7), placed(7), fseq(900))
    for packet in (frame(1, 7), other, frame(2), other, frame(3, 8)):
        assert check.feed(packet, SENDER) == []


def test_streams_may_send_more_at_once_than_datagrams() -> None:
    assert found(LARGE, transport="tcp") == []
    assert found(frame(1, *range(1200)), transport="websocket")[0].rule == "size"


@pytest.mark.parametrize("profile", PROFILES)
def test_every_profile_is_known(profile: str) -> None:
    address, letters = f"/tuio/{profile}", PROFILES[profile]
    values = [1 if letter in "si" else 0.5 for letter in letters]
    packet = bundle(alive(1, profile=address), message(address, "set", *values), fseq(1, address))
    assert found(packet) == []
    wrong = bundle(
        alive(1, profile=address), message(address, "set", *values, 0.5), fseq(1, address)
    )
    assert [each.rule for each in found(wrong)] == ["set"]


@given(st.lists(st.lists(st.integers(0, 30), unique=True, max_size=30), max_size=12))
def test_what_we_send_is_right(frames: list[list[int]]) -> None:
    mapping = DisplayMapping(0.0, 0.0, 400.0, 200.0)
    session = TuioSession(mapping, "we@127.0.0.1", 5, 5)
    blobs = BlobTelling(mapping, "we@127.0.0.1")
    packets = [session.empty(), blobs.empty()]
    told: dict[int, int] = {}
    for number, fingers in enumerate(frames):
        # as from the tracker: a finger that comes back is another touch
        told = {each: told.get(each, 1000 * number + each) for each in fingers}
        touches = TouchFrame(
            0.01 * number,
            tuple(
                Touch(id_, 13.0 * each, 5.0 * each, 99.0, -9.0, 0.0, 8.0)
                for each, id_ in told.items()
            ),
        )
        cursors = session.frame(touches)
        packets += cursors
        if cursors:
            packets += blobs.frame(touches, session.told, session.told_fseq)
        packets += [session.whole(), *session.full_state(), *blobs.full_state()]
    assert [each for each in found(*packets) if each.rule != "size"] == []


@given(st.binary(max_size=200), st.binary(max_size=60))
def test_no_bytes_make_it_stumble(noise: bytes, tail: bytes) -> None:
    check = TuioCheck()
    for packet in (noise, bundle()[:16] + noise, GOOD[:40] + tail, bundle(noise)):
        check.feed(packet, SENDER)


@given(st.integers(0, len(WHOLE) - 1), st.integers(0, 255))
def test_no_changed_byte_makes_it_stumble(place: int, value: int) -> None:
    changed = bytearray(WHOLE)
    changed[place] = value
    for violation in found(bytes(changed)):
        assert 0 <= violation.offset <= len(changed)
