"""The default crossing: the cheapest explanation of all shadow edges by discs.

Centres of shadows are lost as soon as shadows merge; most contacts among ten share their shadow
with another in some camera, but nearly all of them still show three edges of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cornertouchd.fusion.costs import COST_OF_A_DISC, COST_OF_A_NEW_DISC
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.edge_crossing import NO_PREDICTIONS
from cornertouchd.fusion.explanation import MARGIN_SCALE
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.fusion.pool import SMALLEST_FINGER_RADIUS_MM
from cornertouchd.fusion.predicted import COST_OF_A_MISSED_SHADOW
from cornertouchd.fusion.selection import LEAST_MARGIN
from cornertouchd.model import BoolArray, Contact, DirectingLines, FloatArray
from oracle.candidates import dearer, find_candidates, joined
from oracle.cells import find_cells
from oracle.edge_rows import edge_rows
from oracle.predicted import predicted_candidates
from oracle.refinement import RefinedDiscs, refine
from oracle.remaining import cells_worth_searching
from oracle.rescue import is_needed, missed_candidates
from oracle.selection import cheapest_explanation, costs_of


@dataclass(frozen=True, slots=True)
class OracleCrossing:
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
        followed = NO_PREDICTIONS if predictions is None else predictions
        cost = COST_OF_A_DISC if predictions is None else COST_OF_A_NEW_DISC
        candidates, unexplained = None, rows.valid.ravel()
        for stage in ("fingers", "pens", "missed"):
            if stage == "pens" and self.limits.smallest_radius_mm >= SMALLEST_FINGER_RADIUS_MM:
                continue
            if stage == "missed":
                missed = missed_candidates(rows, unexplained, self.limits)
                price = cost + COST_OF_A_MISSED_SHADOW
                candidates = joined([candidates, *(dearer(one, price) for one in missed)])
            else:
                limits = _of_fingers(self.limits) if stage == "fingers" else self.limits
                cells = find_cells(rows, limits)
                predicted = predicted_candidates(rows, followed, self.limits)
                if stage == "fingers" and predicted:
                    cells = cells_worth_searching(cells, rows, predicted, self.edge_sigma_px)
                found = find_candidates(rows, cells, limits)
                candidates = joined([*predicted, dearer(found, cost)])
            explanation = cheapest_explanation(costs_of(candidates, rows, self.edge_sigma_px))
            unexplained = explanation.unexplained & rows.valid.ravel()
            if not is_needed(rows, unexplained, len(explanation.chosen)):
                break
        chosen = candidates.take(explanation.chosen)
        refined = refine(chosen, rows.edge_count, followed)
        contacts = self._contacts(refined, explanation.margins, rows.cameras)
        supports = explanation.margins + chosen.own
        believed = (explanation.margins >= LEAST_MARGIN) | (chosen.prediction >= 0)
        return Crossed(
            tuple(contacts[number] for number in np.flatnonzero(believed)),
            supports[believed],
            np.count_nonzero(refined.owned, axis=1)[believed],
            chosen.prediction[believed],
            np.empty((int(np.count_nonzero(believed)), 0, 2), np.intp),
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


def _of_fingers(limits: DiscLimits) -> DiscLimits:
    smallest_mm = max(limits.smallest_radius_mm, SMALLEST_FINGER_RADIUS_MM)
    return replace(limits, smallest_radius_mm=smallest_mm)
