"""What cameras are there, what they can, which corner each is bound to, and whether they fit."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.config import CamerasSettings
from cornertouchd.devices.camera_places import (
    DEV,
    CameraPlace,
    PlaceError,
    camera_places,
    device_path,
)
from cornertouchd.devices.usb_bandwidth import BusLoad, Demand, bus_loads, demand
from cornertouchd.devices.usb_sysfs import SYSFS


@dataclass(frozen=True, slots=True)
class CameraAbilities:
    """What a node says of itself.

    `modes` are its formats, sizes and rates in words, those of the configured size first.
    `pixel_format` is the one that would be used, empty with a `problem`: why it cannot be used as
    configured.  What does not capture is no camera.
    """

    captures: bool
    modes: tuple[str, ...] = ()
    pixel_format: str = ""
    problem: str = ""


@dataclass(frozen=True, slots=True)
class SurveyedCamera:
    """A camera that is plugged in; `corners` are the names of those it is bound to."""

    place: CameraPlace
    abilities: CameraAbilities
    corners: tuple[str, ...]
    demand: Demand | None


@dataclass(frozen=True, slots=True)
class Survey:
    """All cameras that are plugged in, the corners that lack theirs and why, and the buses.

    The loads count the cameras that are bound; all of them if none is.
    """

    cameras: tuple[SurveyedCamera, ...]
    missing: Mapping[str, str]
    loads: tuple[BusLoad, ...]

    @property
    def bound(self) -> dict[str, CameraPlace]:
        """Where the camera of each corner is plugged in."""
        return {
            corner: camera.place
            for camera in sorted(self.cameras, key=lambda one: one.corners)
            for corner in camera.corners
        }


def survey_cameras(
    settings: CamerasSettings,
    look: Callable[[str], CameraAbilities],
    sysfs: Path = SYSFS,
    dev: Path = DEV,
) -> Survey:
    """Look at all cameras.  `look` asks a node what it can."""
    nodes, missing = _bindings(settings, sysfs, dev)
    cameras = []
    for place in camera_places(sysfs, dev):
        abilities = look(place.node)
        if not abilities.captures:
            continue
        corners = tuple(corner for corner, node in nodes.items() if node == place.node)
        cameras.append(
            SurveyedCamera(place, abilities, corners, _demand(place, abilities, settings))
        )
    seen = {corner for camera in cameras for corner in camera.corners}
    missing |= {
        corner: f"{node} is no camera" for corner, node in nodes.items() if corner not in seen
    }
    used = [camera for camera in cameras if camera.corners] or cameras
    return Survey(tuple(cameras), dict(sorted(missing.items())), bus_loads(list(_demands(used))))


def _bindings(
    settings: CamerasSettings, sysfs: Path, dev: Path
) -> tuple[dict[str, str], dict[str, str]]:
    """Return the nodes of the corners, and why the others have none."""
    nodes, missing = {}, {}
    for corner in settings.enabled_ids:
        device = settings.units[corner].device
        try:
            node = Path(device_path(device, sysfs))
        except PlaceError as error:
            missing[corner] = str(error)
            continue
        if str(node) == device:  # a path: perhaps a link of udev
            file = dev / device.removeprefix("/dev/")
            if not file.exists():
                missing[corner] = f"{device} is not there"
                continue
            node = file.resolve()
        nodes[corner] = f"/dev/{node.name}"
    return nodes, missing


def _demand(
    place: CameraPlace, abilities: CameraAbilities, settings: CamerasSettings
) -> Demand | None:
    if place.usb is None or not abilities.pixel_format:
        return None
    return demand(
        place.node,
        place.usb.directory,
        abilities.pixel_format,
        settings.width_px,
        settings.height_px,
        settings.rate_hz,
    )


def _demands(cameras: Sequence[SurveyedCamera]) -> Iterator[Demand]:
    for camera in cameras:
        if camera.demand is not None:
            yield camera.demand
