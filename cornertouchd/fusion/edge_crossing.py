"""The default crossing: the cheapest explanation of all shadow edges by discs.

Centres of shadows are lost as soon as shadows merge; most contacts among ten share their shadow
with another in some camera, but nearly all of them still show three edges of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.explanation import explain
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.model import Contact, DirectingLines

NO_PREDICTIONS = Predictions(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty(0))


@dataclass(frozen=True, slots=True)
class EdgeCrossing:
    """Finds the fewest discs of plausible size that cast all edges of all shadows.

    The `confidence` c of a contact grows with its margin: the rise in cost of the cheapest
    explanation without it.  Of contacts with confidence c, (1 + c) / 2 are real where it is hard to
    tell.  `sigma_mm` comes from the covariance of the fit, `cameras` are those of which the contact
    owns an edge.  The place of a contact that continues a prediction already takes that into
    account.
    """

    limits: DiscLimits
    edge_sigma_px: float

    def cross(
        self, directing_lines: Sequence[DirectingLines], predictions: Predictions | None = None
    ) -> Crossed:
        """Return the contacts that explain the shadows, on the surface, in no given order."""
        if len(directing_lines) < 2:
            return Crossed.nothing()
        expected = NO_PREDICTIONS if predictions is None else predictions
        measured, supports, counted, edges = explain(
            np.array([(one.x_mm, one.y_mm, *one.view_rad) for one in directing_lines], np.float64),
            np.array([len(one.first_rad) for one in directing_lines], np.intp),
            np.concatenate([one.first_rad for one in directing_lines]),
            np.concatenate([one.last_rad for one in directing_lines]),
            np.concatenate([one.first_valid for one in directing_lines]),
            np.concatenate([one.last_valid for one in directing_lines]),
            np.concatenate([one.sigma_rad for one in directing_lines]),
            *self.limits.surface_mm,
            self.limits.smallest_radius_mm,
            self.limits.largest_radius_mm,
            self.limits.shape_sigma_mm,
            self.edge_sigma_px,
            predictions is not None,
            np.ascontiguousarray(expected.discs),
            np.ascontiguousarray(expected.position_variances_mm2),
            np.ascontiguousarray(expected.radius_variances_mm2),
            np.ascontiguousarray(expected.costs),
        )
        names = tuple(one.camera for one in directing_lines)
        own_edges, cameras, predicted = counted
        contacts = tuple(
            Contact(x_mm, y_mm, diameter_mm, _named(names, seeing), confidence, sigma_mm)
            for (x_mm, y_mm, diameter_mm, confidence, sigma_mm), seeing in zip(
                measured.tolist(), cameras.tolist(), strict=True
            )
        )
        return Crossed(contacts, supports, own_edges, predicted, edges)


@lru_cache(maxsize=256)
def _named(names: tuple[str, ...], cameras: int) -> tuple[str, ...]:
    """Return the names of the cameras whose bits are set."""
    return tuple(name for number, name in enumerate(names) if cameras >> number & 1)
