"""How cameras, their corners and their buses are shown: as tables, and as JSON."""

from collections.abc import Iterator
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Column, Table
from rich.text import Text

from cornertouchd.devices.camera_places import bus_mates
from cornertouchd.devices.camera_survey import Survey, SurveyedCamera
from cornertouchd.devices.usb_bandwidth import BusLoad

CORNER_NAMES = {"C1": "top-left", "C2": "top-right", "C3": "bottom-right", "C4": "bottom-left"}
MOST_MODES = 4
"""Lines of a table cell; --json has them all."""


def show_survey(survey: Survey) -> RenderableType:
    """Return the tables of cameras and buses, and below what is wrong with the remedy."""
    parts: list[RenderableType] = []
    if survey.cameras:
        parts.append(_cameras(survey))
    if survey.loads:
        parts.append(_buses(survey))
    parts += [Text(line) for line in complaints(survey)]
    return Group(*parts)


def complaints(survey: Survey) -> Iterator[str]:
    """Yield what is wrong, a line each with the remedy."""
    if not survey.cameras:
        yield "no cameras are plugged in"
    for corner, reason in survey.missing.items():
        yield f"camera {corner} ({CORNER_NAMES.get(corner, 'further')}): {reason}"
    for camera in survey.cameras:
        if camera.abilities.problem:
            yield f"{camera.place.node}: {camera.abilities.problem}"
        if len(camera.corners) > 1:
            corners = " and ".join(camera.corners)
            yield f"{camera.place.node}: is bound to {corners}; give each camera its own device"
        if camera.demand is not None and not camera.demand.fits_alone:
            yield (
                f"{camera.place.node}: none of its alternate settings carries "
                f"{camera.demand.bytes_s / 1e6:.1f} MB/s; lower cameras.rate_hz or the size"
            )
    for load in survey.loads:
        if load.remedy:
            yield load.remedy
    if survey.missing and any(not camera.corners for camera in survey.cameras):
        yield "to bind cameras to corners: `cornertouchd cameras --identify`"


def _cameras(survey: Survey) -> Table:
    node, port = Column("node", no_wrap=True), Column("USB port", no_wrap=True)
    table = Table("corner", node, port, "camera", "driver", "bus", "modes", "MB/s")
    for camera in survey.cameras:
        place, usb = camera.place, camera.place.usb
        table.add_row(
            ", ".join(camera.corners) or "-",
            place.node,
            usb.port if usb else "-",
            f"{place.name}\n{usb.kind} {usb.serial}".rstrip() if usb else place.name,
            place.driver,
            f"{usb.bus}, {usb.speed_mbit_s:g} Mbit/s" if usb else "-",
            _modes(camera),
            f"{camera.demand.bytes_s / 1e6:.1f}" if camera.demand else "-",
        )
    return table


def _modes(camera: SurveyedCamera) -> str:
    modes = camera.abilities.modes
    more = [f"and {len(modes) - MOST_MODES} more"] if len(modes) > MOST_MODES else []
    used = [f"uses {camera.abilities.pixel_format}"] if camera.abilities.pixel_format else []
    return "\n".join([*modes[:MOST_MODES], *more, *used])


def _buses(survey: Survey) -> Table:
    table = Table("bus", "speed", "cameras", "MB/s", "share", "limit", "")
    for load in survey.loads:
        table.add_row(
            str(load.bus),
            f"{load.speed_mbit_s:g} Mbit/s",
            ", ".join(load.nodes),
            f"{load.bytes_s / 1e6:.1f}",
            f"{load.share:.0%}",
            f"{load.limit:.0%}",
            "fits" if load.fits else "does not fit",
        )
    return table


def survey_json(survey: Survey) -> dict[str, Any]:
    """Return the same as values for `json.dumps`."""
    places = [camera.place for camera in survey.cameras]
    return {
        "cameras": [
            {
                "node": camera.place.node,
                "name": camera.place.name,
                "driver": camera.place.driver,
                "by_path": camera.place.by_path,
                "corners": list(camera.corners),
                "usb": _usb_json(camera),
                "shares_bus_with": [mate.node for mate in bus_mates(camera.place, places)],
                "modes": list(camera.abilities.modes),
                "pixel_format": camera.abilities.pixel_format,
                "bytes_s": camera.demand.bytes_s if camera.demand else None,
                "problem": camera.abilities.problem,
            }
            for camera in survey.cameras
        ],
        "missing": dict(survey.missing),
        "buses": [_load_json(load) for load in survey.loads],
        "complaints": list(complaints(survey)),
    }


def _usb_json(camera: SurveyedCamera) -> dict[str, Any] | None:
    usb = camera.place.usb
    if usb is None:
        return None
    return {
        "port": usb.port,
        "interface": usb.interface,
        "kind": usb.kind,
        "serial": usb.serial,
        "bus": usb.bus,
        "root_hub": usb.root_hub,
        "speed_mbit_s": usb.speed_mbit_s,
    }


def _load_json(load: BusLoad) -> dict[str, Any]:
    return {
        "bus": load.bus,
        "speed_mbit_s": load.speed_mbit_s,
        "nodes": list(load.nodes),
        "bytes_s": load.bytes_s,
        "share": round(load.share, 4),
        "limit": load.limit,
        "fits": load.fits,
        "remedy": load.remedy,
    }
