"""The page's process is started, heard, started again and ended; faults are told once."""

import logging
import select
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from cornertouchd.config import MonitorSettings, Settings
from cornertouchd.monitor.options import PageOptions
from cornertouchd.runtime.monitor_process import (
    FIRST_WAIT_S,
    LONGEST_WAIT_S,
    START_AFTER_S,
    WELL_AFTER_S,
    MonitorProcess,
    page_options,
)

OPTIONS = PageOptions("/run/status.sock", token="0123456789abcdef")
SERVES = """read options
echo '{"serving": "http://page/"}'
read until_the_end
exit 0
"""
FAILS = """read options
echo '{"failed": "the port is taken"}'
exit 1
"""
DIES = "exit 3"


class FakeClock:
    time_s = 100.0

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        raise AssertionError("nothing here sleeps")


class Bench:
    """A page whose program is a shell script, and what was said of it."""

    def __init__(self, script: Path) -> None:
        self.script = script
        self.clock = FakeClock()
        self.said: list[str] = []
        self.wanted: PageOptions | None = OPTIONS
        self.page = MonitorProcess(lambda: self.wanted, self.clock, self.said.append)

    def program(self, text: str) -> None:
        self.script.write_text(f"#!/bin/sh\n{text}")
        self.script.chmod(0o755)

    def look_after(self, seconds: float) -> None:
        self.clock.time_s += seconds
        self.page.look()

    def look_when_it_speaks(self) -> None:
        child = self.page._child
        assert select.select([child.line], [], [], 10.0)[0]
        self.page.look()

    def look_when_it_has_ended(self) -> None:
        self.page._child.process.wait(10.0)
        self.page.look()


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    script = tmp_path / "page"
    monkeypatch.setattr(sys, "executable", str(script))
    bench = Bench(script)
    bench.program(SERVES)
    with bench.page:
        yield bench


def test_it_starts_after_the_first_touches_and_says_where_it_is(bench):
    bench.look_after(0.9 * START_AFTER_S)
    assert bench.page.pid is None
    bench.look_after(0.2 * START_AFTER_S)
    assert bench.page.pid is not None
    bench.look_when_it_speaks()
    assert bench.said == ["live page: http://page/"]


def test_it_ends_when_its_line_is_closed(bench):
    bench.look_after(START_AFTER_S)
    bench.look_when_it_speaks()
    process = bench.page._child.process
    bench.page.close()
    assert process.returncode == 0
    assert bench.page.pid is None


def test_one_that_does_not_end_is_killed(bench):
    bench.program("trap '' TERM\nexec sleep 1000")
    bench.look_after(START_AFTER_S)
    process = bench.page._child.process
    bench.page.close()
    assert process.returncode == -9


def test_the_options_go_through_the_line_and_not_through_the_arguments(bench, tmp_path):
    bench.program(
        f'read options\necho "$options" >{tmp_path}/told\necho "$@" >{tmp_path}/arguments'
    )
    bench.look_after(START_AFTER_S)
    bench.look_when_it_has_ended()
    assert PageOptions.from_line((tmp_path / "told").read_bytes()) == OPTIONS
    arguments = (tmp_path / "arguments").read_text()
    assert "-P -m cornertouchd.monitor --socket /run/status.sock" in arguments
    assert OPTIONS.token not in arguments


@pytest.mark.parametrize(
    ("program", "reason"), [(FAILS, "the port is taken"), (DIES, "ended with status 3")]
)
def test_one_that_fails_is_told_once_and_started_again_ever_later(bench, caplog, program, reason):
    bench.program(program)
    bench.look_after(START_AFTER_S)
    wait_s = FIRST_WAIT_S
    with caplog.at_level(logging.ERROR, "cornertouchd"):
        for _ in range(9):
            bench.look_when_it_has_ended()
            assert bench.page.pid is None
            bench.look_after(0.99 * wait_s)
            assert bench.page.pid is None
            bench.look_after(0.02 * wait_s)
            assert bench.page.pid is not None
            wait_s = min(2.0 * wait_s, LONGEST_WAIT_S)
    assert caplog.messages == [f"live page: not served: {reason}; touches go on"]
    assert wait_s == LONGEST_WAIT_S


def test_after_a_good_while_it_is_started_again_at_once(bench):
    bench.program(DIES)
    bench.look_after(START_AFTER_S)
    for _ in range(5):
        bench.look_when_it_has_ended()
        bench.look_after(LONGEST_WAIT_S)
    bench.look_when_it_has_ended()
    bench.program(SERVES)
    bench.look_after(LONGEST_WAIT_S)
    bench.look_when_it_speaks()
    bench.look_after(WELL_AFTER_S)
    bench.page._child.process.kill()
    bench.look_when_it_has_ended()
    bench.look_after(FIRST_WAIT_S)
    assert bench.page.pid is not None


def test_a_program_that_is_not_there_is_told(bench, caplog):
    bench.script.unlink()
    bench.look_after(START_AFTER_S)
    assert "live page: not served: cannot be started" in caplog.text
    bench.look_after(FIRST_WAIT_S)
    assert bench.page.pid is None


def test_other_options_are_followed_and_none_end_it(bench):
    bench.look_after(START_AFTER_S)
    bench.look_when_it_speaks()
    first = bench.page.pid
    bench.look_after(1.0)
    assert bench.page.pid == first
    bench.wanted = replace(OPTIONS, port=9000)
    bench.look_after(1.0)
    assert bench.page.pid not in {None, first}
    bench.look_when_it_speaks()
    bench.wanted = None
    bench.look_after(1.0)
    assert bench.page.pid is None
    bench.look_after(1000.0)
    assert bench.page.pid is None


def test_the_options_are_those_of_the_settings(tmp_path):
    environ = {"STATE_DIRECTORY": str(tmp_path)}
    monitor = MonitorSettings(
        host="::", port=9, token="x" * 16, names=("a",), allow_actions=True, viewers_max=3
    )
    given = page_options(Settings(monitor=monitor), Path("/run/s"), environ)
    recordings = str(tmp_path / "recordings")
    assert given == PageOptions("/run/s", "::", 9, "x" * 16, ("a",), True, 3, recordings)
    off = Settings(monitor=MonitorSettings(enabled=False))
    assert page_options(off, Path("/run/s"), environ) is None
