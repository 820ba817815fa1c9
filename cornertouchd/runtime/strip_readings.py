"""How bright the strip of a camera is, read from its newest picture when somebody asks."""

from dataclasses import dataclass

import numpy as np

from cornertouchd.model import Frame
from cornertouchd.pipeline import PictureError
from cornertouchd.runtime.daemon import DaemonStages
from cornertouchd.runtime.keeping import KeptPictures
from cornertouchd.vision.lighting import Lighting, lighting

LOOK_BACK = 16
"""Pictures among which a lit one is looked for: one in eight is dark at most."""


@dataclass(frozen=True, slots=True)
class StripReading:
    """The strip in one picture: mean grey level, contrast and clipped share of its columns.

    `contrast` is 0..1, from no light of the strip to nothing but that; both shares, too.
    """

    level: float
    contrast: float
    saturated_share: float


def read_strip(stages: DaemonStages, camera: str) -> StripReading | None:
    """Return what the newest lit picture tells, None if there is none."""
    frame = _newest_lit(stages.kept.cameras[camera])
    if frame is None:
        return None
    try:
        view = stages.captures[camera].pipeline.show(frame)
    except PictureError:
        return None
    on_strip = view.reference > 0.0
    clipped = view.picture.max(axis=0) >= stages.settings.vision.saturated_grey
    share = float(np.mean(clipped[on_strip])) if on_strip.any() else 0.0
    return StripReading(view.level, view.contrast, share)


def _newest_lit(kept: KeptPictures) -> Frame | None:
    for number in range(kept.count - 1, max(kept.oldest, kept.count - LOOK_BACK) - 1, -1):
        frame = kept.read(number)
        if frame is not None and lighting(frame) is Lighting.LIT:
            return frame
    return None
