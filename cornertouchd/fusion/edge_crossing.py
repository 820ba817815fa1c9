"""The default crossing: the cheapest explanation of all shadow edges by discs.

Centres of shadows are lost as soon as shadows merge; most contacts among ten share their shadow
with another in some camera, but nearly all of them still show three edges of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.fusion.candidates import find_candidates, joined
from cornertouchd.fusion.cells import DiscLimits, find_cells
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.edge_rows import edge_rows
from cornertouchd.fusion.refinement import RefinedDiscs, refine
from cornertouchd.fusion.rescue import is_needed, rescue_candidates
from cornertouchd.fusion.selection import COST_OF_A_DISC, cheapest_explanation, costs_of
from cornertouchd.model import BoolArray, Contact, DirectingLines, FloatArray

# Fitted to 10 000 contacts in crowded scenes (15 on 350x400, hands, three cameras): of those with
# margins about 0, 1, 3, 5, 7 and 10, the shares .59, .86, .84, .94, .99 and .99 were real.
MARGIN_SCALE = 3.6


@dataclass(frozen=True, slots=True)
class EdgeCrossing:
    """Finds the fewest discs of plausible size that cast all edges of all shadows.

    The `confidence` c of a contact grows with its margin: the rise in cost of the cheapest
    explanation without it.  Of contacts with confidence c, (1 + c) / 2 are real where it is hard to
    tell.  `sigma_mm` comes from the covariance of the fit, `cameras` are those of which the contact
    owns an edge.
    """

    limits: DiscLimits
    edge_sigma_px: float

    def cross(
        self, directing_lines: Sequence[DirectingLines], predictions: Predictions | None = None
    ) -> Crossed:
        """Return the contacts that explain the shadows, on the surface, in no given order."""
        rows = edge_rows(directing_lines)
        if len(rows.cameras) < 2:
            return Crossed.nothing()
        candidates = find_candidates(rows, find_cells(rows, self.limits), self.limits)
        explanation = cheapest_explanation(costs_of(candidates, rows, self.edge_sigma_px))
        unexplained = explanation.unexplained & rows.valid.ravel()
        if is_needed(rows, unexplained):
            rescued = rescue_candidates(rows, unexplained, self.limits)
            candidates = joined([candidates, *rescued])
            explanation = cheapest_explanation(costs_of(candidates, rows, self.edge_sigma_px))
        refined = refine(candidates.take(explanation.chosen), rows.edge_count)
        own = np.count_nonzero(refined.owned, axis=1)
        return Crossed(
            self._contacts(refined, explanation.margins, rows.cameras),
            explanation.margins + COST_OF_A_DISC,
            own.astype(np.intp),
            np.full(len(own), -1, np.intp),
        )

    def _contacts(
        self, refined: RefinedDiscs, margins: FloatArray, cameras: tuple[str, ...]
    ) -> tuple[Contact, ...]:
        centres = np.clip(refined.discs[:, :2], 0.0, self.limits.surface_mm)
        owned = refined.owned.reshape(len(centres), len(cameras), 2)
        owners: BoolArray = np.any(owned, axis=2)
        confidences = np.tanh(margins / MARGIN_SCALE)
        return tuple(
            Contact(
                x_mm=float(centre[0]),
                y_mm=float(centre[1]),
                diameter_mm=float(2.0 * radius),
                cameras=tuple(camera for camera, owns in zip(cameras, own, strict=True) if owns),
                confidence=float(confidence),
                sigma_mm=float(sigma_mm),
            )
            for centre, radius, own, confidence, sigma_mm in zip(
                centres, refined.discs[:, 2], owners, confidences, refined.sigma_mm, strict=True
            )
        )
