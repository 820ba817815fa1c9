"""Detect a tap by itself: a finger that is held still, seen by enough cameras."""

from collections import deque
from enum import Enum, auto

import numpy as np

from cornertouchd.model import BoolArray, FloatArray

HOLD_S = 0.3
"""A finger held still for so long is meant: shorter than patience, longer than landing."""

LONGEST_GAP_S = 0.15
"""Frame sets farther apart than this do not tell what happened in between."""

LIFTED_S = 0.08
"""A finger is lifted when it has not been seen for so long; one picture without it may be noise."""

FEWEST_CAMERAS = 3
"""A tap that fewer see would not check itself."""

STEADY_SHARE = 0.8
"""A camera counts if it saw the finger in this share of the frame sets."""


class TapState(Enum):
    """What the finger does."""

    AWAY = auto()
    """Nothing touches."""
    TOO_SHORT = auto()
    """It was lifted too soon."""
    HIDDEN = auto()
    """Too few cameras see it."""
    SEVERAL = auto()
    """More than one finger touches."""
    MOVING = auto()
    HOLDING = auto()
    TAPPED = auto()
    """It was held long enough, and has not been lifted since."""


class TapDetector:
    """Watches one finger.  `cameras` is how many look, `needed` how many have to see a tap.

    `hidden` counts the touches that too few of them saw, since the last tap.
    """

    def __init__(self, cameras: int, needed: int = FEWEST_CAMERAS) -> None:
        self._needed = min(needed, cameras)
        self.hidden = 0
        self._samples: deque[tuple[float, FloatArray]] = deque()
        self._seen_at_s = -np.inf
        self.state = TapState.AWAY

    @property
    def held_share(self) -> float:
        """How much of the time that makes a tap is over, 0..1."""
        if self.state is not TapState.HOLDING:
            return float(self.state is TapState.TAPPED)
        return min(1.0, (self._samples[-1][0] - self._samples[0][0]) / HOLD_S)

    def update(
        self, captured_at_s: float, columns_px: FloatArray, still_px: FloatArray
    ) -> FloatArray | None:
        """Take what the cameras see, (cameras, 2) edges, NaN unseen; return a tap when it is one.

        `still_px` (cameras,) is how far the shadow of a finger that is held still may wander.  The
        tap is the median of its edges, (cameras, 2), NaN in cameras that did not see it steadily.
        """
        seen = int(np.count_nonzero(np.isfinite(columns_px).all(axis=1)))
        if seen > 0:
            self._seen_at_s = captured_at_s
        if seen < self._needed:
            self._note_unseen(seen, captured_at_s)
            return None
        if self.state is TapState.TAPPED:
            return None
        if self._samples and captured_at_s - self._samples[-1][0] > LONGEST_GAP_S:
            self._samples.clear()
        self._samples.append((captured_at_s, columns_px))
        while not self._is_still(still_px):
            self._samples.popleft()
        held_s = captured_at_s - self._samples[0][0]
        self.state = TapState.HOLDING if held_s > 0.0 else TapState.MOVING
        if held_s < HOLD_S:
            return None
        self.state = TapState.TAPPED
        self.hidden = 0
        return self._median()

    def disturb(self, captured_at_s: float) -> None:
        """Note that more than one finger touches: what was seen before does not count."""
        self._seen_at_s = captured_at_s
        self._samples.clear()
        if self.state is not TapState.TAPPED:
            self.state = TapState.SEVERAL

    def _note_unseen(self, seen: int, captured_at_s: float) -> None:
        if captured_at_s - self._seen_at_s >= LIFTED_S:
            self.hidden += self.state is TapState.HIDDEN
            held = self.state in (TapState.HOLDING, TapState.MOVING)
            if self.state is not TapState.TOO_SHORT:
                self.state = TapState.TOO_SHORT if held else TapState.AWAY
            self._samples.clear()
        elif seen > 0:
            self._samples.clear()
            if self.state is not TapState.TAPPED:
                self.state = TapState.HIDDEN

    def _steady(self) -> tuple[FloatArray, BoolArray]:
        """Return the edges in the window (samples, cameras, 2), and which cameras count."""
        columns = np.stack([columns for _, columns in self._samples])
        share = np.isfinite(columns).all(axis=2).mean(axis=0)
        return columns, share >= STEADY_SHARE

    def _is_still(self, still_px: FloatArray) -> bool:
        columns, steady = self._steady()
        middles = columns[:, steady].mean(axis=2)
        spread = np.nanmax(middles, axis=0) - np.nanmin(middles, axis=0)
        return int(steady.sum()) >= self._needed and bool(np.all(spread <= still_px[steady]))

    def _median(self) -> FloatArray:
        columns, steady = self._steady()
        tap = np.full(columns.shape[1:], np.nan)
        tap[steady] = np.nanmedian(columns[:, steady], axis=0)
        return tap
