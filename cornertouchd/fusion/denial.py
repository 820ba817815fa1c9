"""Denial: what cameras say that see nothing but light.

The crossing is about shadows and leaves out cameras that have none.  But a camera that looks at a
place and sees light there says that nothing touches it: otherwise two bits of dirt before two
cameras would cross in a touch.  As in a rescue, one camera of many may be wrong, and two are where
they look at each other past a thin contact, each with the other's body for a background.
"""

from collections.abc import Sequence
from math import hypot
from typing import Protocol

import numpy as np

from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.rescue import CAMERA_BODY_MM, FEWEST_CAMERAS
from cornertouchd.model import Contact


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


def without_denied(crossed: Crossed, silent: Sequence[Eye], cameras: int) -> Crossed:
    """Leave out contacts that the silent ones of so many cameras deny."""
    if not silent:
        return crossed
    kept = [
        number
        for number, contact in enumerate(crossed.contacts)
        if not _is_denied(contact, silent, cameras)
    ]
    index = np.array(kept, np.intp)
    return Crossed(
        tuple(crossed.contacts[number] for number in kept),
        crossed.supports[index],
        crossed.own_edges[index],
        crossed.predictions[index],
    )


def _is_denied(contact: Contact, silent: Sequence[Eye], cameras: int) -> bool:
    denying = [eye for eye in silent if eye.sees(contact.x_mm, contact.y_mm)]
    if cameras < FEWEST_CAMERAS:
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
