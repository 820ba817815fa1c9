"""What is kept of the last moments: the newest pictures, in order, none of them mixed up."""

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.model import Frame, PictureFormat
from cornertouchd.runtime.keeping import Keeping, KeptPictures, KeptReader

SMALL = PictureFormat(4, 8, 2, 2)
RATE_HZ = 10.0


def frame(camera: str, number: int, lit_mask: int | None = 15, skew_s: float = 0.0) -> Frame:
    pixels = np.full((SMALL.rows_px, SMALL.width_px), number % 251, np.uint8)
    return Frame(camera, number, number / RATE_HZ + skew_s, lit_mask, pixels)


def same(one: Frame | None, other: Frame) -> bool:
    return (
        one is not None
        and (one.camera, one.sequence, one.captured_at_s, one.lit_mask)
        == (other.camera, other.sequence, other.captured_at_s, other.lit_mask)
        and np.array_equal(one.pixels, other.pixels)
    )


@given(pictures=st.integers(2, 9), came=st.integers(0, 40))
def test_a_ring_has_the_newest_pictures_and_no_other(pictures: int, came: int) -> None:
    kept = KeptPictures("C1", SMALL, pictures)
    for number in range(came):
        kept.put(frame("C1", number, number % 16))
    there = [number for number in range(-2, came + 2) if kept.read(number) is not None]
    assert there == list(range(max(0, came - pictures + 1), came))
    for number in there:
        assert same(kept.read(number), frame("C1", number, number % 16))


@given(
    came=st.lists(st.sampled_from(["C1", "C2"]), max_size=60),
    keep_s=st.integers(0, 3),
    read_after=st.sets(st.integers(0, 60)),
)
def test_a_reader_gets_every_picture_once_or_is_told_that_it_is_missing(
    came: list[str], keep_s: int, read_after: set[int]
) -> None:
    keeping = Keeping({"C1": SMALL, "C2": SMALL}, RATE_HZ, keep_s, 1.0)
    reader = KeptReader(keeping, 0.0)
    numbers = {"C1": 0, "C2": 0}
    read: list[Frame] = []
    for place, camera in enumerate(came):
        keeping.put(frame(camera, numbers[camera]))
        numbers[camera] += 1
        if place in read_after:
            read += reader.pending()
    read += reader.pending()
    assert len(read) + reader.missing == len(came)
    for camera in numbers:
        sequence = [one.sequence for one in read if one.camera == camera]
        assert sequence == sorted(set(sequence))
        assert all(same(one, frame(camera, one.sequence)) for one in read if one.camera == camera)


@given(skew_s=st.floats(-0.04, 0.04), seconds=st.floats(0.0, 4.0))
def test_the_last_seconds_come_in_the_order_of_time(skew_s: float, seconds: float) -> None:
    keeping = Keeping({"C1": SMALL, "C2": SMALL}, RATE_HZ, 3, 1.0)
    for number in range(50):
        keeping.put(frame("C1", number))
        keeping.put(frame("C2", number, skew_s=skew_s))
    last = [one.captured_at_s for one in keeping.last(seconds)]
    assert last == sorted(last)
    assert last[-1] == max(4.9, 4.9 + skew_s)
    assert last[-1] - last[0] <= min(seconds, keeping.seconds) + 1e-9


def test_it_keeps_as_long_as_it_says_and_never_more_memory_than_allowed(
    caplog: pytest.LogCaptureFixture,
) -> None:
    form = PictureFormat(640, 480, 0, 64)
    cameras = dict.fromkeys(("C1", "C2", "C3", "C4"), form)
    assert Keeping(cameras, 100.0, 30, 512).seconds == 30.0
    assert not caplog.text
    assert Keeping(cameras, 100.0, 30, 16).seconds == pytest.approx(0.51, abs=0.01)
    assert "the last 0.5 s are kept, not of 30 s: monitor.keep_mb = 16 is full then" in caplog.text


def test_the_newest_can_be_looked_at_though_nothing_is_to_be_kept() -> None:
    keeping = Keeping({"C1": SMALL, "C2": SMALL}, RATE_HZ, 0, 16)
    keeping.put(frame("C1", 7, None))
    assert same(keeping.latest("C1"), frame("C1", 7, None))
    assert keeping.latest("C2") is None
    assert keeping.seconds == 0.0


def test_what_is_read_does_not_change_when_more_comes() -> None:
    keeping = Keeping({"C1": SMALL}, RATE_HZ, 0, 16)
    keeping.put(frame("C1", 0))
    latest = keeping.latest("C1")
    for number in range(1, 20):
        keeping.put(frame("C1", number))
    assert same(latest, frame("C1", 0))


def test_a_picture_of_another_size_is_not_kept() -> None:
    keeping = Keeping({"C1": SMALL}, RATE_HZ, 1, 16)
    keeping.put(Frame("C1", 0, 0.0, 15, np.zeros((3, 4), np.uint8)))
    assert keeping.latest("C1") is None


def test_no_picture_is_mixed_of_two_while_one_thread_puts_and_another_reads() -> None:
    form = PictureFormat(640, 480, 0, 64)
    keeping = Keeping({"C1": form}, RATE_HZ, 0, 16)
    done = threading.Event()

    def put() -> None:
        for number in range(3000):
            keeping.put(Frame("C1", number, 0.0, 15, np.full((64, 640), number % 251, np.uint8)))
        done.set()

    reader = KeptReader(keeping, 0.0)
    thread = threading.Thread(target=put)
    thread.start()
    read = 0
    while not done.is_set() or read + reader.missing < 3000:
        for one in reader.pending():
            read += 1
            assert (one.pixels == one.sequence % 251).all()
    thread.join()
    assert read + reader.missing == 3000
