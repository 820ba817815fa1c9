"""The LED frame's port: a thread that keeps it as wanted, and never lets anybody wait."""

import errno
import os
import pty
import select
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from led_core import Core, build_core

from cornertouchd.devices.serial_link import SerialLedFrame, open_port
from cornertouchd.ports import FaultReport, LedFrame, LedFrameListener, Report
from cornertouchd.runtime.faults import FaultLog
from cornertouchd.wire import ledframe as wire
from cornertouchd.wire.ledframe import SetLevels, SetPattern, SetTiming, State
from cornertouchd.wire.ledframe_reports import ControllerStatus, FaultsChanged, Identity
from cornertouchd.wire.ledframe_session import Light

LIGHT = Light(SetLevels((10, 20, 30, 40)), SetTiming(8000, 400, 20), SetPattern((15, 0)))
DEADLINE_S = 20.0


class Heard:
    """What the link reported and complained of, to wait for."""

    def __init__(self) -> None:
        self.reports: list[Report] = []
        self.faults: list[str] = []
        self.well = 0
        self.raises = False
        self._changed = threading.Condition()

    def __call__(self, report: Report, received_at_s: float) -> None:
        with self._changed:
            self.reports.append(report)
            self._changed.notify_all()
        if self.raises:
            raise RuntimeError("listener fails")

    def fault(self, kind: str, detail: object = "") -> None:
        with self._changed:
            self.faults.append(f"{kind}: {detail}")
            self._changed.notify_all()

    def good(self) -> None:
        self.well += 1

    def wait_for(self, condition: Callable[[], bool], what: str) -> None:
        with self._changed:
            if not self._changed.wait_for(condition, DEADLINE_S):
                pytest.fail(f"{what} never came; {self.faults}; {self.reports[-5:]}")

    def wait_for_fault(self, words: str) -> None:
        self.wait_for(lambda: any(words in fault for fault in self.faults), words)


class Controller:
    """The core behind a pseudo-terminal, on a thread of its own until it is unplugged.

    Whoever uses the core meanwhile holds `lock`.  Without a core it answers like a modem.
    """

    def __init__(self, core: Core | None, link: Path) -> None:
        self._core = core
        self._host_end, self._port_end = pty.openpty()
        tty.setraw(self._port_end)
        link.unlink(missing_ok=True)
        link.symlink_to(os.ttyname(self._port_end))
        self._link = link
        self._ending, self._end = os.pipe()
        self._plugged = True
        self.lock = threading.Lock()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def unplug(self) -> None:
        if not self._plugged:
            return
        self._plugged = False
        self._link.unlink()
        os.write(self._end, b"\0")
        self._thread.join()
        for descriptor in (self._host_end, self._port_end, self._ending, self._end):
            os.close(descriptor)

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._host_end, self._ending], [], [])
            if self._host_end not in ready:
                return
            data = os.read(self._host_end, 4096)
            os.write(self._host_end, self._answer(data))

    def _answer(self, data: bytes) -> bytes:
        if self._core is None:
            return b"OK\r\n"
        with self.lock:
            self._core.receive(data)
            return self._core.take_sent()


@pytest.fixture(scope="module")
def shared_core(tmp_path_factory: pytest.TempPathFactory) -> Core:
    return Core(build_core(tmp_path_factory.mktemp("core")))


@pytest.fixture
def core(shared_core: Core) -> Core:
    shared_core.start()
    return shared_core


@pytest.fixture
def link(tmp_path: Path) -> Path:
    return tmp_path / "ledframe"


@pytest.fixture
def controller(core: Core, link: Path) -> Iterator[Controller]:
    plugged = Controller(core, link)
    yield plugged
    plugged.unplug()


@pytest.fixture
def heard() -> Heard:
    return Heard()


@pytest.fixture
def frame(link: Path, heard: Heard) -> Iterator[SerialLedFrame]:
    """A link that was not started yet."""
    made = SerialLedFrame(str(link), heard, heard)
    yield made
    made.close()


def is_armed(frame: SerialLedFrame) -> Callable[[], bool]:
    def armed() -> bool:
        controller = frame.status.controller
        return controller is not None and controller.state is State.ARMED

    return armed


def test_it_fills_the_ports(frame: SerialLedFrame, heard: Heard) -> None:
    as_port: LedFrame = frame
    as_listener: LedFrameListener = heard
    as_faults: FaultReport = FaultLog("LED frame")
    assert (as_port.status.connections, as_listener, as_faults) != (1, None, None)


def test_it_shines_as_wanted(
    controller: Controller, frame: SerialLedFrame, heard: Heard, core: Core
) -> None:
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    heard.wait_for(is_armed(frame), "light")
    assert (core.levels, core.timing_us) == ((10, 20, 30, 40), (8000, 400, 20))
    assert frame.status.identity is not None
    assert frame.status.identity.firmware == (1, 0, 0)
    assert (frame.status.connections, heard.faults) == (1, [])
    assert heard.well > 0


def test_closing_is_dark(
    controller: Controller, frame: SerialLedFrame, heard: Heard, core: Core
) -> None:
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    heard.wait_for(is_armed(frame), "light")
    frame.close()
    frame.close()
    controller.unplug()
    assert core.state == State.IDLE
    frame.arm()  # too late, and no harm


def test_unplugged_is_told_and_plugged_in_again_is_set_up_anew(
    controller: Controller, frame: SerialLedFrame, heard: Heard, core: Core, link: Path
) -> None:
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    heard.wait_for(is_armed(frame), "light")
    controller.unplug()
    heard.wait_for_fault("plug the LED frame in again")
    heard.wait_for_fault("it is not there")
    assert frame.status.identity is None
    core.start(boot_id=2)
    again = Controller(core, link)
    heard.wait_for(is_armed(frame), "light")
    assert core.levels == (10, 20, 30, 40)
    assert frame.status.connections == 2
    frame.close()
    again.unplug()


def test_callers_need_no_controller(frame: SerialLedFrame, heard: Heard) -> None:
    frame.start()
    frame.configure(LIGHT)
    frame.arm()
    frame.disarm()
    for _ in range(100_000):  # more than any buffer holds
        frame.ask(wire.SelfTest())
    heard.wait_for_fault("it is not there; plug the LED frame in or correct the name")
    assert frame.status.controller is None


def test_what_was_asked_while_it_was_away_is_forgotten(
    frame: SerialLedFrame, heard: Heard, core: Core, link: Path
) -> None:
    frame.ask(wire.Reset())
    frame.start()
    heard.wait_for_fault("not there")
    plugged = Controller(core, link)
    heard.wait_for(lambda: any(type(report) is Identity for report in heard.reports), "hello")
    heard.wait_for(lambda: any(type(report) is ControllerStatus for report in heard.reports), "it")
    frame.close()
    plugged.unplug()
    assert core.resets == 0


def test_a_listener_that_fails_costs_nothing(
    controller: Controller, frame: SerialLedFrame, heard: Heard
) -> None:
    heard.raises = True
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    heard.wait_for(is_armed(frame), "light")
    heard.wait_for_fault("report not taken: listener fails")


def test_faults_of_the_frame_come_with_their_remedy(
    controller: Controller, frame: SerialLedFrame, heard: Heard, core: Core
) -> None:
    frame.configure(LIGHT)
    frame.arm()
    frame.start()
    heard.wait_for(is_armed(frame), "light")
    with controller.lock:
        core.overcurrent(True)
    heard.wait_for_fault("over-current: all sides are off; look for a short")
    heard.wait_for(lambda: any(type(r) is FaultsChanged for r in heard.reports), "the report")


def test_another_device_at_the_port_is_told(
    frame: SerialLedFrame, heard: Heard, link: Path
) -> None:
    modem = Controller(None, link)
    frame.start()
    heard.wait_for_fault("no LED frame answers")
    frame.close()
    modem.unplug()


def test_what_is_no_serial_port_is_told(heard: Heard, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    frame = SerialLedFrame(str(tmp_path / "file"), heard, heard)
    frame.start()
    heard.wait_for_fault("check that it is a serial port")
    frame.close()


def test_a_port_in_use_is_told(controller: Controller, heard: Heard, link: Path) -> None:
    with open_port(str(link)):
        frame = SerialLedFrame(str(link), heard, heard)
        frame.start()
        heard.wait_for_fault("another program uses it")
        frame.close()


def test_a_port_that_the_unit_keeps_closed_is_told(heard: Heard) -> None:
    """What the kernel says where DevicePolicy forbids, whatever the mode of the device."""

    def refuse(name: str) -> Any:
        raise serial.SerialException(errno.EPERM, f"could not open port {name}")

    frame = SerialLedFrame("/dev/ttyAMA0", heard, heard, open_port=refuse)
    frame.start()
    heard.wait_for_fault("/dev/ttyAMA0: its service may not open it; add a DeviceAllow=")
    frame.close()


@pytest.mark.parametrize("error", [serial.SerialException("odd"), OSError(5, "I/O"), TypeError()])
def test_whatever_an_adapter_raises_the_thread_lives_on(heard: Heard, error: Exception) -> None:
    def fail(name: str) -> Any:
        raise error

    frame = SerialLedFrame("ttyX", heard, heard, open_port=fail)
    frame.start()
    heard.wait_for(lambda: len(heard.faults) >= 2, "a second attempt")
    frame.close()


def test_a_link_that_never_started_closes(frame: SerialLedFrame) -> None:
    frame.close()
    frame.close()
