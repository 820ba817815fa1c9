"""Which contact continues which touch."""

from math import sqrt

import numpy as np
from scipy.optimize import linear_sum_assignment

from cornertouchd.compiling import compiled, inlined
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.track_rows import (
    AT_X,
    AT_Y,
    CONTINUES,
    POSITION_VARIANCE,
    SIGMA,
    TOUCHES,
    X,
    Y,
)
from cornertouchd.model import BoolArray, FloatArray

# Half a finger wide where the prediction is certain, so that a neighbour is never taken for it.
NARROWEST_GATE_MM = 4.0
GATE_SIGMAS = 3.0
LEAST_LARGEST_SIGMA_MM = 1.0
OUT_OF_REACH = 1e12


def largest_sigma_mm(gate_mm: float) -> float:
    """Return the sigma of a prediction that makes its gate as wide as any may be."""
    return max((gate_mm - NARROWEST_GATE_MM) / GATE_SIGMAS, LEAST_LARGEST_SIGMA_MM)


@inlined
def _cost(track: FloatArray, contact: FloatArray, gate_mm: float) -> float:
    sigma_mm = sqrt(track[POSITION_VARIANCE] + contact[SIGMA] ** 2)
    reach_mm = min(gate_mm, NARROWEST_GATE_MM + GATE_SIGMAS * sigma_mm)
    cost = (contact[AT_X] - track[X]) ** 2 + (contact[AT_Y] - track[Y]) ** 2
    return float(cost) if cost <= reach_mm**2 else OUT_OF_REACH


@inlined
def _claimed(tracks: FloatArray, contacts: FloatArray) -> tuple[IntArray, BoolArray]:
    """Return the partners of tracks (T,) that contacts continue, and which contacts are taken.

    Those that touch nothing are taken, too.
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


@compiled("Tuple((i8[::1], i8[::1], i8[::1], f8[:,::1]))(f8[:,::1], f8[:,::1], f8)")
def _sure_partners(
    tracks: FloatArray, contacts: FloatArray, gate_mm: float
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Return the partners of tracks (T,) as far as there is no choice, and what is left to choose.

    That is A tracks and B contacts, by their numbers, with their squared distances (A, B), and
    neither when all is told.
    """
    partners, taken = _claimed(tracks, contacts)
    free_tracks, free_contacts = _without_partner(partners >= 0), _without_partner(taken)
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
    if not choice:
        return partners, free_tracks, free_contacts, np.empty((0, 0))
    for row in range(len(free_tracks)):
        partners[free_tracks[row]] = -1
    return partners, free_tracks, free_contacts, costs


def assign(tracks: FloatArray, contacts: FloatArray, gate_mm: float) -> IntArray:
    """Return for each track the contact that continues it, or -1.

    A contact that says which prediction it continues is believed; whichever of the others may be
    told apart only together are assigned by the Hungarian method, as many as possible at the least
    sum of squared distances.  Columns `CONTINUES` of contacts that cannot be right become -1.
    """
    partners, free_tracks, free_contacts, costs = _sure_partners(tracks, contacts, gate_mm)
    if costs.size:
        rows, columns = linear_sum_assignment(costs)
        within = costs[rows, columns] < OUT_OF_REACH
        partners[free_tracks[rows[within]]] = free_contacts[columns[within]]
    return partners
