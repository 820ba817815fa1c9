"""How firmly a touch is believed in, when it is reported, and when it ends."""

from math import isnan

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.costs import COST_OF_A_NEW_DISC
from cornertouchd.fusion.track_rows import (
    AT_RADIUS,
    AT_X,
    AT_Y,
    CAMERAS,
    CONFIDENCE,
    CONTINUES,
    FINGER_S,
    ID,
    IS_PALM,
    LAST_SUPPORT,
    LOG_ODDS,
    MISSED,
    OWN_EDGES,
    PALM_RADIUS,
    REPORTED_AT_S,
    SEEN,
    SUPPORT,
    TAKEN_FOR_PALM_S,
    UNSUPPORTED_S,
    X,
    Y,
    is_palm,
    is_reported,
)
from cornertouchd.model import FloatArray

# Found by Monte-Carlo with 15 fingers on 350x400: belief comes quickly and goes slowly, because a
# finger that others hide for a moment is still there.  A touch never becomes cheaper than free:
# ghosts would stick.  The least belief is nearly as dear as a new touch: it favours nothing.
LEAST_LOG_ODDS = -6.0
REPORTED_LOG_ODDS = -3.0
SHARE_BELIEVED = 0.5
MOST_BELIEVED = 4.0
SHARE_DOUBTED = 0.1
MOST_DOUBTED = 0.1
# Less than half of what one shadow edge is worth: then the touch's own past alone chose it.
LEAST_SUPPORT = 2.0
LONGEST_UNSUPPORTED_S = 0.5
# What is told apart by less than this (one contact in forty, with ten fingers down) is about to
# pass behind others.  While no camera sees light where it should be, it is waited for so many times
# as long as another touch, once it has been seen for a tenth of a second: few ghosts are.
SUPPORT_OF_HIDDEN = 12.0
SIGHTS_OF_A_LASTING_TOUCH = 10.0
PATIENCE_WITH_HIDDEN = 5.0
# Three of four contacts of this confidence are real, and only one or two in a hundred, with ten
# fingers down, have less: those wait to be confirmed, all others are reported at once.
CONFIDENCE_WITHOUT_CONFIRMATION = 0.5
# Three edges fit a disc that is not there, too: one birth in twenty waits to be seen again.
EDGES_OF_A_CLEAR_BIRTH = 4.0
# Where two cameras see two fingers, the two ghosts explain their shadows nearly as well as the
# fingers do, frame after frame: being seen again proves nothing then.
CAMERAS_THAT_CONFIRM = 3
FRAMES_THAT_CONFIRM = 3.0
# Fingers that meet or pass each other may be taken for a palm, for as long as that takes; a hand
# that lands looks like a finger at first.  So a touch is a palm when it has been taken for one for
# a share of the time that it was a finger, within these limits; the least are two frame sets.
SHARE_OF_FINGER_THAT_LATCHES = 0.2
PALM_LATCHES_AFTER_S = 0.015
PALM_LATCHES_BEFORE_S = 0.15
# A hand that lifts looks like a finger for less than a fifth of a second.  What is one for longer
# was no palm, or the hand has left a finger where it lay.
FINGER_AGAIN_AFTER_S = 0.5
EDGES_OF_A_CLEAR_FINGER = 2.0


@borrowing
def _surplus(contact: FloatArray) -> float:
    """Return by how much the contact would be worth its cost if it were new.

    What supports a touch by more than that makes it surer, by less makes it less sure.
    """
    support = contact[SUPPORT]
    return -COST_OF_A_NEW_DISC if isnan(support) else support - COST_OF_A_NEW_DISC


@borrowing
def _is_supported(contact: FloatArray) -> bool:
    """Whether more than the prediction that it continues speaks for the contact."""
    if contact[CONTINUES] < 0.0:
        return True
    return bool(contact[OWN_EDGES] > 0.0 and contact[SUPPORT] >= LEAST_SUPPORT)


@borrowing
def _doubt(track: FloatArray, by: float) -> None:
    track[LOG_ODDS] = max(track[LOG_ODDS] - by, LEAST_LOG_ODDS)


@borrowing
def start_believing(track: FloatArray, contact: FloatArray) -> None:
    """Begin with the least belief.

    What is not sure enough to be reported is not favoured: ghosts would prove themselves.
    """
    track[ID] = 0.0
    track[LOG_ODDS] = LEAST_LOG_ODDS
    track[SEEN] = 1.0
    track[LAST_SUPPORT] = contact[SUPPORT]
    track[MISSED] = track[UNSUPPORTED_S] = track[TAKEN_FOR_PALM_S] = track[FINGER_S] = 0.0
    track[PALM_RADIUS] = contact[AT_RADIUS] if contact[IS_PALM] > 0.0 else 0.0


@borrowing
def believe_from_now_on(track: FloatArray, contact: FloatArray) -> None:
    """Begin to favour the touch, as much as the contact deserves, because it is reported."""
    track[LOG_ODDS] = min(max(_surplus(contact) - 1.0, REPORTED_LOG_ODDS), 0.0)


@borrowing
def _stay_palm(track: FloatArray, contact: FloatArray, elapsed_s: float) -> None:
    """Weigh whether what has been a palm is one still."""
    if contact[IS_PALM] > 0.0:
        track[PALM_RADIUS] = max(track[PALM_RADIUS], contact[AT_RADIUS])
        track[FINGER_S] = 0.0
    elif contact[OWN_EDGES] >= EDGES_OF_A_CLEAR_FINGER:
        track[FINGER_S] += elapsed_s
    if track[FINGER_S] > FINGER_AGAIN_AFTER_S:
        track[PALM_RADIUS] = track[FINGER_S] = 0.0


@borrowing
def believe(track: FloatArray, contact: FloatArray, elapsed_s: float) -> None:
    """Weigh what a contact tells about the touch that it continues."""
    track[SEEN] += 1.0
    track[LAST_SUPPORT] = contact[SUPPORT]
    track[MISSED] = track[TAKEN_FOR_PALM_S] = 0.0
    track[UNSUPPORTED_S] = 0.0 if _is_supported(contact) else track[UNSUPPORTED_S] + elapsed_s
    if is_palm(track):
        _stay_palm(track, contact, elapsed_s)
    elif not is_reported(track):
        return
    surplus = _surplus(contact)
    if surplus > 0.0:
        track[LOG_ODDS] = min(track[LOG_ODDS] + SHARE_BELIEVED * min(surplus, MOST_BELIEVED), 0.0)
    else:
        _doubt(track, min(-SHARE_DOUBTED * surplus, MOST_DOUBTED))


@borrowing
def may_be_hidden(track: FloatArray) -> bool:
    """Whether so little told the touch apart when it was seen last that others may hide it now."""
    return bool(
        is_reported(track)
        and track[LAST_SUPPORT] < SUPPORT_OF_HIDDEN
        and track[SEEN] >= SIGHTS_OF_A_LASTING_TOUCH
    )


@borrowing
def is_missed_where_hidden(track: FloatArray) -> bool:
    """Whether the touch is missing since others may hide it."""
    return bool(track[MISSED] > 0.0 and track[LAST_SUPPORT] < SUPPORT_OF_HIDDEN)


@borrowing
def miss(track: FloatArray, periods: float) -> None:
    """Weigh that no contact continues the touch, for so many periods of the cameras."""
    track[MISSED] += periods
    _doubt(track, MOST_DOUBTED)


@borrowing
def is_taken_for_palm(
    track: FloatArray, contact: FloatArray, now_s: float, elapsed_s: float
) -> bool:
    """Whether what was a finger so far looks like a palm; once it has done so for long, it is one.

    Until then it rests.
    """
    if contact[IS_PALM] == 0.0 or is_palm(track):
        return False
    track[TAKEN_FOR_PALM_S] += elapsed_s
    finger_s = now_s - track[REPORTED_AT_S] - track[TAKEN_FOR_PALM_S]
    latches_after_s = min(
        max(SHARE_OF_FINGER_THAT_LATCHES * finger_s, PALM_LATCHES_AFTER_S), PALM_LATCHES_BEFORE_S
    )
    if is_reported(track) and track[TAKEN_FOR_PALM_S] < latches_after_s:
        track[MISSED] = 0.0
        _doubt(track, MOST_DOUBTED)
        return True
    track[ID] = 0.0
    track[PALM_RADIUS] = contact[AT_RADIUS]
    return False


@borrowing
def goes_on(track: FloatArray, coast_frames: float, is_hidden: bool) -> bool:
    """Whether the touch is worth following after this frame set."""
    patience = coast_frames if is_reported(track) or is_palm(track) else 0.0
    if is_hidden:
        patience *= PATIENCE_WITH_HIDDEN
    return bool(track[MISSED] <= patience and track[UNSUPPORTED_S] <= LONGEST_UNSUPPORTED_S)


@borrowing
def is_sure(track: FloatArray, contact: FloatArray, confirm_frames: float, whole: bool) -> bool:
    """Whether a touch that the contact shows is real enough to be reported.

    A confident one that owns few edges has to be seen again, and so has a doubtful one that three
    cameras show; a doubtful one that owns few, three times.  A frame set that lacks a camera makes
    ghosts that look sure, but seldom the same ones as the next.
    """
    is_confident = contact[CONFIDENCE] >= CONFIDENCE_WITHOUT_CONFIRMATION
    is_clear = contact[OWN_EDGES] >= EDGES_OF_A_CLEAR_BIRTH
    if whole:
        if is_confident:
            return bool(is_clear or track[SEEN] >= confirm_frames)
        frames = confirm_frames if is_clear else max(confirm_frames, FRAMES_THAT_CONFIRM)
        return bool(track[SEEN] >= frames and contact[CAMERAS] >= CAMERAS_THAT_CONFIRM)
    return bool(is_confident and track[SEEN] >= max(confirm_frames, FRAMES_THAT_CONFIRM))


@borrowing
def is_part_of_palm(contact: FloatArray, palm: FloatArray) -> bool:
    """Whether the contact lies where the palm was at its largest."""
    apart = (contact[AT_X] - palm[X]) ** 2 + (contact[AT_Y] - palm[Y]) ** 2
    return bool(is_palm(palm) and apart < palm[PALM_RADIUS] ** 2)
