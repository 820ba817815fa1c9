"""Crossing: from the directing lines of all cameras to contacts, by the method of the settings."""

from collections.abc import Sequence
from typing import Protocol

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossed import Crossed, Predictions
from cornertouchd.fusion.edge_crossing import EdgeCrossing
from cornertouchd.fusion.limits import disc_limits
from cornertouchd.fusion.paper_crossing import PaperCrossing, nearest_points
from cornertouchd.fusion.paper_reconstruction import reconstruct_in_pairs
from cornertouchd.model import DirectingLines


class Crossing(Protocol):
    """A way to find contacts; keeps nothing from one frame set to the next."""

    def cross(
        self, directing_lines: Sequence[DirectingLines], predictions: Predictions | None = None
    ) -> Crossed:
        """Return the contacts that explain the shadows of 2..8 cameras.

        Cameras without a shadow add nothing; with fewer than two others there are no contacts.
        Without `predictions` the frame set stands for itself.  With them (there may be none of them
        yet) a touch that is expected is cheaper to believe in than a new one, and a new one dearer
        than without.
        """
        ...


def make_crossing(
    settings: CrossingSettings, surface_mm: tuple[float, float], *, reconstructed: bool = False
) -> Crossing:
    """Return the crossing that `settings.method` names, for a surface of this width and height.

    The paper crosses otherwise when the cameras were calibrated by its 3D reconstruction.
    """
    limits = disc_limits(settings, surface_mm)
    if settings.method == "paper":
        locate = reconstruct_in_pairs if reconstructed else nearest_points
        return PaperCrossing(settings.paper, limits, locate)
    return EdgeCrossing(limits, settings.edge_sigma_px)
