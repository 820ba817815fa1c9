"""Real-time priority is taken where it is granted; where it is not, that is told."""

import logging
import os
import threading
from collections.abc import Iterator

import pytest

from cornertouchd.runtime.realtime import prioritise

Calls = list[tuple[int, int, int]]


@pytest.fixture
def waiting_thread() -> Iterator[threading.Thread]:
    release = threading.Event()
    thread = threading.Thread(target=release.wait)
    thread.start()
    yield thread
    release.set()
    thread.join()


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Calls:
    made: Calls = []

    def note(native_id: int, policy: int, parameters: os.sched_param) -> None:
        made.append((native_id, policy, parameters.sched_priority))

    monkeypatch.setattr(os, "sched_setscheduler", note)
    return made


def test_the_kernel_is_asked_for_each_thread(calls: Calls) -> None:
    assert prioritise([11, 12], 10)
    fifo = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    assert calls == [(11, fifo, 10), (12, fifo, 10)]


def test_at_zero_an_ordinary_thread_is_left_alone(
    calls: Calls, waiting_thread: threading.Thread
) -> None:
    assert prioritise([waiting_thread.native_id or 0], 0)
    assert calls == []


def test_a_refusal_is_told_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with caplog.at_level(logging.INFO):
        assert not prioritise([11, 12, 13], 10)
    (told,) = [one.message for one in caplog.records]
    assert "Operation not permitted" in told
    assert "LimitRTPRIO=10" in told


def test_the_kernel_takes_the_priority_where_it_may_be_given(
    waiting_thread: threading.Thread, caplog: pytest.LogCaptureFixture
) -> None:
    thread = waiting_thread.native_id or 0
    with caplog.at_level(logging.INFO):
        granted = prioritise([thread], 5)
    assert granted == (os.sched_getparam(thread).sched_priority == 5)
    assert granted == (not caplog.records)
    assert prioritise([thread], 0) or not granted
    assert os.sched_getscheduler(thread) == os.SCHED_OTHER


def test_a_thread_that_has_ended_is_no_fault(caplog: pytest.LogCaptureFixture) -> None:
    thread = threading.Thread(target=lambda: None)
    thread.start()
    thread.join()
    with caplog.at_level(logging.INFO):
        prioritise([thread.native_id or 0], 0)
    assert caplog.records == []
