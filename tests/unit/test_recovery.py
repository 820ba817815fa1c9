"""A lost camera comes back as soon as it can, and is reset only when that may help.

Time is that of a fake clock: to wait moves it, and what happens meanwhile is on a timetable.
"""

import logging
from collections.abc import Callable
from errno import EACCES, EBUSY, EIO, ENOSPC

import pytest

from cornertouchd.config import CamerasSettings
from cornertouchd.ports import CameraError, ResetError
from cornertouchd.runtime.recovery import (
    HOUR_S,
    JITTER,
    LOOK_EVERY_S,
    SETTLING_S,
    Recovery,
    may_be_cured_by_reset,
)

SETTINGS = CamerasSettings(
    reopen_delay_s=1.0, reopen_delay_max_s=8.0, failures_before_reset=3, resets_per_hour=4
)


class FakeReset:
    def __init__(self, name: str, done: list[str]) -> None:
        self.name = name
        self.error: Exception | None = None
        self._done = done

    def apply(self) -> None:
        if self.error is not None:
            raise self.error
        self._done.append(self.name)


class Bench:
    """A camera that never opens, with its plug and its clock."""

    def __init__(self, settings: CamerasSettings = SETTINGS, plugged: str = "1-1 2") -> None:
        self.time_s = 1000.0
        self.timetable: dict[float, str] = {}
        self._plugged = plugged
        self.done: list[str] = []
        self.resets = (FakeReset("USB reset", self.done), FakeReset("reauthorization", self.done))
        self.recovery = Recovery("C3", self, settings, self, jitter=lambda: 0.0)

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        self.time_s = max(self.time_s, time_s)

    def plugged_in(self) -> str:
        for at_s in [at_s for at_s in sorted(self.timetable) if at_s <= self.time_s]:
            self._plugged = self.timetable.pop(at_s)
        return self._plugged

    def wait(self, seconds: float) -> bool:
        self.time_s += seconds
        return False

    def fail(self, *, worked: bool = False, reset_may_help: bool = True) -> float:
        """Return how long it is waited after a failure."""
        before_s = self.time_s
        self.recovery.wait_to_reopen(worked=worked, reset_may_help=reset_may_help, wait=self.wait)
        return self.time_s - before_s


def test_attempts_grow_rarer_up_to_the_bound_and_begin_anew_when_it_worked() -> None:
    bench = Bench()
    waits = [bench.fail(reset_may_help=False) for _ in range(6)]
    assert waits == pytest.approx([1.0, 2.0, 4.0, 8.0, 8.0, 8.0])
    assert bench.fail(worked=True) == pytest.approx(1.0)


def test_cameras_are_not_opened_in_step() -> None:
    bench = Bench()
    bench.recovery = Recovery("C3", bench, SETTINGS, bench, jitter=lambda: 1.0)
    assert bench.fail(reset_may_help=False) == pytest.approx(1.0 * (1.0 + JITTER))


def test_a_simulated_camera_is_opened_anew_without_a_plug() -> None:
    bench = Bench()
    bench.recovery = Recovery("C3", None, SETTINGS, bench, jitter=lambda: 0.0)
    assert [bench.fail() for _ in range(5)] == pytest.approx([1.0, 2.0, 4.0, 8.0, 8.0])
    assert bench.recovery.resets == 0


def test_a_camera_that_is_plugged_in_again_is_opened_at_the_next_look() -> None:
    bench = Bench()
    for _ in range(5):  # the delay has grown
        bench.fail(reset_may_help=False)
    bench.timetable = {bench.time_s: "", bench.time_s + 100.0: "1-1 3"}
    assert 100.0 <= bench.fail() <= 100.0 + LOOK_EVERY_S


def test_an_unplugged_camera_is_looked_for_and_never_reset() -> None:
    bench = Bench(plugged="")
    bench.timetable = {bench.time_s + 7200.0: "1-1 3"}
    assert bench.fail() >= 7200.0
    assert bench.done == []


def test_a_camera_that_settles_is_tried_at_every_look_without_a_reset() -> None:
    bench = Bench()
    bench.timetable = {bench.time_s + 0.5: "", bench.time_s + 5.0: "1-1 3"}
    bench.fail()
    waits = [bench.fail() for _ in range(int(SETTLING_S / LOOK_EVERY_S) - 1)]
    assert waits == pytest.approx([LOOK_EVERY_S] * len(waits))
    assert bench.done == []


def test_a_plug_that_is_pulled_and_put_back_while_it_waits_ends_the_wait() -> None:
    bench = Bench()
    for _ in range(5):
        bench.fail(reset_may_help=False)
    bench.timetable = {bench.time_s + 1.0: "1-1 3"}  # quicker than a look
    assert bench.fail(reset_may_help=False) <= 1.0 + LOOK_EVERY_S


def fail_until_reset(bench: Bench) -> float:
    """Fail until one more reset is done; return how long that took."""
    before_s, done = bench.time_s, len(bench.done)
    while len(bench.done) == done:
        bench.fail()
        assert bench.time_s - before_s < 10 * HOUR_S
    return bench.time_s - before_s


def test_after_attempts_in_vain_it_is_reset_the_gentle_way_first(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench()
    with caplog.at_level(logging.WARNING):
        assert [bench.fail(), bench.fail()] == pytest.approx([1.0, 2.0])
        assert bench.done == []
        assert bench.fail() == pytest.approx(LOOK_EVERY_S)  # tried soon after the reset
        assert bench.done == ["USB reset"]
        fail_until_reset(bench)
    assert bench.done == ["USB reset", "reauthorization"]
    assert bench.recovery.resets == 2
    assert "camera C3: USB reset after 3 attempts to open it (reset 1 of 4 this hour)" in (
        caplog.text
    )


def test_a_camera_that_works_after_a_reset_begins_at_the_gentle_way() -> None:
    bench = Bench()
    fail_until_reset(bench)
    bench.time_s += SETTLING_S
    bench.fail(worked=True)
    fail_until_reset(bench)
    assert bench.done == ["USB reset", "USB reset"]


def test_resets_are_limited_within_every_hour(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench()
    for _ in range(4):
        fail_until_reset(bench)
    begin_s = bench.time_s
    with caplog.at_level(logging.WARNING):
        fail_until_reset(bench)
    assert bench.time_s - begin_s > HOUR_S - 200.0
    assert caplog.text.count("was reset 4 times within an hour (cameras.resets_per_hour)") == 1
    within_an_hour = []
    for _ in range(20):
        fail_until_reset(bench)
        within_an_hour.append(bench.time_s)
    for first_s, fifth_s in zip(within_an_hour, within_an_hour[4:], strict=False):
        assert fifth_s - first_s >= HOUR_S - 1.0


def test_it_is_never_reset_if_the_settings_say_so(caplog: pytest.LogCaptureFixture) -> None:
    bench = Bench(SETTINGS.model_copy(update={"resets_per_hour": 0}))
    with caplog.at_level(logging.WARNING):
        for _ in range(100):
            bench.fail()
    assert bench.done == []
    assert caplog.text == ""


def test_a_way_that_is_not_possible_is_told_once_and_the_next_is_taken(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench()
    bench.resets[0].error = ResetError("libusb is missing; install libusb-1.0-0")
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            fail_until_reset(bench)
    assert bench.done == ["reauthorization"] * 3
    assert caplog.text.count("camera C3: no USB reset: libusb is missing") == 1


@pytest.mark.parametrize("error", [ResetError("no permission"), RuntimeError("a bug in libusb")])
def test_when_no_way_is_possible_it_is_opened_anew_with_delays(error: Exception) -> None:
    bench = Bench()
    for reset in bench.resets:
        reset.error = error
    assert [bench.fail() for _ in range(5)] == pytest.approx([1.0, 2.0, 4.0, 8.0, 8.0])
    assert bench.recovery.resets == 0


def test_a_fault_that_no_reset_cures_leads_to_none() -> None:
    bench = Bench()
    for _ in range(50):
        bench.fail(reset_may_help=False)
    assert bench.done == []


def stops_after(bench: Bench, seconds: float) -> Callable[[float], bool]:
    until_s = bench.time_s + seconds

    def wait(wait_s: float) -> bool:
        bench.time_s += wait_s
        return bench.time_s >= until_s

    return wait


@pytest.mark.parametrize("plugged", ["", "1-1 2"])
def test_the_end_of_the_daemon_ends_the_wait(plugged: str) -> None:
    bench = Bench(plugged=plugged)
    before_s = bench.time_s
    bench.recovery.wait_to_reopen(worked=False, reset_may_help=True, wait=stops_after(bench, 0.25))
    assert bench.time_s - before_s <= 0.5


@pytest.mark.parametrize("errno", [EACCES, EBUSY, ENOSPC])
def test_a_camera_that_is_in_use_or_has_no_room_on_the_bus_is_no_case_for_a_reset(
    errno: int,
) -> None:
    error = CameraError("C1", "refused")
    error.__cause__ = OSError(errno, "refused")
    assert not may_be_cured_by_reset(error)


def test_a_camera_that_fails_may_be_cured_by_a_reset() -> None:
    error = CameraError("C1", "input/output error")
    assert may_be_cured_by_reset(error)
    error.__cause__ = OSError(EIO, "input/output error")
    assert may_be_cured_by_reset(error)
