"""Commands for a guest that runs: each is done when it is told, beside what the host looks at."""

import threading
import time
from pathlib import Path
from types import TracebackType
from typing import Self

from system.kiosk.disk import KioskError
from system.kiosk.guest import KioskGuest

POLL_S = 0.05
ANSWERS_WITHIN_S = 180.0

# What the harness sets for suites must not reach what is installed.  What is renamed is complete.
_LOOP = """
cd /host/commands
echo ready
n=1
until [ -e end ]; do
    if [ -e $n ]; then
        env -i PATH="$PATH" LANG=C.UTF-8 sh ./$n >$n.said 2>&1
        echo $? >$n.part
        mv $n.part $n.status
        n=$((n + 1))
    else
        sleep 0.2
    fi
done
"""


class GuestShell:
    """A shell as root in a guest, from its boot to its end.  Use as a context manager."""

    def __init__(self, guest: KioskGuest, timeout_s: float) -> None:
        """`timeout_s` is for all, the boot included."""
        self._guest = guest
        self._timeout_s = timeout_s
        self._count = 0
        self._died = ""
        self._thread = threading.Thread(target=self._run, name="guest", daemon=True)

    def __enter__(self) -> Self:
        self._commands.mkdir()
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        (self._commands / "end").touch()
        self._thread.join()

    def do(self, command: str) -> str:
        """Return what a command said.  Raises `KioskError` if it fails or the guest has died."""
        self._count += 1
        place = self._commands / str(self._count)
        written = place.with_suffix(".part")
        written.write_text(command + "\n")
        written.rename(place)
        status = self._status_of(place, command)
        said = place.with_suffix(".said").read_text()
        if status:
            raise KioskError(f"{command}: failed with status {status}:\n{said}")
        return said

    def _status_of(self, place: Path, command: str) -> int:
        """Wait for the exit status of a command."""
        status = place.with_suffix(".status")
        until_s = time.monotonic() + ANSWERS_WITHIN_S
        while not status.exists():
            if not self._thread.is_alive():
                raise KioskError(f"{command}: the guest is gone; {self._died}")
            if time.monotonic() > until_s:
                raise KioskError(f"{command}: no answer within {ANSWERS_WITHIN_S:g} s")
            time.sleep(POLL_S)
        return int(status.read_text())

    @property
    def _commands(self) -> Path:
        return self._guest.share / "commands"

    def _run(self) -> None:
        try:
            self._guest.run(_LOOP, self._timeout_s)
        except KioskError as error:
            self._died = str(error)
