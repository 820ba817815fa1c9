"""Commands that look at the cameras let the LED frame shine meanwhile."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from led_board import Board

from cornertouchd.cli.guided_rig import guided_rig
from cornertouchd.config import LedFrameSettings, Settings
from cornertouchd.model import PictureFormat
from cornertouchd.ports import Camera, CameraError
from cornertouchd.runtime.checks.cameras import cameras_of
from cornertouchd.runtime.checks.installation import Installation
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.led_desk import LedFrameError, shining

pytestmark = pytest.mark.timeout(120)


def settings_for(board: Board, **led_frame: Any) -> Settings:
    return Settings(
        led_frame=LedFrameSettings(
            enabled=True, port=str(board.link), level_top=60, pattern="ambient", **led_frame
        )
    )


def flashes_of(board: Board) -> list[int]:
    """Count how often each side shone within a while; what it was told last is still on its way."""
    board.wait_ms(20)
    board.do("zero")
    board.wait_ms(200)
    lit: list[int] = board.do("get")["lit"]
    return lit


def test_a_guided_command_has_light_in_every_picture_and_leaves_the_frame_dark(
    board: Board,
) -> None:
    with guided_rig(settings_for(board), simulate=False, finger=None):
        assert board.do("get")["levels"] == [60, 128, 128, 128]
        flashes = flashes_of(board)
        assert min(flashes) == max(flashes) > 15  # none is dark, though the daemon's are
    assert flashes_of(board) == [0, 0, 0, 0]


class LooksAtTheBoard:
    """A camera that notes whether it is lit when it is opened."""

    id, identity = "C1", ""
    format = PictureFormat(640, 480, 0, 480)

    def __init__(self, board: Board) -> None:
        self.flashes: list[int] = []
        self._board = board

    def open(self) -> Camera:
        self.flashes = flashes_of(self._board)
        raise CameraError("C1", "that was all")


@pytest.mark.parametrize("is_running", [False, True])
def test_check_lights_what_it_looks_at(
    board: Board, monkeypatch: pytest.MonkeyPatch, is_running: bool
) -> None:
    camera = LooksAtTheBoard(board)
    installation = Installation(
        settings_for(board), {}, MonotonicClock(), "", ports=lambda: (camera,)
    )
    monkeypatch.setattr(Installation, "is_running", property(lambda _: is_running))
    list(cameras_of(installation))
    assert bool(camera.flashes) is not is_running
    assert all(count > 15 for count in camera.flashes)
    assert flashes_of(board) == [0, 0, 0, 0]


@contextmanager
def refused(words: str) -> Iterator[None]:
    with pytest.raises(LedFrameError) as caught:
        yield
    assert words in str(caught.value)


def test_a_frame_that_must_stay_dark_says_why(board: Board) -> None:
    board.do("fault 1")
    with refused("it stays dark: over-current"), shining(settings_for(board)):
        pass


def test_a_frame_in_use_is_refused(board: Board) -> None:
    settings = settings_for(board)
    with shining(settings), refused("another program uses it"), shining(settings):
        pass


def test_without_a_controller_nothing_is_opened() -> None:
    with shining(Settings(led_frame=LedFrameSettings(enabled=False, port="/nowhere"))):
        pass
