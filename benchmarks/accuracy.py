"""How exactly touches are found in recordings whose truth is known.

    python benchmarks/accuracy.py                      all recordings with a truth.csv
    python benchmarks/accuracy.py --own                those of the repository
    python benchmarks/accuracy.py DIR...               these
    python benchmarks/accuracy.py --calibrate-with DIR --empty DIR [--scribble DIR] DIR...

Each recording is replayed frame set by frame set (--independent), by both edge methods and both
crossings.  found: share of true touches with a contact within 8 mm; ghosts: contacts without one,
as a share of the touches.  Then errors in mm: of the section at the height of the cameras; of the
same section taken for the place where the tip touches (plain); and of the touch point.
"""

import csv
import itertools
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table
from scipy.optimize import linear_sum_assignment

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.methods import Stamp, calibrate
from cornertouchd.config import CrossingSettings, Settings, VisionSettings
from cornertouchd.devices.recording import open_recording, read_points
from cornertouchd.runtime.recorded_touches import gather_recorded
from cornertouchd.runtime.replaying import Replay

ROOT = Path(__file__).resolve().parent.parent
PLACES = (ROOT.parent / "shared" / "rendered", ROOT / "tests" / "recordings")
MATCH_MM = 8.0


@dataclass(frozen=True)
class Truth:
    """One true touch."""

    point_mm: tuple[float, float]
    section_mm: tuple[float, float]


def read_truth(path: Path) -> tuple[dict[int, list[Truth]], set[int]]:
    """Return the touching contacts of every frame set, and the sets named in the file."""
    touches = defaultdict(list)
    named = set()
    with path.open(newline="") as file:
        for row in csv.DictReader(file):
            index = int(row["set"])
            if row.get("case") == "empty" or not row["x_mm"]:
                continue
            named.add(index)
            if row.get("touching", "1") == "0":
                continue
            point = (float(row["x_mm"]), float(row["y_mm"]))
            section = (
                float(row.get("section_x_mm") or point[0]),
                float(row.get("section_y_mm") or point[1]),
            )
            touches[index].append(Truth(point, section))
    return dict(touches), named


def runs_without(named: set[int], count: int) -> list[tuple[int, int]]:
    """Return runs of frame sets that the truth does not name: the surface was empty."""
    empty = [k for k in range(count) if k not in named]
    groups = itertools.groupby(enumerate(empty), lambda pair: pair[1] - pair[0])
    runs = [[index for _, index in group] for _, group in groups]
    return [(run[0], run[-1]) for run in runs]


def calibrate_from(taps_dir: Path, empty_dir: Path, scribble_dir: Path | None) -> Calibration:
    """Calibrate by our best method."""
    given = gather_recorded(
        open_recording(taps_dir),
        read_points(taps_dir / "points.csv"),
        open_recording(scribble_dir) if scribble_dir else None,
        open_recording(empty_dir),
        VisionSettings(),
    )
    return calibrate("auto", given, 0.5, Stamp("1970-01-01T00:00:00+00:00", "benchmark"))


def score(directory: Path, calibration: Calibration, settings: Settings) -> list[str]:
    """Replay a recording and return the cells of its row."""
    recording = open_recording(directory)
    truth, named = read_truth(directory / "truth.csv")
    runs = runs_without(named, len(recording))
    replay = Replay(recording, calibration, settings, independent=True, empty_runs=runs)
    found = ghosts = exact = sets = 0
    section_mm, plain_mm, point_mm = [], [], []
    for replayed in replay:
        if replayed.index not in named:
            ghosts += len(replayed.contacts)
            continue
        wanted = truth.get(replayed.index, [])
        contacts = [contact for contact in replayed.contacts if contact.touching]
        pairs = match([t.section_mm for t in wanted], [c.section_mm for c in contacts])
        found += len(pairs)
        ghosts += len(contacts) - len(pairs)
        exact += len(contacts) == len(wanted) == len(pairs)
        sets += 1
        for i, k in pairs:
            section = np.array(contacts[k].section_mm)
            section_mm.append(np.linalg.norm(section - wanted[i].section_mm))
            plain_mm.append(np.linalg.norm(section - wanted[i].point_mm))
            at = np.array([contacts[k].x_mm, contacts[k].y_mm])
            point_mm.append(np.linalg.norm(at - wanted[i].point_mm))
    total = sum(map(len, truth.values()))
    shares = [
        f"{found / max(total, 1):.3f}",
        f"{ghosts / max(total, 1):.3f}",
        f"{exact / max(sets, 1):.2f}",
    ]
    return [str(total), *shares, *errors(section_mm), *errors(plain_mm), *errors(point_mm)]


def match(
    wanted: list[tuple[float, float]], got: list[tuple[float, float]]
) -> list[tuple[int, int]]:
    if not wanted or not got:
        return []
    distances = np.linalg.norm(np.array(wanted)[:, None] - np.array(got)[None], axis=-1)
    rows, columns = linear_sum_assignment(np.where(distances < MATCH_MM, distances, 1e3))
    return [
        (int(i), int(k)) for i, k in zip(rows, columns, strict=True) if distances[i, k] < MATCH_MM
    ]


def errors(values: list[float]) -> list[str]:
    if not values:
        return ["-", "-", "-"]
    e = np.array(values)
    return [f"{np.sqrt(np.mean(e**2)):.3f}", f"{np.median(e):.3f}", f"{np.percentile(e, 95):.3f}"]


def default_recordings(places: tuple[Path, ...]) -> tuple[Path, list[Path]]:
    place = next(place for place in places if (place / "empty_small").is_dir())
    return place, sorted(path.parent for path in place.glob("*/truth.csv"))


@click.command(help=__doc__)
@click.argument("directories", nargs=-1, type=click.Path(path_type=Path, exists=True))
@click.option("--calibrate-with", "taps", type=click.Path(path_type=Path, exists=True))
@click.option("--empty", type=click.Path(path_type=Path, exists=True))
@click.option("--scribble", type=click.Path(path_type=Path, exists=True))
@click.option("--with-scribble", is_flag=True, help="Use scribble_small of the default place.")
@click.option("--own", is_flag=True, help="Only the recordings of the repository.")
def main(
    directories: tuple[Path, ...],
    taps: Path | None,
    empty: Path | None,
    scribble: Path | None,
    with_scribble: bool,
    own: bool,
) -> None:
    place, found = default_recordings(PLACES[-1:] if own else PLACES)
    taps, empty = taps or place / "calib_few_small", empty or place / "empty_small"
    scribble = scribble or (place / "scribble_small" if with_scribble else None)
    calibration = calibrate_from(taps, empty, scribble)
    console = Console(width=180)
    console.print(
        f"auto from {taps.name}{' + ' + scribble.name if scribble else ''}: "
        f"residual {calibration.residual_mm:.3f} mm"
    )
    table = Table()
    for title in (
        "recording",
        "edges",
        "crossing",
        "touches",
        "found",
        "ghosts",
        "exact",
        "section rmse",
        "median",
        "p95",
        "plain rmse",
        "median",
        "p95",
        "point rmse",
        "median",
        "p95",
    ):
        table.add_column(title, justify="left" if title in {"recording", "edges"} else "right")
    for directory in directories or found:
        for edges, crossing in (("profile", "default"), ("profile", "paper"), ("paper", "paper")):
            settings = Settings(
                vision=VisionSettings(edges=edges), crossing=CrossingSettings(method=crossing)
            )
            table.add_row(directory.name, edges, crossing, *score(directory, calibration, settings))
    console.print(table)


if __name__ == "__main__":
    main()
