"""SIGHUP: configuration and calibration are read again while the daemon goes on."""

import logging
import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Literal, Self

from cornertouchd.errors import ReportedError
from cornertouchd.runtime.daemon import Daemon, DaemonStages, make_stages
from cornertouchd.runtime.parts import Parts

Outcome = Literal["changed", "unchanged", "refused"]

_log = logging.getLogger("cornertouchd")


class ReloadSignal:
    """Notes that SIGHUP came.  Use as a context manager, in the main thread."""

    def __init__(self) -> None:
        self._came = False
        self._former: object = None

    def __enter__(self) -> Self:
        self._former = signal.signal(signal.SIGHUP, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        signal.signal(signal.SIGHUP, self._former)  # type: ignore[arg-type]

    def take(self) -> bool:
        """Tell whether it came since the last call; several count as one."""
        came, self._came = self._came, False
        return came

    def _note(self, _number: int, _frame: FrameType | None) -> None:
        self._came = True


class Reload:
    """Makes a daemon follow its configuration, or keeps it as it is if the new one is bad.

    What takes long, the reading and the making of new stages, is done by a thread of its own
    beside the daemon at work; `finish` changes to them within a few milliseconds.
    """

    def __init__(self, daemon: Daemon, parts: Parts, make_parts: Callable[[Parts], Parts]) -> None:
        self._daemon = daemon
        self._parts = parts
        self._make_parts = make_parts
        self._thread: threading.Thread | None = None
        self._made: tuple[Parts, DaemonStages] | None = None
        self._refusal = ""

    @property
    def parts(self) -> Parts:
        """What the daemon is made of at present."""
        return self._parts

    @property
    def is_under_way(self) -> bool:
        """Whether it was begun and has not been finished."""
        return self._thread is not None

    def begin(self) -> None:
        """Begin to read; not while one is under way."""
        self._made, self._refusal = None, ""
        self._thread = threading.Thread(target=self._prepare, name="reload", daemon=True)
        self._thread.start()

    def finish(self, timeout_s: float = 0.0) -> Outcome | None:
        """Change to what was read, once that is done; None while it is not."""
        if self._thread is None:
            return None
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            return None
        self._thread = None
        if self._made is None:
            _log.error("reload refused, the former configuration goes on: %s", self._refusal)
            return "refused"
        parts, stages = self._made
        self._made = None
        present = self._daemon.stages
        if stages is present:
            _log.info("reloaded: nothing has changed")
            return "unchanged"
        self._daemon.exchange(stages)
        kept = sum(port in self._parts.ports for port in parts.ports)
        touches = "go on" if stages.captures is present.captures else "were lifted"
        self._parts = parts
        _log.info(
            "reloaded: %d of %d cameras stayed open, touches %s", kept, len(parts.ports), touches
        )
        return "changed"

    def _prepare(self) -> None:
        try:
            parts = self._make_parts(self._parts)
            self._made = parts, self._stages(parts)
        except ReportedError as error:
            self._refusal = "; ".join(str(error).splitlines())
        except Exception as error:  # noqa: BLE001  the daemon goes on as it was
            _log.exception("reload failed")
            self._refusal = repr(error)

    def _stages(self, parts: Parts) -> DaemonStages:
        """Return stages for these parts: those that the daemon has, as far as they are alike."""
        before, present = self._parts, self._daemon.stages
        if not parts.sees_as(before):
            return make_stages(
                parts.ports,
                parts.calibration,
                parts.sinks,
                parts.settings,
                parts.plugs,
                parts.light,
            )
        if parts.sinks is before.sinks and parts.settings == before.settings:
            return present
        return present.with_sinks(parts.sinks, parts.settings)
