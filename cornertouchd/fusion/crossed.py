"""What goes into a crossing besides lines, and what comes out: predictions, contacts, support."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.model import Contact, FloatArray

IntArray = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Predictions:
    """Where T touches that are followed are expected now.

    `discs` (T, 3) are x, y, r; `position_variances_mm2` (T,) that of x as of y, and
    `radius_variances_mm2` (T,).  `costs` (T,) is what it costs to believe that the touch is still
    there, the negative logarithm of its odds, 0 (sure) to 6.
    """

    discs: FloatArray
    position_variances_mm2: FloatArray
    radius_variances_mm2: FloatArray
    costs: FloatArray

    def __len__(self) -> int:
        return len(self.costs)


@dataclass(frozen=True, slots=True, eq=False)
class Crossed:
    """The N contacts that explain a frame set, and how firmly.

    `supports` (N,) says by how much the shadows would be explained worse without the contact, in
    negative log likelihood: its margin plus what the contact itself costs.  `own_edges` (N,) counts
    the shadow edges that are its alone.  `predictions` (N,) is the number of the prediction that it
    continues, -1 for a contact found without one.  `edges` (N, C, 2) names the shadow of each
    camera, in the order of the lines that were crossed, whose first and last edge is the contact's
    alone, -1 for none; C is 0 if nobody knows.
    """

    contacts: tuple[Contact, ...]
    supports: FloatArray
    own_edges: IntArray
    predictions: IntArray
    edges: IntArray

    def take(self, kept: Sequence[int]) -> "Crossed":
        """Return what belongs to these contacts."""
        index = np.array(kept, np.intp)
        return Crossed(
            tuple(self.contacts[number] for number in kept),
            self.supports[index],
            self.own_edges[index],
            self.predictions[index],
            self.edges[index],
        )

    @staticmethod
    def nothing() -> "Crossed":
        """Return the crossing of a frame set in which nothing touches."""
        return Crossed.unsupported((), np.empty(0))

    @staticmethod
    def unsupported(contacts: tuple[Contact, ...], supports: FloatArray) -> "Crossed":
        """Return contacts of a method that knows neither edges nor predictions."""
        count = len(contacts)
        return Crossed(
            contacts,
            supports,
            np.array([2 * len(c.cameras) for c in contacts], np.intp),
            np.full(count, -1, np.intp),
            np.empty((count, 0, 2), np.intp),
        )
