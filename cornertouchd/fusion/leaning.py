"""How far the tip of a touch lies beside its section, from one frame set to the next.

A finger's lean changes slowly, so what one frame set could not see is kept from those before; a
tip that is found in another way moves the touch only as far as its variance allows.
"""

from math import sqrt

from cornertouchd.compiling import borrowing
from cornertouchd.fusion.track_rows import (
    GAP,
    HEIGHT,
    HOVERS_S,
    SHIFT_VARIANCE,
    SHIFT_X,
    SHIFT_Y,
    TIP_SHIFT_X,
    TIP_SHIFT_Y,
    TIP_VARIANCE,
    TIP_X,
    TIP_Y,
    WIDTH,
    X,
    Y,
    is_reported,
)
from cornertouchd.model import FloatArray

# Fingers lean by so much that their section is .9 mm RMS beside their tip (path-traced pictures),
# and as they move it changes by half a millimetre within a second.
UNKNOWN_SHIFT_MM2 = 0.9**2 / 2.0
SHIFT_GROWTH_MM2_S = 0.25
# What begins to touch lets no more light than this through, in units of `Tips.gaps`.  A touch is
# lifted when clearly more has passed below it for so long; touches show .8 at most, what hovers
# 1.25 and more, also at the highest setting of what counts as touching.
LARGEST_GAP = 1.0
LIFTED_GAP = 1.15
LIFTED_AFTER_S = 0.02
# A tip that becomes known at last moves its touch no quicker than a finger would slide.
LARGEST_SPEED_MM_S = 20.0


@borrowing
def start_leaning(track: FloatArray, contact: FloatArray, rules: FloatArray) -> None:
    """Begin with what the contact tells."""
    track[SHIFT_X] = track[SHIFT_Y] = 0.0
    track[SHIFT_VARIANCE] = UNKNOWN_SHIFT_MM2
    lean(track, contact, rules, 0.0)


@borrowing
def lean(track: FloatArray, contact: FloatArray, rules: FloatArray, elapsed_s: float) -> None:
    """Follow the tip, and for how long there has been light below it."""
    variance = min(track[SHIFT_VARIANCE] + SHIFT_GROWTH_MM2_S * elapsed_s, UNKNOWN_SHIFT_MM2)
    gain = variance / (variance + contact[TIP_VARIANCE])
    dx = gain * (contact[TIP_SHIFT_X] - track[SHIFT_X])
    dy = gain * (contact[TIP_SHIFT_Y] - track[SHIFT_Y])
    if is_reported(track):
        share = LARGEST_SPEED_MM_S * elapsed_s / max(sqrt(dx * dx + dy * dy), 1e-9)
        dx, dy = min(share, 1.0) * dx, min(share, 1.0) * dy
    track[SHIFT_X] += dx
    track[SHIFT_Y] += dy
    track[SHIFT_VARIANCE] = (1.0 - gain) * variance
    track[TIP_X] = min(max(track[X] + track[SHIFT_X], 0.0), rules[WIDTH])
    track[TIP_Y] = min(max(track[Y] + track[SHIFT_Y], 0.0), rules[HEIGHT])
    if contact[GAP] > LIFTED_GAP:
        track[HOVERS_S] += elapsed_s
    elif contact[GAP] <= LIFTED_GAP:  # NaN tells nothing
        track[HOVERS_S] = 0.0


@borrowing
def hovers(contact: FloatArray) -> bool:
    """Whether a contact does not touch yet; False if nobody can tell."""
    return bool(contact[GAP] > LARGEST_GAP)


@borrowing
def is_lifted(track: FloatArray) -> bool:
    """Whether the finger has left the surface, though it is still seen."""
    return bool(track[HOVERS_S] >= LIFTED_AFTER_S)
