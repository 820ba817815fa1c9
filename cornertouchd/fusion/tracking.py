"""Tracking: contacts followed from one frame set to the next, so that a touch keeps its id.

Each touch is a Kalman filter with constant velocity, whose acceleration is white noise.  Both axes
share one covariance, because the sigma of a contact has no direction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, isfinite, sqrt

import numpy as np
from scipy.optimize import linear_sum_assignment

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.model import Contact, Touch

# No contact is known better: its section is not quite an ellipse, and hands tremble.
SMALLEST_SIGMA_MM = 0.1
# A finger may land while it moves: 2 m/s, the quickest swipes, are three sigmas.
BIRTH_SPEED_SIGMA_MM_S = 700.0
# Half a finger wide where the prediction is certain, so that a neighbour is never taken for it.
NARROWEST_GATE_MM = 4.0
GATE_SIGMAS = 3.0
# Three of four contacts of this confidence are real, and only one or two in a hundred, with ten
# fingers down, have less: those wait to be confirmed, all others are reported at once.
CONFIDENCE_WITHOUT_CONFIRMATION = 0.5
# Where two cameras see two fingers, the two ghosts explain their shadows nearly as well as the
# fingers do, frame after frame: being seen again proves nothing then.
CAMERAS_THAT_CONFIRM = 3
# After such a pause nothing says where a finger went, or whether it is the same one.
LONGEST_PAUSE_S = 0.5
OUT_OF_REACH = 1e12


@dataclass(frozen=True, slots=True)
class _Track:
    """A touch, or what may become one: then `id` is 0.

    The variances and the covariance are those of position and velocity in each axis, in mm and
    mm/s.  `seen_x_mm` and `seen_y_mm` are where it was when it was seen last.  `seen` counts the
    frame sets that showed it, `missed` the last ones that did not.
    """

    id: int
    reported_at_s: float
    x_mm: float
    y_mm: float
    seen_x_mm: float
    seen_y_mm: float
    vx_mm_s: float
    vy_mm_s: float
    position_variance: float
    covariance: float
    velocity_variance: float
    seen: int
    missed: int


class Tracker:
    """Gives contacts lasting ids.  Owned by one thread; the same input gives the same touches."""

    def __init__(self, settings: TrackingSettings) -> None:
        self._settings = settings
        self._tracks: tuple[_Track, ...] = ()
        self._updated_at_s: float | None = None
        self._last_id = 0

    def reset(self) -> None:
        """Forget all touches; their ids are not used again."""
        self._tracks = ()
        self._updated_at_s = None

    def predict(self, captured_at_s: float) -> Predictions:
        """Return where the touches are expected at this time."""
        return Predictions(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty(0))

    def update(self, captured_at_s: float, crossed: Crossed) -> tuple[Touch, ...]:
        """Return the touches after a frame set with these contacts, by ascending id.

        A touch is first reported where its contact was measured.  One that is not seen rests where
        it was last for `coast_frames` frame sets before it ends.  When time does not advance, or
        leaps, all touches end and the contacts become new ones.
        """
        touching = [contact for contact in crossed.contacts if _can_be_a_touch(contact)]
        predicted = self._predicted(captured_at_s)
        self._updated_at_s = captured_at_s
        partners = _assigned(predicted, touching, self._settings.gate_mm)
        followed = [
            self._seen(track, touching[partners[number]], captured_at_s)
            if number in partners
            else replace(track, missed=track.missed + 1)
            for number, track in enumerate(predicted)
        ]
        taken = set(partners.values())
        born = [
            self._confirmed(_born(contact), contact, captured_at_s)
            for number, contact in enumerate(touching)
            if number not in taken
        ]
        self._tracks = tuple(track for track in followed if self._goes_on(track)) + tuple(born)
        reported = sorted((track for track in self._tracks if track.id), key=lambda t: t.id)
        return tuple(_touch(track, captured_at_s) for track in reported)

    def _predicted(self, captured_at_s: float) -> list[_Track]:
        if self._updated_at_s is None:
            return []
        elapsed_s = captured_at_s - self._updated_at_s
        if not 0.0 < elapsed_s <= LONGEST_PAUSE_S:
            return []
        acceleration_variance = self._settings.acceleration_mm_s2**2
        return [_predicted(track, elapsed_s, acceleration_variance) for track in self._tracks]

    def _seen(self, track: _Track, contact: Contact, captured_at_s: float) -> _Track:
        return self._confirmed(_corrected(track, contact), contact, captured_at_s)

    def _confirmed(self, track: _Track, contact: Contact, captured_at_s: float) -> _Track:
        """Give the track the next id if it has none yet and is sure enough to be reported."""
        seen_again = track.seen >= self._settings.confirm_frames
        sure = contact.confidence >= CONFIDENCE_WITHOUT_CONFIRMATION or (
            seen_again and len(contact.cameras) >= CAMERAS_THAT_CONFIRM
        )
        if track.id or not sure:
            return track
        self._last_id += 1
        return replace(track, id=self._last_id, reported_at_s=captured_at_s)

    def _goes_on(self, track: _Track) -> bool:
        return track.missed <= (self._settings.coast_frames if track.id else 0)


def _can_be_a_touch(contact: Contact) -> bool:
    return (
        contact.touching
        and contact.kind != "palm"
        and isfinite(contact.x_mm)
        and isfinite(contact.y_mm)
    )


def _sigma_mm(contact: Contact) -> float:
    return max(contact.sigma_mm, SMALLEST_SIGMA_MM) if isfinite(contact.sigma_mm) else 1.0


def _assigned(
    tracks: Sequence[_Track], contacts: Sequence[Contact], gate_mm: float
) -> dict[int, int]:
    """Return the contact of each track that has one: as many as possible, at least distance."""
    costs = np.full((len(tracks), len(contacts)), OUT_OF_REACH)
    for row, track in enumerate(tracks):
        for column, contact in enumerate(contacts):
            sigma_mm = sqrt(track.position_variance + _sigma_mm(contact) ** 2)
            distance_mm = hypot(contact.x_mm - track.x_mm, contact.y_mm - track.y_mm)
            if distance_mm <= min(gate_mm, NARROWEST_GATE_MM + GATE_SIGMAS * sigma_mm):
                costs[row, column] = distance_mm**2
    rows, columns = linear_sum_assignment(costs)
    return {
        int(row): int(column)
        for row, column in zip(rows, columns, strict=True)
        if costs[row, column] < OUT_OF_REACH
    }


def _born(contact: Contact) -> _Track:
    return _Track(
        id=0,
        reported_at_s=0.0,
        x_mm=contact.x_mm,
        y_mm=contact.y_mm,
        seen_x_mm=contact.x_mm,
        seen_y_mm=contact.y_mm,
        vx_mm_s=0.0,
        vy_mm_s=0.0,
        position_variance=_sigma_mm(contact) ** 2,
        covariance=0.0,
        velocity_variance=BIRTH_SPEED_SIGMA_MM_S**2,
        seen=1,
        missed=0,
    )


def _predicted(track: _Track, elapsed_s: float, acceleration_variance: float) -> _Track:
    return replace(
        track,
        x_mm=track.x_mm + track.vx_mm_s * elapsed_s,
        y_mm=track.y_mm + track.vy_mm_s * elapsed_s,
        position_variance=track.position_variance
        + 2.0 * elapsed_s * track.covariance
        + elapsed_s**2 * track.velocity_variance
        + acceleration_variance * elapsed_s**4 / 4.0,
        covariance=track.covariance
        + elapsed_s * track.velocity_variance
        + acceleration_variance * elapsed_s**3 / 2.0,
        velocity_variance=track.velocity_variance + acceleration_variance * elapsed_s**2,
    )


def _corrected(track: _Track, contact: Contact) -> _Track:
    """Move the prediction towards the contact; all the way while the track is not reported yet."""
    noise = _sigma_mm(contact) ** 2
    spread = track.position_variance + noise
    gain = track.position_variance / spread if track.id else 1.0
    velocity_gain = track.covariance / spread
    rest = 1.0 - gain
    dx, dy = contact.x_mm - track.x_mm, contact.y_mm - track.y_mm
    x_mm = rest * track.x_mm + gain * contact.x_mm
    y_mm = rest * track.y_mm + gain * contact.y_mm
    return replace(
        track,
        x_mm=x_mm,
        y_mm=y_mm,
        seen_x_mm=x_mm,
        seen_y_mm=y_mm,
        vx_mm_s=track.vx_mm_s + velocity_gain * dx,
        vy_mm_s=track.vy_mm_s + velocity_gain * dy,
        # Joseph's form, which holds for any gain
        position_variance=rest**2 * track.position_variance + gain**2 * noise,
        covariance=rest * (track.covariance - velocity_gain * track.position_variance)
        + gain * velocity_gain * noise,
        velocity_variance=track.velocity_variance - velocity_gain * track.covariance,
        seen=track.seen + 1,
        missed=0,
    )


def _touch(track: _Track, captured_at_s: float) -> Touch:
    coasts = track.missed > 0
    return Touch(
        id=track.id,
        x_mm=track.seen_x_mm,
        y_mm=track.seen_y_mm,
        vx_mm_s=0.0 if coasts else track.vx_mm_s,
        vy_mm_s=0.0 if coasts else track.vy_mm_s,
        age_s=captured_at_s - track.reported_at_s,
    )
