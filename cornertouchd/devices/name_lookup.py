"""Names of receivers, resolved by a thread of their own: the network may take many seconds."""

import errno
import queue
import socket
import threading
from collections.abc import Callable
from typing import Any

# A socket address as `getaddrinfo` gives it: family, and what `connect` takes.
Address = tuple[socket.AddressFamily, Any]
Resolve = Callable[[str, int], list[Address]]


def addresses_of(host: str, port: int, kind: socket.SocketKind) -> list[Address]:
    """Return the addresses of a host, IPv4 first; may take many seconds.  Raises `OSError`.

    TUIO clients seldom listen on IPv6, which comes first for "localhost".
    """
    found = socket.getaddrinfo(host, port, type=kind)
    addresses: list[Address] = [(family, address) for family, _, _, _, address in found]
    return sorted(addresses, key=lambda address: address[0] != socket.AF_INET)


class NameLookup:
    """Asks for the addresses of host:port aside.  Used by one thread; one question at a time."""

    def __init__(self, host: str, port: int, resolve: Resolve) -> None:
        self._host, self._port = host, port
        self._resolve = resolve
        self._answers: queue.SimpleQueue[list[Address] | OSError] = queue.SimpleQueue()
        self._is_under_way = False

    @property
    def is_under_way(self) -> bool:
        """Whether the answer to a question has not been taken yet."""
        return self._is_under_way

    def begin(self) -> None:
        """Ask; returns at once.  Raises `OSError` if the process may have no more threads."""
        asking = threading.Thread(target=self._ask, name=f"resolve {self._host}", daemon=True)
        try:
            asking.start()
        except RuntimeError as error:
            raise OSError(errno.EAGAIN, str(error)) from error
        self._is_under_way = True

    def take(self) -> list[Address] | OSError | None:
        """Return what came of it, None while nothing did."""
        try:
            answer = self._answers.get_nowait()
        except queue.Empty:
            return None
        self._is_under_way = False
        return answer

    def _ask(self) -> None:
        try:
            self._answers.put(self._resolve(self._host, self._port))
        except OSError as error:
            self._answers.put(error)
        except ValueError as error:  # a name that IDNA cannot encode
            self._answers.put(OSError(errno.EINVAL, str(error)))
