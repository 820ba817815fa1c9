"""How touches are followed in recordings whose truth is known: jitter, ids, error.

    python benchmarks/followed.py            strokes_small and stationary_small beside the checkout
    python benchmarks/followed.py DIR...     these

Calibrated by auto from 16 taps and a scribble.  A new `sequence` of truth.csv begins with new
touches.  Jitter is the RMS distance of the reports from their mean, over a sequence without its
first tenth of a second; errors are against where the tip of the finger touches.
"""

import csv
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from accuracy import PLACES, calibrate_from, default_recordings
from rich.console import Console
from rich.table import Table

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import Settings
from cornertouchd.devices.recording import open_recording
from cornertouchd.model import FloatArray
from cornertouchd.runtime.replaying import Replay

SETTLED_AFTER = 10


def sequences(path: Path) -> dict[int, list[tuple[int, FloatArray]]]:
    """Return of every sequence its frame sets and where the finger touched."""
    found = defaultdict(list)
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            place = np.array([float(row["x_mm"]), float(row["y_mm"])])
            found[int(row["sequence"])].append((int(row["set"]), place))
    return dict(found)


def rows_of(directory: Path, calibration: Calibration) -> Iterator[list[str]]:
    replay = Replay(open_recording(directory), calibration, Settings())
    touches = {replayed.index: replayed.touches for replayed in replay}
    for sequence, truth in sequences(directory / "truth.csv").items():
        ids = {touch.id for index, _ in truth for touch in touches[index]}
        shown = [(touches[index], place) for index, place in truth if touches[index]]
        reported = np.array([(t[0].x_mm, t[0].y_mm) for t, _ in shown]).reshape(-1, 2)
        errors = np.hypot(*(reported - np.array([place for _, place in shown]).reshape(-1, 2)).T)
        moved_mm = float(np.ptp([place for _, place in truth], axis=0).max())
        settled = reported[SETTLED_AFTER:]
        jitter_mm = np.sqrt(np.mean(np.sum((settled - settled.mean(axis=0)) ** 2, axis=1)))
        yield [
            directory.name,
            str(sequence),
            f"{len(shown)} of {len(truth)}",
            str(len(ids)),
            f"{np.sqrt(np.mean(errors**2)):.3f}",
            f"{errors.max():.3f}",
            f"{jitter_mm:.4f}" if moved_mm < 1.0 else "moves",
        ]


@click.command(help=__doc__)
@click.argument("directories", nargs=-1, type=click.Path(path_type=Path, exists=True))
def main(directories: tuple[Path, ...]) -> None:
    place, _ = default_recordings(PLACES)
    calibration = calibrate_from(
        place / "calib_few_small", place / "empty_small", place / "scribble_small"
    )
    table = Table("recording", "sequence", "told", "ids", "RMSE mm", "largest", "jitter mm RMS")
    for directory in directories or (place / "strokes_small", place / "stationary_small"):
        for row in rows_of(directory, calibration):
            table.add_row(*row)
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
