"""The simulated rig as the daemon uses it: made from the settings, calibrated by simulated taps."""

import hashlib
import itertools
import logging
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cornertouchd import __version__
from cornertouchd.calibration.calibration import Calibration, CalibrationError
from cornertouchd.calibration.file import load_calibration, save_calibration
from cornertouchd.config import Settings
from cornertouchd.guiding.targets import calibration_targets
from cornertouchd.model import Frame
from cornertouchd.places import cache_directory
from cornertouchd.runtime.stamping import stamp_now
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.simulation.scripts import scribble
from cornertouchd.simulation.show import make_rig

EMPTY_SETS = 16
SCRIBBLE_TOUCHES = 120
TAP_DIAMETER_MM = 8.0
TAP_SIGMA_MM = 0.1
"""The simulated taps are exact; what is left is the finger's shape."""

FIRST_PICTURE = 1_000_000_000
"""Pictures taken to calibrate are counted from here, so that their noise is that of no other."""

SAME_PICTURE_GREY = 3.0
"""Mean difference of two pictures of the same rig stays under this: twice the noise."""

_log = logging.getLogger("cornertouchd")


def calibrated_rig(settings: Settings, environ: Mapping[str, str]) -> Calibration:
    """Return the calibration of the simulated rig: from the cache, else by simulated taps."""
    path = cache_directory(environ) / f"simulated-{_rig_key(settings)}.json"
    rig = make_rig(settings)
    cached = _cached(path, rig)
    if cached is not None:
        _log.info("simulated rig: calibrated before, from %s", path)
        return cached
    _log.info("simulated rig: calibrating itself with simulated taps and a scribble")
    calibration = calibrate_rig(rig, settings)
    _log.info("simulated rig: calibrated, residual %.2f mm", calibration.residual_mm)
    _keep(calibration, path)
    return calibration


def calibrate_rig(rig: SimulatedRig, settings: Settings) -> Calibration:
    """Calibrate a simulated rig as a person would: empty surface, 16 taps, a scribble."""
    # Half of the time of a start, and only the first one calibrates.
    from cornertouchd.calibration.gathering import Taps, gather_touches  # noqa: PLC0415
    from cornertouchd.calibration.methods import calibrate  # noqa: PLC0415

    places = calibration_targets(rig.surface_mm)
    somewhere = scribble(rig.surface_mm, SCRIBBLE_TOUCHES, settings.simulation.seed)
    pictures = itertools.count(FIRST_PICTURE)
    given = gather_touches(
        rig.surface_mm,
        rig.formats,
        [rig.frame_set(next(pictures), 0.0, ()) for _ in range(EMPTY_SETS)],
        Taps(
            (_touched(rig, next(pictures), place) for place in places),
            np.array(places),
            np.full(len(places), TAP_DIAMETER_MM),
        ),
        (_touched(rig, next(pictures), place) for place in somewhere),
        settings.vision,
    )
    return calibrate("auto", given, TAP_SIGMA_MM, stamp_now())


def _touched(rig: SimulatedRig, index: int, place: tuple[float, float]) -> tuple[Frame, ...]:
    return rig.frame_set(index, 0.0, (Finger(*place, TAP_DIAMETER_MM),))


def _rig_key(settings: Settings) -> str:
    """Name everything that the calibration of the simulated rig depends on."""
    parts = (
        settings.surface.model_dump_json(),
        str((settings.cameras.width_px, settings.cameras.height_px, settings.simulation.seed)),
        settings.vision.model_dump_json(),
    )
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:12]


def _cached(path: Path, rig: SimulatedRig) -> Calibration | None:
    """Return the calibration that was kept, if it is of this software and shows this rig."""
    try:
        cached = load_calibration(path)
        empty = {camera.id: camera.empty for camera in cached.cameras}
        frames = rig.frame_set(FIRST_PICTURE, 0.0, ())
        same = all(
            empty[frame.camera].shape == frame.pixels.shape
            and np.abs(empty[frame.camera] - frame.pixels).mean() < SAME_PICTURE_GREY
            for frame in frames
        )
    except (CalibrationError, KeyError):
        return None
    return cached if same and cached.software == __version__ else None


def _keep(calibration: Calibration, path: Path) -> None:
    """Save to the cache; a cache that cannot be written costs the next start some seconds."""
    try:
        save_calibration(calibration, path)
    except CalibrationError as error:
        _log.warning("calibration is not kept: %s", error)
