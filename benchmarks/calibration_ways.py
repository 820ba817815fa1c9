"""The ways to calibrate that are compared, and the commands that do it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from click.testing import CliRunner

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import Method
from cornertouchd.cli import main as cornertouchd


@dataclass(frozen=True)
class Way:
    """One way to calibrate: a method, the taps that it gets, and what else.

    `taps` is the recording's name; `only_points` are the frame sets that count, all if empty.
    `asked` is for barrel lenses on 350x400 and 2400x1350 mm.
    """

    name: str
    method: Method
    taps: str = ""
    only_points: tuple[int, ...] = ()
    scribble: bool = False
    boards: bool = False
    asked: tuple[str, str] = ("", "")


WAYS = (
    Way("auto, 16 taps", "auto", "taps16", asked=(".51/.94/2.4", "1.1/1.8/12")),
    Way(
        "auto, 16 taps + scribble",
        "auto",
        "taps16",
        scribble=True,
        asked=(".29/.51/.78", ".61/1.1/2.0"),
    ),
    Way(
        "auto, 4 taps + scribble",
        "auto",
        "taps16",
        (0, 3, 12, 15),
        scribble=True,
        asked=(".48/.77/1.0", ".84/1.4/2.3"),
    ),
    Way("auto, no taps + scribble", "auto", scribble=True),
    Way(
        "vanishing-point, 25 taps",
        "vanishing-point",
        "taps25",
        asked=("6.8/12/22", "38/73/124"),
    ),
    Way("vanishing-point, 16 taps", "vanishing-point", "taps16"),
    Way("vanishing-point, 225 points", "vanishing-point", "frame225"),
    Way(
        "lookup-table, 225 points",
        "lookup-table",
        "frame225",
        asked=("33/51/61", "152/262/342"),
    ),
    Way("auto, 225 points", "auto", "frame225"),
    Way("reconstruction, boards + 16 taps", "reconstruction", "taps16", boards=True),
)

ASKED_OF_PINHOLES = {
    ("350x400", "vanishing-point, 25 taps"): ".28/.44/.62",
    ("350x400", "lookup-table, 225 points"): ".53/.89/1.3",
}


DEFAULT_BOARD = BoardPlan()


class CommandError(Exception):
    """A command ended with another status than 0; the message is what it said."""


def run(*arguments: object) -> None:
    """Run a command of cornertouchd."""
    words = [str(argument) for argument in arguments]
    result = CliRunner().invoke(cornertouchd, words, catch_exceptions=False)
    if result.exit_code != 0:
        raise CommandError(result.stderr.strip())


def calibrate(
    way: Way, sets: Mapping[str, Path], output: Path, board: BoardPlan = DEFAULT_BOARD
) -> None:
    """Calibrate by the command from recordings: empty, those of taps, scribble, boards.

    Raises `CommandError`, also for a recording that there is not.
    """
    lacking = recordings_of(way) - set(sets)
    if lacking:
        raise CommandError(f"no recording of {', '.join(lacking)}")
    options: list[object] = ["--empty", sets["empty"]]
    if way.taps:
        points = output.with_suffix(".points.csv")
        copy_points(sets[way.taps] / "points.csv", points, way.only_points)
        options += ["--recording", sets[way.taps], "--points", points]
    options += ["--scribble", sets["scribble"]] if way.scribble else []
    if way.boards:
        columns, rows = board.squares
        plan = f"{board.kind}:{columns}x{rows}:{board.square_mm:g}:{board.marker_mm:g}"
        options += ["--boards", sets["boards"], "--board", plan]
    run("calibrate", *options, "--method", way.method, "--output", output)


def recordings_of(way: Way) -> set[str]:
    """Return the names of the recordings that a way needs."""
    return {"empty", way.taps, "scribble" * way.scribble, "boards" * way.boards} - {""}


def copy_points(source: Path, target: Path, only: Sequence[int]) -> None:
    """Copy a points.csv, or the points of some frame sets only."""
    header, *rows = source.read_text().splitlines()
    kept = [row for row in rows if not only or int(row.split(",")[0]) in only]
    target.write_text("\n".join([header, *kept]) + "\n")
