"""Checks of the USB buses: whether the pictures of all cameras fit."""

from collections.abc import Iterator
from functools import partial

from cornertouchd.devices.camera_survey import survey_cameras
from cornertouchd.devices.usb_bandwidth import BusLoad
from cornertouchd.guiding.finding import Finding, well, wrong
from cornertouchd.runtime.checks.installation import Installation


def bandwidth_of(installation: Installation) -> Iterator[Finding]:
    """Yield how full each bus with cameras is; cameras at work are only asked what they can."""
    cameras = installation.settings.cameras
    if cameras.source == "simulated":
        return
    look = partial(
        installation.look,
        pixel_format=cameras.pixel_format,
        size_px=(cameras.width_px, cameras.height_px),
        rate_hz=cameras.rate_hz,
    )
    survey = survey_cameras(cameras, look, installation.sysfs, installation.dev)
    used = [camera for camera in survey.cameras if camera.corners] or survey.cameras
    for camera in used:
        if camera.demand is not None and not camera.demand.fits_alone:
            yield wrong(
                "bandwidth",
                f"{camera.place.node} cannot send {camera.demand.bytes_s / 1e6:.1f} MB/s",
                "lower cameras.rate_hz or the size of the pictures, or choose MJPG or GREY "
                "(cameras.pixel_format)",
            )
    for load in survey.loads:
        yield _load(load)


def _load(load: BusLoad) -> Finding:
    text = (
        f"bus {load.bus}, {load.speed_mbit_s:g} Mbit/s: {', '.join(load.nodes)} take "
        f"{load.share:.0%}, at most {load.limit:.0%} are theirs"
    )
    return well("bandwidth", text) if load.fits else wrong("bandwidth", text, load.remedy)
