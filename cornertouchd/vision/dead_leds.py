"""Columns whose LEDs have died: masked where the controller says so, until they shine again.

Without a controller's word a dark place that stays may be dirt as well, and counts as that.
"""

import numpy as np

from cornertouchd.model import BoolArray, FloatArray
from cornertouchd.vision.profile import Measured
from cornertouchd.vision.reference import Reference

DARK_SHARE = 0.5
"""Of the light of the strip; a column at the rim of a dead LED has about half."""


class DeadLeds:
    """The masked columns of one camera, and the light that they had.  Owned by one thread."""

    def __init__(self, width_px: int) -> None:
        self._dead = np.zeros(width_px, np.bool_)
        self._light = np.zeros(width_px)
        self._any = False  # asked for every picture

    def follow(
        self, suspected: BoolArray | None, measured: Measured, reference: Reference
    ) -> FloatArray | None:
        """Return the light of the strip (width_px,) as it is to be taken, None if as before.

        `suspected` columns are masked if they are dark, masked ones that shine count again.
        """
        if suspected is not None:
            return self._mask(suspected, measured, reference)
        return self._unmask(measured, reference)

    def _mask(self, suspected: BoolArray, measured: Measured, reference: Reference) -> FloatArray:
        """Return the light of the strip (width_px,) without the suspected columns that are dark.

        A finger before them is masked with them until it leaves: that may lift a touch, and never
        makes one.
        """
        dark = _light(measured, reference) < DARK_SHARE * reference.light
        dead = suspected & reference.usable & dark
        self._dead |= dead
        self._any = bool(self._dead.any())
        self._light = np.where(dead, reference.light, self._light)
        return np.where(dead, 0.0, reference.light)

    def _unmask(self, measured: Measured, reference: Reference) -> FloatArray | None:
        """Return the light of the strip with the columns that shine again, None if none does."""
        if not self._any:
            return None
        bright = _light(measured, reference) >= DARK_SHARE * self._light
        alive = self._dead & bright
        if not alive.any():
            return None
        self._dead &= ~alive
        self._any = bool(self._dead.any())
        return np.where(alive, self._light, reference.light)


def _light(measured: Measured, reference: Reference) -> FloatArray:
    return (measured.light - reference.black) / measured.gain


def how_dim(shares: FloatArray) -> str:
    """Say how much is left of the strip's light in some columns."""
    return f"dead or dim LED, {max(float(shares.min()), 0.0):.0%} of the strip's light"
