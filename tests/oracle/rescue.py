"""Rescue: contacts that a camera fails to show.

A camera misses a shadow when its strip is soiled there or a picture is torn.  Two cameras miss one
when they look at each other past a thin contact, each with the other's body for a background.  Such
a contact lies in the light of those cameras and so in no cell; what the other cameras saw of it
stays unexplained.  So cameras are disbelieved: each one in turn, and each pair along its line.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np

from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.fusion.rescue import (
    CAMERA_BODY_MM,
    FEWEST_CAMERAS,
    FEWEST_CAMERAS_WITH_EDGES,
    FEWEST_EDGES,
    LARGEST_RADIUS_MM,
    MOST_CONTACTS,
    MOST_SHADOWS,
)
from cornertouchd.geometry import angles_and_distances, half_angles_of_discs, wrap_angle
from cornertouchd.model import BoolArray
from oracle.candidates import Candidates, find_candidates
from oracle.cells import CellRows, find_cells
from oracle.edge_rows import EdgeRows, without_cameras


def is_needed(rows: EdgeRows, unexplained: BoolArray, contacts: int) -> bool:
    """Tell whether a rescue has a chance: `unexplained` marks edges by their numbers."""
    return (
        int(np.count_nonzero(unexplained)) >= FEWEST_EDGES
        and len(rows.sigma_rad) <= MOST_SHADOWS
        and contacts <= MOST_CONTACTS
    )


def missed_candidates(
    rows: EdgeRows, unexplained: BoolArray, limits: DiscLimits
) -> list[Candidates]:
    """Return the discs that touch enough of the unexplained edges, for each set of disbelieved.

    The rows of the disbelieved cameras themselves are void.
    """
    if len(rows.cameras) < FEWEST_CAMERAS:
        return []
    found = []
    for a, b in combinations_with_replacement(range(len(rows.cameras)), 2):
        if a == b:
            found.append(_shown_by_others((a,), rows, unexplained, limits))
        else:
            pair = _shown_by_others((a, b), rows, unexplained, limits)
            found.append(_in_line(pair, (a, b), rows))
    return found


def _shown_by_others(
    disbelieved: Sequence[int], rows: EdgeRows, unexplained: BoolArray, limits: DiscLimits
) -> Candidates:
    others, shadows = without_cameras(rows, disbelieved)
    found = find_candidates(others, find_cells(others, limits), limits)
    edges = 2 * shadows[found.rows.edges // 2] + found.rows.edges % 2
    explains = found.tangent & unexplained[edges]
    per_camera = explains.reshape(len(found), len(others.cameras), 2)
    looking = rows.in_view(found.discs[:, :2])[:, list(disbelieved)]
    showing = np.count_nonzero(found.rows.shown, axis=1)
    kept = (
        np.all(looking, axis=1)
        & (showing + len(disbelieved) >= FEWEST_CAMERAS)
        & (np.count_nonzero(explains, axis=1) >= FEWEST_EDGES)
        & (np.count_nonzero(np.any(per_camera, axis=2), axis=1) >= FEWEST_CAMERAS_WITH_EDGES)
        & (found.discs[:, 2] <= LARGEST_RADIUS_MM)
    )
    return _with_void_rows(found.take(kept), edges[kept], disbelieved, rows)


def _with_void_rows(
    found: Candidates, edges: IntArray, disbelieved: Sequence[int], rows: EdgeRows
) -> Candidates:
    """Insert rows that bound nothing and that nothing touches in place of the cameras'."""
    void = np.repeat(np.asarray(disbelieved, dtype=np.intp), 2)
    place = 2 * (void - np.repeat(np.arange(len(disbelieved)), 2))
    return replace(
        found,
        rows=CellRows(
            edges=np.insert(edges, place, 2 * rows.first_shadow[void], axis=1),
            normals=np.insert(found.rows.normals, place, 0.0, axis=1),
            offsets_mm=np.insert(found.rows.offsets_mm, place, 0.0, axis=1),
            sigma_rad=np.insert(found.rows.sigma_rad, place, 1.0, axis=1),
            valid=np.insert(found.rows.valid, place, False, axis=1),
            origins_mm=rows.positions_mm,
        ),
        z=np.insert(found.z, place, np.inf, axis=1),
        tangent=np.insert(found.tangent, place, False, axis=1),
    )


def _in_line(found: Candidates, pair: tuple[int, int], rows: EdgeRows) -> Candidates:
    """Keep the discs that each camera of the pair sees before the body of the other."""
    eyes = rows.positions_mm[list(pair)]
    to_discs, distances = angles_and_distances(found.discs[:, :2], eyes)
    to_bodies, apart = angles_and_distances(eyes[::-1], eyes)
    beside = np.abs(wrap_angle(to_discs - np.diag(to_bodies)))
    reach = half_angles_of_discs(found.discs[:, 2:], distances) + CAMERA_BODY_MM / apart[0, 0]
    return found.take(np.flatnonzero(np.all(beside < reach, axis=1)))
