"""`cornertouchd calibrate`: from recordings of taps to a calibration file."""

import os
from datetime import UTC, datetime
from pathlib import Path

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from cornertouchd import __version__
from cornertouchd.calibration.calibration import Calibration, Method
from cornertouchd.calibration.file import save_calibration
from cornertouchd.calibration.joint_fit import TouchColumns
from cornertouchd.calibration.methods import Stamp
from cornertouchd.calibration.methods import calibrate as fit
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.devices.recording import open_recording, read_points
from cornertouchd.runtime.recorded_touches import gather_recorded


@click.command()
@click.option(
    "--recording",
    "directory",
    type=click.Path(path_type=Path),
    required=True,
    help="Recording of taps at known places, one a frame set.",
)
@click.option(
    "--points",
    "points_file",
    type=click.Path(path_type=Path),
    help="Where the taps were; else points.csv of the recording.",
)
@click.option(
    "--scribble",
    "scribble_directory",
    type=click.Path(path_type=Path),
    help="Recording of one finger at unknown places (method auto).",
)
@click.option(
    "--empty",
    "empty_directory",
    type=click.Path(path_type=Path),
    required=True,
    help="Recording of the empty surface.",
)
@click.option("--output", type=click.Path(path_type=Path), required=True, help="Calibration file.")
@click.option(
    "--method",
    type=click.Choice(["auto", "vanishing-point"]),
    default="auto",
    show_default=True,
    help="auto is our best; vanishing-point is the paper's, section 6.1.2.",
)
@click.option(
    "--tap-sigma-mm",
    type=FiniteRange(0.01, 20.0),
    default=0.5,
    show_default=True,
    help="How far taps are off their places (standard deviation).",
)
@click.option("--config", "config_file", type=click.Path(path_type=Path), help="Settings.")
def calibrate(
    directory: Path,
    points_file: Path | None,
    scribble_directory: Path | None,
    empty_directory: Path,
    output: Path,
    method: Method,
    tap_sigma_mm: float,
    config_file: Path | None,
) -> None:
    """Calibrate from recordings and save the result."""
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    taps = open_recording(directory)
    points = read_points(points_file or directory / "points.csv")
    scribble = open_recording(scribble_directory) if scribble_directory else None
    given = gather_recorded(
        taps, points, scribble, open_recording(empty_directory), settings.vision
    )
    stamp = Stamp(datetime.now(UTC).isoformat(timespec="seconds"), __version__)
    calibration = fit(method, given, tap_sigma_mm, stamp)
    save_calibration(calibration, output)
    _print(calibration, given.touches, output)


def _print(calibration: Calibration, touches: TouchColumns, output: Path) -> None:
    seen = np.isfinite(touches.columns_px).all(axis=2)
    table = Table(title=f"{calibration.method}: {calibration.reference_points} reference points")
    for title in ("camera", "position mm", "touches seen", "residual mm"):
        table.add_column(title, justify="left" if title == "camera" else "right")
    for camera, count in zip(calibration.cameras, seen.sum(axis=1).tolist(), strict=True):
        x, y = camera.model.position_mm
        table.add_row(
            camera.id,
            f"{x:.1f}, {y:.1f}",
            f"{count} of {seen.shape[1]}",
            f"{camera.residual_mm:.3f}",
        )
    console = Console(stderr=True)
    console.print(table)
    console.print(f"residual {calibration.residual_mm:.3f} mm; saved {output}", highlight=False)
