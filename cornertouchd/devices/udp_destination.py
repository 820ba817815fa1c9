"""One UDP destination that never blocks: its name resolved aside, its faults counted."""

import errno
import logging
import queue
import socket
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

log = logging.getLogger(__name__)

RETRY_AFTER_S = 10.0
# A refusing host says so about once a second (icmp_ratelimit of Linux), whatever is sent; a missing
# one is noticed every 3 s, when ARP gives up.  So long without an error, somebody is there.
RECOVERED_AFTER_S = 10.0

# A socket address as `getaddrinfo` gives it: family, and what `connect` takes.
Address = tuple[socket.AddressFamily, Any]
Resolve = Callable[[str, int], list[Address]]


@dataclass(frozen=True, slots=True)
class DestinationStatus:
    """How a destination, or a server of ours, fares; `fault` is None while nothing is wrong.

    For TCP and WebSocket `packets_sent` are bundles to all clients together, `clients` those that
    are connected (None over UDP), `frames_skipped` what slow ones were not told because there was
    something newer, `refused` those sent away.
    """

    host: str
    port: int
    packets_sent: int
    errors: int
    fault: str | None
    transport: Literal["udp", "tcp", "websocket"] = "udp"
    clients: int | None = None
    frames_skipped: int = 0
    refused: int = 0


def resolve_name(host: str, port: int) -> list[Address]:
    """Return the addresses of a host, IPv4 first; may take many seconds.  Raises `OSError`.

    TUIO clients seldom listen on IPv6, which comes first for "localhost".
    """
    found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    addresses: list[Address] = [(family, address) for family, _, _, _, address in found]
    return sorted(addresses, key=lambda address: address[0] != socket.AF_INET)


class UdpDestination:
    """Sends datagrams to host:port without ever blocking or raising.

    Used by one thread; `status` may be read by any.  A name is resolved by a thread of its own,
    again every 10 s while that fails; a numeric address is ready at once.
    """

    def __init__(self, host: str, port: int, resolve: Resolve = resolve_name) -> None:
        if not host:
            raise ValueError("UDP destination has no host; give a name or an address")
        if not 0 < port < 65536:
            raise ValueError(f"UDP destination {host} has port {port}; give one of 1..65535")
        self._host = host
        # no log takes what is no character
        self._shown = f"{host.encode(errors='backslashreplace').decode()}:{port}"
        self._port = port
        self._resolve = resolve
        self._answers: queue.SimpleQueue[list[Address] | OSError] = queue.SimpleQueue()
        self._socket: socket.socket | None = None
        self._resolving = False
        self._retry_at_s = float("-inf")
        self._packets_sent = 0
        self._errors = 0
        self._fault: str | None = None
        self._fault_at_s = float("-inf")

    @property
    def status(self) -> DestinationStatus:
        """What was sent so far and what went wrong."""
        return DestinationStatus(
            self._host, self._port, self._packets_sent, self._errors, self._fault
        )

    def send(self, payload: bytes, now_s: float) -> None:
        """Send one datagram if that is possible now, else count it as an error."""
        self.tick(now_s)
        if self._socket is None:
            self._errors += 1
            return
        try:
            self._send_past_old_error(self._socket, payload, now_s)
        except OSError as error:
            self._note_fault(error, now_s)
            # A full buffer empties by itself; for the rest the way there must be found anew.
            if not isinstance(error, (BlockingIOError, ConnectionRefusedError)):
                self._give_up(now_s)
        else:
            self._packets_sent += 1
            self._note_success(now_s)

    def tick(self, now_s: float) -> None:
        """Go on with finding the way to the host, if there is none."""
        if self._socket is not None:
            return
        if self._resolving:
            self._take_answer(now_s)
        elif now_s >= self._retry_at_s:
            self._find(now_s)

    def close(self) -> None:
        """Close the socket; may be called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send_past_old_error(
        self, open_socket: socket.socket, payload: bytes, now_s: float
    ) -> None:
        """Send; repeat it once if the error may be that of an earlier datagram.

        What the network answers (nobody listens, no such host) is reported by the next call, which
        then sends nothing: a client that was just started would miss its first packet.
        """
        try:
            open_socket.send(payload)
        except BlockingIOError:
            raise
        except OSError as error:
            self._note_fault(error, now_s)
            open_socket.send(payload)

    def _find(self, now_s: float) -> None:
        try:
            numeric = socket.getaddrinfo(
                self._host, self._port, type=socket.SOCK_DGRAM, flags=socket.AI_NUMERICHOST
            )
        except (OSError, ValueError):
            self._ask_aside(now_s)
        else:
            self._connect([(family, address) for family, _, _, _, address in numeric], now_s)

    def _ask_aside(self, now_s: float) -> None:
        asking = threading.Thread(target=self._ask, name=f"resolve {self._host}", daemon=True)
        try:
            asking.start()
        except RuntimeError as error:  # the process may have no more threads
            self._note_fault(OSError(errno.EAGAIN, str(error)), now_s)
            self._give_up(now_s)
        else:
            self._resolving = True

    def _ask(self) -> None:
        """Resolve the name, on a thread of its own."""
        try:
            self._answers.put(self._resolve(self._host, self._port))
        except OSError as error:
            self._answers.put(error)
        except ValueError as error:  # a name that IDNA cannot encode
            self._answers.put(OSError(errno.EINVAL, str(error)))

    def _take_answer(self, now_s: float) -> None:
        try:
            answer = self._answers.get_nowait()
        except queue.Empty:
            return
        self._resolving = False
        if isinstance(answer, OSError):
            self._note_fault(answer, now_s)
            self._give_up(now_s)
        else:
            self._connect(answer, now_s)

    def _connect(self, addresses: list[Address], now_s: float) -> None:
        """Open a socket to the first address that has a route."""
        error = OSError(errno.EADDRNOTAVAIL, "the name has no address")
        for family, address in addresses:
            try:
                self._socket = _connected_socket(family, address)
            except OSError as refusal:
                error = refusal
            else:
                return
        self._note_fault(error, now_s)
        self._give_up(now_s)

    def _give_up(self, now_s: float) -> None:
        self.close()
        self._retry_at_s = now_s + RETRY_AFTER_S

    def _note_fault(self, error: OSError, now_s: float) -> None:
        self._errors += 1
        self._fault_at_s = now_s
        if self._fault is None:
            self._fault = error.strerror or str(error)
            log.warning("TUIO destination %s: %s", self._shown, self._fault)

    def _note_success(self, now_s: float) -> None:
        if self._fault is not None and now_s - self._fault_at_s >= RECOVERED_AFTER_S:
            log.info("TUIO destination %s is reached again", self._shown)
            self._fault = None


def _connected_socket(family: socket.AddressFamily, address: Any) -> socket.socket:
    """Return a socket that only sends to `address`, without waiting; broadcast is allowed."""
    connected = socket.socket(family, socket.SOCK_DGRAM)
    try:
        connected.setblocking(False)
        connected.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        connected.connect(address)
    except OSError:
        connected.close()
        raise
    return connected
