"""Denial: what cameras say that see nothing but light.

The crossing is about shadows and leaves out cameras that have none.  But a camera that looks at a
place and sees light there says that nothing touches it: otherwise two bits of dirt before two
cameras would cross in a touch.  As in a rescue, one camera of many may be wrong, and two are where
they look at each other past a thin contact, each with the other's body for a background.

And where a touch is missed, light tells whether it was lifted, or whether others hide it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Protocol

import numpy as np

from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.rescue import CAMERA_BODY_MM, FEWEST_CAMERAS
from cornertouchd.geometry import is_in_view, wrap_angle
from cornertouchd.model import Contact, DirectingLines, FloatArray

OUTLINE_SIGMA_MM = 0.4
"""How far the outline of a finger may be from a circle; that of `shape_sigma_mm`."""

LARGEST_COST_OF_HIDING = 6.0
"""A disc that has to move by more than 3.5 sigmas to lie in the dark is not hidden there."""

FITS = 3
"""Each is linear; the edges that a disc protrudes over may change with the place."""


class Eye(Protocol):
    """A camera in its place."""

    @property
    def x_mm(self) -> float:
        """Where it stands."""
        ...

    @property
    def y_mm(self) -> float:
        """Where it stands."""
        ...

    def sees(self, x_mm: float, y_mm: float) -> bool:
        """Tell whether a place is in its view."""
        ...


def without_denied(crossed: Crossed, silent: Sequence[Eye], eyes: Sequence[Eye]) -> Crossed:
    """Leave out contacts that the silent ones of these cameras deny."""
    if not silent or not crossed.contacts:
        return crossed
    kept = [
        number
        for number, contact in enumerate(crossed.contacts)
        if not _is_denied(contact, silent, eyes)
    ]
    return crossed.take(kept)


def left_out(before: Crossed, after: Crossed) -> tuple[Contact, ...]:
    """Return the contacts of one crossing that are not among those that were taken from it."""
    if len(before.contacts) == len(after.contacts):
        return ()
    kept = {id(contact) for contact in after.contacts}
    return tuple(contact for contact in before.contacts if id(contact) not in kept)


def _is_denied(contact: Contact, silent: Sequence[Eye], eyes: Sequence[Eye]) -> bool:
    denying = [eye for eye in silent if eye.sees(contact.x_mm, contact.y_mm)]
    if sum(eye.sees(contact.x_mm, contact.y_mm) for eye in eyes) < FEWEST_CAMERAS:
        return len(denying) > 0
    if len(denying) == 2:
        return not _is_between(contact, *denying)
    return len(denying) > 2


def _is_between(contact: Contact, one: Eye, other: Eye) -> bool:
    """Tell whether each of two cameras sees the contact before the body of the other."""
    along_x, along_y = other.x_mm - one.x_mm, other.y_mm - one.y_mm
    away_x, away_y = contact.x_mm - one.x_mm, contact.y_mm - one.y_mm
    across_mm = abs(along_x * away_y - along_y * away_x) / hypot(along_x, along_y)
    return across_mm < CAMERA_BODY_MM + contact.diameter_mm / 2.0


@dataclass(frozen=True, slots=True)
class Darkness:
    """The shadows of a frame set, and the cameras that see none."""

    lines: Sequence[DirectingLines]
    silent: Sequence[Eye]

    def hides(
        self, x_mm: float, y_mm: float, radius_mm: float, position_variance_mm2: float
    ) -> bool:
        """Tell whether a disc that is expected about there may lie in a shadow of every camera."""
        if any(eye.sees(x_mm, y_mm) for eye in self.silent):
            return False
        expected = np.array([x_mm, y_mm])
        place, cost = expected, np.inf
        for _ in range(FITS):
            normals, protruding_mm = self._outside(place, radius_mm)
            away = place - expected
            cost = 0.5 * (
                away @ away / position_variance_mm2
                + protruding_mm @ protruding_mm / OUTLINE_SIGMA_MM**2
            )
            weights = np.eye(2) / position_variance_mm2 + normals.T @ normals / OUTLINE_SIGMA_MM**2
            pull = normals.T @ protruding_mm / OUTLINE_SIGMA_MM**2 - away / position_variance_mm2
            place = place + np.linalg.solve(weights, pull)
        return bool(cost < LARGEST_COST_OF_HIDING)

    def _outside(self, place: FloatArray, radius_mm: float) -> tuple[FloatArray, FloatArray]:
        """Return over which edges a disc protrudes, as inward normals (M, 2), and by how much (M,).

        An edge that is not valid bounds nothing.
        """
        normals, protruding_mm = [], []
        for camera in self.lines:
            eye = (camera.x_mm, camera.y_mm)
            sees = is_in_view(float(place[0]), float(place[1]), eye, camera.view_rad)
            if not (sees and len(camera.first_rad)):  # no lines where its shadows are
                continue
            away = place - eye
            angle = np.arctan2(away[1], away[0])
            beside = np.maximum(
                wrap_angle(camera.first_rad - angle), wrap_angle(angle - camera.last_rad)
            )
            shadow = int(np.argmin(beside))
            for edge_rad, inwards, valid in (
                (camera.first_rad[shadow], 1.0, camera.first_valid[shadow]),
                (camera.last_rad[shadow], -1.0, camera.last_valid[shadow]),
            ):
                normal = inwards * np.array([-np.sin(edge_rad), np.cos(edge_rad)])
                over_mm = radius_mm - normal @ away
                if valid and over_mm > 0.0:
                    normals.append(normal)
                    protruding_mm.append(over_mm)
        return np.array(normals).reshape(-1, 2), np.array(protruding_mm)
