"""The touchscreen as a sink: made aside, lifted in the end, made again when it was away."""

import errno
import logging
import threading
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from kernel_screen import KernelScreen

from cornertouchd.devices import uinput_device
from cornertouchd.devices.uinput_device import ScreenError, product_of, require_uinput
from cornertouchd.devices.uinput_screen import RETRY_AFTER_S, UinputScreen
from cornertouchd.model import Touch, TouchFrame
from cornertouchd.ports import TouchSink
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.touchscreen import Axis

SURFACE = DisplayMapping(0.0, 0.0, 400.0, 200.0)
FINGER = TouchFrame(1.0, (Touch(1, 10.0, 10.0, 0.0, 0.0, 0.0, 8.0),))


class Kernel:
    """Makes screens, or refuses to; `made` holds them all.  `asked` and `may_go_on` are of one."""

    def __init__(self) -> None:
        self.made: list[KernelScreen] = []
        self.refusal: Exception | None = None
        self.asked = threading.Semaphore(0)
        self.may_go_on = threading.Event()
        self.may_go_on.set()

    def __call__(self, name: str, axes: Mapping[int, Axis]) -> KernelScreen:
        self.asked.release()
        assert self.may_go_on.wait(10.0)
        if self.refusal is not None:
            raise self.refusal
        self.made.append(KernelScreen(axes))
        return self.made[-1]

    @property
    def screen(self) -> KernelScreen:
        return self.made[-1]


@pytest.fixture
def kernel() -> Kernel:
    return Kernel()


@pytest.fixture
def sink(kernel: Kernel) -> UinputScreen:
    return UinputScreen("wall", SURFACE, 10, open_device=kernel)


def tick_until(sink: UinputScreen, condition: Callable[[], bool], now_s: float = 0.0) -> None:
    """Tick at one instant until what a thread does aside has come about."""
    wake = threading.Event()
    for _ in range(2000):
        sink.tick(now_s)
        if condition():
            return
        wake.wait(0.005)
    raise AssertionError("did not come about")


def made(sink: UinputScreen, kernel: Kernel, now_s: float = 0.0) -> KernelScreen:
    tick_until(sink, lambda: sink.screens[0].is_there, now_s)
    return kernel.screen


def test_it_is_a_sink(sink: UinputScreen) -> None:
    told: TouchSink = sink
    told.close()


def test_touches_reach_the_screen_and_are_lifted_at_the_end(
    sink: UinputScreen, kernel: Kernel
) -> None:
    screen = made(sink, kernel)
    sink.send(FINGER, 1.0)
    assert screen.is_touched
    sink.close()
    assert not screen.touches
    assert not screen.is_there
    sink.close()
    sink.send(FINGER, 2.0)
    assert len(kernel.made) == 1


def test_lift_all_lifts_and_the_screen_stays(sink: UinputScreen, kernel: Kernel) -> None:
    screen = made(sink, kernel)
    sink.send(FINGER, 1.0)
    sink.lift_all(1.1)
    assert not screen.touches
    sink.lift_all(1.2)
    assert (screen.reports, sink.screens[0].reports_sent) == (2, 2)
    assert screen.is_there
    sink.close()


def test_nobody_waits_for_a_screen_that_takes_long_to_be_made(
    sink: UinputScreen, kernel: Kernel
) -> None:
    kernel.may_go_on.clear()
    sink.tick(0.0)
    assert kernel.asked.acquire(timeout=10.0)
    sink.send(FINGER, 0.1)
    sink.tick(100.0)
    assert not sink.screens[0].is_there
    kernel.may_go_on.set()
    screen = made(sink, kernel)
    sink.send(FINGER, 0.2)
    assert screen.is_touched
    sink.close()


def test_a_screen_that_comes_after_the_end_is_taken_away(
    sink: UinputScreen, kernel: Kernel
) -> None:
    kernel.may_go_on.clear()
    sink.tick(0.0)
    assert kernel.asked.acquire(timeout=10.0)
    sink.close()
    kernel.may_go_on.set()
    tick_until(sink, lambda: bool(kernel.made) and not kernel.screen.is_there)


def test_what_keeps_it_from_being_made_is_said_once_and_tried_again(
    sink: UinputScreen, kernel: Kernel, caplog: pytest.LogCaptureFixture
) -> None:
    kernel.refusal = ScreenError("/dev/uinput: Permission denied; be in the group")
    caplog.set_level(logging.INFO)
    for tries in range(3):
        now_s = tries * RETRY_AFTER_S
        tick_until(sink, lambda tries=tries: sink.screens[0].errors > tries, now_s)  # type: ignore[misc]
        sink.tick(now_s + RETRY_AFTER_S / 2)
    assert sink.screens[0].errors == 3
    assert sink.screens[0].fault == "/dev/uinput: Permission denied; be in the group"
    kernel.refusal = None
    made(sink, kernel, 3 * RETRY_AFTER_S)
    assert sink.screens[0].fault is None
    assert [record.message for record in caplog.records] == [
        "touchscreen wall: /dev/uinput: Permission denied; be in the group",
        "touchscreen wall: is there",
    ]
    sink.close()


def test_an_unforeseen_error_costs_the_screen_only(sink: UinputScreen, kernel: Kernel) -> None:
    kernel.refusal = TypeError("of the library")
    tick_until(sink, lambda: sink.screens[0].errors > 0)
    assert "of the library" in str(sink.screens[0].fault)
    sink.send(FINGER, 1.0)
    sink.close()


def test_a_screen_that_refuses_events_is_made_anew_with_the_touches(
    sink: UinputScreen, kernel: Kernel
) -> None:
    screen = made(sink, kernel)
    sink.send(FINGER, 1.0)
    screen.refusal = OSError(errno.ENODEV, "No such device")
    sink.lift_all(2.0)
    assert not screen.is_there
    assert sink.screens[0].fault == "refuses events: No such device"
    sink.send(FINGER, 3.0)
    assert len(kernel.made) == 1
    again = made(sink, kernel, 2.0 + RETRY_AFTER_S)
    sink.send(FINGER, 13.0)
    assert len(again.touches) == 1
    sink.close()


@pytest.mark.parametrize(
    ("number", "remedy"),
    [
        (errno.ENOENT, "modprobe uinput"),
        (errno.EACCES, "group uinput"),
        (errno.EPERM, "screens.conf"),
        (errno.EIO, "kernel's log"),
    ],
)
def test_what_is_wrong_with_the_node_is_told_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch, number: int, remedy: str
) -> None:
    def refuse(*_: object) -> int:
        raise OSError(number, "refused")

    monkeypatch.setattr(uinput_device.importlib.util, "find_spec", lambda _: object())
    monkeypatch.setattr(uinput_device.os, "open", refuse)
    with pytest.raises(ScreenError, match=remedy):
        require_uinput(Path("/dev/uinput"))


def test_a_missing_library_is_told_with_the_extra_that_brings_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(uinput_device.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ScreenError, match=r"pip install cornertouchd\[uinput\]"):
        require_uinput()


def test_screens_can_be_told_apart_by_their_numbers() -> None:
    names = [f"cornertouchd {name}" for name in ("left", "right", "wall", "table")]
    assert len({product_of(name) for name in names}) == len(names)
