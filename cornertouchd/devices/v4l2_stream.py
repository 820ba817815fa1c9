"""Pictures as a driver fills them into buffers that it shares with us; always the newest."""

import errno
import mmap
import select
from collections.abc import Callable
from ctypes import c_int32
from dataclasses import dataclass

import numpy as np

from cornertouchd.devices import v4l2_abi as abi
from cornertouchd.devices.v4l2_node import Node
from cornertouchd.model import Picture

BUFFERS = 4
"""One is ours, one is being filled; the others let us be late by two pictures."""

LEAST_BUFFERS = 2

OLDEST_STAMP_S = 1.0
"""A capture time further than this from now is not on our clock: the time of arrival is taken."""


class StreamError(Exception):
    """The driver reports an error that it does not name."""


@dataclass(frozen=True, slots=True)
class Filled:
    """A buffer with a picture; `bytes` (length,) is valid until the next one is asked for.

    `sequence` counts the pictures of this stream, those that the driver lost included.
    """

    bytes: Picture
    used_bytes: int
    sequence: int
    captured_at_s: float
    marked_bad: bool


@dataclass(frozen=True, slots=True)
class StreamCounts:
    """What became of the pictures of a stream.

    `lost` never reached a buffer, `overtaken` were older than another that was ready, of `foreign`
    ones the time was not on our clock.
    """

    filled: int = 0
    lost: int = 0
    overtaken: int = 0
    foreign: int = 0


class V4l2Stream:
    """Streams from a node whose format is set.  Raises `OSError` with the driver's errno."""

    def __init__(self, node: Node, now_s: Callable[[], float]) -> None:
        self._node = node
        self._now_s = now_s
        self._ours: int | None = None
        self._last_sequence: int | None = None
        self._sequence = 0
        self.counts = StreamCounts()
        self._memory: list[mmap.mmap] = []
        self._buffers: list[Picture] = []
        try:
            self._start()
        except OSError:
            self.close()
            raise

    def newest(self, timeout_s: float) -> Filled | None:
        """Return the newest picture, None if none came in time.

        Gives the one before back to the driver.  Raises `OSError` or `StreamError` when the stream
        is broken.
        """
        self._give_back()
        until_s = self._now_s() + timeout_s
        while True:
            events = self._node.wait(until_s - self._now_s())
            if not events:
                return None
            newest = self._take()
            if newest is not None:
                return newest
            if events & (select.POLLERR | select.POLLHUP | select.POLLNVAL):
                raise StreamError("the driver reports an error without saying which")
            if self._now_s() >= until_s:
                return None

    def close(self) -> None:
        """Stop, and free the buffers: pictures that came from here must not be used any more."""
        self._ignore_errors(abi.VIDIOC_STREAMOFF, c_int32(abi.BUF_TYPE_VIDEO_CAPTURE))
        self._buffers.clear()
        for memory in self._memory:
            try:
                memory.close()
            except BufferError:  # a picture of it is still in someone's hands; goes with that
                continue
        self._memory.clear()
        request = abi.RequestBuffers(
            count=0, type=abi.BUF_TYPE_VIDEO_CAPTURE, memory=abi.MEMORY_MMAP
        )
        self._ignore_errors(abi.VIDIOC_REQBUFS, request)

    def _start(self) -> None:
        request = abi.RequestBuffers(
            count=BUFFERS, type=abi.BUF_TYPE_VIDEO_CAPTURE, memory=abi.MEMORY_MMAP
        )
        self._node.ioctl(abi.VIDIOC_REQBUFS, request)
        if request.count < LEAST_BUFFERS:
            raise OSError(errno.ENOMEM, f"only {request.count} buffers")
        for index in range(request.count):
            place = _buffer(index)
            self._node.ioctl(abi.VIDIOC_QUERYBUF, place)
            memory = self._node.map(place.offset, place.length)
            self._memory.append(memory)
            self._buffers.append(np.frombuffer(memory, np.uint8))
            self._node.ioctl(abi.VIDIOC_QBUF, _buffer(index))
        self._node.ioctl(abi.VIDIOC_STREAMON, c_int32(abi.BUF_TYPE_VIDEO_CAPTURE))

    def _give_back(self) -> None:
        if self._ours is not None:
            index, self._ours = self._ours, None
            self._node.ioctl(abi.VIDIOC_QBUF, _buffer(index))

    def _take(self) -> Filled | None:
        """Take all buffers that are filled; keep the newest and give the others back."""
        newest = None
        while (filled := self._dequeue()) is not None:
            if newest is not None:
                self._give_back()
                self._count(overtaken=1)
            self._ours = filled.index
            newest = self._described(filled)
        return newest

    def _dequeue(self) -> abi.Buffer | None:
        filled = _buffer(0)
        try:
            self._node.ioctl(abi.VIDIOC_DQBUF, filled)
        except BlockingIOError:
            return None
        if filled.index >= len(self._buffers):
            raise StreamError(f"the driver filled buffer {filled.index}, which does not exist")
        return filled

    def _described(self, filled: abi.Buffer) -> Filled:
        lost = self._follow_sequence(filled.sequence)
        captured_at_s, foreign = self._time(filled)
        self._count(filled=1, lost=lost, foreign=int(foreign))
        buffer = self._buffers[filled.index]
        return Filled(
            buffer,
            min(filled.bytesused, len(buffer)),
            self._sequence,
            captured_at_s,
            bool(filled.flags & abi.BUF_FLAG_ERROR),
        )

    def _follow_sequence(self, sequence: int) -> int:
        """Count on by what the driver counted, over its 32 bits; return how many were lost."""
        before, self._last_sequence = self._last_sequence, sequence
        if before is None:
            return 0
        step = (sequence - before) & 0xFFFF_FFFF
        if not 0 < step < 1 << 31:  # a driver that does not count, or counts anew
            step = 1
        self._sequence += step
        return step - 1

    def _time(self, filled: abi.Buffer) -> tuple[float, bool]:
        now_s = self._now_s()
        stamp_s = filled.timestamp.tv_sec + filled.timestamp.tv_usec * 1e-6
        kind = filled.flags & abi.BUF_FLAG_TIMESTAMP_MASK
        if kind != abi.BUF_FLAG_TIMESTAMP_MONOTONIC or abs(now_s - stamp_s) > OLDEST_STAMP_S:
            return now_s, True
        return min(stamp_s, now_s), False  # drivers that estimate it may be a little ahead

    def _count(self, filled: int = 0, lost: int = 0, overtaken: int = 0, foreign: int = 0) -> None:
        counts = self.counts
        self.counts = StreamCounts(
            counts.filled + filled,
            counts.lost + lost,
            counts.overtaken + overtaken,
            counts.foreign + foreign,
        )

    def _ignore_errors(self, request: int, argument: c_int32 | abi.RequestBuffers) -> None:
        try:
            self._node.ioctl(request, argument)
        except OSError:
            return  # the device is gone, or never began: closing it does the rest


def _buffer(index: int) -> abi.Buffer:
    return abi.Buffer(index=index, type=abi.BUF_TYPE_VIDEO_CAPTURE, memory=abi.MEMORY_MMAP)
