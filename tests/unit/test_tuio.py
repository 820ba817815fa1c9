"""What clients are told: TUIO 1.1 to the letter, and nothing that could confuse one."""

import math
import struct
from collections.abc import Sequence

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pythonosc.osc_bundle import OscBundle
from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
from pythonosc.osc_message_builder import OscMessageBuilder
from pythonosc.parsing import osc_types

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import (
    MAX_CURSORS,
    MAX_PAYLOAD_BYTES,
    BundleEncoder,
    Cursor,
    TuioSession,
    default_source_name,
    seed_at,
)

SOURCE = "cornertouchd-0a1b2c@192.168.1.7"
LAST_INT32 = 2**31 - 1

int32s = st.integers(-(2**31), LAST_INT32)
float32s = st.floats(width=32, allow_nan=False)
cursors = st.builds(Cursor, int32s, *[float32s] * 5)
anything = st.floats()
touches = st.builds(Touch, st.integers(0, 300), anything, anything, anything, anything, anything)


def touch(
    touch_id: int, x_mm: float = 0.0, y_mm: float = 0.0, vx: float = 0.0, vy: float = 0.0
) -> Touch:
    return Touch(touch_id, x_mm, y_mm, vx, vy, 0.0)


def frame(*touches: Touch, at_s: float = 1.0) -> TouchFrame:
    return TouchFrame(at_s, touches)


def session(fseq_seed: int = 1000, id_seed: int = 500, source: str = SOURCE) -> TuioSession:
    """A session of a display that fills a surface of 400 x 200 mm."""
    return TuioSession(DisplayMapping(0.0, 0.0, 400.0, 200.0), source, fseq_seed, id_seed)


def messages(bundle: bytes) -> list[list[object]]:
    assert OscBundle(bundle).timestamp == osc_types.IMMEDIATELY
    parsed = list(OscBundle(bundle))
    assert {message.address for message in parsed} == {"/tuio/2Dcur"}
    return [message.params for message in parsed]


def alive(bundle: bytes) -> list[object]:
    return messages(bundle)[1][1:]


def sets(bundle: bytes) -> list[list[object]]:
    return [message[1:] for message in messages(bundle)[2:-1]]


def fseq(bundle: bytes) -> object:
    return messages(bundle)[-1][1]


def only(bundles: Sequence[bytes]) -> bytes:
    (bundle,) = bundles
    return bundle


# --- the bytes -----------------------------------------------------------------------------------


def built_by_python_osc(
    source: str, alive: Sequence[int], cursors: Sequence[Cursor], fseq: int
) -> bytes:
    bundle = OscBundleBuilder(IMMEDIATELY)

    def add(command: str, *arguments: tuple[object, str]) -> None:
        message = OscMessageBuilder("/tuio/2Dcur")
        message.add_arg(command, "s")
        for value, kind in arguments:
            message.add_arg(value, kind)  # type: ignore[arg-type]
        bundle.add_content(message.build())

    add("source", (source, "s"))
    add("alive", *((id_, "i") for id_ in alive))
    for cursor in cursors:
        add("set", (cursor.id, "i"), *((value, "f") for value in cursor[1:]))
    add("fseq", (fseq, "i"))
    return bundle.build().dgram


@settings(deadline=None)
@given(
    st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=20),
    st.lists(int32s, max_size=20),
    st.lists(cursors, max_size=20),
    int32s,
)
def test_bundles_are_what_python_osc_would_make_of_them(
    name: str, alive: list[int], cursors: list[Cursor], fseq: int
) -> None:
    source = f"{name.replace('@', '')}x@127.0.0.1"
    bundle = BundleEncoder(source).encode(alive, cursors, fseq)
    assert bundle == built_by_python_osc(source, alive, cursors, fseq)


@settings(deadline=None)
@given(st.integers(0, 300), st.integers(0, 40), st.integers(1, 60))
def test_the_size_of_a_bundle_is_known_beforehand(alive: int, sets: int, name: int) -> None:
    encoder = BundleEncoder("n" * name + "@a")
    bundle = encoder.encode(range(alive), [Cursor(0, 0, 0, 0, 0, 0)] * sets, 0)
    assert encoder.size_bytes(alive, sets) == len(bundle)


def test_a_bundle_says_source_alive_set_fseq_in_this_order_and_type() -> None:
    bundle = only(session().frame(frame(touch(7, 100.0, 150.0))))
    assert messages(bundle) == [
        ["source", SOURCE],
        ["alive", 500],
        ["set", 500, 0.25, 0.75, 0.0, 0.0, 0.0],
        ["fseq", 1000],
    ]
    assert bundle.count(b",sifffff\0\0\0\0") == 1
    assert bundle.count(b",si\0") == 2


@pytest.mark.parametrize("source", ["", "tracker", "@10.0.0.1", "tracker@", "träger@a", "a\0b@c"])
def test_a_source_that_is_not_name_at_address_is_refused(source: str) -> None:
    with pytest.raises(ValueError, match="must be name@address in printable ASCII"):
        BundleEncoder(source)


def test_an_endless_source_is_refused() -> None:
    with pytest.raises(ValueError, match="has 303 bytes, at most 200; shorten it"):
        BundleEncoder("n" * 300 + "@ab")


# --- frames --------------------------------------------------------------------------------------


def test_every_contact_is_told_in_every_frame_also_when_it_rests() -> None:
    tuio = session()
    for at_s in (1.0, 1.01, 1.02):
        bundle = only(tuio.frame(frame(touch(1, 40.0, 20.0), touch(2, 80.0, 20.0), at_s=at_s)))
        assert alive(bundle) == [500, 501]
        assert [values[0] for values in sets(bundle)] == [500, 501]


def test_a_finger_that_lifts_is_missing_from_alive_and_the_last_one_leaves_it_empty() -> None:
    tuio = session()
    tuio.frame(frame(touch(1), touch(2)))
    assert alive(only(tuio.frame(frame(touch(2))))) == [501]
    empty = only(tuio.frame(frame()))
    assert (alive(empty), sets(empty), fseq(empty)) == ([], [], 1002)


def test_frames_without_contacts_are_told_once_only() -> None:
    tuio = session()
    assert tuio.frame(frame()) == []
    tuio.frame(frame(touch(1)))
    assert len(tuio.frame(frame())) == 1
    assert tuio.frame(frame()) == []
    assert fseq(only(tuio.frame(frame(touch(2))))) == 1002


def test_velocity_is_in_axis_lengths_per_second_of_the_display() -> None:
    turned = TuioSession(DisplayMapping(0.0, 0.0, 400.0, 200.0, 90), SOURCE, 0, 0)
    values = sets(only(turned.frame(frame(touch(1, 100.0, 50.0, vx=80.0, vy=50.0)))))[0]
    assert values[1:5] == pytest.approx([0.25, 0.75, 0.25, -0.2])


def test_acceleration_is_the_change_of_speed_between_pictures() -> None:
    tuio = session()

    def acceleration(vx_mm_s: float, at_s: float) -> object:
        bundle = only(tuio.frame(frame(touch(1, 100.0, 50.0, vx=vx_mm_s), at_s=at_s)))
        return sets(bundle)[0][5]

    assert acceleration(40.0, at_s=10.0) == 0.0  # nothing to compare with
    assert acceleration(-80.0, at_s=10.5) == pytest.approx(0.2)  # 0.1 -> 0.2 axes a second
    assert acceleration(0.0, at_s=10.75) == pytest.approx(-0.8)
    assert acceleration(40.0, at_s=10.75) == 0.0  # no time has passed
    assert acceleration(80.0, at_s=10.5) == 0.0  # time ran backwards
    assert acceleration(0.0, at_s=math.nan) == 0.0
    assert acceleration(40.0, at_s=11.0) == pytest.approx(0.2)  # since 10.5


def test_a_touch_that_leaves_the_display_and_comes_back_is_another_contact() -> None:
    tuio = session()
    assert alive(only(tuio.frame(frame(touch(1, 399.0, 50.0))))) == [500]
    assert sets(only(tuio.frame(frame(touch(1, 402.0, 50.0)))))[0][:2] == [500, 1.0]
    assert alive(only(tuio.frame(frame(touch(1, 402.5, 50.0))))) == []
    assert alive(only(tuio.frame(frame(touch(1, 402.0, 50.0))))) == [501]


def test_after_everything_was_lifted_a_touch_that_goes_on_is_another_contact() -> None:
    tuio = session()
    tuio.frame(frame(touch(1)))
    empty = tuio.empty()
    assert (alive(empty), fseq(empty)) == ([], -1)
    assert alive(only(tuio.frame(frame(touch(1))))) == [501]


def test_the_full_state_repeats_the_last_frame_as_redundant() -> None:
    tuio = session()
    assert alive(only(tuio.full_state())) == []
    told = only(tuio.frame(frame(touch(1, 100.0, 50.0, vx=3.0), touch(2))))
    repeated = only(tuio.full_state())
    assert messages(repeated)[:-1] == messages(told)[:-1]
    assert fseq(repeated) == -1
    assert fseq(only(tuio.frame(frame(touch(1))))) == 1001


def test_frame_numbers_and_ids_go_on_from_zero_after_the_last_int32() -> None:
    tuio = session(fseq_seed=LAST_INT32, id_seed=LAST_INT32)
    first = only(tuio.frame(frame(touch(1))))
    second = only(tuio.frame(frame(touch(1), touch(2))))
    assert (fseq(first), alive(first)) == (LAST_INT32, [LAST_INT32])
    assert (fseq(second), alive(second)) == (0, [LAST_INT32, 0])


@settings(deadline=None)
@given(st.integers(), st.integers())
def test_any_seed_gives_numbers_that_fit(fseq_seed: int, id_seed: int) -> None:
    bundle = only(session(fseq_seed, id_seed).frame(frame(touch(1))))
    assert fseq(bundle) == fseq_seed % 2**31
    assert alive(bundle) == [id_seed % 2**31]


@settings(deadline=None)
@given(st.floats(0.0, 4e9), st.floats(0.05, 1e4))
def test_a_restart_is_ahead_of_all_that_a_run_could_count(start_s: float, run_s: float) -> None:
    counted_at_250_hz = seed_at(start_s) + int(250 * run_s)
    ahead = (seed_at(start_s + run_s) - counted_at_250_hz) % 2**31
    assert 0 < ahead < 2**30


# --- whatever comes in ---------------------------------------------------------------------------


def test_touches_that_are_not_finite_are_left_out_and_counted() -> None:
    tuio = session()
    broken = [touch(2, math.nan), touch(3, 0.0, math.inf), touch(4, vx=math.nan)]
    assert alive(only(tuio.frame(frame(touch(1), *broken)))) == [500]
    assert tuio.left_out == 3


def test_speeds_beyond_float32_are_clipped() -> None:
    bundle = only(session().frame(frame(touch(1, vx=1e300, vy=-1e300))))
    largest = struct.unpack(">f", b"\x7f\x7f\xff\xff")[0]
    assert sets(bundle)[0][3:5] == [largest, -largest]


@settings(deadline=None)
@given(st.lists(st.tuples(anything, st.lists(touches, max_size=30)), max_size=5))
def test_whatever_the_tracker_says_clients_get_sound_numbers(
    frames: list[tuple[float, list[Touch]]],
) -> None:
    tuio = TuioSession(DisplayMapping(-1.0, -1.0, 2.0, 1e-300), SOURCE, 0, 0)
    for captured_at_s, found in frames:
        for bundle in tuio.frame(TouchFrame(captured_at_s, tuple(found))):
            assert len(bundle) <= MAX_PAYLOAD_BYTES
            for session_id, x, y, *rest in sets(bundle):
                assert session_id in alive(bundle)
                assert 0.0 <= x <= 1.0  # type: ignore[operator]
                assert 0.0 <= y <= 1.0  # type: ignore[operator]
                assert all(map(math.isfinite, rest))  # type: ignore[arg-type]


# --- more contacts than fit a packet -------------------------------------------------------------


def crowd(count: int, first: int = 0) -> list[Touch]:
    return [touch(first + i, i % 400, i // 4) for i in range(count)]


@settings(deadline=None)
@given(st.lists(st.sets(st.integers(0, 120), max_size=70), max_size=6), st.integers(0, 150))
def test_split_frames_leave_no_client_with_a_ghost_or_a_gap(
    frames: list[set[int]], name_length: int
) -> None:
    tuio = session(source="n" * name_length + "x@127.0.0.1")
    shown: set[object] = set()
    for number, ids in enumerate(frames):
        bundles = tuio.frame(frame(*(touch(i, i) for i in sorted(ids)), at_s=float(number)))
        told: list[object] = []
        continuing = {id_ for id_ in shown if bundles and id_ in alive(bundles[-1])}
        for bundle in bundles:
            assert len(bundle) <= MAX_PAYLOAD_BYTES
            assert fseq(bundle) == fseq(bundles[0])
            told += [values[0] for values in sets(bundle)]
            # all that stay are alive in each packet, a new one not before it is set
            assert set(alive(bundle)) == continuing | set(told)
        assert len(told) == len(set(told)) == len(ids)
        first_of_the_old = next((k for k, id_ in enumerate(told) if id_ in continuing), len(told))
        assert continuing.isdisjoint(told[:first_of_the_old])
        assert continuing.issuperset(told[first_of_the_old:])
        shown = set(told)


def test_ten_fingers_fit_one_packet_and_sixty_need_four() -> None:
    assert len(session().frame(frame(*crowd(10)))) == 1
    assert len(session().frame(frame(*crowd(20)))) == 1
    assert len(session().frame(frame(*crowd(60)))) == 4


def test_beyond_two_hundred_contacts_those_already_known_stay() -> None:
    tuio = session(source="n" * 198 + "@a")
    before = tuio.frame(frame(*crowd(MAX_CURSORS, first=1000)))
    after = tuio.frame(frame(*crowd(30), *crowd(MAX_CURSORS, first=1000)))
    assert tuio.left_out == 30
    assert set(alive(after[0])) == set(alive(before[-1]))
    assert max(map(len, before + after)) <= MAX_PAYLOAD_BYTES


# --- names ---------------------------------------------------------------------------------------


def test_the_source_name_is_stable_and_different_for_each_instance() -> None:
    first = default_source_name("kiosk", "/etc/a.toml", "10.0.0.1")
    assert first == default_source_name("kiosk", "/etc/a.toml", "10.0.0.1")
    name, _, address = first.partition("@")
    assert name.startswith("cornertouchd-")
    assert len(name) == len("cornertouchd-") + 6
    assert address == "10.0.0.1"
    others = {
        default_source_name("kiosk2", "/etc/a.toml", "10.0.0.1"),
        default_source_name("kiosk", "/etc/b.toml", "10.0.0.1"),
    }
    assert len(others | {first}) == 3
    BundleEncoder(first)
