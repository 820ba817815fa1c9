"""One line says which cameras are lost; a loose contact does not fill the log."""

import pytest

from cornertouchd.runtime.camera_roll import FIRST_PAUSE_S, CameraRoll

ALL = ("C1", "C2", "C3", "C4")


class Bench:
    def __init__(self, cameras: tuple[str, ...] = ALL) -> None:
        self.roll = CameraRoll(cameras)
        self.time_s = 100.0

    def after(self, seconds: float, *live: str) -> list[str]:
        """Return what is said in so many seconds, while these cameras see."""
        said = []
        for _ in range(max(1, round(seconds * 10))):
            self.time_s += 0.1
            said.append(self.roll.note(live, self.time_s))
        return [line for line in said if line]


@pytest.fixture
def bench() -> Bench:
    steady = Bench()
    assert steady.after(100.0, *ALL) == []
    return steady


def test_a_start_with_all_cameras_says_nothing() -> None:
    starting = Bench()
    assert starting.after(1.0) == []
    assert starting.after(0.5, "C1", "C2") == []
    assert starting.after(100.0, *ALL) == []


def test_a_camera_that_is_missing_from_the_start_is_told() -> None:
    starting = Bench()
    assert starting.after(FIRST_PAUSE_S + 0.2, "C1", "C2", "C4") == [
        "camera C3 lost: touches go on with C1, C2, C4"
    ]


def test_a_loss_and_the_return_are_told_at_once(bench: Bench) -> None:
    assert bench.after(0.1, "C1", "C2", "C4") == ["camera C3 lost: touches go on with C1, C2, C4"]
    assert bench.after(10.0, "C1", "C2", "C4") == []
    assert bench.after(0.1, *ALL) == ["camera C3 back: touches go on with C1, C2, C3, C4"]


@pytest.mark.parametrize(
    ("live", "line"),
    [
        (("C1", "C2"), "cameras C3, C4 lost: single touches go on with C1, C2"),
        (
            ("C1", "C3"),
            "cameras C2, C4 lost: no touches; C1, C3 cannot tell fingers from ghosts",
        ),
        (("C4",), "cameras C1, C2, C3 lost: no touches; C4 cannot tell fingers from ghosts"),
        ((), "cameras C1, C2, C3, C4 lost: no touches"),
    ],
)
def test_the_line_says_what_is_left(bench: Bench, live: tuple[str, ...], line: str) -> None:
    assert bench.after(0.1, *live) == [line]


def test_one_lost_while_another_comes_back_is_one_line(bench: Bench) -> None:
    bench.after(5.0, "C1", "C2", "C4")
    assert bench.after(0.1, "C1", "C2", "C3") == [
        "camera C4 lost, camera C3 back: touches go on with C1, C2, C3"
    ]


def test_a_rig_of_two_cameras_works_with_two() -> None:
    pair = Bench(("C1", "C2"))
    pair.after(100.0, "C1", "C2")
    assert pair.after(0.1, "C1") == [
        "camera C2 lost: no touches; C1 cannot tell fingers from ghosts"
    ]
    assert pair.after(10.0, "C1", "C2") == ["camera C2 back: touches go on with C1, C2"]


def test_a_loose_contact_is_told_ever_more_rarely_and_in_the_end_rightly(bench: Bench) -> None:
    lines = []
    for _ in range(600):
        lines += bench.after(0.5, "C1", "C2", "C4") + bench.after(0.5, *ALL)
    assert 4 <= len(lines) <= 12
    lines += bench.after(700.0, "C1", "C2", "C4")
    assert lines[-1] == "camera C3 lost: touches go on with C1, C2, C4"
    assert bench.after(0.1, *ALL) == ["camera C3 back: touches go on with C1, C2, C3, C4"]
