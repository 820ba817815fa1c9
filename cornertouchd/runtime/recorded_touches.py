"""Everything a calibration is made from, out of recordings."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.gathering import ReferenceTouches, Taps, gather_touches
from cornertouchd.calibration.same_camera import same_camera
from cornertouchd.config import VisionSettings
from cornertouchd.devices.recording import RecordedPoint, Recording

NOWHERE = np.empty((0, 2))


def gather_recorded(
    taps: Recording | None,
    points: Sequence[RecordedPoint],
    scribble: Recording | None,
    empty: Recording,
    settings: VisionSettings,
    boards: Sequence[BoardSight] = (),
) -> ReferenceTouches:
    """Return what the cameras saw of the taps at `points`, of a scribble and of the empty surface.

    Frame sets of `taps` that `points` does not name are left out.  Raises `CalibrationError`.
    """
    for other in (taps, scribble):
        if other is not None:
            _require_same_rig(empty, other)
    known = _known_taps(taps, points) if taps is not None else Taps((), NOWHERE, NOWHERE[:, 0])
    given = gather_touches(empty.surface_mm, empty.formats, empty, known, scribble or (), settings)
    return replace(given, identities=empty.identities, boards=boards)


def require_boards_of(empty: Recording, boards: Recording) -> None:
    """Raise `CalibrationError` unless the board was recorded by the cameras of `empty`.

    Their pictures may hold other rows, but must be cut from pictures of the same size.
    """
    sizes = [
        {camera: (size.width_px, size.height_px) for camera, size in recording.formats.items()}
        for recording in (empty, boards)
    ]
    if sizes[0] != sizes[1]:
        raise CalibrationError(
            f"{boards.directory}: its cameras or the sizes of their images are not those of "
            f"{empty.directory}; record the board with the same settings but for the rows"
        )
    _require_same_cameras(empty, boards)


def _known_taps(taps: Recording, points: Sequence[RecordedPoint]) -> Taps:
    places, diameters = _places(taps, points)
    tapped = np.isfinite(places).all(axis=1).tolist()
    return Taps(
        (frames for frames, use in zip(taps, tapped, strict=True) if use),
        places[tapped],
        diameters[tapped],
    )


def _require_same_rig(empty: Recording, other: Recording) -> None:
    if dict(other.formats) != dict(empty.formats) or other.surface_mm != empty.surface_mm:
        raise CalibrationError(
            f"{other.directory}: its surface, cameras or picture sizes are not those of "
            f"{empty.directory}; record all parts with the same settings"
        )
    _require_same_cameras(empty, other)


def _require_same_cameras(empty: Recording, other: Recording) -> None:
    for camera, identity in empty.identities.items():
        theirs = other.identities[camera]
        if not same_camera(identity, theirs):
            raise CalibrationError(
                f"{other.directory}: camera {camera} is another one ({theirs}) than in "
                f"{empty.directory} ({identity}); record all parts with the same cameras"
            )


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
