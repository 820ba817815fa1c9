"""`cornertouchd calibrate`: guided on the cameras, or from recordings."""

import json
import os
from math import isqrt
from pathlib import Path

import click
from click.core import ParameterSource

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.calibration.calibration import METHODS, Method
from cornertouchd.calibration.file import rollback_calibration
from cornertouchd.calibration.file_schema import calibration_schema
from cornertouchd.cli.calibrate_display import display
from cornertouchd.cli.calibrate_guided import GuideOptions, calibrate_guided
from cornertouchd.cli.calibrate_recorded import Recordings, calibrate_recorded
from cornertouchd.cli.print_board import print_board as draw_board
from cornertouchd.cli.targets import Board, FiniteRange
from cornertouchd.cli.working import require_writable
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.guiding.targets import targets_for
from cornertouchd.runtime.assembly import calibration_file

_PATH = click.Path(path_type=Path)

RECORDINGS = {"taps", "points", "scribble", "empty", "boards"}
GUIDED = {
    "simulate",
    "finger",
    "taps_wanted",
    "anew",
    "no_check",
    "limit_mm",
    "strip_picture",
    "page",
}
ALONE = {"rollback", "schema", "print_board"}


@click.group(invoke_without_command=True)
@click.option("--config", "config_file", type=_PATH, help="Settings.")
@click.option("--output", type=_PATH, help="Calibration file; else the one that the daemon reads.")
@click.option(
    "--method",
    type=click.Choice(METHODS),
    default="auto",
    show_default=True,
    help="auto is our best; the others are the paper's, section 6.1.",
)
@click.option(
    "--tap-sigma-mm",
    type=FiniteRange(0.01, 20.0),
    default=0.5,
    show_default=True,
    help="How far taps are off their places (standard deviation).",
)
@click.option("--error-map", type=_PATH, help="Write the errors to expect as a picture (PNG).")
@click.option(
    "--strip-picture",
    type=_PATH,
    help="Guided: write the empty strip over time as a picture (PNG).",
)
@click.option("--recording", "taps", type=_PATH, help="Recording of taps, one a frame set.")
@click.option("--points", type=_PATH, help="Where the taps were; else points.csv beside them.")
@click.option("--scribble", type=_PATH, help="Recording of one finger at unknown places.")
@click.option("--empty", type=_PATH, help="Recording of the empty surface.")
@click.option("--boards", type=_PATH, help="Recording of a board (method reconstruction).")
@click.option(
    "--board",
    "plan",
    type=Board(),
    default=BoardPlan(),
    show_default="charuco:9x6:29:23",
    help="What the board shows: squares, their size, for ChArUco that of the markers, in mm.",
)
@click.option("--print-board", type=_PATH, help="Write the board to print: .pdf or .png.")
@click.option("--simulate", is_flag=True, help="Guided, on the simulated rig.")
@click.option(
    "--finger",
    type=_PATH,
    help="With --simulate: a file, pipe or - whose lines move the finger: `X Y` in millimetres, an "
    "empty line lifts it.  Else a simulated person does what is asked for.",
)
@click.option(
    "--taps-wanted",
    type=click.IntRange(0, 2000),
    help="Guided: how many places to tap; on a grid (a square number; 0: go by where the cameras "
    "are) or, for the lookup table, along the frame.  Default: 16 (auto), 25 (vanishing-point), "
    "225 (lookup-table), 4 (reconstruction).",
)
@click.option("--anew", is_flag=True, help="Guided: forget taps of a session that was stopped.")
@click.option(
    "--page", is_flag=True, help="Guided: show what to do in browsers, too, where the live page is."
)
@click.option("--no-check", is_flag=True, help="Guided: without the five fresh taps at the end.")
@click.option(
    "--limit-mm",
    type=FiniteRange(0.1, 100.0),
    default=3.0,
    show_default=True,
    help="Guided: largest error of a fresh tap.",
)
@click.option(
    "--rollback", is_flag=True, help="Bring the former calibration back; twice undoes it."
)
@click.option("--schema", is_flag=True, help="Print the JSON schema of the calibration file.")
@click.pass_context
def calibrate(
    context: click.Context,
    config_file: Path | None,
    output: Path | None,
    method: Method,
    tap_sigma_mm: float,
    error_map: Path | None,
    strip_picture: Path | None,
    taps: Path | None,
    points: Path | None,
    scribble: Path | None,
    empty: Path | None,
    boards: Path | None,
    plan: BoardPlan,
    print_board: Path | None,
    simulate: bool,
    finger: Path | None,
    taps_wanted: int | None,
    anew: bool,
    page: bool,
    no_check: bool,
    limit_mm: float,
    rollback: bool,
    schema: bool,
) -> None:
    """Calibrate the cameras and save the result.

    Without recordings it leads through all steps on the cameras: looks at them, learns the empty
    strip, waits for 16 taps and a scribble, shows the result, saves it, checks it with five taps.
    """
    given = {
        name
        for name in context.params
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE
    }
    if context.invoked_subcommand is not None:
        if given:
            raise click.UsageError(f"write options behind {context.invoked_subcommand}")
        return
    _refuse_contradictions(given)
    if schema:
        click.echo(json.dumps(calibration_schema(), indent=2))
        return
    if print_board is not None:
        draw_board(plan, print_board)
        click.echo(f"{print_board}: print it at 100 %", err=True)
        return
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    output = output or _usual_output(settings, simulate)
    for file in (output, error_map, strip_picture):
        require_writable(file)
    if rollback:
        back = rollback_calibration(output)
        click.echo(f"{output}: the calibration of {back.created_at} is in force again", err=True)
    elif given & RECORDINGS:
        if empty is None:
            raise click.UsageError("--empty is missing: the recording of the empty surface")
        if points and not taps:
            raise click.UsageError("--points needs --recording, the taps that they belong to")
        if boards and method != "reconstruction":
            raise click.UsageError("--boards are for --method reconstruction")
        recordings = Recordings(empty, plan, taps, points, scribble, boards)
        calibrate_recorded(recordings, method, tap_sigma_mm, settings, output, error_map)
    else:
        _require_square(method, taps_wanted)
        surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
        options = GuideOptions(
            output=output,
            method=method,
            targets_mm=targets_for(method, surface_mm, taps_wanted),
            tap_sigma_mm=tap_sigma_mm,
            limit_mm=limit_mm,
            check=not no_check,
            anew=anew,
            page=page,
            error_map=error_map,
            strip_picture=strip_picture,
            simulate=simulate,
            finger=finger,
            plan=plan if method == "reconstruction" else None,
        )
        calibrate_guided(settings, options)


def _refuse_contradictions(given: set[str]) -> None:
    """Raise `UsageError` for options that would be passed over."""
    if len(given & ALONE) > 1:
        raise click.UsageError("--rollback, --schema and --print-board exclude each other")
    if given & RECORDINGS and given & GUIDED:
        names = ", ".join(f"--{name.replace('_', '-')}" for name in sorted(given & GUIDED))
        raise click.UsageError(f"{names}: only without recordings, in the guided calibration")
    if "finger" in given and "simulate" not in given:
        raise click.UsageError("--finger moves the finger of the simulated rig: add --simulate")


def _require_square(method: Method, count: int | None) -> None:
    """Raise `UsageError` unless so many places can be tapped for the method."""
    fewest = {"vanishing-point": 9, "lookup-table": 40, "reconstruction": 4, "auto": 0}[method]
    if count is None:
        return
    if count < fewest:
        raise click.UsageError(f"--taps-wanted {count}: {method} needs {fewest} at least")
    side = isqrt(count)
    if method != "lookup-table" and side * side != count:
        raise click.UsageError(
            f"--taps-wanted {count}: must be a square number, such as {side * side} or "
            f"{(side + 1) ** 2}"
        )


def _usual_output(settings: Settings, simulate: bool) -> Path:
    """Return the file that the daemon reads; a simulated rig's must not take its place."""
    usual = calibration_file(settings, os.environ)
    return usual.with_name("simulated.json") if simulate else usual


calibrate.add_command(display)
