"""What the cameras saw while the surface was empty, and while it was touched at one place."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress

import numpy as np

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.config import VisionSettings
from cornertouchd.model import FloatArray, Frame, Outlines, Shadow
from cornertouchd.vision.finder import ProfileFinder, ShadowFinder, make_finder
from cornertouchd.vision.outlines import OutlineTracer
from cornertouchd.vision.profile import NoiseError
from cornertouchd.vision.strip import Strip, StripNotFoundError, find_strip

SMALLEST_WIDTH_PX = 1.2
"""A reference touch is wider than this in every camera; narrower shadows are dirt or noise."""


def mean_pictures(frame_sets: Iterable[Sequence[Frame]]) -> dict[str, FloatArray]:
    """Return the mean picture of every camera, (rows_px, width_px), dark frames left out."""
    sums: dict[str, FloatArray] = {}
    counts: dict[str, int] = {}
    for frame in (frame for frames in frame_sets for frame in frames if frame.lit_mask != 0):
        before = sums.get(frame.camera)
        sums[frame.camera] = frame.pixels.astype(np.float64) if before is None else before
        if before is not None:
            before += frame.pixels
        counts[frame.camera] = counts.get(frame.camera, 0) + 1
    if not sums:
        raise CalibrationError("there is no picture of the empty surface; record some")
    return {camera: total / counts[camera] for camera, total in sums.items()}


def find_strips(empties: Mapping[str, FloatArray]) -> dict[str, Strip]:
    """Return the strip of every camera.  Raises `CalibrationError` naming a camera without one."""
    strips = {}
    for camera, empty in empties.items():
        try:
            strips[camera] = find_strip(empty)
        except StripNotFoundError as error:
            raise CalibrationError(f"camera {camera}: no strip found: {error}") from None
    return strips


def make_finders(
    strips: Mapping[str, Strip], empties: Mapping[str, FloatArray], settings: VisionSettings
) -> dict[str, ShadowFinder]:
    """Return the finder of every camera."""
    return {camera: make_finder(strips[camera], empties[camera], settings) for camera in strips}


def observe_touches(
    frame_sets: Iterable[Sequence[Frame]], finders: Mapping[str, ShadowFinder]
) -> FloatArray:
    """Return the edges of one touch per frame set, (cameras, sets, 2) columns, NaN unseen.

    Cameras are in the order of `finders`.
    """
    columns = []
    for frames in frame_sets:
        edges = {
            frame.camera: edges_of_touch(finders[frame.camera].find(frame.pixels))
            for frame in frames
        }
        columns.append([edges[camera] for camera in finders])
    shape = (len(columns), len(finders), 2)
    return np.array(columns, dtype=np.float64).reshape(shape).transpose(1, 0, 2)


def trace_touches(
    frame_sets: Iterable[Sequence[Frame]],
    finders: Mapping[str, ShadowFinder],
    tracers: Mapping[str, OutlineTracer],
) -> tuple[FloatArray, dict[str, list[Outlines]]]:
    """Return the edges of one touch per frame set, as `observe_touches` does, and its outlines.

    These are by camera, of the pictures in which it is the only one; cameras without a tracer have
    none.
    """
    outlines: dict[str, list[Outlines]] = {camera: [] for camera in finders}

    def traced(frames: Sequence[Frame]) -> Sequence[Frame]:
        for frame in frames:
            finder, tracer = finders[frame.camera], tracers.get(frame.camera)
            if tracer is None or not isinstance(finder, ProfileFinder):
                continue
            with suppress(NoiseError):
                shadows, gain = finder.find_with_hidden(frame.pixels)
                if len(shadows) == 1:
                    reference = finder.sampler.reference
                    outlines[frame.camera].append(
                        tracer.trace(frame.pixels, shadows, reference, gain)
                    )
        return frames

    return observe_touches(map(traced, frame_sets), finders), outlines


def make_tracers(
    finders: Mapping[str, ShadowFinder],
    strips: Mapping[str, Strip],
    empties: Mapping[str, FloatArray],
    settings: VisionSettings,
) -> dict[str, OutlineTracer]:
    """Return the tracer of every camera whose finder knows rows."""
    return {
        camera: OutlineTracer(strips[camera], empties[camera], finder.sampler.reference, settings)
        for camera, finder in finders.items()
        if isinstance(finder, ProfileFinder)
    }


def edges_of_touch(shadows: Iterable[Shadow]) -> tuple[float, float]:
    """Return the edges of the widest shadow, NaN if one of them is not seen."""
    widest = max(shadows, key=_width_px, default=None)
    if widest is None or not (widest.left_valid and widest.right_valid):
        return np.nan, np.nan
    if _width_px(widest) < SMALLEST_WIDTH_PX:
        return np.nan, np.nan
    return widest.left_px, widest.right_px


def touches_seen(shadows: Iterable[Shadow]) -> int:
    """Return how many shadows are wide enough to be touches."""
    return sum(_width_px(shadow) >= SMALLEST_WIDTH_PX for shadow in shadows)


def _width_px(shadow: Shadow) -> float:
    return shadow.right_px - shadow.left_px
