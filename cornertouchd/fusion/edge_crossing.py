"""The default crossing: the cheapest explanation of all shadow edges by discs.

Centres of shadows are lost as soon as shadows merge; most contacts among ten share their shadow
with another in some camera, but nearly all of them still show three edges of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import tanh

import numpy as np

from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.explanation import FIRST_EDGE, explain
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.model import Contact, DirectingLines

# Fitted to 10 000 contacts in crowded scenes (15 on 350x400, hands, three cameras): of those with
# margins about 0, 1, 3, 5, 7 and 10, the shares .59, .86, .84, .94, .99 and .99 were real.
MARGIN_SCALE = 3.6
# Without such a contact the shadows are explained as cheaply: nearly half of them are ghosts.
LEAST_MARGIN = 0.05
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
        measured, counted = explain(
            np.array([(one.x_mm, one.y_mm) for one in directing_lines], np.float64),
            np.array([one.view_rad for one in directing_lines], np.float64),
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
        believed = (measured[:, 4] >= LEAST_MARGIN) | (counted[:, 2] >= 0)
        if not believed.all():
            measured, counted = measured[believed], counted[believed]
        names = tuple(one.camera for one in directing_lines)
        contacts = tuple(
            Contact(x, y, 2.0 * r, _named(names, cameras), tanh(margin / MARGIN_SCALE), sigma)
            for (x, y, r, sigma, margin, _), (_, cameras, _) in zip(
                measured.tolist(), counted[:, :FIRST_EDGE].tolist(), strict=True
            )
        )
        supports = measured[:, 4] + measured[:, 5]
        edges = counted[:, FIRST_EDGE:].reshape(len(contacts), len(names), 2)
        return Crossed(contacts, supports, counted[:, 0], counted[:, 2], edges)


@lru_cache(maxsize=256)
def _named(names: tuple[str, ...], cameras: int) -> tuple[str, ...]:
    """Return the names of the cameras whose bits are set."""
    return tuple(name for number, name in enumerate(names) if cameras >> number & 1)
