"""Crossing: from the directing lines of all cameras to contacts, by the method of the settings."""

from collections.abc import Sequence
from typing import Protocol

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.cells import disc_limits
from cornertouchd.fusion.edge_crossing import EdgeCrossing
from cornertouchd.fusion.paper_crossing import PaperCrossing
from cornertouchd.model import Contact, DirectingLines


class Crossing(Protocol):
    """A way to find contacts; keeps nothing from one frame set to the next."""

    def cross(self, directing_lines: Sequence[DirectingLines]) -> tuple[Contact, ...]:
        """Return the contacts that explain the shadows of 2..8 cameras.

        Cameras without a shadow add nothing; with fewer than two others there are no contacts.
        """
        ...


def make_crossing(settings: CrossingSettings, surface_mm: tuple[float, float]) -> Crossing:
    """Return the crossing that `settings.method` names, for a surface of this width and height."""
    limits = disc_limits(settings, surface_mm)
    if settings.method == "paper":
        return PaperCrossing(settings.paper, limits)
    return EdgeCrossing(limits, settings.edge_sigma_px)
