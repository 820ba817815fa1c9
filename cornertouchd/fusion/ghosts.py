"""Ghosts, for people to look at: where shadows of several cameras cross and nothing was found.

The crossing weighs whole explanations and never makes a list of what it did not believe; this is
that list, made afterwards.  Nothing else depends on it.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations
from math import atan2, hypot

import numpy as np

from cornertouchd.geometry import wrap_angle
from cornertouchd.model import BoolArray, Contact, DirectingLines, FloatArray

FEWEST_CAMERAS = 3
"""Two lines cross everywhere; a place in the shadows of three looks like a finger."""

MOST_CROSSINGS = 1500
"""With more, every place is near a crossing, and a list tells nothing: a dozen fingers."""

MOST_GHOSTS = 16
APART_MM = 6.0
"""Crossings nearer to each other than half a finger are one ghost; or part of a contact."""

NOWHERE = np.empty((0, 2))

PARALLEL = 0.05
"""Lines that meet at less than 3 degrees meet nowhere in particular."""


def find_ghosts(
    lines: Sequence[DirectingLines],
    contacts: Sequence[Contact],
    surface_mm: tuple[float, float],
) -> tuple[Contact, ...]:
    """Return the places that at least three cameras' shadows cover and no contact explains.

    Their confidence is 0.  `lines` are those of one frame set; without contacts they are the whole
    of what might have been.
    """
    pairs = list(combinations(lines, 2))
    if (
        len(lines) < FEWEST_CAMERAS
        or sum(len(one.centre_rad) * len(other.centre_rad) for one, other in pairs) > MOST_CROSSINGS
    ):
        return ()
    places = np.concatenate([NOWHERE, *(_crossings(*pair) for pair in pairs)])
    inside = ((places >= 0.0) & (places <= surface_mm)).all(axis=1)
    places = places[inside & ~_explained(places, contacts)]
    covered = np.array([_covers(one, places) for one in lines])
    support = np.count_nonzero(covered, axis=0)
    order = np.argsort(-support, kind="stable")
    found: list[Contact] = []
    for number in order[support[order] >= FEWEST_CAMERAS].tolist():
        x_mm, y_mm = places[number].tolist()
        if any(hypot(x_mm - one.x_mm, y_mm - one.y_mm) < _reach_mm(one) for one in found):
            continue
        seers = [one for one, covers in zip(lines, covered[:, number], strict=True) if covers]
        found.append(_ghost(x_mm, y_mm, seers))
        if len(found) == MOST_GHOSTS:
            break
    return tuple(found)


def _explained(places: FloatArray, contacts: Sequence[Contact]) -> BoolArray:
    """Tell which places (N, 2) are contacts, (N,)."""
    if not contacts:
        return np.zeros(len(places), np.bool_)
    known = np.array([(one.x_mm, one.y_mm, _reach_mm(one)) for one in contacts])
    away = places[:, None, :] - known[:, :2]
    return np.asarray((np.hypot(away[..., 0], away[..., 1]) < known[:, 2]).any(axis=1))


def _reach_mm(contact: Contact) -> float:
    """Return how far from a contact a crossing is still part of it."""
    return max(APART_MM, contact.diameter_mm)


def _crossings(one: DirectingLines, other: DirectingLines) -> FloatArray:
    """Return where the middles of two cameras' shadows cross before both, (N, 2)."""
    ours, theirs = np.meshgrid(one.centre_rad, other.centre_rad, indexing="ij")
    away_x, away_y = other.x_mm - one.x_mm, other.y_mm - one.y_mm
    turn = np.sin(theirs - ours)
    meet = np.abs(turn) > PARALLEL
    ours, theirs, turn = ours[meet], theirs[meet], turn[meet]
    our_mm = (away_x * np.sin(theirs) - away_y * np.cos(theirs)) / turn
    their_mm = (away_x * np.sin(ours) - away_y * np.cos(ours)) / turn
    before = (our_mm > 0.0) & (their_mm > 0.0)
    our_mm, ours = our_mm[before], ours[before]
    return np.column_stack((one.x_mm + our_mm * np.cos(ours), one.y_mm + our_mm * np.sin(ours)))


def _covers(camera: DirectingLines, places: FloatArray) -> BoolArray:
    """Tell which places (N, 2) lie in a shadow of a camera, (N,)."""
    angles = np.arctan2(places[:, 1] - camera.y_mm, places[:, 0] - camera.x_mm)[:, None]
    within = (wrap_angle(angles - camera.first_rad) >= 0.0) & (
        wrap_angle(camera.last_rad - angles) >= 0.0
    )
    return np.asarray(within.any(axis=1))


def _ghost(x_mm: float, y_mm: float, seers: Sequence[DirectingLines]) -> Contact:
    diameters_mm = [width_mm for one in seers for width_mm in _widths_mm(one, x_mm, y_mm)]
    names = tuple(one.camera for one in seers)
    return Contact(x_mm, y_mm, min(diameters_mm, default=0.0), names, 0.0, APART_MM)


def _widths_mm(camera: DirectingLines, x_mm: float, y_mm: float) -> Iterator[float]:
    """Yield how wide the shadows that cover a place are there."""
    away_mm = hypot(x_mm - camera.x_mm, y_mm - camera.y_mm)
    angle = atan2(y_mm - camera.y_mm, x_mm - camera.x_mm)
    covers = (wrap_angle(angle - camera.first_rad) >= 0.0) & (
        wrap_angle(camera.last_rad - angle) >= 0.0
    )
    yield from (away_mm * (camera.last_rad - camera.first_rad)[covers]).tolist()
