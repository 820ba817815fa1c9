"""`cornertouchd replay`: a recording through the whole pipeline."""

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees
from pathlib import Path
from typing import IO, Any

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)

from cornertouchd.calibration.file import load_calibration
from cornertouchd.calibration.observing import mean_pictures
from cornertouchd.cli.targets import HostPort, SetRuns, Speed
from cornertouchd.config import DestinationSettings, Settings, TuioSettings, read_settings
from cornertouchd.devices.recording import open_recording
from cornertouchd.model import Contact, TouchFrame
from cornertouchd.ports import TouchSink
from cornertouchd.runtime.assembly import make_tuio_sink
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.fusing import SILENCE_S
from cornertouchd.runtime.replaying import Replay, ReplayedSet
from cornertouchd.runtime.stop_signal import StopSignal

TICK_S = 0.02


@click.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("--calibration", "calibration_file", type=click.Path(path_type=Path), required=True)
@click.option(
    "--independent", is_flag=True, help="Every frame set on its own: no tracking, no learning."
)
@click.option(
    "--empty",
    "empty_directory",
    type=click.Path(path_type=Path),
    help="Recording of the empty surface to take the background from.",
)
@click.option(
    "--empty-sets", "empty_runs", type=SetRuns(), help="Empty frame sets of DIRECTORY: 0-7,24-27."
)
@click.option(
    "--output", type=click.Path(path_type=Path, dir_okay=False), help="JSON lines; - is stdout."
)
@click.option("--tuio", type=HostPort(), help="TUIO client to send the touches to.")
@click.option("--speed", type=Speed(), help="Factor, or max.  Default: 1 with --tuio, else max.")
@click.option("--crossing", type=click.Choice(["default", "paper"]), help="Overrides the settings.")
@click.option("--edges", type=click.Choice(["profile", "paper"]), help="Overrides the settings.")
@click.option("--config", "config_file", type=click.Path(path_type=Path), help="Settings.")
def replay(
    directory: Path,
    calibration_file: Path,
    independent: bool,
    empty_directory: Path | None,
    empty_runs: tuple[tuple[int, int], ...] | None,
    output: Path | None,
    tuio: tuple[str, int] | None,
    speed: float | None,
    crossing: str | None,
    edges: str | None,
    config_file: Path | None,
) -> None:
    """Replay a recording through the whole pipeline."""
    if empty_directory and empty_runs:
        raise click.UsageError("--empty and --empty-sets exclude each other: give one of them")
    if independent and tuio:
        raise click.UsageError("--independent finds no touches, so --tuio has nothing to send")
    settings = _settings(config_file, tuio, crossing, edges)
    recording = open_recording(directory)
    source = Replay(
        recording,
        load_calibration(calibration_file),
        settings,
        independent=independent,
        empty_runs=empty_runs or (),
    )
    if empty_directory:
        source.learn_background(mean_pictures(open_recording(empty_directory)))
    pace = speed if speed is not None else 1.0 if tuio else float("inf")
    with (
        _opened(output) as lines,
        StopSignal() as stop,
        _sinks(settings, recording.surface_mm, tuio) as sinks,
    ):
        contacts = count = 0
        for replayed in _shown(_paced(source, pace, sinks, stop), len(recording)):
            if lines is not None:
                lines.write(json.dumps(_as_json(replayed)) + "\n")
            contacts += len(replayed.contacts)
            count += 1
        if count < len(recording):
            raise click.ClickException(f"stopped after {count} of {len(recording)} frame sets")
    refused = f", {source.refused_pictures} pictures refused" if source.refused_pictures else ""
    click.echo(f"{count} frame sets, {contacts} contacts{refused}", err=True)


def _settings(
    config_file: Path | None,
    tuio: tuple[str, int] | None,
    crossing: str | None,
    edges: str | None,
) -> Settings:
    settings = read_settings(config_file) if config_file else Settings()
    changes: dict[str, Any] = {}
    if crossing:
        changes["crossing"] = settings.crossing.model_copy(update={"method": crossing})
    if edges:
        changes["vision"] = settings.vision.model_copy(update={"edges": edges})
    if tuio:
        to = DestinationSettings(host=tuio[0], port=tuio[1])
        changes["tuio"] = TuioSettings(destinations=(to,))
    return settings.model_copy(update=changes)


@contextmanager
def _opened(output: Path | None) -> Iterator[IO[str] | None]:
    """Open the output; one that already stands there is replaced only by a whole one."""
    if output is None:
        yield None
    elif str(output) == "-":
        yield sys.stdout
    else:
        try:
            with _replacing(output) as file:
                yield file
        except OSError as error:
            raise click.ClickException(f"{output}: cannot be written: {error.strerror}") from error


@contextmanager
def _replacing(output: Path) -> Iterator[IO[str]]:
    if output.exists() and not output.is_file():  # a pipe or a device: nothing to replace
        with output.open("w") as stream:
            yield stream
        return
    partial = output.with_name(output.name + ".partial")
    try:
        with partial.open("w") as file:
            yield file
        partial.replace(output)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def _sinks(
    settings: Settings, surface_mm: tuple[float, float], tuio: tuple[str, int] | None
) -> Iterator[list[TouchSink]]:
    sinks: list[TouchSink] = [make_tuio_sink(settings, surface_mm, "replay")] if tuio else []
    try:
        yield sinks
    finally:
        for sink in sinks:
            sink.close()


def _paced(
    source: Replay, pace: float, sinks: list[TouchSink], stop: StopSignal
) -> Iterator[ReplayedSet]:
    """Yield frame sets when they are due, telling the sinks; end when the signal comes."""
    clock = MonotonicClock()
    began_s, first_s = clock.now_s(), None
    for replayed in source:
        first_s = replayed.captured_at_s if first_s is None else first_s
        due_s = began_s + (replayed.captured_at_s - first_s) / pace
        told_s = clock.now_s()
        while not stop.wait(min(TICK_S, max(0.0, due_s - clock.now_s()))):
            for sink in sinks:
                if clock.now_s() - told_s > SILENCE_S:
                    sink.lift_all(clock.now_s())
                sink.tick(clock.now_s())
            if clock.now_s() >= due_s:
                break
        else:
            return
        for sink in sinks:
            sink.send(TouchFrame(replayed.captured_at_s, replayed.touches), clock.now_s())
        yield replayed


def _shown(sets: Iterator[ReplayedSet], count: int) -> Iterator[ReplayedSet]:
    """Yield the same and show on the terminal, if messages go to one, how far it is."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield from sets
        return
    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("frame sets"),
        TaskProgressColumn(show_speed=True),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        yield from progress.track(sets, total=count)


def _lean(contact: Contact) -> dict[str, float]:
    """Return how a finger leans, in degrees, if that is known."""
    if contact.lean is None:
        return {}
    return {
        "lean_deg": round(degrees(contact.lean.angle_rad), 2),
        "azimuth_deg": round(degrees(contact.lean.azimuth_rad), 1),
    }


def _as_json(replayed: ReplayedSet) -> dict[str, object]:
    """Return the line of a frame set; rounded far below what is measured."""
    return {
        "set": replayed.index,
        "captured_at_s": round(replayed.captured_at_s, 6),
        "contacts": [
            {
                "x_mm": round(contact.x_mm, 4),
                "y_mm": round(contact.y_mm, 4),
                "diameter_mm": round(contact.diameter_mm, 3),
                "cameras": list(contact.cameras),
                "confidence": round(contact.confidence, 4),
                "sigma_mm": round(contact.sigma_mm, 4),
                "touching": contact.touching,
                "kind": contact.kind,
                **_lean(contact),
            }
            for contact in replayed.contacts
        ],
        "touches": [
            {
                "id": touch.id,
                "x_mm": round(touch.x_mm, 4),
                "y_mm": round(touch.y_mm, 4),
                "vx_mm_s": round(touch.vx_mm_s, 3),
                "vy_mm_s": round(touch.vy_mm_s, 3),
                "age_s": round(touch.age_s, 6),
            }
            for touch in replayed.touches
        ],
    }
