"""Pictures on their way to whoever records them arrive as they were sent, however they are cut."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cornertouchd.model import Frame, PictureFormat
from cornertouchd.wire.pictures import (
    End,
    PictureDecoder,
    PictureStreamError,
    StreamedCamera,
    StreamHead,
    encode_end,
    encode_picture,
    read_head,
)

FORMATS = {"C1": PictureFormat(4, 8, 2, 2), "C2": PictureFormat(6, 8, 0, 3)}


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    camera = draw(st.sampled_from(sorted(FORMATS)))
    form = FORMATS[camera]
    return Frame(
        camera,
        draw(st.integers(0, 2**62)),
        draw(st.floats(allow_nan=False)),
        draw(st.none() | st.integers(0, 15)),
        draw(arrays(np.uint8, (form.rows_px, form.width_px))),
    )


@given(sent=st.lists(frames(), max_size=8), missing=st.integers(0, 2**62), cut=st.integers(1, 99))
def test_what_is_sent_arrives(sent: list[Frame], missing: int, cut: int) -> None:
    index = {camera: number for number, camera in enumerate(FORMATS)}
    data = b"".join(encode_picture(index[one.camera], one) for one in sent) + encode_end(missing)
    decoder = PictureDecoder(FORMATS)
    came = [one for at in range(0, len(data), cut) for one in decoder.feed(data[at : at + cut])]
    decoder.finish()
    assert came.pop() == End(missing)
    for one, other in zip(came, sent, strict=True):
        assert isinstance(one, Frame)
        assert np.array_equal(one.pixels, other.pixels)
        assert (one.camera, one.sequence, one.captured_at_s, one.lit_mask) == (
            other.camera,
            other.sequence,
            other.captured_at_s,
            other.lit_mask,
        )


@given(data=st.binary(max_size=400))
def test_what_is_no_stream_is_refused_or_waited_for(data: bytes) -> None:
    decoder = PictureDecoder(FORMATS)
    try:
        came = decoder.feed(data)
        decoder.finish()
    except PictureStreamError:
        return
    assert isinstance(came[-1], End)


def test_a_stream_that_is_cut_off_is_told() -> None:
    decoder = PictureDecoder(FORMATS)
    decoder.feed(encode_picture(0, Frame("C1", 1, 0.5, 15, np.zeros((2, 4), np.uint8)))[:-1])
    with pytest.raises(PictureStreamError, match="was cut off"):
        decoder.finish()


def test_a_picture_of_another_size_is_told() -> None:
    other = Frame("C1", 1, 0.5, 15, np.zeros((3, 4), np.uint8))
    with pytest.raises(PictureStreamError, match="camera C1: a picture of 12 bytes, not 4x8"):
        PictureDecoder(FORMATS).feed(encode_picture(0, other))


def test_the_first_line_says_what_comes() -> None:
    camera = StreamedCamera(
        id="C1", width_px=640, height_px=480, row_offset_px=220, rows_px=64, identity="A17"
    )
    head = StreamHead(
        surface_mm=(350.0, 400.0), rate_hz=100.0, tolerance_s=0.004, cameras=(camera,)
    )
    assert read_head(head.encode()) == head
    assert read_head(head.encode()).cameras[0].format == PictureFormat(640, 480, 220, 64)


@pytest.mark.parametrize(
    ("line", "said"), [(b"{", "Invalid JSON"), (b'{"rate_hz": 0}', "surface_mm: Field required")]
)
def test_another_first_line_is_refused(line: bytes, said: str) -> None:
    with pytest.raises(PictureStreamError, match=said):
        read_head(line)
