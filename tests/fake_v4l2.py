"""A V4L2 driver in memory, behind the same system calls: what drivers do, and their faults.

It is held to what real drivers do by tests/guest/test_v4l2_drivers.py, which asks the same of
vivid.
"""

import ctypes
import errno
import mmap
import os
import select
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cornertouchd.devices import v4l2_abi as abi

BYTES_PER_PIXEL = {"GREY": 1, "Y10": 2, "Y16": 2, "YUYV": 2, "MJPG": 1, "RGB3": 3}
LENGTH = 1 << 20


@dataclass
class FakeControl:
    id: int
    name: str
    kind: int
    value: int
    lowest: int = 0
    highest: int = 1
    step: int = 1
    flags: int = 0
    choices: dict[int, str] = field(default_factory=dict)
    refuses: int = 0
    changes_to: int | None = None


class FakeDriver:
    """A device that lives on while nodes of it are opened and closed."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.sizes = {"GREY": [(64, 48)]}
        self.rates = {"GREY": [100, 30]}
        self.padding = 0
        self.controls: list[FakeControl] = []
        self.crops = False
        self.crop_step = 1
        self.fails: dict[int, int] = {}  # request -> errno
        self.makes_of_size: Callable[[int, int], tuple[int, int]] = lambda w, h: (w, h)
        self.capabilities = abi.CAP_VIDEO_CAPTURE | abi.CAP_STREAMING
        self.nodes: list[FakeNode] = []
        self.memory: list[np.ndarray] = []
        self.queued: list[int] = []
        self.filled: list[abi.Buffer] = []
        self.sequence = 0
        self.streaming = False
        self.events_when_idle = 0
        self.while_waiting: list[Callable[[], None]] = []
        self.crop = (0, 0, 64, 48)
        self.layout = ("GREY", 64, 48)
        self.rate = 30

    def open(self, path: str) -> "FakeNode":
        if "open" in self.fails:
            raise OSError(self.fails["open"], os.strerror(self.fails["open"]))
        self.nodes.append(FakeNode(self))
        return self.nodes[-1]

    def fill(
        self,
        picture: np.ndarray,
        flags: int = 0,
        used: int | None = None,
        clock: int = abi.BUF_FLAG_TIMESTAMP_MONOTONIC,
        age_s: float = 0.01,
        lost: int = 0,
    ) -> None:
        """Put a picture into the next free buffer; without any it is lost, as in drivers."""
        self.sequence += 1 + lost
        if not self.queued:
            return
        index = self.queued.pop(0)
        content = np.frombuffer(picture.tobytes(), np.uint8)
        self.memory[index][: len(content)] = content
        stamp = abi.Timeval(*divmod(round((self.now_s - age_s) * 1e6), 1_000_000))
        self.filled.append(
            abi.Buffer(
                index=index,
                bytesused=len(content) if used is None else used,
                flags=flags | clock,
                timestamp=stamp,
                sequence=(self.sequence - 1) & 0xFFFF_FFFF,
            )
        )


class FakeNode:
    def __init__(self, driver: FakeDriver) -> None:
        self._driver = driver
        self.closed = False

    def close(self) -> None:
        self.closed = True

    def wait(self, timeout_s: float) -> int:
        driver = self._driver
        if not driver.filled and driver.while_waiting:
            driver.while_waiting.pop(0)()
        if driver.filled:
            return select.POLLIN
        if driver.events_when_idle:
            return driver.events_when_idle
        driver.now_s += timeout_s
        return 0

    def map(self, offset: int, length: int) -> mmap.mmap:
        memory = mmap.mmap(-1, length)
        self._driver.memory.append(np.frombuffer(memory, np.uint8))
        return memory

    def ioctl(self, request: int, argument: ctypes.Structure | ctypes.c_int32) -> None:
        assert not self.closed
        self._refuse(self._driver.fails.get(request, 0))
        names = {number: name for name, number in vars(abi).items() if name.startswith("VIDIOC_")}
        getattr(self, names[request].removeprefix("VIDIOC_").lower())(argument)

    def _refuse(self, number: int) -> None:
        if number:
            raise OSError(number, os.strerror(number))

    def querycap(self, told: abi.Capability) -> None:
        told.driver, told.card, told.bus_info = b"fake", b"Fake Camera", b"usb-1"
        told.capabilities = abi.CAP_DEVICE_CAPS
        told.device_caps = self._driver.capabilities

    def enum_fmt(self, entry: abi.FormatDescription) -> None:
        names = list(self._driver.sizes)
        self._refuse(errno.EINVAL if entry.index >= len(names) else 0)
        entry.pixelformat = abi.fourcc(names[entry.index])
        entry.flags = abi.FMT_FLAG_COMPRESSED if names[entry.index] == "MJPG" else 0

    def enum_framesizes(self, entry: abi.FrameSizeEnum) -> None:
        sizes = self._driver.sizes[abi.fourcc_name(entry.pixel_format)]
        if isinstance(sizes, tuple):  # stepwise
            self._refuse(errno.EINVAL if entry.index else 0)
            entry.type = 3
            entry.stepwise = abi.FrameSizeStepwise(*sizes)
            return
        self._refuse(errno.EINVAL if entry.index >= len(sizes) else 0)
        entry.type = abi.FRMSIZE_TYPE_DISCRETE
        entry.discrete.width, entry.discrete.height = sizes[entry.index]

    def enum_frameintervals(self, entry: abi.FrameIntervalEnum) -> None:
        rates = self._driver.rates.get(abi.fourcc_name(entry.pixel_format), [])
        if isinstance(rates, tuple):  # continuous, from the slowest to the fastest
            self._refuse(errno.EINVAL if entry.index else 0)
            entry.type = 2
            entry.stepwise.min = abi.Fraction32(1, rates[1])
            entry.stepwise.max = abi.Fraction32(1, rates[0])
            return
        self._refuse(errno.EINVAL if entry.index >= len(rates) else 0)
        entry.type = abi.FRMIVAL_TYPE_DISCRETE
        entry.discrete = abi.Fraction32(1, rates[entry.index])

    def s_fmt(self, request: abi.Format) -> None:
        driver, pix = self._driver, request.pix
        name = abi.fourcc_name(pix.pixelformat)
        if driver.crops:
            pix.width, pix.height = driver.crop[2:]
        pix.width, pix.height = driver.makes_of_size(pix.width, pix.height)
        pix.bytesperline = pix.width * BYTES_PER_PIXEL[name] + driver.padding
        if name == "MJPG":
            pix.bytesperline = 0
        pix.sizeimage = LENGTH
        driver.layout = (name, pix.width, pix.height)

    def s_parm(self, request: abi.StreamParameters) -> None:
        name = self._driver.layout[0]
        rates = self._driver.rates.get(name, [])
        interval = request.capture.timeperframe
        asked = interval.denominator / interval.numerator
        if not rates:
            request.capture.capability = 0
            return
        rate = min(rates, key=lambda rate: abs(rate - asked))
        request.capture.capability = abi.CAP_TIMEPERFRAME
        request.capture.timeperframe = abi.Fraction32(1, rate)
        self._driver.rate = rate

    def g_selection(self, asked: abi.Selection) -> None:
        self._refuse(0 if self._driver.crops else errno.ENOTTY)
        default = (0, 0, *self._driver.sizes["GREY"][0])
        here = default if asked.target == abi.SEL_TGT_CROP_DEFAULT else self._driver.crop
        asked.r = abi.Rectangle(*here)

    def s_selection(self, asked: abi.Selection) -> None:
        self._refuse(0 if self._driver.crops else errno.ENOTTY)
        step = self._driver.crop_step
        top = asked.r.top // step * step
        bottom = -(-(asked.r.top + asked.r.height) // step) * step
        self._driver.crop = (asked.r.left, top, asked.r.width, bottom - top)

    def query_ext_ctrl(self, entry: abi.QueryExtendedControl) -> None:
        wanted = entry.id & ~abi.CTRL_FLAG_NEXT_CTRL
        following = bool(entry.id & abi.CTRL_FLAG_NEXT_CTRL)
        ordered = sorted(self._driver.controls, key=lambda control: control.id)
        found = [one for one in ordered if (one.id > wanted if following else one.id == wanted)]
        self._refuse(0 if found else errno.EINVAL)
        control = found[0]
        entry.id, entry.type, entry.name = control.id, control.kind, control.name.encode()
        entry.minimum, entry.maximum, entry.step = control.lowest, control.highest, control.step
        entry.flags = control.flags

    def querymenu(self, entry: abi.QueryMenu) -> None:
        choices = self._control(entry.id).choices
        self._refuse(0 if entry.index in choices else errno.EINVAL)
        entry.name = choices[entry.index].encode()

    def s_ext_ctrls(self, several: abi.ExtendedControls) -> None:
        held = several.controls[0]
        control = self._control(held.id)
        self._refuse(control.refuses)
        wide = control.kind == abi.CTRL_TYPE_INTEGER64
        value = held.value64 if wide else held.value
        control.value = value if control.changes_to is None else control.changes_to

    def g_ext_ctrls(self, several: abi.ExtendedControls) -> None:
        held = several.controls[0]
        control = self._control(held.id)
        if control.kind == abi.CTRL_TYPE_INTEGER64:
            held.value64 = control.value
        else:
            held.value = control.value

    def _control(self, number: int) -> FakeControl:
        return next(one for one in self._driver.controls if one.id == number)

    def reqbufs(self, request: abi.RequestBuffers) -> None:
        self._driver.queued, self._driver.filled = [], []
        if not request.count:
            self._driver.memory = []

    def querybuf(self, place: abi.Buffer) -> None:
        place.offset, place.length = place.index * LENGTH, LENGTH

    def qbuf(self, buffer: abi.Buffer) -> None:
        assert buffer.index not in self._driver.queued
        assert all(buffer.index != filled.index for filled in self._driver.filled)
        self._driver.queued.append(buffer.index)

    def dqbuf(self, buffer: abi.Buffer) -> None:
        self._refuse(0 if self._driver.filled else errno.EAGAIN)
        filled = self._driver.filled.pop(0)
        ctypes.memmove(ctypes.byref(buffer), ctypes.byref(filled), ctypes.sizeof(filled))

    def streamon(self, kind: ctypes.c_int32) -> None:
        self._driver.streaming = True

    def streamoff(self, kind: ctypes.c_int32) -> None:
        self._driver.streaming = False
