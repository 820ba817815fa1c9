"""`cornertouchd status`: how the running daemon does, for a person or a monitoring program."""

import contextlib
import json
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from cornertouchd.cli.running_daemon import socket_of
from cornertouchd.runtime.asking import RefusedError, read_document
from cornertouchd.runtime.latency import Latency

HEALTHY, DEGRADED, DOWN = 0, 1, 2
"""Exit status, as Nagios and its kin read it: OK, WARNING, CRITICAL."""

LOOK_EVERY_S = 1.0
DAY_S = 86400.0


@click.command()
@click.argument("surface", required=False)
@click.option("--json", "as_json", is_flag=True, help="Everything as one JSON object on stdout.")
@click.option("--watch", is_flag=True, help="Look every second until Ctrl-C.")
@click.option(
    "--socket",
    "socket_file",
    type=click.Path(path_type=Path),
    help="Where the daemon is asked; else in its runtime directory.",
)
def status(surface: str | None, as_json: bool, watch: bool, socket_file: Path | None) -> None:
    """Tell how the running daemon does.

    Of several that run as cornertouchd@SURFACE, SURFACE says which is meant. Exit status 0 if all
    is well, 1 if something is missing, 2 if no daemon answers.
    """
    path = socket_file or socket_of(surface)
    if watch:
        _watch(path, as_json)
    told = _ask(path)
    if as_json:
        click.echo(json.dumps(told, indent=None if watch else 2))
    elif told["state"] == "down":
        click.echo(f"Error: {told['problems'][0]}", err=True)
    else:
        Console().print(_page(told))
    sys.exit({"healthy": HEALTHY, "degraded": DEGRADED}.get(told["state"], DOWN))


def _ask(path: Path) -> dict[str, Any]:
    """Return what the daemon says; in place of one that is down, that it is."""
    try:
        told = read_document(path, "status")
    except PermissionError:
        problem = f"{path}: may not be asked by this user; be in the group cornertouchd"
    except FileNotFoundError:
        problem = f"{path} is not there: no daemon runs; `systemctl start cornertouchd` starts it"
    except OSError as error:
        problem = f"{path}: no daemon answers: {error}"
    except RefusedError as error:
        problem = str(error)
    else:
        return told
    return {"state": "down", "problems": [problem]}


def _watch(path: Path, as_json: bool) -> None:
    """Show how it does until Ctrl-C, as JSON a line for each look."""
    with contextlib.suppress(KeyboardInterrupt):
        if as_json:
            while True:
                click.echo(json.dumps(_ask(path)))
                time.sleep(LOOK_EVERY_S)
        with Live(console=Console(), auto_refresh=False, transient=True) as live:
            while True:
                live.update(_page(_ask(path)), refresh=True)
                time.sleep(LOOK_EVERY_S)


def _page(told: dict[str, Any]) -> Group:
    return Group(*_lines(told))


def _lines(told: dict[str, Any]) -> Iterator[Text | Table]:
    colour = {"healthy": "green", "degraded": "yellow"}.get(told["state"], "red")
    yield Text(told["state"], style=f"bold {colour}")
    for problem in told["problems"]:
        yield Text(f"  {problem}", style=colour)
    if told["state"] == "down":
        return
    for hint in told["hints"]:
        yield Text(f"  {hint}", style="dim")
    fusion = told["fusion"]
    facts = Table(box=None, pad_edge=False, show_header=False)
    facts.add_row("up", _duration(told["up_s"]))
    facts.add_row(
        "frame sets",
        f"{told['frame_sets_per_s']:.0f}/s; {fusion['frame_sets']} so far, {fusion['partial']} "
        f"partial, {fusion['skipped']} skipped, {fusion['dropped']} dropped",
    )
    last = told["last"]
    facts.add_row("latency", _latency(fusion["latency"]))
    facts.add_row(
        "touches",
        f"{fusion['touches_now']} now; {fusion['touches_begun']} so far; {last['contacts']} "
        f"contacts, {fusion['ghosts']} ghosts refused so far",
    )
    facts.add_row(
        "calibrated", f"{_age(told['calibrated_at'])}, residual {told['residual_mm']:.2f} mm"
    )
    facts.add_row(
        "machine",
        f"{told['cpu_share']:.0%} of a processor, {told['process']['memory_bytes'] / 2**20:.0f} MB",
    )
    for to in told["destinations"]:
        facts.add_row("TUIO", _destination(to))
    for screen in told["screens"]:
        state = f"{screen['reports_sent']} reports" if screen["is_there"] else "not there"
        facts.add_row("touchscreen", f"{screen['name']}; {state}, {screen['errors']} errors")
    if told["light"] is not None:
        facts.add_row("LED frame", _light(told["light"]))
    yield facts
    yield _cameras(told["cameras"])


def _destination(told: dict[str, Any]) -> str:
    sent = f"{told['packets_sent']} packets, {told['errors']} errors"
    if told.get("clients") is None:
        return f"{told['host']}:{told['port']}; {sent}"
    return (
        f"{told['transport']} {told['host']}:{told['port']}; {told['clients']} connected, {sent}, "
        f"{told['frames_skipped']} frames skipped, {told['refused']} refused"
    )


def _light(told: dict[str, Any]) -> str:
    levels = "/".join(str(level) for level in told["levels"])
    said = f"{told['controller'] or 'lost'} at {told['port']}; {told['pattern']}, levels {levels}"
    return f"{said}, dimmed" if told["dimmed"] else said


def _cameras(told: list[dict[str, Any]]) -> Table:
    table = Table("camera", box=None, pad_edge=False, padding=(0, 1))
    counts = ("lost", "damaged", "faults", "reopened", "resets")
    for heading in ("pictures/s", *counts, "contrast", "clipped", "blind"):
        table.add_column(heading, justify="right")
    for camera in told:
        table.add_row(
            camera["id"] if camera["live"] else f"[red]{camera['id']} lost[/]",
            f"{camera['pictures_per_s']:.0f}",
            *(str(camera[name]) for name in counts),
            *_strip(camera["strip"]),
            str(camera["masked_columns"]),
        )
    return table


def _latency(told: dict[str, Any]) -> str:
    latency = Latency(tuple(told["bounds_s"]), tuple(told["counts"]), told["sum_s"])
    middle_s, most_s = latency.quantile_s(0.5), latency.quantile_s(0.99)
    if middle_s is None or most_s is None:
        return "nothing sent yet"
    return f"half within {1000 * middle_s:g} ms, 99 of 100 within {1000 * most_s:g} ms"


def _strip(told: dict[str, float] | None) -> tuple[str, str]:
    if told is None:
        return "-", "-"
    return f"{told['contrast']:.2f}", f"{told['saturated_share']:.0%}"


def _duration(seconds: float) -> str:
    days, rest = divmod(int(seconds), int(DAY_S))
    hours, minutes = divmod(rest // 60, 60)
    return f"{days} d {hours:02}:{minutes:02}:{rest % 60:02}"


def _age(created_at: str) -> str:
    try:
        made = datetime.fromisoformat(created_at)
    except ValueError:
        return created_at
    days = (datetime.now(UTC) - made.replace(tzinfo=made.tzinfo or UTC)).total_seconds() / DAY_S
    return f"{created_at} ({days:.0f} days ago)"
