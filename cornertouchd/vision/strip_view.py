"""What people are shown of one picture: the strip, its profile, what was made of it."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cornertouchd.model import BoolArray, FloatArray, Frame, Picture, Shadows
from cornertouchd.vision.profile import Measured
from cornertouchd.vision.reference import Reference
from cornertouchd.vision.strip import Strip

MARGIN_PX = 4
"""Rows above and below the strip that are shown, too: whether it is where it should be."""

MOST_ROWS = 64
"""A strip that is higher, or bent more, is shown with every second row, or third."""


@dataclass(frozen=True, slots=True, eq=False)
class StripView:
    """One picture around the strip, (rows, width_px), and by column what was measured there.

    `brightness` and `known` are those of the profile; `reference` is how bright the empty strip is
    now, in grey levels, (width_px,).  `edges_px` are the columns of all edges found.  `level` is
    the mean grey level of the strip and `dark_level` that of dark pictures, NaN without any;
    `contrast` is 0..1, from no light of the strip to nothing but that.
    """

    captured_at_s: float
    picture: Picture
    brightness: FloatArray
    known: BoolArray
    reference: FloatArray
    edges_px: FloatArray
    level: float
    contrast: float
    dark_level: float


class ShownRows(NamedTuple):
    """The rows of a picture that are shown: first, end and step."""

    first: int
    stop: int
    step: int

    def of(self, picture: Picture) -> Picture:
        """Return these rows as a picture of its own."""
        return picture[self.first : self.stop : self.step].copy()


def shown_rows(strip: Strip, rows_px: int) -> ShownRows:
    """Return which rows of pictures with so many show the strip."""
    seen = strip.visible
    first = max(math.floor(float(strip.top_px[seen].min())) - MARGIN_PX, 0)
    stop = min(math.ceil(float(strip.bottom_px[seen].max())) + MARGIN_PX, rows_px)
    return ShownRows(first, stop, -(-(stop - first) // MOST_ROWS))


def view_of(
    frame: Frame,
    rows: ShownRows,
    seen: tuple[Measured, Shadows],
    reference: Reference,
    *,
    knows_darkness: bool,
) -> StripView:
    """Return what is shown of a picture that was measured against `reference`."""
    measured, shadows = seen
    strip = reference.on_strip
    light = float(np.mean(measured.light[strip]))
    dark = float(np.mean(reference.black[strip]))
    return StripView(
        frame.captured_at_s,
        rows.of(frame.pixels),
        measured.profile.brightness,
        measured.profile.known,
        np.where(strip, reference.light + reference.black, 0.0),
        shadows.edges_px.ravel(),
        light,
        contrast_of(light, dark),
        dark if knows_darkness else math.nan,
    )


def plain_view(frame: Frame, rows: ShownRows, shadows: Shadows) -> StripView:
    """Return what is shown where no profile is measured: the picture and the edges."""
    picture = rows.of(frame.pixels)
    nothing = np.zeros(picture.shape[1])
    return StripView(
        frame.captured_at_s,
        picture,
        nothing,
        np.zeros(picture.shape[1], np.bool_),
        nothing,
        shadows.edges_px.ravel(),
        float(np.mean(picture)),
        0.0,
        math.nan,
    )


def contrast_of(light: float, dark: float) -> float:
    """Return the contrast of two grey levels after Michelson, 0..1."""
    return max(light - dark, 0.0) / max(light + dark, 1.0)
