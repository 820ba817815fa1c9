"""Which sides of the LED frame were lit in a picture, and so what it is good for."""

from enum import Enum, auto

from cornertouchd.model import Frame

ALL_SIDES = 15


class Lighting(Enum):
    """How the LED frame was lit."""

    LIT = auto()
    """All sides, or it is not known: the picture shows shadows."""
    DARK = auto()
    """No side: the picture shows the light of the surroundings."""
    PARTLY = auto()
    """Some sides: shadows before the others cannot be told from darkness."""


def lighting(frame: Frame) -> Lighting:
    """Return how the LED frame was lit when a picture was taken."""
    if frame.lit_mask is None or frame.lit_mask & ALL_SIDES == ALL_SIDES:
        return Lighting.LIT
    return Lighting.DARK if frame.lit_mask & ALL_SIDES == 0 else Lighting.PARTLY
