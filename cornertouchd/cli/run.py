"""`cornertouchd run`: the daemon."""

import logging
import os
from pathlib import Path

import click

from cornertouchd.cli.working import config_name, work
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.runtime.assembly import (
    find_calibration,
    find_display,
    make_plugs,
    make_ports,
    make_tuio_sink,
)
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.stop_signal import StopSignal

_log = logging.getLogger("cornertouchd")


@click.command()
@click.option(
    "--config",
    "config_file",
    type=click.Path(path_type=Path),
    help="Settings; else $CORNERTOUCHD_CONFIG, else /etc/cornertouchd/cornertouchd.toml.",
)
def run(config_file: Path | None) -> None:
    """Run the daemon: cameras in, TUIO out, until SIGINT or SIGTERM."""
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    clock = MonotonicClock()
    calibration = find_calibration(settings, os.environ)
    display = find_display(settings, os.environ)
    with StopSignal() as stop:
        ports = make_ports(settings, clock)
        daemon = Daemon(
            ports,
            calibration,
            [make_tuio_sink(settings, calibration.surface_mm, config_name(path), display)],
            settings,
            clock,
            make_plugs(settings),
        )
        _log.info(
            "running: %d cameras, TUIO to %s",
            len(ports),
            ", ".join(f"{to.host}:{to.port}" for to in settings.tuio.destinations) or "nobody",
        )
        work(daemon, stop, None, lambda _: None)
    counts = daemon.fusion_counts()
    _log.info("stopped: %d frame sets, %d touches", counts.frame_sets, counts.touches_begun)
