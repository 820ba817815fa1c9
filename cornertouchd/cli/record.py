"""`cornertouchd record`: pictures of the running daemon, or of the cameras, into a recording."""

import math
import os
from collections.abc import Callable, Generator, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Protocol

import click

from cornertouchd.cli.running_daemon import find_daemon
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.devices.recording_format import RecordingError
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import Frame, PictureFormat
from cornertouchd.runtime.assembly import make_ports
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.kept_recorder import KeptRecorder
from cornertouchd.runtime.led_desk import shining
from cornertouchd.runtime.recorder import Recorder
from cornertouchd.runtime.stop_signal import StopSignal
from cornertouchd.wire.pictures import PictureStreamError

MEGABYTE = 2**20
SIZE_EVERY = 50
"""Frame sets between two looks at the size: half a second, less than 2 MB of it."""

NICENESS = 10
"""To compress pictures takes half a processor; the daemon comes first."""


class Source(Protocol):
    """Where frame sets come from."""

    @property
    def dropped(self) -> int:
        """Frames without fellows of the same instant."""
        ...

    def frame_sets(self, stop: Callable[[], bool]) -> Generator[tuple[Frame, ...]]:
        """Yield frame sets until `stop()`."""
        ...


Opened = tuple[Source, RecordingWriter]


@click.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("--seconds", type=FiniteRange(min=0, min_open=True), help="End by itself.")
@click.option(
    "--last",
    "last_s",
    type=FiniteRange(min=0, min_open=True),
    help="Begin so many seconds ago, with what the daemon keeps (monitor.keep_s); without "
    "--seconds, end now.",
)
@click.option("--max-mb", type=FiniteRange(min=1), help="End when it is as large as that.")
@click.option("--notes", default="", help="What is recorded; kept with it.")
@click.option("--config", "config_file", type=click.Path(path_type=Path), help="Settings.")
@click.option(
    "--socket",
    "socket_file",
    type=click.Path(path_type=Path),
    help="The daemon to record from; else the one that runs with these settings, if one does.",
)
def record(
    directory: Path,
    seconds: float | None,
    last_s: float | None,
    max_mb: float | None,
    notes: str,
    config_file: Path | None,
    socket_file: Path | None,
) -> None:
    """Record the running daemon, or the cameras, into a directory.

    The daemon that runs with these settings, if one does, and until Ctrl-C. It goes on meanwhile;
    it waits for nobody, so what cannot be written fast enough is missing, and said.
    """
    path = find_settings(config_file, os.environ)
    daemon = socket_file or find_daemon(path)
    if daemon is None and last_s is not None:
        raise click.ClickException(
            "--last: no daemon runs with these settings, so nothing is kept; start it, or name its "
            "socket with --socket"
        )
    opened = (
        _from_cameras(directory, read_settings(path) if path else Settings(), notes)
        if daemon is None
        else _from_daemon(directory, daemon, last_s, seconds, notes)
    )
    limit_bytes = math.inf if max_mb is None else max_mb * MEGABYTE
    with StopSignal() as stop, opened as (source, writer):
        click.echo(f"recording into {directory}; Ctrl-C ends", err=True)
        # those of the cameras are counted from the first frame set: they take a while to start
        limit_s = math.inf if seconds is None or daemon is not None else seconds
        _write(source, writer, directory, stop, limit_s, limit_bytes)


@contextmanager
def _from_cameras(directory: Path, settings: Settings, notes: str) -> Iterator[Opened]:
    ports = make_ports(settings, MonotonicClock())
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    formats: Mapping[str, PictureFormat] = {port.id: port.format for port in ports}
    identities = {port.id: port.identity for port in ports}
    recorder = Recorder(
        ports, settings.pairing.tolerance_ms / 1000, settings.cameras.read_timeout_s
    )
    rate_hz = settings.cameras.rate_hz
    with (
        shining(settings),
        RecordingWriter(directory, surface_mm, rate_hz, formats, notes, identities) as writer,
    ):
        yield recorder, writer


@contextmanager
def _from_daemon(
    directory: Path, path: Path, last_s: float | None, seconds: float | None, notes: str
) -> Iterator[Opened]:
    if last_s is not None and seconds is None:
        seconds = 0.0
    try:
        recorder = KeptRecorder(path, last_s or 0.0, seconds)
    except OSError as error:
        raise click.ClickException(
            f"{path}: no daemon answers: {error.strerror or error}"
        ) from error
    os.nice(NICENESS)
    head, formats = recorder.head, recorder.formats
    blind = [camera.id for camera in head.cameras if camera.id not in formats]
    if blind:
        click.echo(f"without {', '.join(blind)}: no pictures of the last seconds", err=True)
    identities = {camera.id: camera.identity for camera in head.cameras}
    with (
        recorder,
        RecordingWriter(
            directory, head.surface_mm, head.rate_hz, formats, notes, identities
        ) as writer,
    ):
        yield recorder, writer
    if recorder.missing:
        click.echo(
            f"{recorder.missing} pictures are missing: they came faster than they could be written",
            err=True,
        )


def _write(
    source: Source,
    writer: RecordingWriter,
    directory: Path,
    stop: StopSignal,
    limit_s: float,
    limit_bytes: float,
) -> None:
    clock = MonotonicClock()
    until_s, count = math.inf, 0
    is_full = False

    def is_over() -> bool:
        return is_full or stop.wait(0.0) or clock.now_s() >= until_s

    try:
        with closing(source.frame_sets(is_over)) as frame_sets:
            for frames in frame_sets:
                if count == 0:
                    until_s = clock.now_s() + limit_s
                if is_full:
                    continue  # the daemon still says what is missing
                writer.write(frames)
                count += 1
                is_full = count % SIZE_EVERY == 0 and _size_bytes(directory) >= limit_bytes
    except (RecordingError, PictureStreamError) as error:
        raise click.ClickException(
            f"{error}; {count} frame sets until then are in {directory}"
        ) from error
    if is_full:
        click.echo(f"{directory}: is as large as --max-mb allows", err=True)
    click.echo(f"{directory}: {count} frame sets, {source.dropped} frames left out", err=True)


def _size_bytes(directory: Path) -> int:
    return sum(file.stat().st_size for file in directory.iterdir())
