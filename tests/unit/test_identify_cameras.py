"""`cornertouchd cameras --identify` asks for one corner after the other and reads all cameras."""

from collections.abc import Callable

import numpy as np

from cornertouchd.cli.identify_cameras import PicturesInTurn, identify
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.ports import CameraError

CORNERS = ("C1", "C2")
SIZE = PictureFormat(64, 8, 0, 8)


class Hand:
    """Covers the cameras of a list, one after the other, with pauses."""

    def __init__(self, *covers: str) -> None:
        self._covers = covers
        self.round = 0

    def covers(self, node: str) -> bool:
        number, within = divmod(self.round - 40, 40)
        return 0 <= number < len(self._covers) and within < 25 and self._covers[number] == node


class FakePort:
    """A camera at a node: bright, dark while the hand covers it; or one that fails."""

    format = SIZE
    identity = ""

    def __init__(self, number: int, hand: Hand, fails_at: int | None = None) -> None:
        self.id = f"C{number + 1}"
        self.node = f"/dev/video{2 * number}"
        self._hand, self._fails_at = hand, fails_at
        self.closed = False

    def open(self) -> "FakePort":
        if self._fails_at == 0:
            raise CameraError(self.id, f"{self.node} is in use by another program")
        return self

    def read(self, timeout_s: float) -> Frame:
        if self.id == "C1":
            self._hand.round += 1
        if self._fails_at is not None and self._hand.round >= self._fails_at:
            raise CameraError(self.id, f"{self.node} is gone")
        level = 10 if self._hand.covers(self.node) else 180
        return Frame(self.id, self._hand.round, 0.0, None, np.full((8, 64), level, np.uint8))

    def close(self) -> None:
        self.closed = True


def session(
    ports: list[FakePort], hand: Hand, stopped: Callable[[], bool] | None = None
) -> tuple[list[tuple[str, str]], list[str]]:
    told: list[str] = []
    names = {port.id: port.node for port in ports}
    with PicturesInTurn(ports, names, told.append) as pictures:
        found = list(
            identify(CORNERS, pictures, told.append, stopped or (lambda: hand.round > 400))
        )
    return found, told


def test_each_corner_gets_the_camera_that_was_covered() -> None:
    hand = Hand("/dev/video2", "/dev/video0")
    ports = [FakePort(number, hand) for number in range(3)]
    found, told = session(ports, hand)
    assert found == [("C1", "/dev/video2"), ("C2", "/dev/video0")]
    assert "cover the lens of camera C1, or touch right before it" in told
    assert all(port.closed for port in ports)


def test_a_camera_is_not_taken_twice() -> None:
    hand = Hand("/dev/video2", "/dev/video2", "/dev/video4")
    found, told = session([FakePort(number, hand) for number in range(3)], hand)
    assert found == [("C1", "/dev/video2"), ("C2", "/dev/video4")]
    assert "that is /dev/video2, which was taken; cover the lens of camera C2" in told


def test_a_camera_that_fails_is_left_out_and_the_others_go_on() -> None:
    hand = Hand("/dev/video0", "/dev/video6")
    ports = [
        FakePort(0, hand),
        FakePort(1, hand, fails_at=0),
        FakePort(2, hand, fails_at=60),
        FakePort(3, hand),
    ]
    found, told = session(ports, hand)
    assert found == [("C1", "/dev/video0"), ("C2", "/dev/video6")]
    assert "/dev/video2 is in use by another program; it is left out" in told
    assert "/dev/video4 is gone; it is left out" in told


def test_the_user_may_stop_at_any_time() -> None:
    hand = Hand("/dev/video0")
    found, _ = session([FakePort(number, hand) for number in range(2)], hand)
    assert found == [("C1", "/dev/video0")]


def test_without_cameras_nothing_is_asked() -> None:
    hand = Hand()
    assert session([FakePort(0, hand, fails_at=0)], hand) == (
        [],
        ["/dev/video0 is in use by another program; it is left out"],
    )
