"""Tracking: contacts followed from one frame set to the next, so that a touch keeps its id.

Each touch is a row of an array (`track_rows`).  A Kalman filter says where it is expected
(`kalman`), what supports it says how firmly it is believed in (`evidence`), and what is reported of
it is smoothed (`smoothing`).
"""

from math import inf, isfinite
from operator import attrgetter
from typing import Protocol

import numpy as np

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.assignment import assign, largest_sigma_mm
from cornertouchd.fusion.crossed import Crossed, IntArray, Predictions
from cornertouchd.fusion.evidence import SIGHTS_OF_A_LASTING_TOUCH, SUPPORT_OF_HIDDEN
from cornertouchd.fusion.following import predicted, updated
from cornertouchd.fusion.tips import Tips
from cornertouchd.fusion.track_rows import (
    AHEAD_S,
    BETA,
    COAST_FRAMES,
    CONFIRM_FRAMES,
    CONTACT_COLUMNS,
    CONTINUES,
    CUTOFF_HZ,
    DEAD_BAND,
    GAP,
    HEIGHT,
    ID,
    IS_PALM,
    LAST_SUPPORT,
    OWN_COLUMNS,
    OWN_EDGES,
    POSITION_VARIANCE,
    RADIUS,
    RULES,
    SEEN,
    SUPPORT,
    TIP_SHIFT_X,
    TIP_SHIFT_Y,
    TIP_VARIANCE,
    TOLD_COLUMNS,
    TRACK_COLUMNS,
    TREND_CUTOFF_HZ,
    WIDTH,
    X,
    Y,
)
from cornertouchd.model import BoolArray, Contact, FloatArray, Touch

# After such a pause nothing says where a finger went, or whether it is the same one.
LONGEST_PAUSE_S = 0.5
UNBOUNDED_MM = (inf, inf)
NO_TRACKS = np.empty((0, TRACK_COLUMNS))
# A running median: fourteen frame sets until it has halved or doubled.
STEP_OF_MEDIAN = 1.05
USUAL_PERIOD_S = 0.01


class Hides(Protocol):
    """Tells whether something may touch where no contact was found."""

    def __call__(
        self, x_mm: float, y_mm: float, radius_mm: float, position_variance_mm2: float
    ) -> bool:
        """Tell it of a disc that is expected about there: False if a camera sees light there."""
        ...


class _Period:
    """How long after each other frame sets usually come, so that skipped ones can be counted.

    It begins with what the cameras were told: the first ones may be those that are skipped.
    """

    def __init__(self, first_s: float) -> None:
        self._median_s = first_s

    def count(self, elapsed_s: float) -> float:
        """Return how many periods have passed with a frame set that comes so long after another."""
        if not 0.0 < elapsed_s <= LONGEST_PAUSE_S:
            return 1.0
        self._median_s *= STEP_OF_MEDIAN if elapsed_s > self._median_s else 1.0 / STEP_OF_MEDIAN
        return max(1.0, float(round(elapsed_s / self._median_s)))


class Tracker:
    """Gives contacts lasting ids.  Owned by one thread; the same input gives the same touches.

    Of each frame set `predict` tells where the touches are expected, for the crossing, and `update`
    takes what was found there.  Predicted places are kept on a surface of `surface_mm`, its width
    and height.  Frame sets are taken to come every `period_s` until they tell otherwise.
    """

    def __init__(
        self,
        settings: TrackingSettings,
        surface_mm: tuple[float, float] = UNBOUNDED_MM,
        period_s: float = USUAL_PERIOD_S,
    ) -> None:
        self._settings = settings
        self._rules = _rules(settings, surface_mm)
        self._last_id = 0
        self._period = _Period(period_s)
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
        self,
        captured_at_s: float,
        crossed: Crossed,
        *,
        tips: Tips | None = None,
        whole: bool = True,
        hides: Hides | None = None,
    ) -> tuple[Touch, ...]:
        """Return the touches after a frame set with these contacts, by ascending id.

        The contacts are sections; `tips` says where they touch.  A touch is first reported where it
        was measured, and ends when light has passed below it for some frame sets.  One that is not
        seen rests where it was last for `coast_frames` frame sets before it ends, those that were
        skipped included, and longer where others hide it, as `hides` says.  New touches wait to be
        seen again if the frame set is not `whole`: if a camera is missing.  When time does not
        advance, or leaps, all touches end and the contacts become new ones.
        """
        elapsed_s = self._advance(captured_at_s)
        expected = self._predicted[0]
        contacts = _contact_rows(
            crossed, tips or Tips.unknown(len(crossed.contacts)), self._settings.report_palms
        )
        partners = assign(expected, contacts, self._settings.gate_mm)
        periods = self._period.count(elapsed_s)
        self._tracks, self._last_id = updated(
            expected,
            partners,
            _hidden(expected, partners, periods, hides),
            contacts,
            self._rules,
            captured_at_s,
            elapsed_s,
            periods,
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


def _hidden(
    tracks: FloatArray, partners: IntArray, periods: float, hides: Hides | None
) -> BoolArray:
    """Tell which tracks (T,) miss a partner and may yet be where others hide them.

    Only of touches that have lasted, and that others were about to hide or that were not looked at
    for a while: any other finger that is not found has been lifted.
    """
    hidden: BoolArray = partners < 0
    if not hidden.any():
        return hidden
    hidden &= (tracks[:, ID] > 0.0) & (tracks[:, SEEN] >= SIGHTS_OF_A_LASTING_TOUCH)
    if periods == 1.0:
        hidden &= tracks[:, LAST_SUPPORT] < SUPPORT_OF_HIDDEN
    for number in np.flatnonzero(hidden).tolist():
        where = tracks[number, [X, Y, RADIUS, POSITION_VARIANCE]].tolist()
        hidden[number] = hides is not None and hides(*where)
    return hidden


def _contact_rows(crossed: Crossed, tips: Tips, report_palms: bool) -> FloatArray:
    """Return what counts of the contacts as rows; where palms are reported, none is one."""
    rows = np.empty((len(crossed.contacts), CONTACT_COLUMNS))
    if len(rows):
        rows[:, :OWN_COLUMNS] = [_values(contact) for contact in crossed.contacts]
        rows[:, SUPPORT] = crossed.supports
        rows[:, OWN_EDGES] = crossed.own_edges
        rows[:, CONTINUES] = crossed.predictions
        rows[:, TIP_SHIFT_X : TIP_SHIFT_Y + 1] = tips.shifts_mm
        rows[:, TIP_VARIANCE] = tips.variances_mm2
        rows[:, GAP] = tips.gaps
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
        Touch(
            int(number), x_mm, y_mm, vx_mm_s, vy_mm_s, captured_at_s - reported_at_s, 2.0 * radius
        )
        for number, reported_at_s, x_mm, y_mm, vx_mm_s, vy_mm_s, _, _, radius in (
            tracks[:, :TOLD_COLUMNS].tolist()
        )
        if number
    ]
    return tuple(sorted(touches, key=attrgetter("id")))
