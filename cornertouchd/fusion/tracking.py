"""Tracking: contacts followed from one frame set to the next, so that a touch keeps its id.

Each touch is a row of an array (`track_rows`).  A Kalman filter says where it is expected
(`kalman`), what supports it says how firmly it is believed in (`evidence`), and what is reported of
it is smoothed (`smoothing`).
"""

from math import inf, isfinite
from operator import attrgetter

import numpy as np

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.assignment import assign, largest_sigma_mm
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.following import predicted, updated
from cornertouchd.fusion.track_rows import (
    AHEAD_S,
    BETA,
    COAST_FRAMES,
    CONFIRM_FRAMES,
    CONTACT_COLUMNS,
    CONTINUES,
    CUTOFF_HZ,
    DEAD_BAND,
    HEIGHT,
    IS_PALM,
    OWN_COLUMNS,
    OWN_EDGES,
    RULES,
    SUPPORT,
    TOLD_COLUMNS,
    TRACK_COLUMNS,
    TREND_CUTOFF_HZ,
    WIDTH,
)
from cornertouchd.model import Contact, FloatArray, Touch

# After such a pause nothing says where a finger went, or whether it is the same one.
LONGEST_PAUSE_S = 0.5
UNBOUNDED_MM = (inf, inf)
NO_TRACKS = np.empty((0, TRACK_COLUMNS))


class Tracker:
    """Gives contacts lasting ids.  Owned by one thread; the same input gives the same touches.

    Of each frame set `predict` tells where the touches are expected, for the crossing, and `update`
    takes what was found there.  Predicted places are kept on a surface of `surface_mm`, its width
    and height.
    """

    def __init__(
        self, settings: TrackingSettings, surface_mm: tuple[float, float] = UNBOUNDED_MM
    ) -> None:
        self._settings = settings
        self._rules = _rules(settings, surface_mm)
        self._last_id = 0
        self.reset()

    def reset(self) -> None:
        """Forget all touches; their ids are not used again."""
        self._tracks = NO_TRACKS
        self._updated_at_s: float | None = None
        self._advanced_to_s: float | None = None

    def predict(self, captured_at_s: float) -> Predictions:
        """Return where the touches are expected at this time."""
        self._advance(captured_at_s)
        return Predictions(*self._predicted[1:])

    def update(
        self, captured_at_s: float, crossed: Crossed, *, whole: bool = True
    ) -> tuple[Touch, ...]:
        """Return the touches after a frame set with these contacts, by ascending id.

        A touch is first reported where its contact was measured.  One that is not seen rests where
        it was last for `coast_frames` frame sets before it ends.  New touches wait to be seen again
        if the frame set is not `whole`: if a camera is missing.  When time does not advance, or
        leaps, all touches end and the contacts become new ones.
        """
        elapsed_s = self._advance(captured_at_s)
        expected = self._predicted[0]
        contacts = _contact_rows(crossed, self._settings.report_palms)
        self._tracks, self._last_id = updated(
            expected,
            assign(expected, contacts, self._settings.gate_mm),
            contacts,
            self._rules,
            captured_at_s,
            elapsed_s,
            self._last_id,
            whole,
        )
        self._updated_at_s, self._advanced_to_s = captured_at_s, None
        return _touches(self._tracks, captured_at_s)

    def _advance(self, captured_at_s: float) -> float:
        """Bring the tracks to this time, once a frame set; return the time since the last one."""
        elapsed_s = inf if self._updated_at_s is None else captured_at_s - self._updated_at_s
        if self._advanced_to_s != captured_at_s:
            tracks = self._tracks if 0.0 < elapsed_s <= LONGEST_PAUSE_S else NO_TRACKS
            self._predicted = predicted(
                tracks,
                elapsed_s,
                self._settings.acceleration_mm_s2**2,
                largest_sigma_mm(self._settings.gate_mm) ** 2,
            )
            self._advanced_to_s = captured_at_s
        return elapsed_s


def _rules(settings: TrackingSettings, surface_mm: tuple[float, float]) -> FloatArray:
    rules = np.empty(RULES)
    rules[COAST_FRAMES] = settings.coast_frames
    rules[CONFIRM_FRAMES] = settings.confirm_frames
    rules[CUTOFF_HZ] = settings.min_cutoff_hz if settings.smoothing else 0.0
    rules[BETA] = settings.beta
    rules[TREND_CUTOFF_HZ] = settings.derivative_cutoff_hz
    rules[DEAD_BAND] = settings.dead_band_mm
    rules[AHEAD_S] = settings.predict_ms / 1000.0
    rules[WIDTH], rules[HEIGHT] = surface_mm
    return rules


def _contact_rows(crossed: Crossed, report_palms: bool) -> FloatArray:
    """Return what counts of the contacts as rows; where palms are reported, none is one."""
    rows = np.empty((len(crossed.contacts), CONTACT_COLUMNS))
    if len(rows):
        rows[:, :OWN_COLUMNS] = [_values(contact) for contact in crossed.contacts]
        rows[:, SUPPORT] = crossed.supports
        rows[:, OWN_EDGES] = crossed.own_edges
        rows[:, CONTINUES] = crossed.predictions
        if report_palms:
            rows[:, IS_PALM] = 0.0
    return rows


def _values(contact: Contact) -> tuple[float, float, float, float, float, int, bool, bool]:
    """Return the first columns of a contact; one that is nowhere or has no size touches nothing."""
    somewhere = isfinite(contact.x_mm + contact.y_mm) and 0.0 < contact.diameter_mm < inf
    return (
        contact.x_mm,
        contact.y_mm,
        0.5 * contact.diameter_mm,
        contact.sigma_mm,
        contact.confidence,
        len(contact.cameras),
        contact.touching and somewhere,
        contact.kind == "palm",
    )


def _touches(tracks: FloatArray, captured_at_s: float) -> tuple[Touch, ...]:
    touches = [
        Touch(int(number), x_mm, y_mm, vx_mm_s, vy_mm_s, captured_at_s - reported_at_s)
        for number, reported_at_s, x_mm, y_mm, vx_mm_s, vy_mm_s in tracks[:, :TOLD_COLUMNS].tolist()
        if number
    ]
    return tuple(sorted(touches, key=attrgetter("id")))
