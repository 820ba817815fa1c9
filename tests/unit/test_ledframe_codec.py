"""The LED frame's messages: what is sent is what is read, and noise is never taken for it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.wire import ledframe as wire
from cornertouchd.wire.ledframe_faults import explain
from cornertouchd.wire.ledframe_framing import (
    FramingError,
    Kind,
    Message,
    StreamDecoder,
    crc16,
    decode,
    encode,
    stuff,
    unstuff,
)
from cornertouchd.wire.ledframe_reports import (
    Booted,
    ControllerStatus,
    FaultsChanged,
    FrameLit,
    Identity,
    SelfTested,
    StateChanged,
    encode_event,
    read_event,
)

U8, U16, U32 = st.integers(0, 255), st.integers(0, 65535), st.integers(0, 2**32 - 1)
FAULTS = U16.map(wire.Fault)
STATES = st.sampled_from(wire.State)
MESSAGES = st.builds(
    Message, st.sampled_from(Kind), U8, U8, st.binary(max_size=48), st.integers(0, 63)
)
REQUESTS = st.one_of(
    st.builds(wire.Hello),
    st.builds(wire.AskStatus),
    st.builds(wire.Echo, st.binary(max_size=47)),
    st.builds(wire.SetLevels, st.tuples(U8, U8, U8, U8)),
    st.builds(wire.SetTiming, U16, U16, st.integers(-32768, 32767)),
    st.builds(wire.SetPattern, st.lists(U8, max_size=8).map(tuple)),
    st.builds(wire.Arm),
    st.builds(wire.Disarm),
    st.builds(wire.ClearFaults, FAULTS),
    st.builds(wire.SetWatchdog, U16),
    st.builds(wire.SelfTest),
    st.builds(wire.SetReport, U8),
    st.builds(wire.Reset),
)
EVENTS = st.one_of(
    st.builds(Booted, U8, U16),
    st.builds(FaultsChanged, FAULTS, FAULTS, U32, STATES),
    st.builds(FrameLit, U32, U8, U32),
    st.builds(StateChanged, STATES, STATES, U8),
    st.builds(SelfTested, STATES, STATES, U8),
)


def test_crc_is_the_one_of_the_specification() -> None:
    assert crc16(b"123456789") == 0x29B1


@pytest.mark.parametrize(
    ("request_", "sequence", "sent"),
    [
        (wire.Hello(), 7, "00 06 01 07 01 72 1a 00"),
        (wire.SetLevels((0, 1, 0, 255)), 0, "00 02 01 02 10 02 01 04 ff 64 35 00"),
    ],
)
def test_requests_byte_for_byte(request_: wire.Request, sequence: int, sent: str) -> None:
    assert encode(wire.encode_request(request_, sequence)) == bytes.fromhex(sent)


@pytest.mark.parametrize(
    ("plain", "stuffed"),
    [  # examples of Cheshire and Baker
        (b"", b"\x01"),
        (b"\x00", b"\x01\x01"),
        (b"\x00\x00", b"\x01\x01\x01"),
        (b"\x11\x22\x00\x33", b"\x03\x11\x22\x02\x33"),
        (b"\x11\x00\x00\x00", b"\x02\x11\x01\x01\x01"),
    ],
)
def test_stuffing_by_example(plain: bytes, stuffed: bytes) -> None:
    assert stuff(plain) == stuffed
    assert unstuff(stuffed) == plain


@given(st.binary(max_size=253))
def test_stuffed_bytes_hold_no_zero_and_come_back(data: bytes) -> None:
    stuffed = stuff(data)
    assert 0 not in stuffed
    assert unstuff(stuffed) == data


@given(st.binary(max_size=80))
def test_any_bytes_are_a_message_or_refused(data: bytes) -> None:
    try:
        message = decode(data)
    except FramingError:
        return
    assert encode(message) == b"\0" + data + b"\0"


@given(MESSAGES)
def test_messages_come_back(message: Message) -> None:
    assert StreamDecoder().feed(encode(message)) == [message]


@given(st.lists(MESSAGES, max_size=5), st.data())
def test_messages_come_back_however_the_stream_is_cut(
    messages: list[Message], data: st.DataObject
) -> None:
    stream = b"".join(map(encode, messages))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=10)))
    decoder = StreamDecoder()
    found = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += decoder.feed(stream[start:end])
    assert found == messages
    assert (decoder.counts.messages, decoder.counts.bad) == (len(messages), 0)


@given(st.binary(max_size=300), MESSAGES)
def test_a_message_after_any_garbage_is_found(garbage: bytes, message: Message) -> None:
    assert StreamDecoder().feed(garbage + encode(message))[-1] == message


@given(MESSAGES, st.data())
def test_a_garbled_byte_is_never_taken(message: Message, data: st.DataObject) -> None:
    sent = bytearray(encode(message))
    sent[data.draw(st.integers(1, len(sent) - 2))] ^= data.draw(st.integers(1, 255))
    assert message not in StreamDecoder().feed(bytes(sent))


def test_bad_frames_are_counted() -> None:
    decoder = StreamDecoder()
    decoder.feed(b"\0\x05ab\0" + b"x" * 5000 + b"\0\0\0")
    assert decoder.counts.bad == 2


@given(REQUESTS, U8)
def test_requests_come_back(request: wire.Request, sequence: int) -> None:
    message = wire.encode_request(request, sequence)
    assert (message.kind, message.sequence) == (Kind.REQUEST, sequence)
    assert wire.read_request(message) == request


@given(EVENTS, U8)
def test_events_come_back(event: Booted, sequence: int) -> None:
    read = read_event(encode_event(event, sequence))
    assert read == event
    assert type(read) is type(event)


@given(
    st.builds(
        ControllerStatus, STATES, FAULTS, U32, U32, U8,
        st.integers(-400, 1250).map(lambda tenths: tenths / 10), U16, U16, U16, U16,
    )
)  # fmt: skip
def test_status_comes_back(status: ControllerStatus) -> None:
    assert ControllerStatus.read(status.payload) == status


@given(st.builds(Identity, st.tuples(U8, U8), st.tuples(U8, U8, U8), U8, U8, U8, U16, U16, U8))
def test_identity_comes_back_with_whatever_later_protocols_add(identity: Identity) -> None:
    assert Identity.read(identity.payload) == identity
    assert Identity.read(identity.payload + b"more") == identity


@given(st.sampled_from(wire.REQUESTS), st.binary(max_size=48))
def test_payloads_of_any_length_are_read_or_refused(
    request: type[wire.Request], payload: bytes
) -> None:
    try:
        read = request.read(payload)
    except wire.ProtocolError:
        return
    assert read.payload == payload


def test_another_device_is_no_led_frame() -> None:
    with pytest.raises(wire.ProtocolError, match="no cornertouchd LED frame"):
        Identity.read(bytes(17))


def test_too_long_payloads_are_not_sent() -> None:
    with pytest.raises(ValueError, match="49 bytes, at most 48"):
        encode(Message(Kind.REQUEST, 0, 3, bytes(49)))


def test_every_fault_is_explained_with_its_side() -> None:
    for fault in wire.Fault:
        assert len(explain(fault)) == 1
    assert explain(wire.Fault.OPEN_RIGHT | wire.Fault.OVERCURRENT)[1].startswith("right side")
    assert explain(wire.Fault(0)) == []
