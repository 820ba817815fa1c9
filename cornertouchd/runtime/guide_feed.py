"""What a guided calibration asks for, as JSON for whoever watches: the answer to "guide"."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from threading import Condition
from typing import Any

from cornertouchd import __version__
from cornertouchd.calibration.display import DisplayPlace
from cornertouchd.guiding.status import Status, StepName
from cornertouchd.model import BoolArray
from cornertouchd.ports import CameraError, Clock
from cornertouchd.runtime.asking import Asker

TOLD_EVERY_S = 1.0 / 30.0
"""A finger that is followed seems to be followed at once."""

LOOK_EVERY_S = 0.5
"""How often it is looked whether he who asks has left while nothing happens."""


class GuideFeed:
    """Keeps what was last asked for and tells it, a JSON object a line, the newest only.

    `display` is where the picture lies on the surface, if that is known; `inset` is the share of
    its sides that taps at its corners keep from them.  Any thread may tell and ask.
    """

    def __init__(
        self,
        surface_mm: tuple[float, float],
        clock: Clock,
        display: DisplayPlace | None = None,
        inset: float = 0.0,
    ) -> None:
        self._surface_mm = surface_mm
        self._clock = clock
        self._display = None if display is None else asdict(display)
        self._inset = inset
        self._steps: tuple[StepName, ...] = ()
        self._status = Status("cameras", "looking at the cameras")
        self._missing: tuple[str, ...] = ()
        self._changed = Condition()
        self._number = 0

    def begin(self, steps: Sequence[StepName]) -> None:
        """Tell which steps there are, in order."""
        self._steps = tuple(steps)

    def show(self, status: Status) -> None:
        """Tell where the calibration is."""
        self._tell(status, ())

    def missing(self, errors: Sequence[CameraError]) -> None:
        """Tell which cameras are not there."""
        self._tell(self._status, tuple(str(error) for error in errors))

    def finish(self, hint: str) -> None:
        """Tell how it ended."""
        self._tell(Status("done", hint, 1.0), ())

    def hello(self) -> bytes:
        """Return what a page is told first: that a calibration runs here, and no daemon."""
        return json.dumps(
            {
                "version": __version__,
                "surface_mm": self._surface_mm,
                "cameras": [],
                "destinations": [],
                "display": self._display,
                "source_name": "",
                "keeps_s": 0,
                "calibrating": True,
            }
        ).encode()

    def __call__(self, asker: Asker) -> None:
        """Tell what is new until he has left."""
        told, due_at_s = -1, self._clock.now_s()
        while not asker.has_enough:
            asker.further()  # he says nothing; this notices that he has left
            with self._changed:
                self._changed.wait_for(lambda: self._number != told, LOOK_EVERY_S)  # noqa: B023
                is_news, told = self._number != told, self._number
                line = self._line() if is_news else b""
            if is_news:
                asker.send(line)
            due_at_s = max(due_at_s + TOLD_EVERY_S, self._clock.now_s())
            self._clock.sleep_until(due_at_s)

    def _tell(self, status: Status, missing: tuple[str, ...]) -> None:
        with self._changed:
            self._status, self._missing = status, missing
            self._number += 1
            self._changed.notify_all()

    def _line(self) -> bytes:
        status = self._status
        told: dict[str, Any] = {
            "surface_mm": self._surface_mm,
            "display": self._display,
            "inset": self._inset,
            "steps": self._steps,
            "missing": self._missing,
            "step": status.step,
            "hint": status.hint,
            "progress": status.progress,
            "held": status.held,
            "target_mm": status.target_mm,
            "number": status.number,
            "of": status.of,
            "name": status.name,
            "tapped_mm": status.tapped_mm,
            "finger_mm": status.finger_mm,
            "visited": _cells(status.visited),
            "checks": [
                {
                    "camera": check.camera,
                    "findings": [
                        {"severity": finding.severity, "text": finding.text}
                        for finding in check.findings
                    ],
                }
                for check in status.checks
            ],
        }
        return json.dumps(told).encode() + b"\n"


def _cells(visited: BoolArray | None) -> dict[str, Any] | None:
    """Return rows, columns and a digit for each part of the surface, row by row: 1 is visited."""
    if visited is None:
        return None
    rows, columns = visited.shape
    cells = "".join("1" if cell else "0" for cell in visited.ravel().tolist())
    return {"rows": rows, "columns": columns, "cells": cells}
