"""`cornertouchd bench`: how many frame sets a second this machine carries."""

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import click
from rich.console import Console
from rich.table import Table

from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.runtime.assembly import calibration_file, find_calibration
from cornertouchd.runtime.bench_show import BenchRig, bench_rig
from cornertouchd.runtime.benching import (
    STAGES,
    StagedPath,
    Timed,
    Times,
    WholePath,
    time_in_turns,
)

SETS_IN_MEMORY = 100
"""One second of movement at the usual rate, played to and fro."""

SHARE_TO_USE = 0.5
"""More than half of a core for this leaves too little for reading cameras and for what is shown."""

WHOLE = "whole frame set"

DAEMON = "import cornertouchd.runtime.assembly, cornertouchd.runtime.daemon"


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether the machine carries what the cameras ask for."""

    touches: int
    carried_hz: int
    asked_hz: float

    @property
    def word(self) -> str:
        """fine, tight or too much."""
        if self.asked_hz <= SHARE_TO_USE * self.carried_hz:
            return "fine"
        return "tight" if self.asked_hz <= self.carried_hz else "too much"

    def __str__(self) -> str:
        fingers = "1 touch" if self.touches == 1 else f"{self.touches} touches"
        return (
            f"this machine carries {self.carried_hz} frame sets a second with {fingers} on one "
            f"core; your cameras ask for {self.asked_hz:g}: {self.word}{self._remedy()}"
        )

    def _remedy(self) -> str:
        if self.word == "fine":
            return ""
        lower_hz = max(1, int(SHARE_TO_USE * self.carried_hz))
        return (
            f"; set cameras.rate_hz to {lower_hz} or less, end other programs, "
            "or take a faster machine"
        )


@click.command()
@click.option(
    "--config",
    "config_file",
    type=click.Path(path_type=Path),
    help="Settings; else $CORNERTOUCHD_CONFIG, else /etc/cornertouchd/cornertouchd.toml.",
)
@click.option(
    "--touches", type=click.IntRange(0, 20), default=10, show_default=True, help="Moving fingers."
)
@click.option(
    "--seconds",
    type=FiniteRange(min=0, min_open=True, max=3600),
    default=5.0,
    show_default=True,
    help="How long to measure.",
)
@click.option("--json", "as_json", is_flag=True, help="One JSON object instead of the table.")
def bench(config_file: Path | None, touches: int, seconds: float, as_json: bool) -> None:
    """Measure what this machine carries: microseconds per stage.

    On pictures of a simulated rig of the size of yours, in memory, with one thread. End other
    programs before, the daemon too.
    """
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    real = _calibration_in_force(settings)
    show = bench_rig(settings, os.environ, real)
    click.echo(f"painting {SETS_IN_MEMORY} frame sets with {touches} fingers", err=True)
    frame_sets = show.frame_sets(touches, SETS_IN_MEMORY)
    paths: dict[str, Timed] = {
        "whole": WholePath(show.calibration, settings),
        "staged": StagedPath(show.calibration, settings),
    }
    click.echo(f"measuring for {seconds:g} s", err=True)
    times = time_in_turns(paths, frame_sets, show.rate_hz, seconds)
    verdict = Verdict(touches, int(1e6 / times["whole"].p99_us()), show.rate_hz)
    if as_json:
        click.echo(json.dumps(_as_json(show, times, verdict)))
    else:
        _print(show, times, verdict)


def _calibration_in_force(settings: Settings) -> Calibration | None:
    """Return the calibration of the real rig; one that cannot be used is told and left aside."""
    if settings.cameras.source == "simulated":
        return None
    if not calibration_file(settings, os.environ).exists():
        return None
    try:
        return find_calibration(settings, os.environ)
    except CalibrationError as error:
        click.echo(f"measuring at the sizes of the settings: {error}", err=True)
        return None


def _start_s() -> float:
    """Return how long the daemon takes to be imported, compiled parts and all."""
    started_s = time.perf_counter()
    subprocess.run([sys.executable, "-c", DAEMON], check=True)  # noqa: S603  our own words
    return time.perf_counter() - started_s


def _rows_us(times: dict[str, Times]) -> dict[str, dict[str, float]]:
    """Return median and p99 of the stages and of the whole, the median of what it takes beyond."""
    staged, whole = times["staged"], times["whole"]
    rows = {
        name: {"median": staged.median_us(part), "p99": staged.p99_us(part)}
        for part, name in enumerate(STAGES)
    }
    beyond = whole.median_us() - sum(row["median"] for row in rows.values())
    return {
        **rows,
        "between them": {"median": max(0.0, beyond)},
        WHOLE: {"median": whole.median_us(), "p99": whole.p99_us()},
    }


def _as_json(show: BenchRig, times: dict[str, Times], verdict: Verdict) -> dict[str, object]:
    whole = times["whole"]
    form = next(iter(show.rig.formats.values()))
    return {
        "touches": verdict.touches,
        "surface_mm": list(show.rig.surface_mm),
        "cameras": len(show.rig.formats),
        "width_px": form.width_px,
        "frame_sets": len(whole.laps_us),
        "touches_found": round(whole.found, 2),
        "stages_us": {
            name: {figure: round(us, 1) for figure, us in row.items()}
            for name, row in _rows_us(times).items()
        },
        "start_s": round(_start_s(), 2),
        "carried_hz": verdict.carried_hz,
        "asked_hz": verdict.asked_hz,
        "verdict": verdict.word,
    }


def _print(show: BenchRig, times: dict[str, Times], verdict: Verdict) -> None:
    whole = times["whole"]
    form = next(iter(show.rig.formats.values()))
    width_mm, height_mm = show.rig.surface_mm
    table = Table(
        title=f"{verdict.touches} fingers, {len(show.rig.formats)} cameras of {form.width_px} "
        f"columns, {width_mm:g}x{height_mm:g} mm"
    )
    table.add_column("stage")
    table.add_column("median µs", justify="right")
    table.add_column("p99 µs", justify="right")
    for name, row in _rows_us(times).items():
        if name == WHOLE:
            table.add_section()
        table.add_row(name, *(f"{us:.1f}" for us in row.values()))
    Console().print(table)
    click.echo(
        f"{len(whole.laps_us)} frame sets measured, {whole.found:.1f} touches found in each; "
        f"the daemon is loaded in {_start_s():.1f} s"
    )
    click.echo(str(verdict))
