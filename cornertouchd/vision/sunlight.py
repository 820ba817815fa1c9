"""Shadows of sunlit fingers: half as bright as the strip, on one side or all over.

Where the sun lights the strip to full scale it lights the fingers before it, too.
"""

from cornertouchd.compiling import inlined
from cornertouchd.model import FloatArray

NARROWEST_PX = 4.5
"""In a narrower shadow there is no room between its edges to see how bright it is."""

OUTSIDE = 0.85
FARTHEST_PX = 8
"""From an edge outwards it is this bright again within so many columns."""

INSIDE_PX = 2.6
"""So far inwards from there the blur of an edge is over (rendered pictures; 2 to 3.2 do)."""

SLOPE_PX = (3.5, 24.0)
"""The blur of an edge is over within two columns.  A longer slope is a finger that the sun lights
from the edge on inwards: where it ends is not told (rendered pictures).  One that is longer still
is a strip that has become dimmer."""

LIT_FLANK = (0.2, 0.8)
"""As bright as this is a flank in the sun; below, what a finger throws back without any."""

GLINT_WIDTH_PX, GLINT_DEPTH = 6.0, 0.6
"""A dark piece between two glints on a sunlit finger: a pen, as narrow, is darker."""


@inlined
def is_glint(width_px: float, depth: float) -> bool:
    """Tell whether a shadow in the sun may be a piece of one, so that its edges mean nothing."""
    return width_px < GLINT_WIDTH_PX and depth < GLINT_DEPTH


@inlined
def end_of_slope(brightness: FloatArray, edge: float, outwards: int) -> float:
    """Return where it is bright again beyond an edge, the edge itself if there is no slope.

    `outwards` is -1 for a left edge, 1 for a right one.
    """
    column = int(edge - 0.5)
    if outwards > 0:
        column += 1
    while 0 <= column < len(brightness) and brightness[column] < OUTSIDE:
        column += outwards
    end = column + 0.5
    return end if SLOPE_PX[0] < abs(end - edge) <= SLOPE_PX[1] else edge


@inlined
def edge_of_lit_flank(brightness: FloatArray, edge: float, inwards: int, level: float) -> float:
    """Return an edge anew, half-way between the strip and the flank beside it.

    `inwards` is 1 for a left edge, -1 for a right one; the edge was measured at `level`.  Returns
    the same edge if the flank is dark or cannot be seen, or if it is dark on the other side, too.
    """
    count = len(brightness)
    column = int(edge)
    risen = False
    for _ in range(FARTHEST_PX):
        if not 0 < column < count - 1 or brightness[column] >= OUTSIDE:
            break
        if risen and brightness[column] < level:
            return edge
        risen = brightness[column] >= level
        column -= inwards
    if not 0 < column < count - 1 or brightness[column] < OUTSIDE:
        return edge
    outer = _crossing_inwards(brightness, column, inwards, OUTSIDE)
    if outer < 0.0:
        return edge
    place = outer - 0.5 + inwards * INSIDE_PX
    if not 0.0 <= place < count - 1:
        return edge
    below = int(place)
    flank = brightness[below] + (place - below) * (brightness[below + 1] - brightness[below])
    if not LIT_FLANK[0] < flank < LIT_FLANK[1]:
        return edge
    anew = _crossing_inwards(brightness, column, inwards, (1.0 + flank) / 2.0)
    return anew if anew >= 0.0 else edge


@inlined
def _crossing_inwards(brightness: FloatArray, column: int, inwards: int, level: float) -> float:
    """Return where the brightness falls through `level` from `column` on, -1 if it does not."""
    for _ in range(FARTHEST_PX):
        there = column + inwards
        if not 0 <= there < len(brightness):
            break
        if brightness[column] >= level > brightness[there]:
            share = (brightness[column] - level) / (brightness[column] - brightness[there])
            return float(column + inwards * share + 0.5)
        column = there
    return -1.0
