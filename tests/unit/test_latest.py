"""The box between threads."""

import threading

from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.runtime.latest import Latest


def test_what_is_put_is_taken_once_oldest_first() -> None:
    box: Latest[int] = Latest()
    box.put("C2", 1)
    box.put("C1", 2)
    assert box.take(0) == [1, 2]
    assert box.take(0) == []


def test_only_the_newest_of_a_camera_is_kept_and_the_rest_counted() -> None:
    box: Latest[int] = Latest()
    for value in range(5):
        box.put("C1", value)
    box.put("C2", 9)
    assert box.take(0) == [4, 9]
    assert box.dropped() == {"C1": 4}


def test_a_taker_that_waits_is_woken() -> None:
    box: Latest[str] = Latest()
    taken: list[str] = []
    taker = threading.Thread(target=lambda: taken.extend(box.take(30.0)))
    taker.start()
    box.put("C1", "picture")
    taker.join(30.0)
    assert taken == ["picture"]


@given(st.lists(st.tuples(st.sampled_from(["C1", "C2", "C3"]), st.booleans())))
def test_everything_put_is_taken_or_counted(steps: list[tuple[str, bool]]) -> None:
    box: Latest[int] = Latest()
    taken = 0
    for number, (camera, take) in enumerate(steps):
        box.put(camera, number)
        if take:
            taken += len(box.take(0))
    taken += len(box.take(0))
    assert taken + sum(box.dropped().values()) == len(steps)
