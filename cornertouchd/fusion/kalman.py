"""Where a touch is and how it moves: a Kalman filter with constant velocity.

The acceleration is white noise.  The radius is followed beside it, slowly.
"""

from math import exp, inf, isfinite, sqrt

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.evidence import SUPPORT_OF_HIDDEN, is_missed_where_hidden
from cornertouchd.fusion.track_rows import (
    AT_RADIUS,
    AT_X,
    AT_Y,
    CONTINUES,
    COVARIANCE,
    OWN_EDGES,
    POSITION_VARIANCE,
    RADIUS,
    RADIUS_VARIANCE,
    SIGMA,
    SPEED_VARIANCE,
    SPEED_X,
    SPEED_Y,
    SUPPORT,
    TAKEN_FOR_PALM_S,
    UNSUPPORTED_S,
    X,
    Y,
)
from cornertouchd.model import FloatArray

# No contact is known better: its section is not quite an ellipse, and hands tremble.
SMALLEST_SIGMA_MM = 0.1
# A crossing that had the prediction before it has weighed it already; this much it may be wrong.
SMALLEST_SIGMA_OF_CONTINUED_MM = 0.05
SIGMA_OF_UNKNOWN_MM = 1.0
# A finger may land while it moves: 2 m/s, the quickest swipes, are three sigmas.
BIRTH_SPEED_SIGMA_MM_S = 700.0
# A touch that nothing but the belief in it supports slows down and stays where it was lost:
# within this time a finger at 150 mm/s passes behind another one.
SLOWS_DOWN_WITHIN_S = 0.1
SPEED_OF_UNSUPPORTED_MM_S = 300.0
# The radius of a new touch is known to a finger's; then a fifth of each difference is believed.
# A shadow grows while a finger lands, which this follows within four frame sets.
BIRTH_RADIUS_SIGMA_MM = 1.0
RADIUS_SIGMA_MM = 0.4
RADIUS_NOISE_MM = 0.8
# With fewer edges of its own the radius of a contact says more about its neighbours.
EDGES_THAT_TELL_A_RADIUS = 4


@borrowing
def _variance(contact: FloatArray, smallest_sigma_mm: float) -> float:
    sigma_mm = contact[SIGMA]
    return max(sigma_mm, smallest_sigma_mm) ** 2 if isfinite(sigma_mm) else SIGMA_OF_UNKNOWN_MM**2


@borrowing
def _slow_down(track: FloatArray, elapsed_s: float, most_mm_s: float) -> None:
    speed = sqrt(track[SPEED_X] ** 2 + track[SPEED_Y] ** 2)
    rest = exp(-elapsed_s / SLOWS_DOWN_WITHIN_S)
    if speed * rest > most_mm_s:
        rest = most_mm_s / speed
    track[SPEED_X] *= rest
    track[SPEED_Y] *= rest


@borrowing
def _follow_radius(track: FloatArray, radius_mm: float) -> None:
    gain = track[RADIUS_VARIANCE] / (track[RADIUS_VARIANCE] + RADIUS_NOISE_MM**2)
    track[RADIUS] += gain * (radius_mm - track[RADIUS])
    track[RADIUS_VARIANCE] = max((1.0 - gain) * track[RADIUS_VARIANCE], RADIUS_SIGMA_MM**2)


@borrowing
def start_moving(track: FloatArray, contact: FloatArray) -> None:
    """Begin where the contact is, with a velocity that is not known."""
    track[X], track[Y], track[RADIUS] = contact[AT_X], contact[AT_Y], contact[AT_RADIUS]
    track[SPEED_X] = track[SPEED_Y] = 0.0
    track[POSITION_VARIANCE] = _variance(contact, SMALLEST_SIGMA_MM)
    track[COVARIANCE] = 0.0
    track[SPEED_VARIANCE] = BIRTH_SPEED_SIGMA_MM_S**2
    track[RADIUS_VARIANCE] = BIRTH_RADIUS_SIGMA_MM**2


@borrowing
def advance(
    track: FloatArray, elapsed_s: float, acceleration_variance: float, largest_variance: float
) -> None:
    """Move the track on; its position never gets less certain than `largest_variance`."""
    if track[UNSUPPORTED_S] > 0.0:
        _slow_down(track, elapsed_s, SPEED_OF_UNSUPPORTED_MM_S)
    elif track[TAKEN_FOR_PALM_S] > 0.0 or is_missed_where_hidden(track):
        _slow_down(track, elapsed_s, inf)
    track[X] += elapsed_s * track[SPEED_X]
    track[Y] += elapsed_s * track[SPEED_Y]
    track[POSITION_VARIANCE] += (
        2.0 * elapsed_s * track[COVARIANCE]
        + elapsed_s**2 * track[SPEED_VARIANCE]
        + acceleration_variance * elapsed_s**4 / 4.0
    )
    track[COVARIANCE] += (
        elapsed_s * track[SPEED_VARIANCE] + acceleration_variance * elapsed_s**3 / 2.0
    )
    track[SPEED_VARIANCE] += acceleration_variance * elapsed_s**2
    if track[POSITION_VARIANCE] > largest_variance:
        # the covariance with it, so that both go on to be those of something possible
        track[COVARIANCE] *= largest_variance / track[POSITION_VARIANCE]
        track[POSITION_VARIANCE] = largest_variance


@borrowing
def follow(track: FloatArray, contact: FloatArray) -> None:
    """Move the track to where the contact says that the touch is."""
    before = track[POSITION_VARIANCE]
    if contact[CONTINUES] >= 0.0:
        after = min(before, _variance(contact, SMALLEST_SIGMA_OF_CONTINUED_MM))
        dx, dy = contact[AT_X] - track[X], contact[AT_Y] - track[Y]
    else:
        gain = before / (before + _variance(contact, SMALLEST_SIGMA_MM))
        after = (1.0 - gain) * before
        dx, dy = gain * (contact[AT_X] - track[X]), gain * (contact[AT_Y] - track[Y])
    speed_per_mm = track[COVARIANCE] / before
    if contact[CONTINUES] >= 0.0:
        # what others half hide is found a little beside its place, and each time more to one side
        is_known = contact[SUPPORT] > 0.0  # and no NaN
        speed_per_mm *= min(contact[SUPPORT] / SUPPORT_OF_HIDDEN, 1.0) if is_known else 0.0
    track[X] += dx
    track[Y] += dy
    track[SPEED_X] += speed_per_mm * dx
    track[SPEED_Y] += speed_per_mm * dy
    track[SPEED_VARIANCE] -= speed_per_mm * track[COVARIANCE] * (1.0 - after / before)
    track[COVARIANCE] *= after / before
    track[POSITION_VARIANCE] = after
    if contact[OWN_EDGES] >= EDGES_THAT_TELL_A_RADIUS:
        _follow_radius(track, contact[AT_RADIUS])
