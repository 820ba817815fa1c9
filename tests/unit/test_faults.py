"""Faults are told once, their end too, and a flood of them does not fill the journal."""

import logging

import pytest

from cornertouchd.runtime.faults import GOOD_TO_RECOVER, IN_S, MOST_LINES, FaultLog


class Camera:
    """A part of the daemon that fails, and its clock."""

    def __init__(self) -> None:
        self.time_s = 100.0
        self.log = FaultLog("camera C1", lambda: self.time_s)

    def come_and_go(self, times: int, period_s: float) -> None:
        for _ in range(times):
            self.log.fault("lost", "gone")
            for _ in range(GOOD_TO_RECOVER):
                self.log.good()
            self.time_s += period_s


@pytest.fixture
def camera(caplog: pytest.LogCaptureFixture) -> Camera:
    caplog.set_level(logging.WARNING)
    return Camera()


def test_a_fault_is_told_once_and_its_end_with_the_count(
    camera: Camera, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(7):
        camera.log.fault("no picture")
    for _ in range(GOOD_TO_RECOVER):
        camera.log.good()
    assert caplog.messages == ["camera C1: no picture", "camera C1: works again after 7 faults"]


def test_what_seldom_fails_is_told_each_time(
    camera: Camera, caplog: pytest.LogCaptureFixture
) -> None:
    camera.come_and_go(50, period_s=30.0)
    assert len(caplog.messages) == 100


def test_a_loose_plug_does_not_fill_the_journal(
    camera: Camera, caplog: pytest.LogCaptureFixture
) -> None:
    camera.come_and_go(600, period_s=1.0)
    assert len(caplog.messages) <= 10 * (MOST_LINES + 2)
    assert camera.log.count == 600


def test_the_last_word_is_true_however_much_was_said_before(
    camera: Camera, caplog: pytest.LogCaptureFixture
) -> None:
    camera.come_and_go(20, period_s=0.5)
    assert "counted only" in caplog.messages[MOST_LINES]
    assert len(caplog.messages) == MOST_LINES + 1
    camera.time_s += IN_S
    camera.log.good()
    assert caplog.messages[MOST_LINES + 1 :] == ["camera C1: works again after 15 faults"]
