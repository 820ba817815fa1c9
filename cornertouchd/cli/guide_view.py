"""A guided calibration in the terminal: what to do, and a plan of the surface to do it on."""

import time
from collections.abc import Sequence
from itertools import groupby
from operator import itemgetter
from types import TracebackType
from typing import Self

import numpy as np
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from cornertouchd.guiding.status import Status, StepName
from cornertouchd.ports import CameraError

REDRAW_EVERY_S = 0.1

TITLES: dict[StepName, str] = {
    "boards": "Boards",
    "cameras": "Cameras",
    "empty": "Empty strip",
    "taps": "Taps",
    "scribble": "Scribble",
    "check": "Check",
    "display": "Display",
}

LARGEST_PLAN = (56, 20)
"""Columns and rows of characters that show a target well enough; a small terminal has fewer."""

BORDER = (4, 2)
"""Columns and rows around the plan."""

CHARACTER_HEIGHT = 2.0
"""A character is about twice as high as wide."""


class GuideView:
    """Shows how a calibration goes; use as a context manager.

    In a terminal the picture stands still and changes; elsewhere every change is a line.
    """

    def __init__(
        self, console: Console, surface_mm: tuple[float, float], steps: Sequence[StepName]
    ) -> None:
        self._console = console
        self._surface_mm = surface_mm
        self._steps = steps
        self._live: Live | None = None
        self._last_line = ""
        self._drawn_at_s = 0.0

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._live = Live(console=self._console, auto_refresh=False, transient=True)
            self._live.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._live is not None:
            self._live.__exit__(kind, error, trace)

    def show(self, status: Status) -> None:
        """Show where the calibration is."""
        line = status_line(status)
        changed, self._last_line = line != self._last_line, line
        if self._live is None:
            if changed:
                self._console.print(line, highlight=False, markup=False, soft_wrap=True)
            return
        now_s = time.monotonic()
        if changed or now_s - self._drawn_at_s >= REDRAW_EVERY_S:
            self._drawn_at_s = now_s
            self._live.update(self._picture(status), refresh=True)

    def missing(self, errors: Sequence[CameraError]) -> None:
        """Show which cameras are not there."""
        lines = [f"{error}" for error in errors]
        text = "\n".join([*lines, "see to it: this goes on as soon as all are there"])
        if self._live is not None:
            self._live.update(Panel(Text(text), title="Cameras are missing"), refresh=True)
        elif text != self._last_line:
            self._console.print(text, highlight=False, markup=False, soft_wrap=True)
        self._last_line = text

    def _picture(self, status: Status) -> RenderableType:
        steps = Text("  ").join(
            Text(
                f"{number} {TITLES[step]}",
                "bold reverse" if step == status.step else "dim",
            )
            for number, step in enumerate(self._steps, start=1)
        )
        hint = Text(status_line(status), "bold")
        bar = ProgressBar(total=1.0, completed=status.held or status.progress, width=40)
        head = Group(steps, Text(""), hint, bar, Text(""))
        if status.step == "cameras":
            return Group(head, _findings(status))
        return Group(head, plan(status, self._surface_mm, self._room_below(head)))

    def _room_below(self, head: RenderableType) -> tuple[int, int]:
        """Return how many columns and rows of a plan the terminal has room for."""
        taken = len(self._console.render_lines(head))
        room = self._console.width - BORDER[0], self._console.height - BORDER[1] - taken
        return min(LARGEST_PLAN[0], room[0]), min(LARGEST_PLAN[1], room[1])


def status_line(status: Status) -> str:
    """Return one line: the step, where to tap, what to do."""
    words = [TITLES[status.step]]
    if status.of:
        words.append(
            f"{status.number} of {status.of}" + (f", {status.name}" if status.name else "")
        )
    if status.target_mm is not None:
        x_mm, y_mm = status.target_mm
        words.append(f"{x_mm:g} mm from the left, {y_mm:g} mm from the top")
    if status.visited is not None:
        words.append(f"{status.progress:.0%}")
    return " - ".join([*words, status.hint])


def plan(status: Status, surface_mm: tuple[float, float], largest: tuple[int, int]) -> Panel:
    """Return a plan of the surface to scale: targets, what was tapped or covered, the finger."""
    scale = min(largest[0] / surface_mm[0], largest[1] * CHARACTER_HEIGHT / surface_mm[1])
    columns = max(8, round(surface_mm[0] * scale))
    rows = max(4, round(surface_mm[1] * scale / CHARACTER_HEIGHT))
    characters = np.full((rows, columns), " ")
    styles = np.full((rows, columns), "", dtype=object)

    def at(place_mm: tuple[float, float]) -> tuple[int, int]:
        row, column = place_mm[1] / surface_mm[1] * rows, place_mm[0] / surface_mm[0] * columns
        return min(max(int(row), 0), rows - 1), min(max(int(column), 0), columns - 1)

    if status.visited is not None:
        row_cells = np.arange(rows) * status.visited.shape[0] // rows
        column_cells = np.arange(columns) * status.visited.shape[1] // columns
        covered = status.visited[np.ix_(row_cells, column_cells)]
        characters[covered], styles[covered] = "░", "green"
    if status.target_mm is not None:
        row, column = at(status.target_mm)
        characters[row, :], characters[:, column] = "·", "·"
    for place_mm in status.tapped_mm:
        characters[at(place_mm)], styles[at(place_mm)] = "●", "green"
    if status.target_mm is not None:
        characters[at(status.target_mm)], styles[at(status.target_mm)] = "✕", "bold yellow"
    if status.finger_mm is not None:
        characters[at(status.finger_mm)], styles[at(status.finger_mm)] = "●", "bold yellow"
    text = Text()
    for row in range(rows):
        cells = zip(styles[row].tolist(), characters[row].tolist(), strict=True)
        for style, run in groupby(cells, key=itemgetter(0)):
            text.append("".join(character for _, character in run), style)
        text.append("\n" if row + 1 < rows else "")
    return Panel(text, width=columns + BORDER[0], title="C1" + "─" * (columns - 6) + "C2",
                 subtitle="C4" + "─" * (columns - 6) + "C3")  # fmt: skip


def _findings(status: Status) -> RenderableType:
    table = Table.grid(padding=(0, 2))
    for check in status.checks:
        for finding in check.findings:
            style = "bold red" if finding.severity == "bad" else "yellow"
            table.add_row(check.camera, Text(finding.severity, style), Text(finding.text))
        if not check.findings:
            table.add_row(check.camera, Text("good", "green"), "")
    return table
