"""Motion between cameras: the edges of shadows, carried to the time that a frame set stands for.

Cameras without a common trigger take the pictures of a frame set up to half a period apart.  A
finger at 1 m/s has moved 4 mm in 4 ms, and then its edges no longer meet in one place.  So every
edge is moved by its own velocity, which its place in the camera's picture before tells.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cornertouchd.compiling import borrowing, compiled, inlined
from cornertouchd.config import MotionSettings
from cornertouchd.fusion.crossed import IntArray
from cornertouchd.model import (
    BoolArray,
    FloatArray,
    FrameSet,
    Observation,
    Outlines,
    Shadows,
)

LARGEST_MOVE_OF_LIGHT_PX = 0.5
"""Light that is looked for so far beside where it was is still that below the finger."""

NEGLIGIBLE_S = 1e-4
"""The quickest edges, 5000 px/s, move half a pixel in this time, and a hand 0.1 mm."""

LONGEST_PAUSE_S = 0.1
"""An edge this much later may be another one."""

REACH_SHARE = 0.06
"""How far an edge can get in one period, as a share of the picture's width: a finger at 1.5 m/s,
130 mm before the camera, at 100 pictures a second."""

SURPRISE_SHARE = 0.02
"""How far an edge may be from where its velocity led to expect it: a finger that turns round at
1.5 m/s, 250 mm before the camera, comes half as far."""

CLEARLY_NEARER = 2.0
"""A partner is clear when the next best is so many times further away."""

NOISE_PX = 0.6
"""Surprises much smaller than this are noise (sigma 0.15 px) and only smooth the velocity."""

SMOOTHING = 0.1
"""The least share of a surprise that the velocity takes up.  With both, a still edge jitters by
0.11 px instead of 0.10."""

ALIKE_SHARE = 0.5
ALIKE_PX = 1.0
"""Both edges of one finger move alike: these are how much they may differ when it nears or leaves
the camera, as a share of the larger move, and in any case."""

QUICK_PX = 1.5
"""Where edges move by more than this on average, one that just came out of a shadow is worse than
none: it is not known where it was, nor how wrong it is.  2.5 and 0 find fewer touches."""

UNKNOWN, GUESSED, KNOWN = 0.0, 1.0, 2.0
"""An edge seen once; found again once; and found where it was expected, or with its shadow."""


class _Seen(NamedTuple):
    """What a camera saw last.  A tuple, since it is made for every picture.

    `velocities_px_s` and `trust` are (K, 2), one for each edge; None while nobody has needed them.
    """

    captured_at_s: float
    shadows: Shadows
    velocities_px_s: FloatArray | None = None
    trust: FloatArray | None = None


class CommonTime:
    """Carries what all cameras saw to a common time.  Owned by one thread.

    Costs nearly nothing while the cameras are triggered together.
    """

    def __init__(self, settings: MotionSettings, widths_px: Mapping[str, int]) -> None:
        self._carries = settings.carry_edges
        self._widths_px = dict(widths_px)
        self._seen: dict[str, _Seen] = {}

    def reset(self) -> None:
        """Forget where edges were."""
        self._seen.clear()

    def carry(self, frame_set: FrameSet) -> FrameSet:
        """Return the frame set as if all its pictures had been taken at its own time.

        Edges that are not valid, or that have no clear partner in the picture before, stay where
        they are.  One that leaves the picture is not valid any more, and neither are two that
        would pass each other.
        """
        if not self._carries:
            return frame_set
        common_s = frame_set.captured_at_s
        if all(abs(common_s - one.captured_at_s) < NEGLIGIBLE_S for one in frame_set.observations):
            for one in frame_set.observations:
                self._seen[one.camera] = _Seen(one.captured_at_s, one.shadows)
            return frame_set
        return FrameSet(
            common_s, tuple(self._carried(one, common_s) for one in frame_set.observations)
        )

    def _carried(self, observation: Observation, common_s: float) -> Observation:
        before = self._seen.get(observation.camera)
        captured_at_s, shadows = observation.captured_at_s, observation.shadows
        elapsed_s = captured_at_s - before.captured_at_s if before else 0.0
        if before is None or not 0.0 < elapsed_s <= LONGEST_PAUSE_S:
            self._seen[observation.camera] = _Seen(captured_at_s, shadows)
            return observation
        nothing = np.zeros(before.shadows.edges_px.shape)
        ahead_s = common_s - captured_at_s
        edges_px, valid, velocities_px_s, trust = _carry_edges(
            before.shadows.edges_px,
            before.shadows.valid,
            nothing if before.velocities_px_s is None else before.velocities_px_s,
            nothing if before.trust is None else before.trust,
            shadows.edges_px,
            shadows.valid,
            elapsed_s,
            ahead_s,
            float(self._widths_px[observation.camera]),
        )
        self._seen[observation.camera] = _Seen(captured_at_s, shadows, velocities_px_s, trust)
        if abs(ahead_s) < NEGLIGIBLE_S:
            return observation
        carried = Shadows(edges_px, valid, shadows.depth)
        outlines = observation.outlines
        if outlines is not None:
            outlines = _moved(outlines, edges_px - shadows.edges_px)
        return Observation(observation.camera, observation.sequence, common_s, carried, outlines)


def _moved(outlines: Outlines, moved_px: FloatArray) -> Outlines:
    """Move outlines as their edges do (K, 2).

    The light stays where it was: what has moved does not find it there any more.
    """
    columns_px = outlines.columns_px + moved_px[:, :, None]
    light_at = outlines.light_at
    if np.abs(moved_px).max(initial=0.0) > LARGEST_MOVE_OF_LIGHT_PX:
        light_at = np.full_like(light_at, -1)
    return replace(outlines, columns_px=columns_px, light_at=light_at)


@borrowing
def _clear_partner(place_px: float, side: int, others_px: FloatArray, free: BoolArray) -> int:
    """Return which of the other shadows' free edges is clearly the nearest, -1 if none is."""
    nearest, nearest_px, next_px = -1, np.inf, np.inf
    for other in range(len(others_px)):
        if free[other, side]:
            away_px = abs(others_px[other, side] - place_px)
            if away_px < nearest_px:
                nearest, nearest_px, next_px = other, away_px, nearest_px
            elif away_px < next_px:
                next_px = away_px
    return nearest if next_px > CLEARLY_NEARER * nearest_px else -1


@borrowing
def _match(
    partners: IntArray,
    side: int,
    expected_px: FloatArray,
    seeking: BoolArray,
    edges_px: FloatArray,
    free: BoolArray,
    reach_px: float,
) -> None:
    """Give each seeking edge the free one that is clearly nearest to where it is expected."""
    for old in range(len(expected_px)):
        if seeking[old, side]:
            new = _clear_partner(expected_px[old, side], side, edges_px, free)
            if (
                new >= 0
                and abs(edges_px[new, side] - expected_px[old, side]) <= reach_px
                and _clear_partner(edges_px[new, side], side, expected_px, seeking) == old
            ):
                partners[new, side] = old
    for new in range(len(edges_px)):
        if partners[new, side] >= 0:
            free[new, side] = False


@inlined
def _find_partners(
    partners: IntArray,
    expected_px: FloatArray,
    old_valid: BoolArray,
    old_trust: FloatArray,
    edges_px: FloatArray,
    valid: BoolArray,
    width_px: float,
) -> None:
    """Find for each edge (K, 2) the shadow that had it before, -1 if none clearly did."""
    free, seeking = valid.copy(), np.empty(expected_px.shape, np.bool_)
    for side in range(2):
        for new in range(len(edges_px)):
            partners[new, side] = -1
        # those whose velocity is known find their own first, and are out of the others' way
        for is_known in (True, False):
            for old in range(len(expected_px)):
                known = old_trust[old, side] == KNOWN
                seeking[old, side] = old_valid[old, side] and known == is_known
            share = SURPRISE_SHARE if is_known else REACH_SHARE
            _match(partners, side, expected_px, seeking, edges_px, free, share * width_px)


@borrowing
def _updated(
    velocity: float, trust: float, surprise_px: float, elapsed_s: float, width_px: float
) -> tuple[float, float]:
    """Return velocity and trust of an edge that was found again."""
    if trust == UNKNOWN:
        return surprise_px / elapsed_s, GUESSED
    as_expected = abs(surprise_px) <= SURPRISE_SHARE * width_px
    # what is more than noise is a turn, and to be followed at once
    gain = max(SMOOTHING, min(1.0, (surprise_px / NOISE_PX) ** 2))
    return velocity + gain * surprise_px / elapsed_s, KNOWN if as_expected else GUESSED


@borrowing
def _trust_pairs(trust: FloatArray, moves_px: FloatArray) -> None:
    """Trust the two edges of a shadow that were both found again, having moved alike."""
    for shadow in range(len(trust)):
        if trust[shadow, 0] >= GUESSED and trust[shadow, 1] >= GUESSED:
            larger_px = max(abs(moves_px[shadow, 0]), abs(moves_px[shadow, 1]))
            apart_px = abs(moves_px[shadow, 0] - moves_px[shadow, 1])
            if apart_px <= ALIKE_SHARE * larger_px + ALIKE_PX:
                trust[shadow, 0] = trust[shadow, 1] = KNOWN


@borrowing
def _was_dark(place_px: float, old_px: FloatArray) -> bool:
    """Tell whether a place lay in a shadow."""
    dark = False
    for shadow in range(len(old_px)):
        dark |= old_px[shadow, 0] < place_px < old_px[shadow, 1]
    return dark


@borrowing
def _hide_uncovered(
    shown: BoolArray,
    edges_px: FloatArray,
    old_px: FloatArray,
    trust: FloatArray,
    ahead_px: FloatArray,
) -> None:
    """Take the edges that quick shadows uncovered for not valid: where they were is not known."""
    moved_px, known = 0.0, 0
    for shadow in range(len(edges_px)):
        for side in range(2):
            if trust[shadow, side] == KNOWN:
                moved_px += abs(ahead_px[shadow, side])
                known += 1
    if moved_px <= QUICK_PX * known:
        return
    for shadow in range(len(edges_px)):
        for side in range(2):
            if trust[shadow, side] != KNOWN and _was_dark(edges_px[shadow, side], old_px):
                shown[shadow, side] = False


@borrowing
def _shift(
    shifted_px: FloatArray,
    shown: BoolArray,
    edges_px: FloatArray,
    ahead_px: FloatArray,
    width_px: float,
) -> bool:
    """Move the edges on, in order and in the picture; tell whether that is possible."""
    for shadow in range(len(edges_px)):
        for side in range(2):
            shifted_px[shadow, side] = edges_px[shadow, side] + ahead_px[shadow, side]
        if shifted_px[shadow, 0] >= shifted_px[shadow, 1]:
            shifted_px[shadow, 0], shifted_px[shadow, 1] = edges_px[shadow, 0], edges_px[shadow, 1]
        for side in range(2):
            if not 0.0 < shifted_px[shadow, side] < width_px:
                shifted_px[shadow, side] = min(max(shifted_px[shadow, side], 0.0), width_px)
                shown[shadow, side] = False
        if shadow > 0 and shifted_px[shadow - 1, 1] > shifted_px[shadow, 0]:
            # at that time they were one shadow, whose inner edges nobody would see
            between_px = 0.5 * (shifted_px[shadow - 1, 1] + shifted_px[shadow, 0])
            if not shifted_px[shadow - 1, 0] < between_px < shifted_px[shadow, 1]:
                return False
            shifted_px[shadow - 1, 1] = shifted_px[shadow, 0] = between_px
            shown[shadow - 1, 1] = shown[shadow, 0] = False
    return True


@compiled(
    "Tuple((f8[:,::1], b1[:,::1], f8[:,::1], f8[:,::1]))"
    "(f8[:,::1], b1[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], b1[:,::1], f8, f8, f8)"
)
def _carry_edges(
    old_px: FloatArray,
    old_valid: BoolArray,
    old_velocities: FloatArray,
    old_trust: FloatArray,
    edges_px: FloatArray,
    valid: BoolArray,
    elapsed_s: float,
    ahead_s: float,
    width_px: float,
) -> tuple[FloatArray, BoolArray, FloatArray, FloatArray]:
    """Return the edges `ahead_s` later, which of them are valid, velocities and trust (all K, 2).

    Left edges are sought among left ones and right among right, so that an edge goes on as itself
    when its shadow merges with another or parts from it.  Everything is loops, because whole-array
    arithmetic takes seconds longer to compile.
    """
    expected_px = np.empty(old_px.shape)
    for old in range(len(old_px)):
        for side in range(2):
            expected_px[old, side] = old_px[old, side] + old_velocities[old, side] * elapsed_s
    partners = np.empty(edges_px.shape, np.intp)
    _find_partners(partners, expected_px, old_valid, old_trust, edges_px, valid, width_px)
    velocities, trust = np.zeros(edges_px.shape), np.zeros(edges_px.shape)
    moves_px, ahead_px = np.zeros(edges_px.shape), np.zeros(edges_px.shape)
    for new in range(len(edges_px)):
        for side in range(2):
            old = partners[new, side]
            if old >= 0:
                moves_px[new, side] = edges_px[new, side] - old_px[old, side]
                velocities[new, side], trust[new, side] = _updated(
                    old_velocities[old, side],
                    old_trust[old, side],
                    edges_px[new, side] - expected_px[old, side],
                    elapsed_s,
                    width_px,
                )
    _trust_pairs(trust, moves_px)
    for new in range(len(edges_px)):
        for side in range(2):
            if trust[new, side] == KNOWN:
                ahead_px[new, side] = velocities[new, side] * ahead_s
    shown, shifted_px = valid.copy(), np.empty(edges_px.shape)
    _hide_uncovered(shown, edges_px, old_px, trust, ahead_px)
    if not _shift(shifted_px, shown, edges_px, ahead_px, width_px):
        return edges_px.copy(), valid.copy(), velocities, trust
    return shifted_px, shown, velocities, trust
