"""What simulated fingers do: scripts, pure functions of time.

A script returns all fingers of an instant; a finger keeps its key as long as it stays down, and
moves at limited speed.  The same time gives the same fingers, so any thread may ask for any time.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import atan2, cos, floor, hypot, pi, sin

import numpy as np

from cornertouchd.model import FloatArray
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.sway import Sway, sway_within

# A finger of an adult, upright; gestures put it where they need it.
PLAIN_FINGER = Finger(0.0, 0.0, diameter_mm=10.0)

MAX_TOUCHES = 20
SIDE_MM = 15.0
"""Scripts that fill a surface stay this far inside its sides and of one another's cells."""
SHOW_SPEEDS_MM_S = (150.0, 400.0)
SHOW_PERIODS_S = (4.0, 9.0)
SHOW_DOWN_SHARE = 0.9
HANDS_SPEED_MM_S = 200.0

# Tips of a right hand at rest around the middle of the hand, thumb first; the user sits at the
# lower side.  The left hand is its mirror image.
RIGHT_HAND_MM = ((-55.0, 35.0), (-28.0, -20.0), (-5.0, -33.0), (18.0, -25.0), (40.0, -5.0))


@dataclass(frozen=True, slots=True)
class TimedFinger:
    """A finger of one instant; `key` stays the same from landing to lifting."""

    key: int
    finger: Finger


Script = Callable[[float], tuple[TimedFinger, ...]]


def together(*scripts: Script) -> Script:
    """Return the script in which all of these happen at once."""

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        return tuple(
            TimedFinger(timed.key * len(scripts) + number, timed.finger)
            for number, script in enumerate(scripts)
            for timed in script(t_s)
        )

    return fingers_at


def taps(
    places_mm: Sequence[tuple[float, float]] | FloatArray,
    hold_s: float = 0.3,
    pause_s: float = 0.2,
    finger: Finger = PLAIN_FINGER,
) -> Script:
    """Return a script that touches place after place; the key is the number of the place."""

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        number = floor(t_s / (hold_s + pause_s))
        held_s = t_s - number * (hold_s + pause_s)
        if not 0 <= number < len(places_mm) or held_s >= hold_s:
            return ()
        x_mm, y_mm = places_mm[number]
        return (TimedFinger(number, replace(finger, x_mm=float(x_mm), y_mm=float(y_mm))),)

    return fingers_at


def drag(
    start_mm: tuple[float, float],
    end_mm: tuple[float, float],
    speed_mm_s: float = 200.0,
    lands_at_s: float = 0.0,
    finger: Finger = PLAIN_FINGER,
) -> Script:
    """Return a script that draws one straight line, then lifts."""
    across_mm, down_mm = end_mm[0] - start_mm[0], end_mm[1] - start_mm[1]
    duration_s = hypot(across_mm, down_mm) / speed_mm_s

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        if not 0.0 <= t_s - lands_at_s <= duration_s:
            return ()
        share = (t_s - lands_at_s) / duration_s
        x_mm, y_mm = start_mm[0] + share * across_mm, start_mm[1] + share * down_mm
        return (TimedFinger(0, replace(finger, x_mm=x_mm, y_mm=y_mm)),)

    return fingers_at


def pinch(
    centre_mm: tuple[float, float],
    first_gap_mm: float,
    last_gap_mm: float,
    duration_s: float = 1.0,
    angle_rad: float = 0.0,
    finger: Finger = PLAIN_FINGER,
) -> Script:
    """Return a script of two fingers that move gently from one gap to the other, then lift.

    `angle_rad` is the direction from the first to the second, from +x towards +y.  Each moves at
    up to .75 x the change of the gap a duration.
    """

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        if not 0.0 <= t_s <= duration_s:
            return ()
        share = t_s / duration_s
        gently = share * share * (3.0 - 2.0 * share)
        half_mm = (first_gap_mm + gently * (last_gap_mm - first_gap_mm)) / 2.0
        across_mm, down_mm = half_mm * cos(angle_rad), half_mm * sin(angle_rad)
        return tuple(
            TimedFinger(
                key,
                replace(
                    finger,
                    x_mm=centre_mm[0] + side * across_mm,
                    y_mm=centre_mm[1] + side * down_mm,
                ),
            )
            for key, side in enumerate((-1.0, 1.0))
        )

    return fingers_at


def crossing_paths(
    surface_mm: tuple[float, float], miss_mm: float = 30.0, speed_mm_s: float = 200.0
) -> Script:
    """Return a script of two fingers drawn along the diagonals from left to right.

    The second follows so much later that they never come nearer than `miss_mm`.
    """
    width_mm, height_mm = surface_mm
    left_mm, right_mm = 2.0 * SIDE_MM, width_mm - 2.0 * SIDE_MM
    upper_mm, lower_mm = 2.0 * SIDE_MM, height_mm - 2.0 * SIDE_MM
    # Two points at equal speed on lines at ± a, one late by T, are never nearer than T v cos a.
    half_angle_rad = atan2(lower_mm - upper_mm, right_mm - left_mm)
    late_s = miss_mm / (speed_mm_s * cos(half_angle_rad))
    return together(
        drag((left_mm, upper_mm), (right_mm, lower_mm), speed_mm_s),
        drag((left_mm, lower_mm), (right_mm, upper_mm), speed_mm_s, lands_at_s=late_s),
    )


def _finger_from_below(rng: np.random.Generator) -> Finger:
    """Return a finger of someone at the lower side: it leans roughly towards +y."""
    return Finger(
        0.0,
        0.0,
        diameter_mm=rng.uniform(8.0, 14.0),
        lean_rad=rng.uniform(0.1, 0.6),
        lean_azimuth_rad=pi / 2.0 + rng.uniform(-0.6, 0.6),
    )


def two_hands(surface_mm: tuple[float, float], seed: int = 1) -> Script:
    """Return an endless script of ten fingers: two hands that move about, each in its half."""
    rng = np.random.default_rng(seed)
    width_mm, height_mm = surface_mm
    spread_mm = max(abs(x) for x, _ in RIGHT_HAND_MM)
    length_mm = max(abs(y) for _, y in RIGHT_HAND_MM)
    reach_mm = (width_mm / 4.0 - spread_mm - SIDE_MM, height_mm / 2.0 - length_mm - SIDE_MM)
    tips = []
    for number, (middle_x_mm, mirror) in enumerate(((0.25, -1.0), (0.75, 1.0))):
        middle_mm = (middle_x_mm * width_mm, height_mm / 2.0)
        hand = sway_within(middle_mm, reach_mm, HANDS_SPEED_MM_S, rng)
        for tip, (x_mm, y_mm) in enumerate(RIGHT_HAND_MM):
            key = number * len(RIGHT_HAND_MM) + tip
            tips.append((key, hand, mirror * x_mm, y_mm, _finger_from_below(rng)))

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        places = ((key, *hand.place_mm(t_s), x, y, finger) for key, hand, x, y, finger in tips)
        return tuple(
            TimedFinger(key, replace(finger, x_mm=hand_x + x, y_mm=hand_y + y))
            for key, hand_x, hand_y, x, y, finger in places
        )

    return fingers_at


@dataclass(frozen=True, slots=True)
class Dancer:
    """One finger of the show: it sways in its cell, and now and then lifts for a while."""

    sway: Sway
    finger: Finger
    period_s: float
    phase_s: float

    def round_at(self, t_s: float) -> int | None:
        """Return the number of the touch it makes at a time, or None while it is lifted."""
        number, share = divmod((t_s + self.phase_s) / self.period_s, 1.0)
        return int(number) if share < SHOW_DOWN_SHARE else None


def demo_script(surface_mm: tuple[float, float], touches: int, seed: int = 1) -> Script:
    """Return an endless show of up to `touches` fingers, each dancing in a cell of its own.

    Cells tile the surface and fingers stay 15 mm inside theirs, so they keep 30 mm apart as long
    as the surface has room for it.  None is faster than 400 mm/s.  Raises `ValueError` for more
    than 20 touches.
    """
    if not 0 <= touches <= MAX_TOUCHES:
        raise ValueError(f"touches is {touches}; give 0 to {MAX_TOUCHES}")
    rng = np.random.default_rng(seed)
    dancers = []
    for x_mm, y_mm, cell_width_mm, cell_height_mm in _cells(surface_mm, touches):
        reach_mm = (cell_width_mm / 2.0 - SIDE_MM, cell_height_mm / 2.0 - SIDE_MM)
        period_s = rng.uniform(*SHOW_PERIODS_S)
        dancers.append(
            Dancer(
                sway=sway_within((x_mm, y_mm), reach_mm, rng.uniform(*SHOW_SPEEDS_MM_S), rng),
                finger=_finger_from_below(rng),
                period_s=period_s,
                phase_s=rng.uniform(0.0, period_s),
            )
        )

    def fingers_at(t_s: float) -> tuple[TimedFinger, ...]:
        timed = []
        for number, dancer in enumerate(dancers):
            touch = dancer.round_at(t_s)
            if touch is not None:
                x_mm, y_mm = dancer.sway.place_mm(t_s)
                finger = replace(dancer.finger, x_mm=x_mm, y_mm=y_mm)
                timed.append(TimedFinger(touch * len(dancers) + number, finger))
        return tuple(timed)

    return fingers_at


def _cells(surface_mm: tuple[float, float], count: int) -> list[tuple[float, float, float, float]]:
    """Return centre, width and height of `count` cells that tile the surface, nearly square."""
    width_mm, height_mm = surface_mm
    rows = min(count, max(1, round((count * height_mm / width_mm) ** 0.5)))
    cells = []
    for row in range(rows):
        in_row = (count * (row + 1)) // rows - (count * row) // rows
        cell_mm = (width_mm / in_row, height_mm / rows)
        cells += [
            ((column + 0.5) * cell_mm[0], (row + 0.5) * cell_mm[1], *cell_mm)
            for column in range(in_row)
        ]
    return cells


def scribble(
    surface_mm: tuple[float, float], n: int, seed: int = 1, inset_mm: float = 10.0
) -> FloatArray:
    """Return places all over the surface (n, 2), in millimetres, drawn from the seed."""
    rng = np.random.default_rng(seed)
    return rng.uniform(inset_mm, np.array(surface_mm) - inset_mm, (n, 2))
