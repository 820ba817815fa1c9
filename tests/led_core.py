"""The C core of the firmware, compiled for this machine: the controller that the tests talk to."""

import ctypes
import os
import shutil
import subprocess
from pathlib import Path

import pytest

from cornertouchd.wire.ledframe_framing import Message, StreamDecoder, encode

FIRMWARE = Path(__file__).resolve().parent.parent / "firmware"
SIDES = 4


def build_core(directory: Path) -> Path:
    """Compile the core as a shared library; skips the test where there is no C compiler."""
    missing = [tool for tool in ("cc", "make") if shutil.which(tool) is None]
    if missing and not os.environ.get("CORNERTOUCHD_REQUIRE_CLIENTS"):
        pytest.skip(f"{' and '.join(missing)} needed to compile the firmware's core")
    command = ["make", "-C", FIRMWARE, "host", f"BUILD={directory}"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return directory / "libledframe.so"


class Core:
    """The core on a board that only remembers.  There is one in a process; `start` begins anew."""

    def __init__(self, library: Path) -> None:
        self._library = ctypes.CDLL(str(library))
        self._library.host_receive.argtypes = [ctypes.c_char_p, ctypes.c_uint32]
        self._library.host_temperature.argtypes = [ctypes.c_int16]
        self._library.host_pass_frame.restype = ctypes.c_uint8
        self._library.host_mask.restype = ctypes.c_uint8
        self._library.host_faults.restype = ctypes.c_uint16
        self._library.crc16.restype = ctypes.c_uint16
        self._taken = ctypes.create_string_buffer(65536)

    def start(self, reset_cause: int = 1, boot_id: int = 1) -> None:
        self._library.host_start(reset_cause, boot_id)

    def receive(self, data: bytes) -> None:
        self._library.host_receive(data, len(data))

    def take_sent(self) -> bytes:
        count = self._library.host_take_sent(self._taken, len(self._taken))
        return self._taken.raw[:count]

    def messages(self) -> list[Message]:
        """What was sent, whole: anything else would be a fault of the core."""
        decoder = StreamDecoder()
        messages = decoder.feed(self.take_sent())
        assert decoder.counts.bad == 0
        return messages

    def ask(self, message: Message) -> list[Message]:
        self.take_sent()
        self.receive(encode(message))
        return self.messages()

    def crc16(self, data: bytes) -> int:
        return int(self._library.crc16(data, len(data)))

    def pass_ms(self, count: int) -> None:
        self._library.host_pass_ms(count)

    def pass_frame(self, sense_counts: tuple[int, ...] = (0,) * SIDES) -> int:
        """One period; returns the side that was sensed, 4 for none."""
        return int(self._library.host_pass_frame((ctypes.c_uint16 * SIDES)(*sense_counts)))

    def overcurrent(self, active: bool) -> None:
        self._library.host_overcurrent(active)

    def temperature(self, temperature_c: float) -> None:
        self._library.host_temperature(round(10 * temperature_c))

    def fill_line(self, full: bool) -> None:
        ctypes.c_bool.in_dll(self._library, "host_line_full").value = full

    @property
    def state(self) -> int:
        return int(self._library.host_state())

    @property
    def faults(self) -> int:
        return int(self._library.host_faults())

    @property
    def mask(self) -> int:
        return int(self._library.host_mask())

    @property
    def lit(self) -> int:
        return ctypes.c_uint8.in_dll(self._library, "host_lit").value

    @property
    def lock_depth(self) -> int:
        return int(self._library.host_lock_depth())

    @property
    def resets(self) -> int:
        return ctypes.c_uint32.in_dll(self._library, "host_resets").value

    @property
    def levels(self) -> tuple[int, ...]:
        return tuple((ctypes.c_uint8 * SIDES).in_dll(self._library, "host_levels"))

    @property
    def timing_us(self) -> tuple[int, int, int]:
        """Period, strobe and lead."""
        return (
            ctypes.c_uint16.in_dll(self._library, "host_period_us").value,
            ctypes.c_uint16.in_dll(self._library, "host_strobe_us").value,
            ctypes.c_int16.in_dll(self._library, "host_lead_us").value,
        )
