"""Everything a calibration is made from, gathered from frame sets."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cornertouchd.calibration.board_sights import BoardSight
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.observing import (
    find_strips,
    make_finders,
    make_tracers,
    mean_pictures,
    observe_touches,
    trace_touches,
)
from cornertouchd.calibration.touch_columns import TouchColumns
from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray, Frame, Outlines, PictureFormat
from cornertouchd.vision.finder import ShadowFinder
from cornertouchd.vision.strip import Strip

FrameSets = Iterable[Sequence[Frame]]


MOST_DISTURBED = 0.05
"""Share of pictures of the empty surface that an insect may spoil."""


@dataclass(frozen=True)
class Taps:
    """Touches at known places, one a frame set.

    `points_mm` (sets, 2) and `diameters_mm` (sets,) are NaN where unknown.
    """

    frame_sets: FrameSets
    points_mm: FloatArray
    diameters_mm: FloatArray


@dataclass(frozen=True)
class ReferenceTouches:
    """What the cameras of a rig saw; cameras in the order of `formats`.

    `empties` are mean pictures of the empty surface, `touches` the columns of taps (places known)
    and scribble (places NaN).  `boards` are needed for the reconstruction only; `identities` are
    those of `CameraCalibration`, where they are known.  `uprights` are the outlines of the taps, by
    camera, where they were traced: a tap is a finger that stands more or less upright.
    """

    surface_mm: tuple[float, float]
    formats: Mapping[str, PictureFormat]
    empties: Mapping[str, FloatArray]
    strips: Mapping[str, Strip]
    touches: TouchColumns
    boards: Sequence[BoardSight] = ()
    identities: Mapping[str, str] = field(default_factory=dict)
    uprights: Mapping[str, Sequence[Outlines]] = field(default_factory=dict)


def gather_touches(
    surface_mm: tuple[float, float],
    formats: Mapping[str, PictureFormat],
    empty: FrameSets,
    taps: Taps,
    scribble: FrameSets,
    settings: VisionSettings,
) -> ReferenceTouches:
    """Look at the empty surface (twice), then at every touch.  Raises `CalibrationError`."""
    means = mean_pictures(empty)
    empties = {camera: means[camera] for camera in formats}
    strips = find_strips(empties)
    finders = make_finders(strips, empties, settings)
    _require_empty(empty, finders)
    tracers = make_tracers(finders, strips, empties, settings)
    known, uprights = trace_touches(taps.frame_sets, finders, tracers)
    unknown = observe_touches(scribble, finders)
    nowhere = np.full((unknown.shape[1], 2), np.nan)
    touches = TouchColumns(
        np.concatenate([known, unknown], axis=1),
        np.concatenate([taps.points_mm, nowhere]),
        np.concatenate([taps.diameters_mm, nowhere[:, 0]]),
    )
    return ReferenceTouches(surface_mm, formats, empties, strips, touches, uprights=uprights)


def _require_empty(empty: FrameSets, finders: Mapping[str, ShadowFinder]) -> None:
    """Raise `CalibrationError` if something moved before the strip while it was learned."""
    pictures: Counter[str] = Counter()
    disturbed: Counter[str] = Counter()
    for frame in (frame for frames in empty for frame in frames if frame.lit_mask != 0):
        pictures[frame.camera] += 1
        disturbed[frame.camera] += bool(finders[frame.camera].find(frame.pixels))
    for camera, count in disturbed.items():
        if count > MOST_DISTURBED * pictures[camera]:
            raise CalibrationError(
                f"camera {camera}: {count} of {pictures[camera]} pictures of the empty surface "
                "show shadows that the others do not: something moved, or the light did; record "
                "the empty surface anew"
            )
