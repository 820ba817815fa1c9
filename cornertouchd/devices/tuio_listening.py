"""Where TUIO comes from: datagrams to a port, a server over TCP or WebSocket."""

import contextlib
import errno
import socket
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from typing import Protocol

from cornertouchd.errors import ReportedError
from cornertouchd.wire.tuio_stream import MAX_BUNDLE_BYTES, MalformedStreamError, PrefixedBundles

MAX_DATAGRAM_BYTES = 65536
# A thousand large bundles, should drawing take long; the kernel grants at most net.core.rmem_max.
RECEIVE_BUFFER_BYTES = 2 * 1024 * 1024
CONNECT_S = 5.0
RECEIVE_BYTES = 65536


class ListenError(ReportedError):
    """TUIO cannot be listened to there; the text says why and what to do."""


class StreamEndedError(Exception):
    """The other side has ended the stream, or sends what is none; the text says which."""


class TuioInput(Protocol):
    """Packets of TUIO, one after the other."""

    def receive(self, wait_s: float) -> tuple[bytes, str] | None:
        """Return the next packet and who sent it, None if none comes in time.

        Raises `StreamEndedError`.
        """
        ...


class Datagrams:
    """What is sent to a UDP port.  Raises `ListenError` if that is not to be had."""

    def __init__(self, host: str, port: int) -> None:
        self.socket = _bound_socket(host, port)

    def receive(self, wait_s: float) -> tuple[bytes, str] | None:
        """Return the next datagram and who sent it, None if none comes in time."""
        self.socket.settimeout(max(wait_s, 0.001))  # 0 would mean not to wait at all, and raise
        try:
            datagram, address = self.socket.recvfrom(MAX_DATAGRAM_BYTES)
        except TimeoutError:
            return None
        return datagram, f"{address[0]}:{address[1]}"


class TcpStream:
    """What a server tells over TCP."""

    def __init__(self, connected: socket.socket, name: str) -> None:
        self._socket = connected
        self._name = name
        self._bundles = PrefixedBundles()
        self._whole: deque[bytes] = deque()

    def receive(self, wait_s: float) -> tuple[bytes, str] | None:
        """Return the next bundle and the server, None if none comes in time."""
        until_s = time.monotonic() + wait_s
        while not self._whole:
            self._socket.settimeout(max(until_s - time.monotonic(), 0.001))
            try:
                data = self._socket.recv(RECEIVE_BYTES)
            except TimeoutError:
                return None
            except OSError as error:
                raise StreamEndedError(f"{self._name}: {error.strerror}") from error
            if not data:
                raise StreamEndedError(f"{self._name} has closed the connection")
            try:
                self._whole.extend(self._bundles.feed(data))
            except MalformedStreamError as error:
                raise StreamEndedError(f"{self._name} sends {error}") from error
        return self._whole.popleft(), self._name


class WebSocketStream:
    """What a server tells over WebSocket; `take` returns its next message or raises."""

    def __init__(self, take: Callable[[float], bytes | str], name: str) -> None:
        self._take = take
        self._name = name

    def receive(self, wait_s: float) -> tuple[bytes, str] | None:
        """Return the next message and the server, None if none comes in time."""
        from websockets.exceptions import ConnectionClosed  # noqa: PLC0415

        try:
            message = self._take(max(wait_s, 0.001))
        except TimeoutError:
            return None
        except ConnectionClosed as error:
            raise StreamEndedError(f"{self._name} has closed the connection: {error}") from error
        if isinstance(message, str):
            raise StreamEndedError(f"{self._name} sends text; TUIO comes in binary messages")
        return message, self._name


@contextlib.contextmanager
def datagrams(host: str, port: int) -> Iterator[TuioInput]:
    """Listen at a UDP port.  Raises `ListenError`."""
    listening = Datagrams(host, port)
    with listening.socket:
        yield listening


@contextlib.contextmanager
def tcp_stream(host: str, port: int) -> Iterator[TuioInput]:
    """Connect to a server over TCP.  Raises `ListenError`."""
    try:
        connected = socket.create_connection((host, port), CONNECT_S)
    except (OSError, ValueError) as error:
        raise _unreachable("tcp", host, port, error) from error
    with connected:
        yield TcpStream(connected, f"{host}:{port}")


@contextlib.contextmanager
def websocket_stream(host: str, port: int) -> Iterator[TuioInput]:
    """Connect to a server over WebSocket.  Raises `ListenError`."""
    from websockets.exceptions import WebSocketException  # noqa: PLC0415
    from websockets.sync.client import connect  # noqa: PLC0415

    address = f"[{host}]" if ":" in host else host
    with contextlib.ExitStack() as stack:
        try:
            connection = stack.enter_context(
                connect(
                    f"ws://{address}:{port}/",
                    compression=None,
                    proxy=None,
                    open_timeout=CONNECT_S,
                    close_timeout=1.0,
                    max_size=MAX_BUNDLE_BYTES,
                )
            )
        except (OSError, ValueError, WebSocketException) as error:
            raise _unreachable("ws", host, port, error) from error
        yield WebSocketStream(lambda wait_s: connection.recv(timeout=wait_s), f"{host}:{port}")


INPUTS: dict[str, Callable[[str, int], AbstractContextManager[TuioInput]]] = {
    "udp": datagrams,
    "tcp": tcp_stream,
    "websocket": websocket_stream,
}
"""How to listen, by transport."""


def _unreachable(scheme: str, host: str, port: int, error: Exception) -> ListenError:
    reason = getattr(error, "strerror", None) or str(error)
    return ListenError(
        f"cannot connect to {scheme}://{host}:{port}: {reason}; is the server enabled there "
        "(tuio.tcp, tuio.websocket)?"
    )


def _bound_socket(host: str, port: int) -> socket.socket:
    """Return a socket that receives what is sent to host:port.  Raises `ListenError`."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        receiver = socket.socket(family, kind)
    except (OSError, ValueError) as error:
        raise ListenError(f"cannot listen on {host}: {error}") from error
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    try:
        receiver.bind(address)
    except OSError as error:
        receiver.close()
        if error.errno == errno.EADDRINUSE:
            raise ListenError(
                f"UDP port {port} of {host} is in use: end the other TUIO client, "
                "or choose another port with --port"
            ) from error
        raise ListenError(f"cannot listen on {host}:{port}: {error.strerror}") from error
    return receiver
