"""`cornertouchd record`: pictures of the configured cameras into a recording."""

import math
import os
from contextlib import closing
from pathlib import Path

import click

from cornertouchd.cli.targets import FiniteRange
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.runtime.assembly import make_ports
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.recorder import Recorder
from cornertouchd.runtime.stop_signal import StopSignal


@click.command()
@click.argument("directory", type=click.Path(path_type=Path))
@click.option("--seconds", type=FiniteRange(min=0, min_open=True), help="End by itself.")
@click.option("--notes", default="", help="What is recorded; kept with it.")
@click.option("--config", "config_file", type=click.Path(path_type=Path), help="Settings.")
def record(directory: Path, seconds: float | None, notes: str, config_file: Path | None) -> None:
    """Record the configured cameras into a directory until Ctrl-C."""
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    clock = MonotonicClock()
    ports = make_ports(settings, clock)
    recorder = Recorder(
        ports, settings.pairing.tolerance_ms / 1000, settings.cameras.read_timeout_s
    )
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    formats = {port.id: port.format for port in ports}
    identities = {port.id: port.identity for port in ports}
    count = 0
    with (
        StopSignal() as stop,
        RecordingWriter(
            directory, surface_mm, settings.cameras.rate_hz, formats, notes, identities
        ) as writer,
    ):
        click.echo(f"recording into {directory}; Ctrl-C ends", err=True)
        until_s = math.inf  # counted from the first frame set: cameras take a while to start
        with closing(
            recorder.frame_sets(lambda: stop.wait(0.0) or clock.now_s() >= until_s)
        ) as frame_sets:
            for frames in frame_sets:
                if count == 0 and seconds is not None:
                    until_s = clock.now_s() + seconds
                writer.write(frames)
                count += 1
    click.echo(f"{directory}: {count} frame sets, {recorder.dropped} frames left out", err=True)
