"""`cornertouchd cameras`: what is plugged in, which corner it is bound to, and how to bind it."""

import json
import os
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import click
from rich.console import Console

from cornertouchd.cli.camera_table import CORNER_NAMES, show_survey, survey_json
from cornertouchd.cli.identify_cameras import PicturesInTurn, confirmed, identify
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.config.rig import CAMERA_IDS
from cornertouchd.devices.camera_abilities import look_at_node
from cornertouchd.devices.camera_places import CameraPlace, camera_places
from cornertouchd.devices.camera_survey import Survey, survey_cameras
from cornertouchd.devices.opencv_camera import OpenCvCameraPort
from cornertouchd.devices.udev_rules import RULES_FILE, render_rules
from cornertouchd.devices.v4l2_camera import V4l2CameraPort
from cornertouchd.model import PictureFormat
from cornertouchd.ports import CameraPort
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.led_desk import shining
from cornertouchd.runtime.stop_signal import StopSignal


@click.command()
@click.option("--json", "as_json", is_flag=True, help="The same as JSON, with all modes.")
@click.option("--identify", "identifying", is_flag=True, help="Cover lenses to tell corners.")
@click.option("--udev-rules", is_flag=True, help="Write rules for /dev/cornertouch/c1 and so on.")
@click.option(
    "--output",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File for the rules; else they go to stdout.",
)
@click.option("--config", "config_file", type=click.Path(path_type=Path), help="Settings.")
def cameras(
    as_json: bool,
    identifying: bool,
    udev_rules: bool,
    output: Path | None,
    config_file: Path | None,
) -> None:
    """Show what cameras there are and bind them to corners.

    With --identify, cover the lens of one camera after the other: it tells which one stands in
    which corner, and offers to write the udev rules that give them lasting names.  --udev-rules
    writes these for the cameras that are bound already.
    """
    path = find_settings(config_file, os.environ)
    settings = read_settings(path) if path else Settings()
    if identifying:
        _identify(settings, output)
    elif udev_rules:
        _write_rules(_survey(settings).bound, output)
    elif as_json:
        click.echo(json.dumps(survey_json(_survey(settings)), indent=2))
    else:
        Console().print(show_survey(_survey(settings)))


def _survey(settings: Settings) -> Survey:
    look = partial(
        look_at_node,
        pixel_format=settings.cameras.pixel_format,
        size_px=(settings.cameras.width_px, settings.cameras.height_px),
        rate_hz=settings.cameras.rate_hz,
    )
    return survey_cameras(settings.cameras, look)


def _write_rules(bound: Mapping[str, CameraPlace], output: Path | None) -> None:
    if not bound:
        raise click.ClickException(
            "no camera is bound to a corner yet: run `cornertouchd cameras --identify`, or set "
            'device = "port:..." of each camera in the configuration'
        )
    rules = render_rules(bound)
    if output is None:
        click.echo(rules, nl=False)
        click.echo(f"install these lines as {RULES_FILE} (see --output)", err=True)
        return
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(rules, encoding="utf-8")
    except OSError as error:
        raise click.ClickException(f"{output}: cannot be written: {error.strerror}") from error
    click.echo(f"{output}: names for {', '.join(bound)}", err=True)
    click.echo(
        "udevadm control --reload && udevadm trigger --action=add --settle   lets it take effect",
        err=True,
    )


def _identify(settings: Settings, output: Path | None) -> None:
    found = _ask_for_corners(settings)
    if not found:
        raise click.ClickException("no camera was identified; nothing is bound")
    for corner, place in found.items():
        click.echo(f"{corner} {place.node} {_device(place)} {place.name}")
    for corner, place in found.items():
        click.echo(f'[cameras.{corner}]\ndevice = "{_device(place)}"')
    if output is not None:
        _write_rules(found, output)
    elif confirmed(f"write udev rules for /dev/cornertouch/... to {RULES_FILE}?"):
        _write_rules(found, Path(RULES_FILE))
    else:
        click.echo("put the lines above into the configuration to bind the cameras", err=True)


def _ask_for_corners(settings: Settings) -> dict[str, CameraPlace]:
    """Return where the camera of each corner is, as far as the user has shown it."""
    corners = {
        f"{corner} ({CORNER_NAMES[corner]})" if corner in CORNER_NAMES else corner: corner
        for corner in settings.cameras.enabled_ids
    }
    places, ports = _all_cameras(settings)
    nodes = {camera: place.node for camera, place in places.items()}
    found: dict[str, CameraPlace] = {}
    with (
        StopSignal() as stop,
        shining(settings),
        PicturesInTurn(ports, nodes, _tell) as pictures,
    ):
        for corner, node in identify(tuple(corners), pictures, _tell, lambda: stop.wait(0.0)):
            found[corners[corner]] = next(one for one in places.values() if one.node == node)
            _tell(f"{corner} is {node}")
    return found


def _all_cameras(settings: Settings) -> tuple[dict[str, CameraPlace], tuple[CameraPort, ...]]:
    """Return all cameras that are plugged in, read as those of the rig are, by their nodes."""
    if settings.cameras.source == "simulated":
        raise click.ClickException(
            'cameras.source is "simulated": there is nothing to identify; set it to "v4l2"'
        )
    found = dict(zip(CAMERA_IDS, camera_places(), strict=False))
    return found, tuple(_port(name, place, settings) for name, place in found.items())


def _port(name: str, place: CameraPlace, settings: Settings) -> CameraPort:
    """Return a camera of which all rows are read."""
    cameras, clock = settings.cameras, MonotonicClock()
    whole = PictureFormat(cameras.width_px, cameras.height_px, 0, cameras.height_px)
    if cameras.source == "opencv":
        return OpenCvCameraPort(name, place.node, whole, cameras.rate_hz, clock.now_s)
    return V4l2CameraPort(
        name, place.node, whole, cameras.rate_hz, clock.now_s, cameras.pixel_format
    )


def _device(place: CameraPlace) -> str:
    """Return the lasting name of a camera for the configuration."""
    return f"port:{place.usb.port}" if place.usb else place.node


def _tell(text: str) -> None:
    click.echo(text, err=True)
