"""How exactly touches are located after calibrating by each of the methods.

    python benchmarks/calibration.py                     simulated rigs, every method
    python benchmarks/calibration.py --exact             the same with taps that hit their targets
    python benchmarks/calibration.py --rendered [DIR]    path-traced recordings of one rig
    python benchmarks/calibration.py --figure FILE.png   the paper's Fig. 10 (needs matplotlib)

Every method goes through the same commands: recordings of a simulated rig are written, then
`cornertouchd calibrate --recording ... --method ...`, then `cornertouchd replay --independent` of a
test recording with 300 upright fingers.  A tap misses its target by .5 mm (standard deviation per
axis).  Of each finger the most confident contact counts, however far off it is; `missed` are
fingers without one.  Each figure is RMSE / 95 % / largest error in mm, of the rig with the median
RMSE and of the worst.  `told` is the RMSE that the calibration itself expects, `asked` what this
project set out to reach (the paper's methods: what a study in numpy had found).
"""

import json
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from accuracy import PLACES, default_recordings, read_truth, score
from calibration_sets import RIGS, RigKind, write_sets
from calibration_ways import (
    ASKED_OF_PINHOLES,
    WAYS,
    CommandError,
    Way,
    calibrate,
    recordings_of,
    run,
)
from rich.console import Console
from rich.table import Table

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import METHODS, Method
from cornertouchd.calibration.file import load_calibration
from cornertouchd.config import CrossingSettings, Settings
from cornertouchd.model import FloatArray

TAP_SIGMA_MM = 0.5

RENDERED = {
    "empty": "empty_small",
    "taps16": "calib_few_small",
    "frame225": "calib_small",
    "scribble": "scribble_small",
}
"""What the recordings of the path-traced rig are called."""


@dataclass(frozen=True)
class Outcome:
    """Errors of the fingers that were found; NaN where not.  `told_mm` is what was expected."""

    errors_mm: FloatArray
    told_mm: float

    @property
    def rmse_mm(self) -> float:
        """RMSE of the fingers that were found; endless if none was."""
        found = self.errors_mm[np.isfinite(self.errors_mm)]
        return float(np.sqrt(np.mean(found**2))) if len(found) else np.inf

    def __str__(self) -> str:
        found = self.errors_mm[np.isfinite(self.errors_mm)]
        if not len(found):
            return "-"
        figures = (self.rmse_mm, float(np.percentile(found, 95)), float(found.max()))
        return " / ".join(f"{mm:.3g}" for mm in figures)

    @property
    def missed(self) -> float:
        """Share of the fingers that were not found."""
        return float(np.mean(~np.isfinite(self.errors_mm)))


def try_out(way: Way, sets: Mapping[str, Path], board: BoardPlan) -> dict[str, Outcome]:
    """Calibrate, replay the test by every crossing of the way and compare with the truth."""
    truth, _ = read_truth(sets["test"] / "truth.csv")
    outcomes = {}
    with tempfile.TemporaryDirectory() as scratch:
        calibration, contacts = Path(scratch, "calibration.json"), Path(scratch, "contacts.jsonl")
        calibrate(way, sets, calibration, board)
        told_mm = load_calibration(calibration).expected.rms_mm
        for crossing in crossings_of(way):
            options = ["--calibration", calibration, "--crossing", crossing, "--output", contacts]
            run("replay", sets["test"], "--independent", *options)
            places = dict(most_confident(contacts))
            errors = [
                np.linalg.norm(np.subtract(places.get(index, (np.nan, np.nan)), touch.section_mm))
                for index, (touch,) in truth.items()
            ]
            outcomes[crossing] = Outcome(np.array(errors), told_mm)
    return outcomes


def most_confident(contacts: Path) -> Iterator[tuple[int, tuple[float, float]]]:
    """Yield frame set and place of the most confident contact of each that has any."""
    for line in contacts.read_text().splitlines():
        replayed = json.loads(line)
        best = max(replayed["contacts"], key=lambda each: each["confidence"], default=None)
        if best is not None:
            yield replayed["set"], (best["x_mm"], best["y_mm"])


def compare_on(
    kind: RigKind, ways: Sequence[Way], seeds: Sequence[int], tap_sigma_mm: float
) -> Table:
    """Return a table with a row for every way and crossing."""
    wanted = set().union(*map(recordings_of, ways))
    outcomes: dict[tuple[str, str], list[Outcome]] = {}
    refusals: dict[str, str] = {}
    for seed in seeds:
        with tempfile.TemporaryDirectory() as scratch:
            sets = write_sets(kind, seed, tap_sigma_mm, wanted, Path(scratch))
            for way in ways:
                try:
                    tried_out = try_out(way, sets, kind.board)
                except CommandError as error:
                    refusals[way.name] = str(error)
                    continue
                for crossing, outcome in tried_out.items():
                    outcomes.setdefault((way.name, crossing), []).append(outcome)
    table = Table(title=f"{kind.name} mm, {kind.size_px[0]} px, {kind.lens}")
    for title in ("calibrated by", "crossing", "asked"):
        table.add_column(title)
    for title in ("median rig", "missed", "told", "worst rig"):
        table.add_column(title, justify="right", max_width=40)
    for way in ways:
        for crossing in crossings_of(way):
            tried = sorted(outcomes.get((way.name, crossing), []), key=lambda one: one.rmse_mm)
            cells = [way.name, crossing, asked(way, kind)]
            if tried:
                median, worst = tried[(len(tried) - 1) // 2], tried[-1]
                told = f"{median.told_mm:.3g}"
                cells += [str(median), f"{median.missed:.1%}", told, str(worst)]
            if len(tried) < len(seeds):
                cells.append(f"{len(seeds) - len(tried)} refused: {refusals[way.name]}")
            table.add_row(*cells)
    return table


def crossings_of(way: Way) -> tuple[str, ...]:
    """Return ours, and for the paper's methods the paper's own too."""
    return ("default",) if way.method == "auto" else ("default", "paper")


def asked(way: Way, kind: RigKind) -> str:
    """Return the figures to reach."""
    if kind.lens == "pinhole":
        return ASKED_OF_PINHOLES.get((kind.name, way.name), "")
    return way.asked[("350x400", "2400x1350").index(kind.name)]


def compare_on_rendered(place: Path, ways: Sequence[Way], console: Console) -> None:
    """Calibrate from path-traced recordings and print how each test recording comes out."""
    _, tests = default_recordings((place,))
    table = Table()
    titles = ("calibrated by", "recording", "crossing", "touches", "found", "ghosts", "exact")
    for title in (*titles, "section rmse", "median", "p95", "point rmse", "median", "p95"):
        table.add_column(title, justify="left" if title in titles[:3] else "right")
    sets = {name: place / there for name, there in RENDERED.items() if (place / there).is_dir()}
    for way in (way for way in ways if recordings_of(way) <= set(sets)):
        with tempfile.TemporaryDirectory() as scratch:
            file = Path(scratch, "calibration.json")
            calibrate(way, sets, file)
            calibration = load_calibration(file)
        for test in (test for test in tests if test.name != "scribble_small"):
            for crossing in crossings_of(way):
                settings = Settings(crossing=CrossingSettings(method=crossing))
                cells = score(test, calibration, settings)
                table.add_row(way.name, test.name, crossing, *cells)
        table.add_section()
    console.print(table)


@click.command(help=__doc__)
@click.option("--method", "methods", multiple=True, type=click.Choice(METHODS), help="Only these.")
@click.option("--seeds", default=3, show_default=True, help="Rigs of each kind.")
@click.option("--exact", is_flag=True, help="Taps hit their targets.")
@click.option("--rendered", is_flag=False, flag_value=Path(), type=click.Path(path_type=Path))
@click.option("--figure", type=click.Path(path_type=Path))
def main(
    methods: Sequence[Method], seeds: int, exact: bool, rendered: Path | None, figure: Path | None
) -> None:
    console = Console(width=180)
    ways = [way for way in WAYS if way.method in (methods or METHODS)]
    if figure is not None:
        from calibration_figure import draw_figure  # noqa: PLC0415  matplotlib only for this

        draw_figure(figure, console)
    if rendered is not None:
        place = default_recordings(PLACES)[0] if rendered == Path() else rendered
        compare_on_rendered(place, ways, console)
    if figure is None and rendered is None:
        for kind in RIGS:
            tap_sigma_mm = 0.0 if exact else TAP_SIGMA_MM
            console.print(compare_on(kind, ways, range(1, seeds + 1), tap_sigma_mm))


if __name__ == "__main__":
    main()
