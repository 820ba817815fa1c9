"""What viewers may do: save what just happened as a recording."""

import asyncio
import json
import sys
from datetime import UTC, datetime
from pathlib import Path

from cornertouchd.monitor.options import PageOptions

LONGEST_S = 600.0
"""As much as `monitor.keep_s` allows."""

WITHIN_S = 120.0
"""Longer than a slow card takes for half a gigabyte."""


class SavingError(Exception):
    """Nothing was saved; `status` is that of HTTP, the text says why and what to do."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class Saving:
    """Runs `cornertouchd record`, once at a time.  For the thread of the event loop only."""

    def __init__(self, options: PageOptions) -> None:
        self._is_allowed = options.allow_actions
        self._socket = options.socket
        self._directory = Path(options.recordings)
        self._is_busy = False

    async def save(self, request: bytes) -> dict[str, object]:
        """Save as many seconds as `{"last_s": 30}` asks for; return name, path and size.

        Raises `SavingError`.
        """
        if not self._is_allowed:
            raise SavingError(403, "viewers may look only; monitor.allow_actions = true lets them")
        last_s = _seconds(request)
        if self._is_busy:
            raise SavingError(409, "another recording is being saved; wait for its end")
        self._is_busy = True
        try:
            return await self._record(last_s)
        finally:
            self._is_busy = False

    async def _record(self, last_s: float) -> dict[str, object]:
        name = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%SZ")
        place = self._directory / name
        recording = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "cornertouchd", "record", str(place)),
            *("--last", f"{last_s:g}", "--socket", self._socket),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
        try:
            async with asyncio.timeout(WITHIN_S):
                _, said = await recording.communicate()
        except TimeoutError:
            raise SavingError(504, f"not saved within {WITHIN_S:g} s; is the disk slow?") from None
        finally:
            if recording.returncode is None:
                recording.kill()
                await recording.wait()
        if recording.returncode:
            raise SavingError(500, _last_line(said))
        size = sum(file.stat().st_size for file in place.iterdir())
        return {"name": name, "path": str(place), "bytes": size}


def _seconds(request: bytes) -> float:
    try:
        last_s = json.loads(request)["last_s"]
    except (ValueError, LookupError, TypeError, RecursionError):
        last_s = None
    if isinstance(last_s, bool) or not isinstance(last_s, int | float):
        raise SavingError(400, 'send {"last_s": 30}')
    if not 0.0 < last_s <= LONGEST_S:
        raise SavingError(400, f"last_s = {last_s!r}: must be above 0 and at most {LONGEST_S:g} s")
    return float(last_s)


def _last_line(said: bytes) -> str:
    lines = said.decode(errors="replace").strip().splitlines()
    return lines[-1][:500] if lines else "the recording failed without a word"
