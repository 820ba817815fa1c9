"""Checks of the cameras: whether they are there and give the pictures that were calibrated."""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path

from cornertouchd.calibration.calibration import CalibrationError, CameraCalibration
from cornertouchd.devices.camera_places import PlaceError, device_path
from cornertouchd.devices.usb_sysfs import usb_device_above
from cornertouchd.guiding.checking import InForce, check_camera
from cornertouchd.guiding.finding import Finding, doubtful, well, wrong
from cornertouchd.model import Frame
from cornertouchd.ports import CameraError, CameraPort
from cornertouchd.runtime.assembly import find_calibration
from cornertouchd.runtime.checks.installation import Installation
from cornertouchd.runtime.led_desk import LedFrameError, shining

LOOK_S = 1.5
FIRST_PICTURE_S = 5.0
SLOWEST_SHARE = 0.9
"""Of the rate that is set; drivers that have only near rates round by less."""


def cameras_of(installation: Installation) -> Iterator[Finding]:
    """Yield what is to be said of each camera, looked at all at once, as the daemon does."""
    if installation.is_running:
        yield well("cameras", f"are in use by {installation.unit}, so they are not opened here")
    else:
        ports = installation.ports()
        calibrated = _calibrated(installation)
        with ExitStack() as lit, ThreadPoolExecutor(max(1, len(ports))) as at_once:
            with suppress(LedFrameError):  # another finding tells it
                lit.enter_context(shining(installation.settings))
            looks = [
                at_once.submit(_camera, port, installation, calibrated.get(port.id))
                for port in ports
            ]
            for look in looks:
                yield from look.result()
    if installation.settings.cameras.source != "simulated":
        yield from _suspended(installation)


def _calibrated(installation: Installation) -> dict[str, tuple[CameraCalibration, InForce]]:
    if installation.settings.cameras.source == "simulated":
        return {}
    try:
        calibration = find_calibration(installation.settings, installation.environ)
    except CalibrationError:  # another check tells it
        return {}
    return {
        camera.id: (camera, InForce(camera, calibration.surface_mm))
        for camera in calibration.cameras
    }


def _camera(
    port: CameraPort,
    installation: Installation,
    calibrated: tuple[CameraCalibration, InForce] | None,
) -> list[Finding]:
    subject = f"camera {port.id}"
    try:
        frames = _pictures(port, installation)
    except CameraError as error:
        return [wrong(subject, error.reason, "`cornertouchd cameras` shows what is plugged in")]
    if not frames:
        return [wrong(subject, "gives no pictures", "check cable, power and trigger")]
    found = [_rate(subject, frames, installation.settings.cameras.rate_hz)]
    if calibrated is not None:
        try:
            calibrated[0].require_camera(port.format, port.identity)
        except CalibrationError as error:
            return [*found, wrong(subject, str(error), "cornertouchd calibrate")]
    looked_at = check_camera(
        port.id,
        [frame.pixels for frame in frames],
        in_force=None if calibrated is None else calibrated[1],
    )
    for one in looked_at.findings:
        text, _, remedy = one.text.rpartition(": ")
        make = wrong if one.severity == "bad" else doubtful
        found.append(make(subject, text or one.text, remedy if text else "see docs/calibration.md"))
    return found


def _pictures(port: CameraPort, installation: Installation) -> Sequence[Frame]:
    camera = port.open()
    try:
        frames: list[Frame] = []
        until_s = installation.clock.now_s() + FIRST_PICTURE_S
        while (now_s := installation.clock.now_s()) < until_s:
            frame = camera.read(until_s - now_s)
            if frame is None:
                break
            if not frames:
                until_s = installation.clock.now_s() + LOOK_S
            pixels = frame.pixels.copy()  # the camera uses its buffers again
            frames.append(
                Frame(frame.camera, frame.sequence, frame.captured_at_s, frame.lit_mask, pixels)
            )
        return frames
    finally:
        camera.close()


def _rate(subject: str, frames: Sequence[Frame], asked_hz: float) -> Finding:
    span_s = frames[-1].captured_at_s - frames[0].captured_at_s
    given_hz = (len(frames) - 1) / span_s if span_s > 0 else 0.0
    text = f"{given_hz:.0f} of {asked_hz:g} pictures/s"
    if given_hz < SLOWEST_SHARE * asked_hz:
        return doubtful(
            subject,
            text,
            "shorten the exposure below the period; look whether the bus carries it: "
            "`cornertouchd cameras`; else lower cameras.rate_hz",
        )
    return well(subject, text)


def _suspended(installation: Installation) -> Iterator[Finding]:
    """Yield the cameras that the kernel may put to sleep."""
    for camera_id in installation.settings.cameras.enabled_ids:
        device = installation.settings.cameras.units[camera_id].device
        usb = _usb_device(device, installation.sysfs)
        control = None if usb is None else usb / "power" / "control"
        if control is not None and _text(control) == "auto":
            yield doubtful(
                f"camera {camera_id}",
                "may be suspended to save power, and then comes late or not at all",
                f"install systemd/60-cornertouchd.rules, or echo on > {control}",
            )


def _usb_device(device: str, sysfs: Path) -> Path | None:
    """Return the USB device of a camera in sysfs, None if it is not there or not on USB."""
    try:
        node = Path(device_path(device, sysfs)).resolve().name
    except PlaceError:  # another finding tells it
        return None
    video = sysfs / "class" / "video4linux" / node
    return usb_device_above(video) if video.exists() else None


def _text(path: Path) -> str:
    try:
        return path.read_text().strip()
    except OSError:
        return ""
