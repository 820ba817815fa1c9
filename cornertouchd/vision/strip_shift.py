"""Whether the strip is on the rows where it was calibrated: a camera that moved shows it first.

At work there is no empty picture, but most columns show the strip, from its upper end (where a
camera hangs upside down, from the end of the mirror image) on downwards.
"""

from collections import deque
from dataclasses import dataclass
from math import hypot

import numpy as np

from cornertouchd.model import FloatArray, Picture
from cornertouchd.vision.strip import SMALLEST_LEVEL, Strip

LOOK_EVERY_S = 1.0
LOOKS = 5
"""It is told what the median of so many looks says: hands pass, knocks fade."""

EVERY_PX = 4
"""Columns looked at: a hundred or more tell the row to .02 px."""

FARTHEST_PX = 8
"""An end of the strip is looked for this far above and below its place."""

UNCOVERED = 0.6
"""Share of the empty strip's brightness above which nothing stands before a column."""

FEWEST_COLUMNS = 30

LARGEST_SCATTER_PX = 0.5
"""Columns scatter by .02 px around the line of a shift, with ten fingers or in the sun by .35
(path-traced); noise by more than a pixel."""

MOVED_PX = 0.7
"""Rows that differ by more have moved: half a millimetre on the strip of a small rig.  Looks at a
rig that did not move differ by .01 px, with ten fingers .03, in the sun .5 (path-traced)."""

BACK_PX = 0.55
"""A strip that has shifted is back where it was below this."""

CHANGE_PX = 0.5
"""A shift that grows or shrinks by less is still the same."""


@dataclass(frozen=True, slots=True)
class StripShift:
    """The strip is `lower_px` below its place in the middle of the picture.

    Towards the right it is lower by another `tilt_px` at the picture's border.
    """

    lower_px: float
    tilt_px: float

    def is_like(self, other: "StripShift") -> bool:
        """Tell whether both say much the same."""
        return hypot(self.lower_px - other.lower_px, self.tilt_px - other.tilt_px) < CHANGE_PX

    def __str__(self) -> str:
        lower = f"{abs(self.lower_px):.1f} px {'lower' if self.lower_px > 0 else 'higher'}"
        tilted = f"{abs(self.tilt_px):.1f} px {'lower' if self.tilt_px > 0 else 'higher'}"
        told = []
        if abs(self.lower_px) >= MOVED_PX / 2:
            told.append(f"{lower} than calibrated")
        if abs(self.tilt_px) >= MOVED_PX / 2:
            told.append(f"tilted, {tilted} at the right border of the picture")
        return (
            f"the strip is {' and '.join(told)}: the camera was moved; run `cornertouchd calibrate`"
        )


class StripShiftWatch:
    """Watches the rows of one camera's strip.  Owned by one thread; any may read `shift`.

    `shift` is what is known at present, the same object until something changes.
    """

    def __init__(self, strip: Strip, empty: FloatArray) -> None:
        """Prepare for pictures of the size of `empty`, the mean of empty pictures (rows, W)."""
        self._columns = np.flatnonzero(strip.visible)[::EVERY_PX]
        first = np.rint(strip.top_px[self._columns]).astype(np.int64) - FARTHEST_PX
        self._first = np.clip(first, 0, max(len(empty) - 2 * FARTHEST_PX, 0))
        count = min(2 * FARTHEST_PX, len(empty))
        self._rows = self._first + np.arange(count)[:, None]
        self._w = 2.0 * (self._columns + 0.5) / empty.shape[1] - 1.0
        self._peaks = np.full(len(self._columns), SMALLEST_LEVEL)
        self._ends, peaks = self._look_at(empty)
        self._peaks = np.maximum(UNCOVERED * peaks, SMALLEST_LEVEL)
        self._looked_at_s: float | None = None
        self._looks: deque[tuple[float, float]] = deque(maxlen=LOOKS)
        self.shift: StripShift | None = None

    def look(self, picture: Picture, captured_at_s: float) -> None:
        """Look at a picture (rows, width_px), if it is time."""
        if (
            self._looked_at_s is not None
            and 0.0 <= captured_at_s - self._looked_at_s < LOOK_EVERY_S
        ):
            return
        self._looked_at_s = captured_at_s
        line = self._line_of_shift(picture)
        if line is None:
            return
        self._looks.append(line)
        if len(self._looks) == LOOKS:
            lower, tilt = np.median(np.array(self._looks), axis=0).tolist()
            self._tell(StripShift(lower, tilt))

    def _tell(self, found: StripShift) -> None:
        most = MOVED_PX if self.shift is None else BACK_PX
        if abs(found.lower_px) < most and abs(found.tilt_px) < most:
            self.shift = None
        elif self.shift is None or not self.shift.is_like(found):
            self.shift = found

    def _line_of_shift(self, picture: Picture) -> tuple[float, float] | None:
        """Return by how much the strip is lower in the middle, and more so at the right border."""
        ends, _ = self._look_at(picture)
        off = ends - self._ends
        kept = np.isfinite(off)
        for _ in range(3):
            if np.count_nonzero(kept) < FEWEST_COLUMNS:
                return None
            tilt, lower = np.polyfit(self._w[kept], off[kept], 1)
            left = np.abs(off - lower - tilt * self._w)
            scatter = float(np.median(left[kept]))
            kept &= left < 3.0 * 1.4826 * scatter + 0.1
        return (float(lower), float(tilt)) if scatter < LARGEST_SCATTER_PX else None

    def _look_at(self, picture: Picture | FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the row of the strip's upper end, NaN if it is not seen, and its peak light."""
        dark = float(np.percentile(picture, 10))
        lit = picture[:, self._columns].astype(np.float64) - dark
        peaks = np.partition(lit, -4, axis=0)[-4]
        seen = lit[self._rows, np.arange(len(self._columns))]
        half = peaks / 2.0
        bright = seen > half
        below = np.argmax(bright, axis=0)
        clear = (below > 0) & bright.any(axis=0) & (peaks > self._peaks)
        above = np.maximum(below - 1, 0)
        number = np.arange(len(below))
        step = seen[below, number] - seen[above, number]
        share = (half - seen[above, number]) / np.where(step > 0.0, step, 1.0)
        ends = np.where(clear, self._first + above + 0.5 + share, np.nan)
        return ends, peaks
