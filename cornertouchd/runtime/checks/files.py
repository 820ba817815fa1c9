"""Checks of what is kept: the calibration, compiled kernels, space for more."""

import os
import shutil
import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.compiling import compiled_directory
from cornertouchd.guiding.finding import Finding, doubtful, well, wrong
from cornertouchd.runtime.assembly import calibration_file, find_calibration
from cornertouchd.runtime.checks.installation import Installation

OLD_DAYS = 365
"""Frames warp and lenses slip over seasons; a rig that has been through all of them has moved."""

LEAST_BYTES, ENOUGH_BYTES = 10_000_000, 100_000_000
"""A calibration takes half a megabyte, twice that while it is replaced; compiled kernels ten."""


def calibration_of(installation: Installation) -> Iterator[Finding]:
    """Yield whether there is a calibration, how old it is and whether it fits the cameras."""
    settings = installation.settings
    if settings.cameras.source == "simulated" and not settings.calibration.file:
        yield well("calibration", "the simulated rig calibrates itself")
        return
    path = calibration_file(settings, installation.environ)
    try:
        calibration = find_calibration(settings, installation.environ)
    except CalibrationError as error:
        yield wrong("calibration", str(error), "cornertouchd calibrate")
        return
    yield _age(calibration, path)
    if not path.stat().st_mode & 0o004:
        yield doubtful("calibration", f"{path} can only be read by its owner", f"chmod a+r {path}")
    for camera_id in settings.cameras.enabled_ids:
        if camera_id not in {camera.id for camera in calibration.cameras}:
            yield wrong(
                "calibration", f"camera {camera_id} is not calibrated", "cornertouchd calibrate"
            )


def _age(calibration: Calibration, path: Path) -> Finding:
    made_at = datetime.fromisoformat(calibration.created_at)
    if made_at.tzinfo is None:
        made_at = made_at.replace(tzinfo=UTC)
    days = (time.time() - made_at.timestamp()) / 86_400
    text = f"{path}: {days:.0f} days old, residual {calibration.residual_mm:.2f} mm"
    if days > OLD_DAYS:
        return doubtful("calibration", text, "cornertouchd calibrate, when touches are off")
    if days < 0:
        return doubtful("calibration", text, "set the clock of this machine")
    return well("calibration", text)


def kernels_of(_: Installation) -> Iterator[Finding]:
    """Yield whether the next start compiles."""
    directory = compiled_directory()
    compiled = sum(1 for _ in directory.glob("*/*.nbc"))
    if not os.access(directory, os.W_OK):
        yield doubtful("kernels", f"{directory} cannot be written", "correct its permissions")
    elif not compiled:
        yield doubtful(
            "kernels",
            f"nothing is compiled in {directory} yet: the next start takes a minute",
            "start it once, or reinstall the package",
        )
    else:
        yield well("kernels", f"{compiled} compiled functions in {directory}")


def disk_of(installation: Installation) -> Iterator[Finding]:
    """Yield whether there is space where calibrations are kept."""
    place = calibration_file(installation.settings, installation.environ).parent
    there = next(one for one in (place, *place.parents) if one.exists())
    free_bytes = shutil.disk_usage(there).free
    text = f"{free_bytes / 1e6:.0f} MB free in {there}"
    if free_bytes < LEAST_BYTES:
        yield wrong("disk", text, "make space: no calibration can be saved")
    elif free_bytes < ENOUGH_BYTES:
        yield doubtful("disk", text, "make space, before a calibration cannot be saved")
    else:
        yield well("disk", text)
