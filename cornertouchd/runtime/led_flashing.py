"""Write the firmware of the LED frame's controller, by avrdude and the Arduino's bootloader."""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

from cornertouchd.devices.serial_link import open_port, opening_failed
from cornertouchd.runtime.led_desk import LedFrameError, who_else

READ_BYTES = 4096


def write_firmware(port: str, image: Path, baud: int, tell: Callable[[str], None]) -> None:
    """Write `image` (Intel HEX) to the controller at `port` and verify it; `tell` hears of it.

    Raises `LedFrameError`.  The port is held meanwhile, so that no daemon opens it in between:
    avrdude itself does not ask whether another program uses it.
    """
    program = shutil.which("avrdude")
    if program is None:
        raise LedFrameError("avrdude is not installed; apt install avrdude")
    if not image.is_file():
        raise LedFrameError(
            f"{image}: no such firmware; build it with make -C firmware avr, or name one with "
            "--image"
        )
    try:
        held = open_port(port)
    except Exception as error:  # noqa: BLE001  adapters raise more than SerialException
        raise LedFrameError(who_else(opening_failed(port, error))) from None
    where = ["-p", "m328p", "-c", "arduino", "-P", port, "-b", str(baud)]
    with held:
        status, said = _run([program, *where, "-D", "-U", f"flash:w:{image}:i"], tell)
    if status != 0:
        raise LedFrameError(f"{port}: not written: {_reason(said, baud)}")


def _run(command: list[str], tell: Callable[[str], None]) -> tuple[int, str]:
    """Return exit status and messages of a program; they are told as they come."""
    said = b""
    with subprocess.Popen(command, stderr=subprocess.PIPE) as running:  # noqa: S603
        assert running.stderr is not None  # noqa: S101
        while some := os.read(running.stderr.fileno(), READ_BYTES):
            tell(some.decode(errors="replace"))
            said += some
    return running.returncode, said.decode(errors="replace")


def _reason(said: str, baud: int) -> str:
    """Say what went wrong and what to do, by what avrdude said."""
    signature = re.search(r"signature = (?:0x)?(\w+(?: \w+ \w+)?)(?: \(probably (\w+)\))?", said)
    if signature and "xpected signature" in said:
        other = signature[2] or signature[1]
        return f"the controller is another one ({other}); an ATmega328P is needed: Uno, Nano"
    if "not in sync" in said or "programmer is not responding" in said:
        return (
            f"no bootloader answers at {baud} baud; is it an Arduino Uno or Nano? One with the old "
            "bootloader needs --baud 57600; else write it with a programmer (firmware/README.md)"
        )
    if "mismatch" in said or "verification error" in said:
        return "what stands in its memory differs; write it again, or take another board"
    if "Invalid record" in said or "invalid input file" in said or "checksum" in said:
        return "the image is damaged; build it anew with make -C firmware avr"
    last = said.strip().splitlines()[-1:] or ["no reason is told"]
    return f"avrdude failed: {last[0]}"
