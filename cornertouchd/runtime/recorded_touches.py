"""Everything a calibration is made from, out of recordings."""

from collections import Counter
from collections.abc import Sequence

import numpy as np

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.gathering import ReferenceTouches, Taps, gather_touches
from cornertouchd.config import VisionSettings
from cornertouchd.devices.recording import RecordedPoint, Recording


def gather_recorded(
    taps: Recording,
    points: Sequence[RecordedPoint],
    scribble: Recording | None,
    empty: Recording,
    settings: VisionSettings,
) -> ReferenceTouches:
    """Return what the cameras saw of the taps at `points`, of a scribble and of the empty surface.

    Frame sets of `taps` that `points` does not name are left out.  Raises `CalibrationError`.
    """
    for other in (empty, scribble):
        if other is not None and dict(other.formats) != dict(taps.formats):
            raise CalibrationError(
                f"{other.directory}: its cameras or picture sizes are not those of "
                f"{taps.directory}; record all parts with the same settings"
            )
    places, diameters = _places(taps, points)
    tapped = np.isfinite(places).all(axis=1).tolist()
    known = Taps(
        (frames for frames, use in zip(taps, tapped, strict=True) if use),
        places[tapped],
        diameters[tapped],
    )
    return gather_touches(taps.surface_mm, taps.formats, empty, known, scribble or (), settings)


def _places(taps: Recording, points: Sequence[RecordedPoint]) -> tuple[np.ndarray, np.ndarray]:
    """Return where each frame set was touched and with what diameter, NaN where unknown.

    One with several contacts counts as unknown: which shadow is whose cannot be told.
    """
    places = np.full((len(taps), 2), np.nan)
    diameters = np.full(len(taps), np.nan)
    times = Counter(point.set for point in points)
    for point in points:
        if point.set >= len(taps):
            raise CalibrationError(
                f"{taps.directory}: has {len(taps)} frame sets, a reference point names set "
                f"{point.set}"
            )
        if times[point.set] == 1:
            places[point.set] = point.x_mm, point.y_mm
            if point.diameter_mm is not None:
                diameters[point.set] = point.diameter_mm
    return places, diameters
