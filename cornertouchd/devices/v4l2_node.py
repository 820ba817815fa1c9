"""A video node, opened: the system calls and nothing else."""

import ctypes
import fcntl
import mmap
import os
import select
from typing import Protocol

Argument = ctypes.Structure | ctypes.c_int32
"""What an ioctl reads and fills."""


class Node(Protocol):
    """What we ask of the kernel; everything raises `OSError` with its errno."""

    def ioctl(self, request: int, argument: Argument) -> None:
        """Do a request; its answer is in `argument`."""
        ...

    def wait(self, timeout_s: float) -> int:
        """Return the events of poll(2) when there are any, 0 if none came in time."""
        ...

    def map(self, offset: int, length: int) -> mmap.mmap:
        """Return a buffer of the driver in our memory."""
        ...

    def close(self) -> None:
        """Give the node back; may be called twice."""
        ...


class DeviceNode:
    """A node of /dev.  Raises `OSError` if it cannot be opened.

    It does not block: a request that would have to wait fails with EAGAIN.
    """

    def __init__(self, path: str) -> None:
        self._fd = os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)

    def ioctl(self, request: int, argument: Argument) -> None:
        """Do a request, again if a signal came between."""
        while True:
            try:
                fcntl.ioctl(self._fd, request, argument)
            except InterruptedError:
                continue
            return

    def wait(self, timeout_s: float) -> int:
        """Return what poll(2) tells of the node, 0 after the timeout."""
        events = self._poll.poll(max(0.0, timeout_s) * 1000.0)
        return events[0][1] if events else 0

    def map(self, offset: int, length: int) -> mmap.mmap:
        """Map a buffer, to be written as well: compiled code takes no read-only arrays."""
        return mmap.mmap(
            self._fd, length, mmap.MAP_SHARED, mmap.PROT_READ | mmap.PROT_WRITE, offset=offset
        )

    def close(self) -> None:
        """Close the file."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1
