"""Which contact continues which touch."""

from math import sqrt

import numpy as np

from cornertouchd.compiling import borrowing, compiled, inlined
from cornertouchd.fusion.cheapest import NONE, cheapest_partners
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.evidence import CONFIDENCE_WITHOUT_CONFIRMATION, may_be_hidden
from cornertouchd.fusion.track_rows import (
    AT_X,
    AT_Y,
    CONFIDENCE,
    CONTINUES,
    POSITION_VARIANCE,
    SIGMA,
    TOUCHES,
    X,
    Y,
    is_palm,
    is_reported,
)
from cornertouchd.model import BoolArray, FloatArray

# Half a finger wide where the prediction is certain, so that a neighbour is never taken for it.
NARROWEST_GATE_MM = 4.0
GATE_SIGMAS = 3.0
# Where a touch is that others are about to hide is not known as well as it seems: a clear contact
# this much farther is more likely that finger than one that lands beside it.  A doubtful one is
# more likely a ghost that the others make: it would lead the touch away.
WIDER_GATE_OF_HIDDEN_MM = 4.0
GATE_OF_DOUBTFUL_MM = 4.0
LEAST_LARGEST_SIGMA_MM = 1.0
OUT_OF_REACH = 1e12
# Dearer than any distance: what is not reported yet gets what those that are leave.
COST_OF_TENTATIVE = 1e6


def largest_sigma_mm(gate_mm: float) -> float:
    """Return the sigma of a prediction that makes its gate as wide as any may be."""
    return max((gate_mm - NARROWEST_GATE_MM) / GATE_SIGMAS, LEAST_LARGEST_SIGMA_MM)


@borrowing
def _is_tentative(track: FloatArray) -> bool:
    """Whether the track may be a ghost: neither reported yet nor a palm."""
    return not is_reported(track) and not is_palm(track)


@borrowing
def _reach_mm(track: FloatArray, contact: FloatArray, gate_mm: float) -> float:
    """Return how far from where the track is expected the contact may continue it."""
    sigma_mm = sqrt(track[POSITION_VARIANCE] + contact[SIGMA] ** 2)
    reach_mm = NARROWEST_GATE_MM + GATE_SIGMAS * sigma_mm
    if may_be_hidden(track):
        if contact[CONFIDENCE] < CONFIDENCE_WITHOUT_CONFIRMATION:
            return min(gate_mm, GATE_OF_DOUBTFUL_MM)
        reach_mm += WIDER_GATE_OF_HIDDEN_MM
    return min(gate_mm, reach_mm)


@borrowing
def _cost(track: FloatArray, contact: FloatArray, gate_mm: float) -> float:
    cost = (contact[AT_X] - track[X]) ** 2 + (contact[AT_Y] - track[Y]) ** 2
    if not cost <= _reach_mm(track, contact, gate_mm) ** 2:
        return OUT_OF_REACH
    return float(cost + COST_OF_TENTATIVE) if _is_tentative(track) else float(cost)


@inlined
def _claimed(tracks: FloatArray, contacts: FloatArray) -> tuple[IntArray, BoolArray]:
    """Return the partners of tracks (T,) that contacts continue, and which contacts are taken.

    Those that touch nothing are taken, too.  What continues a tentative track is not: it may be the
    touch that went missing beside it.
    """
    partners = np.empty(len(tracks), np.int64)
    partners[:] = -1
    taken = np.empty(len(contacts), np.bool_)
    for number in range(len(contacts)):
        taken[number] = contacts[number, TOUCHES] == 0.0
        continued = int(contacts[number, CONTINUES])
        if taken[number] or not 0 <= continued < len(tracks) or partners[continued] >= 0:
            contacts[number, CONTINUES] = -1.0
            continue
        if _is_tentative(tracks[continued]):
            continue
        partners[continued] = number
        taken[number] = True
    return partners, taken


@inlined
def _without_partner(has_one: BoolArray) -> IntArray:
    numbers = np.empty(len(has_one), np.int64)
    count = 0
    for number in range(len(has_one)):
        if not has_one[number]:
            numbers[count] = number
            count += 1
    return numbers[:count]


@borrowing
def _forget_wrong_claims(partners: IntArray, contacts: FloatArray) -> None:
    """Let contacts that continue another track than they say, or none, say nothing."""
    for number in range(len(contacts)):
        continued = int(contacts[number, CONTINUES])
        if continued >= 0 and partners[continued] != number:
            contacts[number, CONTINUES] = -1.0


@inlined
def _sure_partners(
    partners: IntArray,
    tracks: FloatArray,
    contacts: FloatArray,
    gate_mm: float,
    free_tracks: IntArray,
    free_contacts: IntArray,
) -> FloatArray:
    """Give tracks their partners as far as there is no choice.

    Returns the squared distances (A, B) of the free tracks to the free contacts if there is one,
    else nothing (0, 0).
    """
    costs = np.empty((len(free_tracks), len(free_contacts)))
    reached_by = np.zeros(len(free_contacts), np.int64)
    choice = False
    for row in range(len(free_tracks)):
        reached = 0
        for column in range(len(free_contacts)):
            cost = _cost(tracks[free_tracks[row]], contacts[free_contacts[column]], gate_mm)
            costs[row, column] = cost
            if cost < OUT_OF_REACH:
                reached += 1
                reached_by[column] += 1
                partners[free_tracks[row]] = free_contacts[column]
                choice |= reached_by[column] > 1
        choice |= reached > 1
    return costs if choice else np.empty((0, 0))


@compiled("i8[::1](f8[:,::1], f8[:,::1], f8)")
def assign(tracks: FloatArray, contacts: FloatArray, gate_mm: float) -> IntArray:
    """Return for each track the contact that continues it, or -1.

    A contact that says which prediction it continues is believed; whichever of the others may be
    told apart only together are assigned as many as possible, to touches that are reported before
    others, at the least sum of squared distances.  Columns `CONTINUES` of contacts that cannot be
    right become -1.
    """
    partners, taken = _claimed(tracks, contacts)
    free_tracks, free_contacts = _without_partner(partners >= 0), _without_partner(taken)
    costs = _sure_partners(partners, tracks, contacts, gate_mm, free_tracks, free_contacts)
    if costs.size > 0:
        chosen = cheapest_partners(costs)
        for row in range(len(free_tracks)):
            column = chosen[row]
            within = column != NONE and costs[row, column] < OUT_OF_REACH
            partners[free_tracks[row]] = free_contacts[column] if within else NONE
    _forget_wrong_claims(partners, contacts)
    return partners
