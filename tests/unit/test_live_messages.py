"""What the live page is told comes out as it went in, whatever it is."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from live_messages import ToldMoment, ToldStrip, read_message

from cornertouchd.model import (
    Contact,
    DirectingLines,
    FrameSet,
    Lean,
    Observation,
    Shadows,
    Touch,
)
from cornertouchd.vision.strip_view import StripView
from cornertouchd.wire.live import Moment, encode_moment, encode_strip, with_length

numbers = st.floats(-1e4, 1e4, width=32)
leans = st.builds(Lean, numbers, numbers, st.just(0.1), st.just(0.1))
contacts = st.builds(
    Contact,
    numbers,
    numbers,
    numbers,
    st.just(("C1", "C3")),
    st.floats(0, 1, width=32),
    st.just(0.3),
    st.booleans(),
    st.sampled_from(["finger", "palm", "pen"]),
    lean=st.none() | leans,
)
touches = st.builds(
    Touch, st.integers(1, 2**31 - 1), numbers, numbers, numbers, numbers, numbers, numbers
)
times = st.floats(0, 1e7)


def lines_of(bounds: list[tuple[float, float]]) -> DirectingLines:
    first, last = np.array(bounds).reshape(-1, 2).T
    some = np.ones(len(first), np.bool_)
    return DirectingLines("C1", 0, 0, first, first, last, some, some, first)


def seen_at(*times_s: float) -> tuple[Observation, ...]:
    return tuple(Observation("C1", 0, at_s, Shadows.of([])) for at_s in times_s)


@given(
    times,
    st.floats(0, 1),
    st.floats(0, 1),
    st.lists(touches, max_size=20, unique_by=lambda one: one.id),
    st.lists(contacts, max_size=20),
    st.lists(contacts, max_size=5),
    st.dictionaries(
        st.integers(0, 7), st.lists(st.tuples(numbers, numbers), max_size=64), max_size=8
    ),
)
def test_moments(at_s, latency_s, skew_s, touched, found, refused, lines):
    observations = seen_at(at_s, at_s + skew_s)
    moment = Moment(FrameSet(at_s, observations), found, touched, refused, at_s + latency_s)
    shown = [(camera, lines_of(bounds)) for camera, bounds in lines.items()]
    told = read_message(encode_moment(moment, shown))

    assert isinstance(told, ToldMoment)
    assert told.captured_at_s == at_s
    assert told.latency_ms == pytest.approx(1000.0 * latency_s, abs=1e-3)
    assert told.skew_ms == pytest.approx(1000.0 * skew_s, abs=1e-3)
    assert [touch.id for touch in told.touches] == [touch.id for touch in touched]
    for got, given_touch in zip(told.touches, touched, strict=True):
        assert (got.x_mm, got.y_mm) == (given_touch.x_mm, given_touch.y_mm)
        assert (got.vx_mm_s, got.vy_mm_s) == (given_touch.vx_mm_s, given_touch.vy_mm_s)
        assert (got.diameter_mm, got.age_s) == (given_touch.diameter_mm, given_touch.age_s)
    assert [one.refused for one in told.contacts] == [False] * len(found) + [True] * len(refused)
    for got, contact in zip(told.contacts, [*found, *refused], strict=True):
        assert (got.x_mm, got.y_mm, got.kind) == (contact.x_mm, contact.y_mm, contact.kind)
        assert got.touching == contact.touching
        if contact.lean is None:
            assert math.isnan(got.lean_deg)
            assert math.isnan(got.azimuth_deg)
        else:
            assert got.lean_deg == pytest.approx(math.degrees(contact.lean.angle_rad), rel=1e-6)
    assert told.lines == lines


def test_more_than_a_byte_counts_is_left_out():
    many = [Touch(number, 0, 0, 0, 0, 0) for number in range(300)]
    found = [Contact(0, 0, 9, (), 1, 1)] * 250
    moment = Moment(FrameSet(1.0, ()), found, many, found, 1.0)
    told = read_message(encode_moment(moment, [(0, lines_of([(0.0, 1.0)] * 300))]))
    assert (len(told.touches), len(told.contacts), len(told.lines[0])) == (255, 255, 255)
    assert sum(contact.refused for contact in told.contacts) == 5


@given(
    st.data(),
    st.integers(1, 64),
    st.integers(1, 300),
    st.integers(0, 3),
    st.lists(st.floats(0, 300, width=32), max_size=40),
    st.floats(0, 255, width=32) | st.just(math.nan),
)
def test_strips(data, rows, width, camera, edges, dark):
    picture = data.draw(hnp.arrays(np.uint8, (rows, width)))
    brightness = data.draw(
        hnp.arrays(np.float64, width, elements=st.floats(-0.5, 2) | st.just(math.nan))
    )
    known = data.draw(hnp.arrays(np.bool_, width))
    reference = data.draw(hnp.arrays(np.float64, width, elements=st.floats(-10, 300)))
    view = StripView(3.5, picture, brightness, known, reference, np.array(edges), 80.0, 0.5, dark)
    told = read_message(encode_strip(camera, view))

    assert isinstance(told, ToldStrip)
    assert (told.camera, told.rows, told.width_px, told.captured_at_s) == (camera, rows, width, 3.5)
    assert told.picture == picture.tobytes()
    assert told.state == bytes(0 if one else 1 for one in known)
    shown = np.frombuffer(told.brightness, np.uint8) / 200.0
    assert shown == pytest.approx(np.clip(np.nan_to_num(brightness), 0, 1.25), abs=0.0026)
    assert np.frombuffer(told.reference, np.uint8) == pytest.approx(
        np.clip(reference, 0, 255), abs=0.51
    )
    assert told.edges_px == edges
    assert (told.level, told.contrast) == (80.0, 0.5)
    assert told.dark_level == dark or math.isnan(dark)


def test_each_goes_after_its_length():
    assert with_length(b"abc") == b"\x03\x00\x00\x00abc"
