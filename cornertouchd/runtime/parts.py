"""The parts of a daemon, made from a configuration; those of the next one, where they differ."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.calibration.file import same_calibration
from cornertouchd.config import Settings, find_settings, read_settings
from cornertouchd.ports import CameraPlug, CameraPort, Clock, TouchSink
from cornertouchd.runtime.assembly import (
    calibration_file,
    find_calibration,
    make_plugs,
    make_ports,
    make_tuio_sink,
)
from cornertouchd.runtime.displays import Displays, find_displays
from cornertouchd.runtime.led_light import LedLight, make_light
from cornertouchd.runtime.screens import make_screens

BEHIND_THE_SINKS = ("tuio", "screens", "monitor", "runtime")
"""Settings that no picture and no touch depends on."""


@dataclass(frozen=True, slots=True)
class Parts:
    """What a configuration and the files that it names give; `path` is None for the defaults."""

    path: Path | None
    settings: Settings
    calibration: Calibration
    displays: Displays
    ports: Sequence[CameraPort]
    sinks: Sequence[TouchSink]
    plugs: Mapping[str, CameraPlug]
    light: LedLight | None = None

    def sees_as(self, other: "Parts") -> bool:
        """Tell whether the same pictures would give the same touches."""
        left_out = set(BEHIND_THE_SINKS)
        return self.settings.model_dump(exclude=left_out) == other.settings.model_dump(
            exclude=left_out
        ) and same_calibration(self.calibration, other.calibration)


def make_parts(
    config_file: Path | None,
    environ: Mapping[str, str],
    clock: Clock,
    before: Parts | None = None,
) -> Parts:
    """Return the parts; of those `before`, what would be made alike is kept.

    Raises `ConfigError` or `CalibrationError`.
    """
    path = find_settings(config_file, environ)
    settings = read_settings(path) if path else Settings()
    calibration = find_calibration(settings, environ)
    displays = find_displays(settings, calibration_file(settings, environ))
    ports = _ports(settings, clock, before)
    alike = before is not None and (
        before.settings.tuio == settings.tuio
        and before.settings.screens == settings.screens
        and before.displays == displays
        and before.calibration.surface_mm == calibration.surface_mm
    )
    sinks: Sequence[TouchSink] = (
        before.sinks
        if before is not None and alike
        else (
            make_tuio_sink(settings, calibration.surface_mm, _name(path), displays),
            *make_screens(settings, calibration.surface_mm, _name(path), displays),
        )
    )
    light = before.light if before is not None else None
    if light is None or not light.fits(settings, calibration):
        light = make_light(settings, calibration)
    return Parts(path, settings, calibration, displays, ports, sinks, make_plugs(settings), light)


def _name(path: Path | None) -> str:
    """Return what tells this configuration from others on the same machine."""
    return os.fspath(path.resolve()) if path else ""


def _ports(settings: Settings, clock: Clock, before: Parts | None) -> Sequence[CameraPort]:
    """Return the ports; a camera whose own settings are the same keeps the one it has."""
    if before is None:
        return make_ports(settings, clock)
    kept = {
        port.id: port
        for port in before.ports
        if port.id in settings.cameras.enabled_ids
        and _camera_settings(settings, port.id) == _camera_settings(before.settings, port.id)
    }
    if len(kept) == len(settings.cameras.enabled_ids):
        return tuple(kept[camera] for camera in settings.cameras.enabled_ids)
    return tuple(kept.get(port.id, port) for port in make_ports(settings, clock))


def _camera_settings(settings: Settings, camera: str) -> object:
    """Return everything that the opening and reading of one camera depends on."""
    cameras = settings.cameras
    own = cameras.model_copy(update={"units": {camera: cameras.units[camera]}})
    if cameras.source == "simulated":  # its rig is made of more
        return own, settings.surface, settings.simulation
    return own
