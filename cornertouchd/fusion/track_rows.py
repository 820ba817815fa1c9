"""What is known of each touch that is followed, and of each contact, as rows of an array.

The filters that move a touch, weigh it and smooth its report share its row; each has its own
columns.  Times are seconds of the frame sets, lengths millimetres, speeds mm/s.
"""

from cornertouchd.compiling import borrowing
from cornertouchd.model import FloatArray

(
    # what is told of it; ID is 0 until the touch is reported, and for one that shall not be
    ID,
    REPORTED_AT_S,
    SHOWN_X,
    SHOWN_Y,
    SHOWN_SPEED_X,
    SHOWN_SPEED_Y,
    # kalman: both axes share the variances, because the sigma of a contact has no direction
    X,
    Y,
    RADIUS,
    SPEED_X,
    SPEED_Y,
    POSITION_VARIANCE,
    COVARIANCE,
    SPEED_VARIANCE,
    RADIUS_VARIANCE,
    # leaning: how far the tip is beside the section, where it is, and how long it hovers
    SHIFT_X,
    SHIFT_Y,
    SHIFT_VARIANCE,
    TIP_X,
    TIP_Y,
    HOVERS_S,
    # evidence: how firmly it is believed in, how often it was seen, and missed since
    LOG_ODDS,
    SEEN,
    MISSED,
    LAST_SUPPORT,
    UNSUPPORTED_S,
    TAKEN_FOR_PALM_S,
    PALM_RADIUS,
    FINGER_S,
    # smoothing: what the filter took in last and gave out last, what it rests on,
    # and what a report that has just begun to move has still to make up for
    TAKEN_AT_S,
    TAKEN_X,
    TAKEN_Y,
    TREND_X,
    TREND_Y,
    SMOOTH_X,
    SMOOTH_Y,
    STILL,
    REST_X,
    REST_Y,
    REST_SINCE_S,
    BEHIND_X,
    BEHIND_Y,
) = range(42)
TRACK_COLUMNS = 42
# what is told reaches up to the radius
TOLD_COLUMNS = 9

(
    # the contact itself
    AT_X,
    AT_Y,
    AT_RADIUS,
    SIGMA,
    CONFIDENCE,
    CAMERAS,
    TOUCHES,
    IS_PALM,
    # what the crossing says about it
    SUPPORT,
    OWN_EDGES,
    CONTINUES,
    # what its rows tell
    TIP_SHIFT_X,
    TIP_SHIFT_Y,
    TIP_VARIANCE,
    GAP,
) = range(15)
CONTACT_COLUMNS = 15
OWN_COLUMNS = 8

# what the settings say, one array for all touches; a cutoff of 0 lets all through
(
    COAST_FRAMES,
    CONFIRM_FRAMES,
    CUTOFF_HZ,
    BETA,
    TREND_CUTOFF_HZ,
    DEAD_BAND,
    AHEAD_S,
    WIDTH,
    HEIGHT,
) = range(9)
RULES = 9


@borrowing
def is_reported(track: FloatArray) -> bool:
    """Whether the track has been a touch for others since some frame set."""
    return bool(track[ID] > 0.0)


@borrowing
def is_palm(track: FloatArray) -> bool:
    """Whether the track has been a palm; then it stays one, whatever it shrinks to."""
    return bool(track[PALM_RADIUS] > 0.0)
