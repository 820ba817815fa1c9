"""Touches are native touches of this machine: libinput, evtest and a browser see them."""

import contextlib
import subprocess
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

import pytest
from evdev import ecodes
from guest.client import TuioClient, wait_until
from guest.running import RunningDaemon
from guest.touchscreens import (
    XORG_SIZE_PX,
    Page,
    ScreenReader,
    browser_at,
    eventually,
    evtest_values,
    find_screen,
    libinput_touches,
    opened_screen,
    watch_evtest,
    watch_libinput,
)
from kernel_screen import KernelScreen
from uvc.show import SURFACE_MM, distance_mm

from cornertouchd.devices.uinput_device import ScreenDevice, open_screen
from cornertouchd.devices.uinput_screen import UinputScreen
from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.touchscreen import Axis

NAME = "cornertouchd guest"
FINGERS = 10
STEPS, STEP_S = 12, 0.03
BROWSER_STEP_S = 0.1
"""Chromium without a graphics card is slow in the guest."""
WATCH_S = 6.0
CLOSE_MM = 0.5


class Both:
    """The kernel's screen and the fake one, told the same."""

    def __init__(self) -> None:
        self.fake = KernelScreen({})

    def open(self, name: str, axes: Mapping[int, Axis]) -> ScreenDevice:
        self.real = open_screen(name, axes)
        self.fake = KernelScreen(axes)
        return self

    def write(self, events: bytes) -> None:
        self.fake.write(events)
        self.real.write(events)

    def close(self) -> None:
        self.real.close()


@pytest.fixture
def both() -> Both:
    return Both()


@pytest.fixture
def screen(both: Both) -> Iterator[UinputScreen]:
    """A touchscreen of the size of the surface, which is there."""
    sink = UinputScreen(NAME, DisplayMapping(0.0, 0.0, *SURFACE_MM), 20, open_device=both.open)

    def is_there() -> bool:
        sink.tick(time.monotonic())
        return sink.screens[0].is_there

    wait_until(is_there, 20.0, "the touchscreen")
    yield sink
    sink.close()


def place_mm(finger: int, step: int) -> tuple[float, float]:
    """Return where a finger is, on its way to the right."""
    return 20.0 + 30.0 * finger + step, 40.0 + 30.0 * finger


def slide(screen: UinputScreen, first_id: int = 1, step_s: float = STEP_S) -> None:
    """Put all fingers down, move them step by step, lift them."""
    for step in range(STEPS):
        now_s = time.monotonic()
        touches = tuple(
            Touch(first_id + finger, *place_mm(finger, step), 0.0, 0.0, step * step_s, 8.0)
            for finger in range(FINGERS)
        )
        screen.send(TouchFrame(now_s, touches), now_s)
        time.sleep(step_s)
    now_s = time.monotonic()
    screen.send(TouchFrame(now_s, ()), now_s)


def test_desktops_find_a_touchscreen_of_the_real_size(screen: UinputScreen) -> None:
    with contextlib.closing(opened_screen(NAME)) as device:
        path, properties = device.path, device.input_props()
    said = subprocess.run(
        ["libinput", "list-devices"], capture_output=True, text=True, check=True
    ).stdout
    assert f"Device:           {NAME}" in said
    assert "Size:             350x400mm" in said
    assert "Capabilities:     touch" in said
    told = subprocess.run(
        ["udevadm", "info", path], capture_output=True, text=True, check=True
    ).stdout
    assert "ID_INPUT_TOUCHSCREEN=1" in told
    assert ecodes.INPUT_PROP_DIRECT in properties


def test_the_fake_kernel_of_the_unit_tests_does_as_this_one(
    screen: UinputScreen, both: Both
) -> None:
    with ScreenReader(opened_screen(NAME)) as reader:
        slide(screen)
        eventually(lambda: len(reader.reports) >= both.fake.reports, "all reports")
        assert len(reader.reports) == both.fake.reports == STEPS + 1
        assert reader.dropped == 0
        assert reader.touches() == both.fake.touches == {}
        now_s = time.monotonic()
        screen.send(TouchFrame(now_s, (Touch(99, 11.0, 12.0, 0.0, 0.0, 0.0, 9.0),)), now_s)
        eventually(lambda: len(reader.touches()) == 1, "another touch")
        assert reader.touches() == both.fake.touches
        absolute = {code: reader.device.absinfo(code).value for code in both.fake.state}
        assert absolute == both.fake.state
        assert reader.device.active_keys() == [ecodes.BTN_TOUCH]


def test_ten_fingers_land_move_and_lift_where_they_are(screen: UinputScreen) -> None:
    with contextlib.closing(opened_screen(NAME)) as device:
        path = device.path
    with watch_libinput(path) as libinput, watch_evtest(path) as evtest:
        slide(screen)
        libinput.wait_for("TOUCH_UP", FINGERS)
        evtest.wait_for("(ABS_MT_TRACKING_ID), value -1", FINGERS)
    told = list(libinput_touches(libinput.lines))
    for finger in range(FINGERS):
        whats, places = zip(*((what, at) for what, slot, at in told if slot == finger), strict=True)
        assert whats == ("DOWN", *["MOTION"] * (STEPS - 1), "UP")
        for step, place in enumerate(places[:-1]):
            assert distance_mm(place, place_mm(finger, step)) <= 0.02
    assert len(set(evtest_values(evtest.lines, "ABS_MT_TRACKING_ID"))) == FINGERS + 1
    assert set(evtest_values(evtest.lines, "ABS_MT_TOUCH_MAJOR")) == {800}
    assert len(evtest_values(evtest.lines, "ABS_MT_POSITION_X")) == FINGERS * STEPS


@pytest.mark.timeout(240)
def test_a_page_in_chromium_gets_the_touches(screen: UinputScreen, tmp_path: Path) -> None:
    page = Page()
    with browser_at(page, tmp_path):
        rounds = iter(range(1, 100_000, FINGERS))

        def has_seen_all_fingers() -> bool:
            slide(screen, next(rounds), BROWSER_STEP_S)
            return all(len(fingers_of(page, what)) == FINGERS for what in WHATS)

        wait_until(has_seen_all_fingers, 60.0, "all fingers in the page")
    page.close()
    assert {what for what, *_ in page.touches} == set(WHATS)


WHATS = ("touchstart", "touchmove", "touchend")
NEAR_PX = 1.5


def fingers_of(page: Page, what: str) -> set[int]:
    """Return the fingers that the page was told of, in events of a kind, where they were."""
    told = [(x, y) for kind, _, x, y in page.touches if kind == what]
    return {
        finger
        for finger in range(FINGERS)
        for step in range(STEPS)
        for x, y in told
        if distance_mm((x, y), pixel_of(place_mm(finger, step))) <= NEAR_PX
    }


def pixel_of(place: tuple[float, float]) -> tuple[float, float]:
    """Return where a place of the surface is on a screen that fills it."""
    (x, y), (width, height), (across, down) = place, SURFACE_MM, XORG_SIZE_PX
    return x / width * across, y / height * down


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """A daemon whose simulated rig has ten fingers."""
    file = tmp_path / "kiosk.toml"
    file.write_text(
        '[cameras]\nsource = "simulated"\nrate_hz = 15.0\n'
        f"[simulation]\ntouches = {FINGERS}\nspeed = 0.3\n"
        "[[screens]]\nenabled = true\n"
    )
    return file


@pytest.mark.timeout(300)
def test_the_daemon_tells_tuio_and_the_touchscreen_the_same(
    config: Path, client: TuioClient
) -> None:
    daemon = RunningDaemon(config)
    device = opened_screen("cornertouchd kiosk", 150.0)
    with ScreenReader(device) as reader, watch_libinput(device.path) as libinput:
        eventually(lambda: any(len(touches) >= 7 for touches in reader.reports), "many fingers")
        began_s, first = time.monotonic(), len(reader.reports)
        time.sleep(WATCH_S)
        shown = [touches for _, touches in client.frames_since(began_s - 1.0)]
        reports = reader.reports[first : len(reader.reports) - 5]
        off_mm = [_farthest_mm(list(report.values()), shown) for report in reports if report]
        print(
            f"\n{len(off_mm)} reports, up to {max(map(len, reports))} fingers, "
            f"off TUIO by {max(off_mm):.3f} mm at most"
        )
        assert len(off_mm) > WATCH_S
        assert max(off_mm) <= CLOSE_MM

        daemon.process.kill()
        eventually(lambda: reader.is_gone, "the end of the touchscreen")
        libinput.wait_for("DEVICE_REMOVED")
    assert daemon.stop() == -9
    assert find_screen("cornertouchd kiosk") is None
    whats = [what for what, *_ in libinput_touches(libinput.lines)]
    begun = whats.count("DOWN")
    assert begun >= FINGERS
    assert begun == whats.count("UP") + whats.count("CANCEL")


def _farthest_mm(
    report: list[tuple[float, float]], shown: list[Mapping[int, tuple[float, float]]]
) -> float:
    """Return how far the farthest finger is from where the most similar frame of TUIO has it."""
    return min(
        (
            max(min(distance_mm(place, other) for other in touches.values()) for place in report)
            for touches in shown
            if len(touches) == len(report)
        ),
        default=float("inf"),
    )
