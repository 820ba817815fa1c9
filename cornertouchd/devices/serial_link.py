"""The LED frame behind a serial port; fills `ports.LedFrame`."""

import contextlib
import errno
import logging
import queue
import selectors
import socket
import termios
import threading
import time
from collections.abc import Callable
from dataclasses import replace

import serial

from cornertouchd.ports import FaultReport, LedFrameListener, LedFrameStatus
from cornertouchd.wire.ledframe import Disarm, Request, Status, encode_request
from cornertouchd.wire.ledframe_faults import explain
from cornertouchd.wire.ledframe_framing import encode
from cornertouchd.wire.ledframe_reports import (
    ControllerStatus,
    FaultsChanged,
    Identity,
    SelfTested,
)
from cornertouchd.wire.ledframe_session import (
    Light,
    LinkLostError,
    LinkSession,
    Refused,
    Report,
    Wanted,
)

_log = logging.getLogger("cornertouchd")

BAUD = 500_000
REOPEN_DELAY_S = 0.25
REOPEN_DELAY_MAX_S = 5.0
JOIN_S = 0.8
# A port that takes no bytes for so long is as good as gone; the controller waits for 500 ms.
WRITE_TIMEOUT_S = 0.2
READ_BYTES = 4096  # all that Linux keeps of a line

OpenPort = Callable[[str], serial.Serial]


def open_port(name: str) -> serial.Serial:
    """Open a serial port for this process alone.  Raises `OSError` (`serial.SerialException`)."""
    port = serial.Serial(name, BAUD, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
    # FTDI adapters otherwise collect bytes for 16 ms; others have no such thing.
    with contextlib.suppress(ValueError, OSError, NotImplementedError):
        port.set_low_latency_mode(True)
    # Closing must not restart an Arduino, which resets when DTR goes off and on.
    with contextlib.suppress(termios.error, OSError):
        attributes = termios.tcgetattr(port.fileno())
        attributes[2] &= ~termios.HUPCL
        termios.tcsetattr(port.fileno(), termios.TCSANOW, attributes)
    port.reset_input_buffer()
    return port


class SerialLedFrame:
    """Keeps the LED frame at `port_name` as it is wanted; opens the port anew when it is lost.

    Guarantees: methods return at once; no exception of port or listener ends the thread.
    `listener` and `faults` are called from the thread of the link only.
    """

    def __init__(
        self,
        port_name: str,
        listener: LedFrameListener,
        faults: FaultReport,
        *,
        open_port: OpenPort = open_port,
    ) -> None:
        self._port_name = port_name
        self._listener = listener
        self._faults = faults
        self._open_port = open_port
        self._lock = threading.Lock()
        self._wanted = Wanted()
        self._asked: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._stop = threading.Event()
        self._wake, self._woken = socket.socketpair()
        self._wake.setblocking(False)
        self._woken.setblocking(False)
        self._status = LedFrameStatus()
        self._bad_before = 0
        self._thread = threading.Thread(target=self._run, name="led-frame", daemon=True)

    @property
    def status(self) -> LedFrameStatus:
        """How it fares now.  Any thread may ask."""
        return self._status

    def start(self) -> None:
        """Begin to look for the controller."""
        self._thread.start()

    def configure(self, light: Light) -> None:
        """Set levels, timing and pattern."""
        with self._lock:
            self._wanted = replace(self._wanted, light=light)
        self._wake_up()

    def arm(self) -> None:
        """Shine, once configured."""
        with self._lock:
            self._wanted = replace(self._wanted, armed=True)
        self._wake_up()

    def disarm(self) -> None:
        """Be dark."""
        with self._lock:
            self._wanted = replace(self._wanted, armed=False)
        self._wake_up()

    def ask(self, request: Request) -> None:
        """Send a request once; lost if the frame is not there."""
        self._asked.put(request)
        self._wake_up()

    def close(self) -> None:
        """Switch the light off and give the port back."""
        self._stop.set()
        self._wake_up()
        if self._thread.is_alive():
            self._thread.join(JOIN_S)
        if not self._thread.is_alive():
            self._wake.close()
            self._woken.close()

    def _wake_up(self) -> None:
        with contextlib.suppress(OSError):  # full: it wakes already; closed: it has ended
            self._wake.send(b"\0")

    def _run(self) -> None:
        delay_s = REOPEN_DELAY_S
        while not self._stop.is_set():
            connections = self._status.connections
            self._connect_once()
            self._status = replace(self._status, identity=None, controller=None)
            if self._status.connections > connections:
                delay_s = REOPEN_DELAY_S
            self._stop.wait(delay_s)
            delay_s = min(2.0 * delay_s, REOPEN_DELAY_MAX_S)

    def _connect_once(self) -> None:
        """Open the port and serve it until it is lost or the daemon stops."""
        try:
            port = self._open_port(self._port_name)
        except Exception as error:  # noqa: BLE001  adapters raise more than SerialException
            self._faults.fault("not opened", opening_failed(self._port_name, error))
            return
        try:
            self._serve(port)
        except LinkLostError as error:
            self._faults.fault("lost", f"{self._port_name}: {error}")
        except Exception as error:  # noqa: BLE001  unplugged: SerialException, OSError, TypeError
            self._faults.fault(
                "lost", f"{self._port_name} is gone ({error}); plug the LED frame in again"
            )
        finally:
            with contextlib.suppress(Exception):
                port.close()

    def _serve(self, port: serial.Serial) -> None:
        while not self._asked.empty():  # nobody was there to hear it
            self._asked.get_nowait()
        session = LinkSession(time.monotonic(), self._wanted)
        self._bad_before = self._status.bad_messages
        with selectors.DefaultSelector() as selector:
            selector.register(port.fileno(), selectors.EVENT_READ)
            selector.register(self._woken, selectors.EVENT_READ)
            while not self._stop.is_set():
                self._exchange(port, session)
                selector.select(max(0.0, session.wake_at_s() - time.monotonic()))
        port.write(encode(encode_request(Disarm(), 0)))
        port.flush()

    def _exchange(self, port: serial.Serial, session: LinkSession) -> None:
        """Read what has come, tell it, write what is due."""
        with contextlib.suppress(BlockingIOError):
            self._woken.recv(READ_BYTES)
        session.want(self._wanted)
        while not self._asked.empty():
            session.ask(self._asked.get_nowait())
        data = port.read(READ_BYTES)  # returns at once; raises when the port has gone
        now_s = time.monotonic()
        try:
            session.receive(data, now_s)
        finally:
            for report in session.take_reports():
                self._take(report, session, now_s)
        due = session.to_send(now_s)
        if due:
            port.write(due)

    def _take(self, report: Report, session: LinkSession, now_s: float) -> None:
        match report:
            case Identity():
                self._connected(report)
            case ControllerStatus():
                bad = self._bad_before + session.counts.bad
                self._status = replace(self._status, controller=report, bad_messages=bad)
                if not report.faults:
                    self._faults.good()
            case FaultsChanged():
                for meaning in explain(report.faults & report.changed):
                    self._faults.fault(meaning)
            case SelfTested() if report.sides_failed:
                sides = ", ".join(report.sides_failed)
                self._faults.fault("self test", f"no light on these sides: {sides}")
            case Refused():
                self._faults.fault("refused", _refusal(report))
            case _:
                pass
        try:
            self._listener(report, now_s)
        except Exception as error:  # noqa: BLE001  the light stays on, whoever listens
            self._faults.fault("report not taken", error)

    def _connected(self, identity: Identity) -> None:
        first = self._status.identity is None
        connections = self._status.connections + first
        self._status = replace(self._status, identity=identity, connections=connections)
        _log.info(
            "LED frame at %s: firmware %s, start %d%s",
            self._port_name,
            ".".join(map(str, identity.firmware)),
            identity.boot_id,
            "" if first else "; it has restarted and is set up again",
        )


def opening_failed(name: str, error: Exception) -> str:
    """Say why a port cannot be opened, and what to do."""
    number = getattr(error, "errno", None)
    remedy = {
        errno.ENOENT: "it is not there; plug the LED frame in or correct the name",
        errno.EACCES: "not allowed; add the daemon's user to the group of the port (dialout)",
        errno.EPERM: "its service may not open it; add a DeviceAllow= to the unit (led-frame.md)",
        errno.EAGAIN: "another program uses it; end that program",
        errno.EBUSY: "another program uses it; end that program",
    }.get(number or 0, f"{error}; check that it is a serial port")
    return f"{name}: {remedy}"


def _refusal(refused: Refused) -> str:
    why = {
        Status.RANGE: "beyond the limits of the firmware",
        Status.STATE: "not possible in the state it is in",
        Status.FAULTED: "a fault keeps it dark",
        Status.BUSY: "the self test runs",
    }.get(refused.status, f"its firmware does not know that ({refused.status.name})")
    return f"{refused.request}: {why}"
