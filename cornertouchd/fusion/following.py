"""All touches from one frame set to the next, compiled."""

import numpy as np

from cornertouchd.compiling import borrowing, compiled
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.evidence import (
    believe,
    believe_from_now_on,
    goes_on,
    is_part_of_palm,
    is_sure,
    is_taken_for_palm,
    miss,
    start_believing,
)
from cornertouchd.fusion.kalman import advance, follow, start_moving
from cornertouchd.fusion.leaning import LARGEST_GAP, hovers, is_lifted, lean, start_leaning
from cornertouchd.fusion.smoothing import show, show_first, show_last
from cornertouchd.fusion.track_rows import (
    AT_RADIUS,
    COAST_FRAMES,
    CONFIRM_FRAMES,
    GAP,
    ID,
    LOG_ODDS,
    PALM_RADIUS,
    POSITION_VARIANCE,
    RADIUS,
    RADIUS_VARIANCE,
    REPORTED_AT_S,
    TOUCHES,
    TRACK_COLUMNS,
    X,
    Y,
    is_palm,
    is_reported,
)
from cornertouchd.model import BoolArray, FloatArray


@borrowing
def _report_if_sure(
    track: FloatArray,
    contact: FloatArray,
    rules: FloatArray,
    now_s: float,
    last_id: int,
    whole: bool,
) -> int:
    """Give the track the next id if it is a touch for sure; return the last id."""
    if is_palm(track) or hovers(contact):
        return last_id
    if not is_sure(track, contact, rules[CONFIRM_FRAMES], whole):
        return last_id
    track[ID] = last_id + 1
    track[REPORTED_AT_S] = now_s
    believe_from_now_on(track, contact)
    show_first(track, contact, now_s, rules)
    return last_id + 1


@borrowing
def _begin(
    track: FloatArray,
    contact: FloatArray,
    expected: FloatArray,
    rules: FloatArray,
    now_s: float,
    last_id: int,
    whole: bool,
) -> int:
    """Make a track of a contact that continues none; return the last id."""
    track[:] = 0.0
    start_moving(track, contact)
    start_leaning(track, contact, rules)
    start_believing(track, contact)
    for number in range(len(expected)):
        # what a palm falls apart into when the hand lifts
        if is_part_of_palm(contact, expected[number]):
            track[PALM_RADIUS] = contact[AT_RADIUS]
    return _report_if_sure(track, contact, rules, now_s, last_id, whole)


@borrowing
def _go_on(
    track: FloatArray,
    contact: FloatArray,
    rules: FloatArray,
    now_s: float,
    elapsed_s: float,
    last_id: int,
    whole: bool,
) -> int:
    """Bring a track to the contact that continues it; return the last id."""
    if is_taken_for_palm(track, contact, now_s, elapsed_s):
        show_last(track)
        return last_id
    believe(track, contact, elapsed_s)
    follow(track, contact)
    lean(track, contact, rules, elapsed_s)
    if is_reported(track):
        show(track, now_s, rules)
        return last_id
    return _report_if_sure(track, contact, rules, now_s, last_id, whole)


@compiled("Tuple((f8[:,::1], f8[:,::1], f8[::1], f8[::1], f8[::1]))(f8[:,::1], f8, f8, f8)")
def predicted(
    tracks: FloatArray, elapsed_s: float, acceleration_variance: float, largest_variance: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the tracks at a later time, and of them what `Predictions` consist of."""
    later = tracks.copy()
    discs = np.empty((len(tracks), 3))
    for number in range(len(later)):
        track = later[number]
        advance(track, elapsed_s, acceleration_variance, largest_variance)
        discs[number, 0], discs[number, 1], discs[number, 2] = track[X], track[Y], track[RADIUS]
    return (
        later,
        discs,
        later[:, POSITION_VARIANCE].copy(),
        later[:, RADIUS_VARIANCE].copy(),
        -later[:, LOG_ODDS],
    )


@compiled(
    "Tuple((f8[:,::1], i8))(f8[:,::1], i8[::1], b1[::1], f8[:,::1], f8[::1], f8, f8, f8, i8, b1)",
)
def updated(
    expected: FloatArray,
    partners: IntArray,
    hidden: BoolArray,
    contacts: FloatArray,
    rules: FloatArray,
    now_s: float,
    elapsed_s: float,
    periods: float,
    last_id: int,
    whole: bool,
) -> tuple[FloatArray, int]:
    """Return the tracks that go on or begin, and the last id that is given.

    `whole` says whether all cameras saw the frame set.
    """
    tracks = np.zeros((len(expected) + len(contacts), TRACK_COLUMNS))
    taken = (contacts[:, TOUCHES] == 0.0) | (contacts[:, GAP] > LARGEST_GAP)
    count = 0
    for number in range(len(expected)):
        track = tracks[count]
        for column in range(TRACK_COLUMNS):  # compiles in a tenth of the time of an assignment
            track[column] = expected[number, column]
        partner = partners[number]
        if partner < 0:
            miss(track, periods)
            show_last(track)
        else:
            taken[partner] = True
            last_id = _go_on(track, contacts[partner], rules, now_s, elapsed_s, last_id, whole)
        if goes_on(track, rules[COAST_FRAMES], hidden[number]) and not is_lifted(track):
            count += 1
    for number in range(len(contacts)):
        if not taken[number]:
            last_id = _begin(
                tracks[count], contacts[number], expected, rules, now_s, last_id, whole
            )
            count += 1
    return tracks[:count].copy(), last_id
