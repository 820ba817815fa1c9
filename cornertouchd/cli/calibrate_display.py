"""`cornertouchd calibrate display`: four taps fix where the display lies on the surface."""

import os
import re
from pathlib import Path

import click

from cornertouchd.calibration.display import fit_display, fit_perspective, save_display
from cornertouchd.cli.following import follow, shown_page
from cornertouchd.cli.guided_rig import guided_rig
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.cli.working import require_writable
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.config.output import DISPLAY_NAME, LONGEST_DISPLAY_NAME
from cornertouchd.guiding.display_taps import DisplayTaps, TappedCorners, watch_with
from cornertouchd.runtime.assembly import calibration_file, find_calibration
from cornertouchd.runtime.displays import display_file
from cornertouchd.runtime.stamping import stamp_now
from cornertouchd.runtime.stop_signal import StopSignal

_PATH = click.Path(path_type=Path)


@click.command()
@click.option("--config", "config_file", type=_PATH, help="Settings.")
@click.option(
    "--inset",
    type=FiniteRange(0.0, 0.4),
    default=0.0,
    show_default=True,
    help="Tap this share of the picture's sides inside its corners: 0.1 is a tenth.",
)
@click.option(
    "--name",
    default="",
    callback=lambda _context, _option, name: _checked(name),
    help="Name of the display, if the surface has several; as `display` of who is to have it.",
)
@click.option(
    "--perspective",
    is_flag=True,
    help="The picture may be turned a little, or a trapezium as projectors throw it.",
)
@click.option("--output", type=_PATH, help="File; else display.json in the state directory.")
@click.option("--simulate", is_flag=True, help="On the simulated rig.")
@click.option("--finger", type=_PATH, help="With --simulate: as for `cornertouchd calibrate`.")
@click.option("--page", is_flag=True, help="Show the corners in browsers, too.")
@click.option("--forget", is_flag=True, help="The display fills the surface again.")
def display(
    config_file: Path | None,
    inset: float,
    name: str,
    perspective: bool,
    output: Path | None,
    simulate: bool,
    finger: Path | None,
    page: bool,
    forget: bool,
) -> None:
    """Fix where the display lies on the surface.

    Tap the corners of the picture as you see it: top left, top right, bottom right, bottom left.
    Touches are then told in the picture's own coordinates, also when it is turned or mirrored.
    Destinations and touchscreens whose display settings are not at their defaults keep those.
    """
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    output = output or _usual_output(settings, simulate, name)
    if forget:
        _forget(output)
        return
    require_writable(output)
    if simulate:
        cameras = settings.cameras.model_copy(update={"source": "simulated"})
        settings = settings.model_copy(update={"cameras": cameras})
    calibration = find_calibration(settings, os.environ)
    with (
        guided_rig(settings, simulate, finger) as rig,
        StopSignal() as stop,
        shown_page(settings, page, inset=inset) as shown,
    ):
        for port in rig.ports:
            calibration.camera(port.id).require_camera(port.format, port.identity)
        watch = watch_with(calibration, [port.id for port in rig.ports], settings.vision)
        tapped = follow(DisplayTaps(watch), rig, settings, stop, ("display",), shown)
        if shown is not None and isinstance(tapped, TappedCorners):
            shown.finish("all four corners are there")
    if not isinstance(tapped, TappedCorners):
        raise click.ClickException("stopped; nothing was saved")
    surface_mm = (settings.surface.width_mm, settings.surface.height_mm)
    fit = fit_perspective if perspective else fit_display
    place = fit(tapped.places_mm, surface_mm, inset, stamp_now().created_at)
    save_display(place, output)
    mirrored = ", mirrored" if place.mirror else ""
    click.echo(
        f"the picture is {place.width_mm:.1f} x {place.height_mm:.1f} mm, {place.left_mm:.1f} mm "
        f"from the left and {place.top_mm:.1f} mm from the top, turned by {place.rotation_deg} "
        f"degrees{mirrored}; taps fit to {place.residual_mm:.1f} mm; saved {output}",
        err=True,
    )


def _forget(file: Path) -> None:
    try:
        file.unlink()
    except FileNotFoundError:
        click.echo(f"{file}: there is none", err=True)
    except OSError as error:
        raise click.ClickException(f"{file}: cannot be removed: {error.strerror}") from error
    else:
        click.echo(f"{file}: removed", err=True)


def _usual_output(settings: Settings, simulate: bool, name: str) -> Path:
    """Return the file that the daemon reads; a simulated display must not take its place."""
    usual = display_file(calibration_file(settings, os.environ), name)
    return usual.with_name(f"simulated-{usual.name}") if simulate else usual


def _checked(name: str) -> str:
    """Return a name that the settings would take, too."""
    if len(name) > LONGEST_DISPLAY_NAME or not re.fullmatch(DISPLAY_NAME, name):
        raise click.BadParameter(
            f"{name!r} must be up to {LONGEST_DISPLAY_NAME} letters, digits, - and _"
        )
    return name
