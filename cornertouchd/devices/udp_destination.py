"""One UDP destination that never blocks: its name resolved aside, its faults counted."""

import errno
import logging
import socket
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

from cornertouchd.devices.name_lookup import Address, NameLookup, Resolve, addresses_of

log = logging.getLogger(__name__)

RETRY_AFTER_S = 10.0
# A refusing host says so about once a second (icmp_ratelimit of Linux), whatever is sent; a missing
# one is noticed every 3 s, when ARP gives up.  So long without an error, somebody is there.
RECOVERED_AFTER_S = 10.0


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


resolve_name = partial(addresses_of, kind=socket.SOCK_DGRAM)


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
        self._lookup = NameLookup(host, port, resolve)
        self._socket: socket.socket | None = None
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
        if self._lookup.is_under_way:
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
        try:
            self._lookup.begin()
        except OSError as error:
            self._note_fault(error, now_s)
            self._give_up(now_s)

    def _take_answer(self, now_s: float) -> None:
        answer = self._lookup.take()
        if answer is None:
            return
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
