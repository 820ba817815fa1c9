"""One simulated USB camera: answers the kernel, sends pictures and has faults."""

import socket
import struct
import time
from dataclasses import dataclass, field
from pathlib import Path

from uvc.descriptors import (
    CLOCK_HZ,
    CONTROLS,
    FORMATS,
    PAYLOAD_HEADER_BYTES,
    CameraKind,
)
from uvc.pictures import PACKERS, PictureLoop, noise
from uvc.usbip import STALL, Submit, Unlink, done, take_requests, unlinked

HOST_CONTROLLER = Path("/sys/devices/platform/vhci_hcd.0")
SUPER_SPEED = 5
SOCKET_BYTES = 1 << 20
"""Several pictures: a camera must not wait for a host that is busy for a moment."""

HOLE_BYTES = 512
"""What is lost when a packet is, of a camera on USB 2."""
HOLE_PLACES = 7
"""Holes are in so many places, one picture after the other."""

GET_DESCRIPTOR, GET_STATUS, SET_INTERFACE, CLEAR_FEATURE = 6, 0, 11, 1
GET_CUR, GET_MIN, GET_MAX, GET_RES, GET_LEN, GET_INFO, GET_DEF = range(0x81, 0x88)
PROBE, COMMIT = 1, 2
END_OF_HEADER, ERROR, CLOCK, STAMP, END_OF_FRAME = 0x80, 0x40, 0x08, 0x04, 0x02
"""Bits of a payload's header; UVC 1.1, table 2-5."""


@dataclass(slots=True)
class Transfer:
    """A picture on its way: a payload, cut into the requests that are waiting."""

    payload: memoryview
    sent: int = 0
    ended: bool = False


@dataclass(slots=True)
class Faults:
    """What is wrong with the camera."""

    stalled: bool = False
    noise: bool = False
    dark: bool = False
    short: int = 0
    err: int = 0
    hole: int = 0


@dataclass(slots=True)
class UvcCamera:
    """The camera, plugged in or not."""

    kind: CameraKind
    loop: PictureLoop
    faults: Faults = field(default_factory=Faults)
    link: socket.socket | None = None
    port: int = -1
    _received: bytearray = field(default_factory=bytearray)
    _waiting: list[Submit] = field(default_factory=list)
    _values: dict[tuple[int, int], bytes] = field(default_factory=dict)
    _agreed: bytes = b""
    _streaming: bool = False
    _frame_id: int = 0
    _every: int = 1
    _transfer: Transfer | None = None
    _packed: tuple[int, bytes] | None = None

    def plug(self, port: int) -> None:
        """Hang on a port of the virtual host controller.  Raises `OSError` while it is taken."""
        ours, kernels = socket.socketpair()
        for end in (ours, kernels):
            end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SOCKET_BYTES)
        device = 0x10001 + port
        attach = f"{port} {kernels.fileno()} {device} {SUPER_SPEED}"
        try:
            (HOST_CONTROLLER / "attach").write_text(attach)
        except OSError:
            ours.close()
            raise
        finally:
            kernels.close()
        self.link, self.port = ours, port
        self._agreed = self.kind.negotiated(1, 0)
        self._values = {
            key: control.default.to_bytes(control.size, "little")
            for key, control in CONTROLS.items()
        }
        self._received.clear()
        self._end_streaming()

    def unplug(self) -> None:
        """Leave the port, as when the cable is pulled."""
        if self.link is None:
            return
        (HOST_CONTROLLER / "detach").write_text(str(self.port))
        self._hang_up()

    def _hang_up(self) -> None:
        if self.link is not None:
            self.link.close()
        self.link = None
        self._end_streaming()

    def _end_streaming(self) -> None:
        self._streaming = False
        self._transfer = None
        self._packed = None
        self._waiting.clear()

    def receive(self) -> None:
        """Answer what the kernel asks."""
        if self.link is None:  # unplugged a moment ago
            return
        try:
            data = self.link.recv(1 << 16)
            if not data:
                self._hang_up()
                return
            self._received += data
            for request in take_requests(self._received):
                self._answer(request)
            self.go_on()
        except OSError:
            self._hang_up()

    def _answer(self, request: Submit | Unlink) -> None:
        assert self.link is not None
        if isinstance(request, Unlink):
            kept = [other for other in self._waiting if other.number != request.target]
            in_time = len(kept) < len(self._waiting)
            self._waiting = kept
            self.link.sendall(unlinked(request.number, in_time))
        elif request.endpoint:
            self._waiting.append(request)
        else:
            kind, asked, value, index, length = struct.unpack("<BBHHH", request.setup)
            data = self._control(kind, asked, value, index, request.data)
            if data is None:
                self.link.sendall(done(request.number, 0, STALL))
            elif kind & 0x80:
                self.link.sendall(done(request.number, len(data[:length])) + data[:length])
            else:
                self.link.sendall(done(request.number, len(request.data)))

    def _control(self, kind: int, asked: int, value: int, index: int, data: bytes) -> bytes | None:
        """Return the answer to a control request, None if the camera does not know it."""
        if kind == 0x80 and asked == GET_DESCRIPTOR:
            return self.kind.descriptor(value >> 8, value & 0xFF)
        if kind in {0x80, 0x81, 0x82} and asked == GET_STATUS:
            return bytes(2)
        if kind in {0x00, 0x01, 0x02}:
            if (kind, asked) in {(0x01, SET_INTERFACE), (0x02, CLEAR_FEATURE)}:
                self._end_streaming()
            return b""
        interface, unit, selector = index & 0xFF, index >> 8, value >> 8
        if interface == 1 and selector in {PROBE, COMMIT}:
            return self._negotiate(asked, selector, data)
        if interface == 0 and (unit, selector) in CONTROLS:
            return self._number(asked, (unit, selector), data)
        return bytes(1) if interface == 0 and unit == 0 else None

    def _negotiate(self, asked: int, selector: int, data: bytes) -> bytes:
        if asked < GET_CUR:
            self._agreed = self.kind.negotiated(data[2], struct.unpack_from("<I", data, 4)[0])
            if selector == COMMIT:
                self._streaming = True
                self._packed = None
                interval = struct.unpack_from("<I", self._agreed, 4)[0]
                self._every = round(interval / self.kind.intervals[0])
            return b""
        if asked == GET_LEN:
            return struct.pack("<H", len(self._agreed))
        return b"\x03" if asked == GET_INFO else self._agreed

    def _number(self, asked: int, key: tuple[int, int], data: bytes) -> bytes:
        control = CONTROLS[key]
        if asked < GET_CUR:
            self._values[key] = data
            return b""
        if asked == GET_INFO:
            return b"\x03"
        if asked == GET_LEN:
            return struct.pack("<H", control.size)
        told = {
            GET_MIN: control.least,
            GET_MAX: control.most,
            GET_RES: control.step,
            GET_DEF: control.default,
        }
        if asked in told:
            return told[asked].to_bytes(control.size, "little")
        return self._values[key]

    def show(self, number: int) -> None:
        """Begin to send picture `number`, unless the host wants fewer pictures than there are.

        `go_on` sends the rest: its time is when it begins, and all cameras are to begin at once.
        A picture is lost while the one before is under way, or when the host is not ready.
        """
        if not self._wants(number) or self._transfer is not None or not self._waiting:
            return
        packed, self._packed = self._packed, None
        payload = packed[1] if packed and packed[0] == number else self._payload(number)
        self._transfer = Transfer(memoryview(payload))
        self._send(1)

    def go_on(self) -> None:
        """Send what the host waits for."""
        if self.link is not None and self._transfer is not None:
            self._send(len(self._waiting))

    def prepare(self, number: int) -> None:
        """Pack a picture ahead, while there is time."""
        if self._packed is None and self._wants(number):
            self._packed = number, self._payload(number)

    def _wants(self, number: int) -> bool:
        streaming = self.link is not None and self._streaming and not self.faults.stalled
        return streaming and number % self._every == 0

    def _payload(self, number: int) -> bytes:
        form = FORMATS[self._agreed[2] - 1].name
        if self.faults.noise:
            body = PACKERS[form](noise(self.loop.picture(number).shape, number))
        elif self.faults.dark:
            body = PACKERS[form](self.loop.picture(number) // 64)
        else:
            body = self.loop.packed(number, form)
        self._frame_id ^= 1
        flags = END_OF_HEADER | CLOCK | STAMP | END_OF_FRAME | self._frame_id
        if self.faults.err:
            self.faults.err -= 1
            flags |= ERROR
        if self.faults.short:
            self.faults.short -= 1
            body = body[: len(body) // 2]
        if self.faults.hole:
            self.faults.hole -= 1
            begins = int(len(body) * (0.2 + 0.6 * (number % HOLE_PLACES) / HOLE_PLACES))
            body = body[:begins] + body[begins + HOLE_BYTES :]
        now_s = time.monotonic()
        ticks = int(now_s * CLOCK_HZ) & 0xFFFFFFFF
        frame_number = int(now_s * 1000) & 0x7FF
        head = struct.pack("<BBIIH", PAYLOAD_HEADER_BYTES, flags, ticks, ticks, frame_number)
        return head + body

    def _send(self, requests: int) -> None:
        """Fill so many of the waiting requests; a payload ends with one that is not full."""
        assert self.link is not None
        assert self._transfer is not None
        transfer = self._transfer
        full = self.kind.picture_bytes(self._agreed[2]) + PAYLOAD_HEADER_BYTES
        parts: list[bytes | memoryview] = []
        for request in self._waiting[:requests]:
            if transfer.ended:
                break
            self._waiting.remove(request)
            chunk = transfer.payload[transfer.sent : transfer.sent + request.length]
            transfer.sent += len(chunk)
            transfer.ended = len(chunk) < request.length or transfer.sent == full
            parts += [done(request.number, len(chunk)), chunk]
        if parts:
            try:
                self.link.sendall(b"".join(parts))
            except OSError:
                self._hang_up()
                return
        if transfer.ended:
            self._transfer = None

    def obey(self, command: str) -> str:
        """Do what a line says and return the answer."""
        match command.split():
            case ["plug", port]:
                self.plug(int(port))
            case ["unplug"]:
                self.unplug()
            case ["stall" | "noise" | "dark" as fault]:
                setattr(self.faults, "stalled" if fault == "stall" else fault, True)
            case ["short" | "err" | "hole" as fault, count]:
                setattr(self.faults, fault, int(count))
            case ["go"]:
                self.faults = Faults()
            case _:
                return f"unknown command {command!r}"
        return "ok"
