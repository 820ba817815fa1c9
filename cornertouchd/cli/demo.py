"""`cornertouchd demo`: a simulated rig with moving fingers, through the whole daemon."""

import os

import click

from cornertouchd.cli.targets import FiniteRange, HostPort
from cornertouchd.config import (
    CamerasSettings,
    DestinationSettings,
    MonitorSettings,
    Settings,
    SimulationSettings,
    TuioSettings,
)
from cornertouchd.places import runtime_directory
from cornertouchd.runtime.answers import answers_of
from cornertouchd.runtime.asking import SOCKET_NAME, AskSocket
from cornertouchd.runtime.assembly import find_calibration, make_ports, make_tuio_sink
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.displays import NO_DISPLAYS
from cornertouchd.runtime.health import LOOK_EVERY_S, Health, HealthWatch
from cornertouchd.runtime.log_tail import LogTail
from cornertouchd.runtime.monitor_process import MonitorProcess, page_options
from cornertouchd.runtime.stop_signal import StopSignal


@click.command()
@click.option("--seconds", type=FiniteRange(min=0, min_open=True), help="End by itself.")
@click.option(
    "--touches", type=click.IntRange(0, 20), default=5, show_default=True, help="Moving fingers."
)
@click.option(
    "--tuio", type=HostPort(), default="127.0.0.1:3333", show_default=True, help="TUIO client."
)
@click.option("--no-monitor", is_flag=True, help="Without the live page.")
@click.option(
    "--monitor-port",
    type=click.IntRange(1, 65535),
    default=MonitorSettings().port,
    show_default=True,
    help="Where the live page is served, on this machine only.",
)
@click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=1, show_default=True)
@click.option(
    "--speed",
    type=FiniteRange(0.01, 100),
    default=1.0,
    show_default=True,
    help="How fast the fingers move.",
)
def demo(
    seconds: float | None,
    touches: int,
    tuio: tuple[str, int],
    no_monitor: bool,
    monitor_port: int,
    seed: int,
    speed: float,
) -> None:
    """Simulate a rig with moving fingers and send its touches as TUIO.

    Ctrl-C ends it.
    """
    host, port = tuio
    settings = Settings(
        cameras=CamerasSettings(source="simulated"),
        simulation=SimulationSettings(seed=seed, touches=touches, speed=speed),
        tuio=TuioSettings(destinations=(DestinationSettings(host=host, port=port),)),
        monitor=MonitorSettings(enabled=not no_monitor, port=monitor_port),
    )
    clock = MonotonicClock()
    ports = make_ports(settings, clock)  # its pictures get ready while the rig is calibrated
    calibration = find_calibration(settings, os.environ)
    with StopSignal() as stop, LogTail() as log:
        sink = make_tuio_sink(settings, calibration.surface_mm, "demo")
        daemon = Daemon(ports, calibration, [sink], settings, clock)
        click.echo(
            f"TUIO to {host}:{port}; see it with `cornertouchd listen`; Ctrl-C ends", err=True
        )
        health = HealthWatch(daemon, clock)
        answers = answers_of(daemon, health, log, "", lambda: NO_DISPLAYS, clock)
        socket = runtime_directory(os.environ) / SOCKET_NAME
        options = page_options(settings, socket, os.environ)
        with (
            AskSocket(socket, answers),
            MonitorProcess(lambda: options, clock, _say) as page,
        ):
            _work(daemon, health, page, stop, seconds)
    counts = daemon.fusion_counts()
    click.echo(f"{counts.frame_sets} frame sets, {counts.touches_begun} touches", err=True)


def _say(text: str) -> None:
    click.echo(text, err=True)


def _work(
    daemon: Daemon,
    health: HealthWatch,
    page: MonitorProcess,
    stop: StopSignal,
    seconds: float | None,
) -> None:
    """Run the daemon until the signal or the end of `seconds`; say every second how it does."""
    daemon.start()
    try:
        left_s = float("inf") if seconds is None else seconds
        while left_s > 0 and not stop.wait(min(LOOK_EVERY_S, left_s)):
            left_s -= LOOK_EVERY_S
            health.look()
            page.look()
            click.echo(_line(health.now), err=True)
    finally:
        daemon.stop()


def _line(health: Health) -> str:
    return (
        f"{health.frame_sets_per_s:4.0f} frame sets/s   "
        f"{sum(camera.live for camera in health.cameras)} cameras   "
        f"{health.fusion.touches_now:2d} touches   "
        f"{health.fusion.partial} partial, {health.fusion.skipped} skipped"
    )
