"""What goes into a crossing besides lines, and what comes out: predictions, contacts, support."""

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
    continues, -1 for a contact found without one.
    """

    contacts: tuple[Contact, ...]
    supports: FloatArray
    own_edges: IntArray
    predictions: IntArray

    @staticmethod
    def nothing() -> "Crossed":
        """Return the crossing of a frame set in which nothing touches."""
        return Crossed((), np.empty(0), np.empty(0, np.intp), np.empty(0, np.intp))

    @staticmethod
    def unsupported(contacts: tuple[Contact, ...], supports: FloatArray) -> "Crossed":
        """Return contacts of a method that knows neither edges nor predictions."""
        unknown = np.full(len(contacts), -1, np.intp)
        return Crossed(
            contacts, supports, np.array([2 * len(c.cameras) for c in contacts], np.intp), unknown
        )
