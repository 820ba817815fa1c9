"""What is reported of a touch: smoothed where it is slow, at rest where it is still.

Casiez, Roussel, Vogel: 1€ Filter: A Simple Speed-based Low-pass Filter for Noisy Input in
Interactive Systems (CHI 2012).  Both axes share one cutoff, so that strokes stay straight.
"""

from math import exp, pi, sqrt

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.track_rows import (
    AHEAD_S,
    AT_X,
    AT_Y,
    BEHIND_X,
    BEHIND_Y,
    BETA,
    CUTOFF_HZ,
    DEAD_BAND,
    HEIGHT,
    REST_SINCE_S,
    REST_X,
    REST_Y,
    SHIFT_X,
    SHIFT_Y,
    SHOWN_SPEED_X,
    SHOWN_SPEED_Y,
    SHOWN_X,
    SHOWN_Y,
    SMOOTH_X,
    SMOOTH_Y,
    SPEED_X,
    SPEED_Y,
    STILL,
    TAKEN_AT_S,
    TAKEN_X,
    TAKEN_Y,
    TIP_X,
    TIP_Y,
    TREND_CUTOFF_HZ,
    TREND_X,
    TREND_Y,
    WIDTH,
)
from cornertouchd.model import FloatArray

# A finger is still again when it has not left a circle of half the dead band for so long: with a
# dead band of 0.08 mm a drag of 0.4 mm/s is still followed.
STILL_AFTER_S = 0.1
SHARE_OF_DEAD_BAND = 0.5
# A report that leaves the dead band makes up for it within this time instead of jumping.
CATCHES_UP_WITHIN_S = 0.03
# Two frame sets are never nearer in time; if they seem to be, speeds stay finite.
SHORTEST_TIME_S = 1e-6


@borrowing
def _share(cutoff_hz: float, elapsed_s: float) -> float:
    """Return how much of a difference a low-pass filter of first order takes over."""
    return 1.0 / (1.0 + 1.0 / (2.0 * pi * cutoff_hz * elapsed_s))


@borrowing
def _smooth(track: FloatArray, elapsed_s: float, rules: FloatArray) -> None:
    """Take in where the track is; a cutoff of 0 lets all through."""
    trend_share = _share(rules[TREND_CUTOFF_HZ], elapsed_s)
    track[TREND_X] += trend_share * ((track[TIP_X] - track[TAKEN_X]) / elapsed_s - track[TREND_X])
    track[TREND_Y] += trend_share * ((track[TIP_Y] - track[TAKEN_Y]) / elapsed_s - track[TREND_Y])
    track[TAKEN_X], track[TAKEN_Y] = track[TIP_X], track[TIP_Y]
    share = 1.0
    if rules[CUTOFF_HZ] > 0.0:
        speed = sqrt(track[TREND_X] ** 2 + track[TREND_Y] ** 2)
        share = _share(rules[CUTOFF_HZ] + rules[BETA] * speed, elapsed_s)
    track[SMOOTH_X] += share * (track[TIP_X] - track[SMOOTH_X])
    track[SMOOTH_Y] += share * (track[TIP_Y] - track[SMOOTH_Y])


@borrowing
def _rest(track: FloatArray, elapsed_s: float, now_s: float, dead_band_mm: float) -> None:
    """Tell whether the finger is still, by a dead band with hysteresis.

    A still one has to leave the dead band to move; one that moves has to stay in half of it for
    some time to be still, and rests where it is then.
    """
    was_still = track[STILL] > 0.0
    allowed_mm = dead_band_mm if was_still else SHARE_OF_DEAD_BAND * dead_band_mm
    dx, dy = track[SMOOTH_X] - track[REST_X], track[SMOOTH_Y] - track[REST_Y]
    if dx * dx + dy * dy > allowed_mm * allowed_mm:
        if was_still:
            share = dead_band_mm / sqrt(dx * dx + dy * dy)
            track[BEHIND_X], track[BEHIND_Y] = share * dx, share * dy
        track[STILL] = 0.0
        track[REST_SINCE_S] = now_s
        track[REST_X], track[REST_Y] = track[SMOOTH_X], track[SMOOTH_Y]
    elif not was_still and now_s - track[REST_SINCE_S] >= STILL_AFTER_S:
        track[STILL] = 1.0
        track[REST_X], track[REST_Y] = track[SMOOTH_X], track[SMOOTH_Y]
    left = exp(-elapsed_s / CATCHES_UP_WITHIN_S)
    track[BEHIND_X] *= left
    track[BEHIND_Y] *= left


@borrowing
def _ahead(place_mm: float, speed_mm_s: float, ahead_s: float, side_mm: float) -> float:
    """Return where the finger will be, on the surface; without prediction, where it is."""
    if ahead_s == 0.0:
        return place_mm
    return min(max(place_mm + speed_mm_s * ahead_s, 0.0), side_mm)


@borrowing
def show_first(track: FloatArray, contact: FloatArray, now_s: float, rules: FloatArray) -> None:
    """Report the measurement itself, at rest: nothing is known of its motion."""
    x = min(max(contact[AT_X] + track[SHIFT_X], 0.0), rules[WIDTH])
    y = min(max(contact[AT_Y] + track[SHIFT_Y], 0.0), rules[HEIGHT])
    track[TAKEN_AT_S] = track[REST_SINCE_S] = now_s
    track[TAKEN_X], track[TAKEN_Y] = x, y
    track[TREND_X] = track[TREND_Y] = 0.0
    track[SMOOTH_X], track[SMOOTH_Y] = x, y
    track[REST_X], track[REST_Y] = x, y
    track[BEHIND_X] = track[BEHIND_Y] = 0.0
    track[STILL] = 1.0
    track[SHOWN_X], track[SHOWN_Y] = x, y
    track[SHOWN_SPEED_X] = track[SHOWN_SPEED_Y] = 0.0


@borrowing
def show(track: FloatArray, now_s: float, rules: FloatArray) -> None:
    """Report where the track is now."""
    elapsed_s = max(now_s - track[TAKEN_AT_S], SHORTEST_TIME_S)
    track[TAKEN_AT_S] = now_s
    _smooth(track, elapsed_s, rules)
    _rest(track, elapsed_s, now_s, rules[DEAD_BAND])
    if track[STILL] > 0.0:
        track[SHOWN_X], track[SHOWN_Y] = track[REST_X], track[REST_Y]
        track[SHOWN_SPEED_X] = track[SHOWN_SPEED_Y] = 0.0
        return
    track[SHOWN_SPEED_X], track[SHOWN_SPEED_Y] = track[SPEED_X], track[SPEED_Y]
    x, y = track[SMOOTH_X] - track[BEHIND_X], track[SMOOTH_Y] - track[BEHIND_Y]
    track[SHOWN_X] = _ahead(x, track[SPEED_X], rules[AHEAD_S], rules[WIDTH])
    track[SHOWN_Y] = _ahead(y, track[SPEED_Y], rules[AHEAD_S], rules[HEIGHT])


@borrowing
def show_last(track: FloatArray) -> None:
    """Report the touch where it was reported last, at rest."""
    track[SHOWN_SPEED_X] = track[SHOWN_SPEED_Y] = 0.0
