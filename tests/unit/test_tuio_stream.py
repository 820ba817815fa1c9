"""Bundles over TCP and WebSocket, without sockets."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from websockets.frames import Frame, Opcode

from cornertouchd.wire.tuio_stream import (
    MAX_BUNDLE_BYTES,
    TCP,
    MalformedStreamError,
    PrefixedBundles,
    length_prefixed,
)
from cornertouchd.wire.websocket import binary_message, websocket_dialect

SHAKE = (
    b"GET / HTTP/1.1\r\nHost: a\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
)


@given(st.lists(st.binary(min_size=1, max_size=300), max_size=8), st.data())
def test_bundles_come_out_of_tcp_as_they_went_in(bundles: list[bytes], data: st.DataObject) -> None:
    stream = b"".join(map(length_prefixed, bundles))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
    reader = PrefixedBundles()
    received: list[bytes] = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        received += reader.feed(stream[start:end])
    assert received == bundles


def test_the_length_is_big_endian_and_leaves_itself_out() -> None:
    assert length_prefixed(b"abcd") == b"\0\0\0\4abcd"


@pytest.mark.parametrize("length", [b"\0\0\0\0", b"\xff\xff\xff\xff", b"\0\1\0\1"])
def test_a_length_that_no_bundle_has_ends_the_stream(length: bytes) -> None:
    with pytest.raises(MalformedStreamError, match=f"must be 1..{MAX_BUNDLE_BYTES}"):
        PrefixedBundles().feed(length)


def test_over_tcp_clients_say_nothing_and_hear_at_once() -> None:
    conversation = TCP.converse()
    assert conversation.is_ready
    assert conversation.receive(b"GET / HTTP/1.1\r\n\r\n") == b""
    assert not conversation.is_over
    assert conversation.farewell() == b""


@given(st.binary(max_size=70_000))
def test_a_message_is_a_whole_binary_frame_without_mask(payload: bytes) -> None:
    message = binary_message(payload)
    assert message[0] == 0x82  # FIN, binary
    assert not message[1] & 0x80
    assert message.endswith(payload)
    assert len(message) - len(payload) == next(
        head for head, largest in ((2, 125), (4, 65_535), (10, 2**63)) if len(payload) <= largest
    )


def test_a_handshake_ping_and_close() -> None:
    conversation = websocket_dialect(()).converse()
    assert not conversation.is_ready
    answer = conversation.receive(SHAKE)
    assert answer.startswith(b"HTTP/1.1 101 ")
    assert b"Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=" in answer  # RFC 6455, 1.3
    assert conversation.is_ready
    assert conversation.receive(masked(Opcode.PING, b"hi")) == b"\x8a\2hi"
    assert conversation.receive(masked(Opcode.TEXT, b"hi")) == b""
    assert conversation.receive(masked(Opcode.CLOSE, b"\x03\xe8")) == b"\x88\2\x03\xe8"
    assert conversation.is_over
    assert not conversation.is_ready
    assert conversation.refusal == ""
    assert conversation.receive(b"more") == b""


def test_a_handshake_that_comes_byte_by_byte() -> None:
    conversation = websocket_dialect(()).converse()
    answers = [conversation.receive(SHAKE[place : place + 1]) for place in range(len(SHAKE))]
    assert answers[-1].startswith(b"HTTP/1.1 101 ")
    assert not any(answers[:-1])


def test_a_farewell_says_that_the_server_goes_away() -> None:
    conversation = websocket_dialect(()).converse()
    assert conversation.farewell() == b""
    conversation.receive(SHAKE)
    assert conversation.farewell() == b"\x88\2\x03\xe9"


def test_a_frame_without_mask_is_refused_as_the_standard_demands() -> None:
    conversation = websocket_dialect(()).converse()
    conversation.receive(SHAKE)
    assert conversation.receive(b"\x81\2hi").startswith(b"\x88")
    assert conversation.is_over


@pytest.mark.parametrize(
    ("opcode", "payload"),
    [(Opcode.CLOSE, b"\x03\xe8"), (Opcode.PING, b"hi"), (Opcode.TEXT, b"hi")],
)
def test_who_does_not_wait_for_the_handshake_is_sent_away(opcode: Opcode, payload: bytes) -> None:
    conversation = websocket_dialect(()).converse()
    assert conversation.receive(SHAKE + masked(opcode, payload)) == b""
    assert conversation.is_over
    assert not conversation.is_ready
    assert conversation.refusal == "it sent frames before the handshake was done"
    assert conversation.farewell() == b""


@given(st.lists(st.binary(max_size=200), max_size=10), st.sampled_from([b"", SHAKE]), st.booleans())
def test_no_bytes_make_it_stumble(pieces: list[bytes], first: bytes, at_once: bool) -> None:
    conversation = websocket_dialect(()).converse()
    if at_once and pieces:
        pieces = [first + pieces[0], *pieces[1:]]
    else:
        conversation.receive(first)
    for piece in pieces:
        conversation.receive(piece)
    conversation.farewell()


def masked(opcode: Opcode, payload: bytes) -> bytes:
    return Frame(opcode, payload).serialize(mask=True)
