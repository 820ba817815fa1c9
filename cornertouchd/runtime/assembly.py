"""From settings to the parts of a daemon: cameras, calibration, sinks.

What only some rigs need is imported where they need it: OpenCV's reader, the simulation and the
fitting of its calibration take a quarter of a second, for which touches would be missing after
every start (benchmarks/restart.py).
"""

import socket
import time
from collections.abc import Mapping
from pathlib import Path

from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.calibration.file import load_calibration
from cornertouchd.config import CameraSettings, Settings
from cornertouchd.devices.camera_plug import DevicePlug
from cornertouchd.devices.stream_hub import StreamHub
from cornertouchd.devices.tuio_sink import TuioSink, local_address
from cornertouchd.devices.v4l2_camera import V4l2CameraPort
from cornertouchd.model import PictureFormat
from cornertouchd.places import state_directory
from cornertouchd.ports import CameraPlug, CameraPort, Clock
from cornertouchd.runtime.displays import NO_DISPLAYS, Displays, display_mapping
from cornertouchd.runtime.tuio_receivers import make_receivers
from cornertouchd.wire.tuio import default_source_name, seed_at

SAME_SURFACE_MM = 0.5
"""Two figures for the same surface, rounded by whoever measured."""


def make_ports(settings: Settings, clock: Clock) -> tuple[CameraPort, ...]:
    """Return the cameras that the settings name."""
    cameras = settings.cameras
    if cameras.source == "simulated":
        from cornertouchd.runtime.simulated_ports import simulated_ports  # noqa: PLC0415

        return simulated_ports(settings, clock)
    return tuple(_real_camera(settings, camera, clock) for camera in cameras.enabled_ids)


def _real_camera(settings: Settings, camera_id: str, clock: Clock) -> CameraPort:
    cameras = settings.cameras
    device = cameras.units[camera_id].device
    pictures = picture_format(settings, cameras.units[camera_id])
    if cameras.source == "opencv":
        from cornertouchd.devices.opencv_camera import OpenCvCameraPort  # noqa: PLC0415

        return OpenCvCameraPort(camera_id, device, pictures, cameras.rate_hz, clock.now_s)
    return V4l2CameraPort(
        camera_id,
        device,
        pictures,
        cameras.rate_hz,
        clock.now_s,
        cameras.pixel_format,
        cameras.controls_of(camera_id),
    )


def make_plugs(settings: Settings) -> Mapping[str, CameraPlug]:
    """Return where the cameras are plugged in.

    Only of those that are read by V4L2: no other reader tells a camera that is in use by another
    program from one that needs to be reset.
    """
    cameras = settings.cameras
    if cameras.source != "v4l2":
        return {}
    return {camera: DevicePlug(cameras.units[camera].device) for camera in cameras.enabled_ids}


def picture_format(settings: Settings, camera: CameraSettings) -> PictureFormat:
    """Return the size and rows of one camera's pictures."""
    width_px, height_px = settings.cameras.width_px, settings.cameras.height_px
    rows_px = camera.rows_px or height_px - camera.row_offset_px
    return PictureFormat(width_px, height_px, camera.row_offset_px, rows_px)


def find_calibration(settings: Settings, environ: Mapping[str, str]) -> Calibration:
    """Return the calibration that the daemon works with.  Raises `CalibrationError`.

    A simulated rig calibrates itself unless a file is set.
    """
    if settings.cameras.source == "simulated" and not settings.calibration.file:
        from cornertouchd.runtime.simulated_rig import calibrated_rig  # noqa: PLC0415

        return calibrated_rig(settings, environ)
    path = calibration_file(settings, environ)
    calibration = load_calibration(path)
    require_surface(
        calibration, (settings.surface.width_mm, settings.surface.height_mm), "the configuration"
    )
    return calibration


def require_surface(calibration: Calibration, surface_mm: tuple[float, float], whose: str) -> None:
    """Raise `CalibrationError` unless a surface has the size that was calibrated."""
    if any(
        abs(ours - theirs) > SAME_SURFACE_MM
        for ours, theirs in zip(calibration.surface_mm, surface_mm, strict=True)
    ):
        calibrated = "x".join(f"{side:g}" for side in calibration.surface_mm)
        given = "x".join(f"{side:g}" for side in surface_mm)
        raise CalibrationError(
            f"the surface is {given} mm in {whose}, {calibrated} mm in the calibration; "
            "correct surface.width_mm and height_mm, or calibrate again"
        )


def calibration_file(settings: Settings, environ: Mapping[str, str]) -> Path:
    """Return where the calibration is kept."""
    given = settings.calibration.file
    return Path(given) if given else state_directory(environ) / "calibration.json"


def make_tuio_sink(
    settings: Settings,
    surface_mm: tuple[float, float],
    config_file: str,
    displays: Displays = NO_DISPLAYS,
) -> TuioSink:
    """Return the sink that tells all receivers of touches on a surface of this size.

    `config_file` tells two daemons on one machine apart; `displays` are where displays were found
    to lie.
    """
    tuio = settings.tuio
    address = local_address(tuio.destinations[0].host) if tuio.destinations else "127.0.0.1"
    name = tuio.source_name
    source = (
        f"{name}@{address}"
        if name
        else default_source_name(socket.gethostname(), config_file, address)
    )
    seed = seed_at(time.time())
    hub = StreamHub()
    receivers = make_receivers(tuio, hub, lambda to: display_mapping(surface_mm, to, displays))
    return TuioSink(receivers, source, seed, seed, hub=hub)
