"""`cornertouchd run`: the daemon."""

import contextlib
import logging
import os
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import click

from cornertouchd.cli.working import config_name
from cornertouchd.errors import ReportedError
from cornertouchd.places import runtime_directory
from cornertouchd.runtime.answers import answers_of
from cornertouchd.runtime.asking import SOCKET_NAME, AskSocket
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.health import HealthWatch
from cornertouchd.runtime.log_tail import LogTail
from cornertouchd.runtime.monitor_process import MonitorProcess, page_options
from cornertouchd.runtime.notify import ServiceManager
from cornertouchd.runtime.parts import make_parts
from cornertouchd.runtime.reloading import Reload, ReloadSignal
from cornertouchd.runtime.service import ServiceReport
from cornertouchd.runtime.stop_signal import StopSignal
from cornertouchd.runtime.tuio_receivers import receivers_in_words

HOLD_BACK_S = 10.0
"""What only a person can mend is not tried again every second, which would fill the journal."""

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
    clock = MonotonicClock()
    with (
        contextlib.closing(ServiceManager(os.environ)) as manager,
        StopSignal() as stop,
        ReloadSignal() as hangup,
        LogTail() as log,
        _told(manager, stop),
    ):
        manager.status("starting")
        make = partial(make_parts, config_file, os.environ, clock)
        parts = make()
        daemon = Daemon(
            parts.ports,
            parts.calibration,
            parts.sinks,
            parts.settings,
            clock,
            parts.plugs,
            parts.light,
        )
        _log.info(
            "running: %d cameras, TUIO to %s",
            len(parts.ports),
            receivers_in_words(parts.settings.tuio),
        )
        health = HealthWatch(daemon, clock)
        report = ServiceReport(manager, daemon, health, clock)
        reload = Reload(daemon, parts, make)
        answers = answers_of(
            daemon, health, log, config_name(parts.path), lambda: reload.parts.displays, clock
        )
        socket = runtime_directory(os.environ) / SOCKET_NAME
        with (
            AskSocket(socket, answers),
            MonitorProcess(
                lambda: page_options(daemon.stages.settings, socket, os.environ), clock
            ) as page,
        ):
            _serve(daemon, stop, hangup, reload, report, page)
        counts = daemon.fusion_counts()
    _log.info("stopped: %d frame sets, %d touches", counts.frame_sets, counts.touches_begun)


def _serve(
    daemon: Daemon,
    stop: StopSignal,
    hangup: ReloadSignal,
    reload: Reload,
    report: ServiceReport,
    page: MonitorProcess,
) -> None:
    """Run the daemon until the signal comes; follow SIGHUP and tell the service manager."""
    daemon.start()
    try:
        while not stop.wait(report.look_every_s):
            if reload.is_under_way:
                outcome = reload.finish()
                if outcome is not None:
                    report.reloaded("the last reload was refused" * (outcome == "refused"))
            elif hangup.take():
                report.reloading()
                reload.begin()
            report.look()
            page.look()
    finally:
        report.stopping()
        daemon.stop()


@contextlib.contextmanager
def _told(manager: ServiceManager, stop: StopSignal) -> Iterator[None]:
    """Tell the service manager what keeps the daemon from starting, and hold the next try back."""
    try:
        yield
    except ReportedError as error:
        if not manager.listens:
            raise
        _log.error("%s", error)
        manager.status(f"does not start: {error}")
        stopped = stop.wait(HOLD_BACK_S)
        sys.exit(int(not stopped))  # a unit that was stopped has not failed
