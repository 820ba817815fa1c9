"""What a TUIO client understands, of any tracker and of any datagram."""

import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pythonosc.osc_message_builder import OscMessageBuilder

from cornertouchd.wire.tuio import BundleEncoder, Cursor
from cornertouchd.wire.tuio_reader import TouchEvent, TuioReader

SENDER = "10.0.0.5:40000"


def cursor(session_id: int, x: float = 0.5) -> Cursor:
    return Cursor(session_id, x, 0.25, 0.0, 0.0, 0.0)


def bundle(fseq: int, *cursors: Cursor, source: str = "one@a") -> bytes:
    return BundleEncoder(source).encode([c.id for c in cursors], cursors, fseq)


def kinds(events: list[TouchEvent]) -> list[tuple[str, int]]:
    return [(event.kind, event.cursor.id) for event in events]


def message(*arguments: object, address: str = "/tuio/2Dcur") -> bytes:
    builder = OscMessageBuilder(address)
    for argument in arguments:
        builder.add_arg(argument)  # type: ignore[arg-type]
    return builder.build().dgram


def bundled(*elements: bytes) -> bytes:
    head = b"#bundle\0" + struct.pack(">Q", 1)
    return head + b"".join(struct.pack(">i", len(element)) + element for element in elements)


def test_contacts_come_move_and_go() -> None:
    reader = TuioReader()
    assert kinds(reader.feed(bundle(1, cursor(7)), SENDER, 0.0)) == [("add", 7)]
    assert kinds(reader.feed(bundle(2, cursor(7, 0.75)), SENDER, 0.1)) == [("update", 7)]
    assert kinds(reader.feed(bundle(3, cursor(7, 0.75)), SENDER, 0.2)) == []
    moved = reader.feed(bundle(4, cursor(8)), SENDER, 0.3)
    assert kinds(moved) == [("remove", 7), ("add", 8)]
    assert moved[0].cursor.x == 0.75
    assert reader.sources["one@a"].since_s == {8: 0.3}


def test_each_tracker_is_followed_on_its_own() -> None:
    reader = TuioReader()
    reader.feed(bundle(1, cursor(7)), SENDER, 0.0)
    assert kinds(reader.feed(bundle(1, cursor(7), source="two@b"), SENDER, 0.0)) == [("add", 7)]
    assert kinds(reader.feed(bundle(2, source="two@b"), SENDER, 0.0)) == [("remove", 7)]
    assert set(reader.sources["one@a"].cursors) == {7}


def test_a_tracker_of_tuio_1_0_has_the_name_of_its_address_and_may_send_message_by_message() -> (
    None
):
    reader = TuioReader()
    parts = [message("alive", 3), message("set", 3, 0.5, 0.25, 0.0, 0.0, 0.0), message("fseq", 1)]
    events = [event for part in parts for event in reader.feed(part, SENDER, 0.0)]
    assert events == [TouchEvent("add", SENDER, cursor(3))]
    assert reader.sources[SENDER].packets == 3


def test_a_name_cannot_command_the_terminal() -> None:
    reader = TuioReader()
    name = "\x1b[2Jevil\n" + "x" * 1000
    reader.feed(bundled(message("source", name), message("fseq", 1)), SENDER, 0.0)
    assert list(reader.sources) == ["?[2Jevil?" + "x" * 191]


def test_a_set_may_lack_speed_or_carry_a_size() -> None:
    reader = TuioReader()
    short = message("set", 1, 0.5, 0.25)
    long = message("set", 2, 0.5, 0.25, 1.0, 2.0, 3.0, 0.1, 0.1)
    events = reader.feed(bundled(message("alive", 1, 2), short, long, message("fseq", 5)), "s", 0.0)
    assert [tuple(event.cursor) for event in events] == [
        (1, 0.5, 0.25, 0.0, 0.0, 0.0),
        (2, 0.5, 0.25, 1.0, 2.0, 3.0),
    ]


def test_other_profiles_are_left_alone() -> None:
    reader = TuioReader()
    other = message("alive", 1, address="/tuio/2Dobj")
    assert reader.feed(bundled(other, message("fseq", 1, address="/tuio/2Dobj")), "s", 0.0) == []
    assert reader.sources == {}
    assert (reader.packets, reader.malformed) == (1, 0)


def test_gaps_in_the_frame_numbers_are_lost_frames() -> None:
    reader = TuioReader()
    for fseq in (10, 11, 14, 14, -1, 15):
        reader.feed(bundle(fseq, cursor(1)), SENDER, 0.0)
    source = reader.sources["one@a"]
    assert (source.lost_frames, source.late_frames, source.frames) == (2, 0, 4)


def test_a_late_frame_is_dropped_but_a_restart_is_followed() -> None:
    reader = TuioReader()
    reader.feed(bundle(500, cursor(1)), SENDER, 0.0)
    assert reader.feed(bundle(450), SENDER, 0.0) == []
    assert kinds(reader.feed(bundle(399), SENDER, 0.0)) == [("remove", 1)]
    reader.feed(bundle(90_000, cursor(1)), SENDER, 0.0)
    source = reader.sources["one@a"]
    assert (source.lost_frames, source.late_frames) == (0, 1)


def test_a_tracker_that_died_is_forgotten_with_its_touches() -> None:
    reader = TuioReader()
    reader.feed(bundle(1, cursor(7)), SENDER, 100.0)
    assert reader.forget_silent(160.0) == []
    assert kinds(reader.forget_silent(160.1)) == [("remove", 7)]
    assert reader.sources == {}


def test_a_sender_that_never_ends_its_frame_fills_no_memory() -> None:
    reader = TuioReader()
    for session_id in range(5000):
        reader.feed(message("set", session_id, 0.5, 0.5), SENDER, 0.0)
        reader.feed(message("alive", 1), f"10.0.0.6:{session_id}", 0.0)
    assert len(reader._pending) <= 101


BROKEN = {
    "empty": b"",
    "no OSC": b"GET / HTTP/1.1\r\n\r\n",
    "no time tag": b"#bundle\0",
    "no length": bundled() + b"\0\0",
    "negative length": bundled() + struct.pack(">i", -4),
    "no end": bundled() + struct.pack(">i", 400) + b"/tuio",
    "odd length": bundled() + struct.pack(">i", 3) + b"/a\0",
    "nothing said": message(),
    "unknown command": message("sit", 1),
    "id no number": message("set", "one", 0.5, 0.5),
    "no y": message("set", 1, 0.5),
    "x no number": message("set", 1, "left", 0.5),
    "x not finite": message("set", 1, float("nan"), 0.5),
    "alive no number": message("alive", "all"),
    "fseq no number": message("fseq", 1.5),
    "not UTF-8": b"/tuio/2Dcur\0,s\0\0\xff\xfe\0\0",
    "cut off": message("alive", 1, 2)[:-4],
    "deeply nested": b"",
}
for _ in range(2000):
    BROKEN["deeply nested"] = bundled(BROKEN["deeply nested"])


@pytest.mark.parametrize("datagram", BROKEN.values(), ids=BROKEN)
def test_a_malformed_packet_is_counted_and_changes_nothing(datagram: bytes) -> None:
    reader = TuioReader()
    reader.feed(bundle(1, cursor(7)), SENDER, 0.0)
    assert reader.feed(datagram, SENDER, 1.0) == []
    assert (reader.malformed, reader.packets) == (1, 2)
    assert reader.last_malformed
    assert kinds(reader.feed(bundle(2), SENDER, 2.0)) == [("remove", 7)]


def test_a_packet_is_taken_whole_or_not_at_all() -> None:
    reader = TuioReader()
    half = bundled(message("alive", 1), message("set", 1, 0.5, 0.5), message("fseq"))
    assert reader.feed(half, SENDER, 0.0) == []
    assert kinds(reader.feed(bundled(message("fseq", 1)), SENDER, 0.0)) == []


@settings(deadline=None)
@given(st.binary(max_size=60), st.text("ifshdbrmtTFN[]x", max_size=8), st.booleans())
def test_no_datagram_raises(payload: bytes, tags: str, in_bundle: bool) -> None:
    tag_string = b"," + tags.encode()
    padded = tag_string + b"\0" * (4 - len(tag_string) % 4)
    payload += b"\0" * (-len(payload) % 4)
    datagram = b"/tuio/2Dcur\0" + padded + payload
    reader = TuioReader()
    reader.feed(bundled(datagram) if in_bundle else datagram, SENDER, 0.0)
    reader.feed(payload, SENDER, 0.0)
    assert reader.packets == 2
