"""The profile 2Dblb: what is told of a touch's size, and that it always fits the cursors."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pythonosc.osc_bundle import OscBundle

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import MAX_PAYLOAD_BYTES, REDUNDANT_FSEQ, TuioSession
from cornertouchd.wire.tuio_blobs import Blob, BlobEncoder, BlobTelling

SOURCE = "table@10.0.0.5"
SURFACE = DisplayMapping(0.0, 0.0, 400.0, 200.0)

Messages = list[list[object]]


def messages(bundle: bytes) -> Messages:
    decoded = list(OscBundle(bundle))
    assert {message.address for message in decoded} == {"/tuio/2Dblb"}
    return [message.params for message in decoded]


class Told:
    """A display's cursors and blobs, told frame by frame."""

    def __init__(self, mapping: DisplayMapping = SURFACE) -> None:
        self.session = TuioSession(mapping, SOURCE, 1000, 500)
        self.blobs = BlobTelling(mapping, SOURCE)

    def frame(self, *touches: Touch, at_s: float = 0.0) -> list[Messages]:
        frame = TouchFrame(at_s, touches)
        self.session.frame(frame)
        bundles = self.blobs.frame(frame, self.session.told, self.session.told_fseq)
        return [messages(bundle) for bundle in bundles]


def touch(
    id_: int = 1, x_mm: float = 100.0, y_mm: float = 50.0, diameter_mm: float = 10.0
) -> Touch:
    return Touch(id_, x_mm, y_mm, 40.0, -20.0, 0.0, diameter_mm)


def test_a_blob_tells_place_size_area_and_speed() -> None:
    ((source, alive, blob, fseq),) = Told().frame(touch())
    assert source == ["source", SOURCE]
    assert alive == ["alive", 500]
    assert fseq == ["fseq", 1000]
    assert blob[:2] == ["set", 500]
    width, height = 10.0 / 400.0, 10.0 / 200.0
    area = math.pi / 4.0 * width * height
    assert blob[2:] == pytest.approx(
        [0.25, 0.25, 0.0, width, height, area, 0.1, -0.1, 0.0, 0.0, 0.0]
    )


def test_width_and_height_are_those_of_a_turned_picture() -> None:
    ((_, _, blob, _),) = Told(DisplayMapping(0.0, 0.0, 400.0, 200.0, 90)).frame(touch())
    assert blob[5:7] == pytest.approx([10.0 / 200.0, 10.0 / 400.0])


@pytest.mark.parametrize(
    ("diameter_mm", "width"), [(0.0, 0.0), (math.nan, 0.0), (math.inf, 0.0), (500.0, 1.0)]
)
def test_sizes_that_are_not_known_or_cannot_be_are_told_within_bounds(
    diameter_mm: float, width: float
) -> None:
    ((_, _, blob, _),) = Told().frame(touch(diameter_mm=diameter_mm))
    assert blob[5] == width


def test_a_lift_a_repeat_and_an_end() -> None:
    told = Told()
    told.frame(touch())
    ((_, alive, blob, fseq),) = map(messages, told.blobs.full_state())
    assert (alive, blob[1], fseq) == (["alive", 500], 500, ["fseq", REDUNDANT_FSEQ])
    ((_, alive, fseq),) = told.frame()
    assert (alive, fseq) == (["alive"], ["fseq", 1001])
    told.frame(touch(2))
    assert messages(told.blobs.empty())[1:] == [["alive"], ["fseq", REDUNDANT_FSEQ]]
    assert messages(told.blobs.whole())[1:] == [["alive"], ["fseq", REDUNDANT_FSEQ]]


def test_a_touch_beside_the_display_is_no_blob() -> None:
    ((_, alive, _, _),) = Told(DisplayMapping(0.0, 0.0, 200.0, 200.0)).frame(
        touch(1), touch(2, x_mm=300.0)
    )
    assert alive == ["alive", 500]


@given(st.lists(st.integers(0, 80), unique=True), st.lists(st.integers(0, 80), unique=True))
def test_bundles_fit_packets_and_name_no_blob_before_it_is_set(
    first: list[int], second: list[int]
) -> None:
    told = Told()
    ids: list[object] = []
    known: set[object] = set()
    for number, fingers in enumerate((first, second)):
        frame = TouchFrame(0.01 * number, tuple(touch(id_, 1.0 * id_) for id_ in fingers))
        if not told.session.frame(frame):
            continue
        bundles = told.blobs.frame(frame, told.session.told, told.session.told_fseq)
        cursors = {cursor.id for cursor in told.session.told.values()}
        seen = set(known)
        for bundle in bundles:
            assert len(bundle) <= MAX_PAYLOAD_BYTES
            _, alive, *sets, fseq = messages(bundle)
            seen |= {blob[1] for blob in sets}
            ids = alive[1:]
            assert set(ids) <= seen
            assert fseq == ["fseq", told.session.told_fseq]
        assert set(ids) == cursors
        whole = messages(told.blobs.whole())
        assert {blob[1] for blob in whole[2:-1]} == set(whole[1][1:]) == cursors
        known = set(ids)


@given(st.integers(0, 60), st.integers(0, 60))
def test_the_size_of_a_bundle_is_known_before(alive: int, blobs: int) -> None:
    encoder = BlobEncoder(SOURCE)
    blob = Blob(1, 0.5, 0.5, 0.0, 0.1, 0.1, 0.01, 0.0, 0.0, 0.0, 0.0, 0.0)
    bundle = encoder.encode(range(alive), [blob] * blobs, 1)
    assert len(bundle) == encoder.size_bytes(alive, blobs)
