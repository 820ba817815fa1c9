"""`cornertouchd demo`: a simulated rig with moving fingers, through the whole daemon."""

import os

import click

from cornertouchd.cli.targets import FiniteRange, HostPort
from cornertouchd.cli.working import work
from cornertouchd.config import (
    CamerasSettings,
    DestinationSettings,
    Settings,
    SimulationSettings,
    TuioSettings,
)
from cornertouchd.runtime.assembly import find_calibration, make_ports, make_tuio_sink
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.daemon import Daemon
from cornertouchd.runtime.stop_signal import StopSignal


@click.command()
@click.option("--seconds", type=FiniteRange(min=0, min_open=True), help="End by itself.")
@click.option(
    "--touches", type=click.IntRange(0, 20), default=5, show_default=True, help="Moving fingers."
)
@click.option(
    "--tuio", type=HostPort(), default="127.0.0.1:3333", show_default=True, help="TUIO client."
)
@click.option("--no-monitor", is_flag=True, help="Without the live page (there is none yet).")
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
    no_monitor: bool,  # noqa: ARG001  accepted so that scripts need not change when the page comes
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
    )
    clock = MonotonicClock()
    ports = make_ports(settings, clock)  # its pictures get ready while the rig is calibrated
    calibration = find_calibration(settings, os.environ)
    with StopSignal() as stop:
        sink = make_tuio_sink(settings, calibration.surface_mm, "demo")
        daemon = Daemon(ports, calibration, [sink], settings, clock)
        click.echo(
            f"TUIO to {host}:{port}; see it with `cornertouchd listen`; Ctrl-C ends", err=True
        )
        work(daemon, stop, seconds, _Report())
    counts = daemon.fusion_counts()
    click.echo(f"{counts.frame_sets} frame sets, {counts.touches_begun} touches", err=True)


class _Report:
    """Prints one line a second: how it goes."""

    def __init__(self) -> None:
        self._frame_sets = 0

    def __call__(self, daemon: Daemon) -> None:
        counts = daemon.fusion_counts()
        cameras = daemon.camera_counts().values()
        click.echo(
            f"{counts.frame_sets - self._frame_sets:4d} frame sets/s   "
            f"{sum(camera.live for camera in cameras)} cameras   "
            f"{counts.touches_now:2d} touches   "
            f"{counts.partial} partial, {counts.skipped} skipped",
            err=True,
        )
        self._frame_sets = counts.frame_sets
