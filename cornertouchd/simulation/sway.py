"""Swinging to and fro on the surface: the movement out of which shows are made."""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

# In a small cell the speed alone would let a finger tremble; .8 Hz still looks like play.
MAX_TURN_RAD_S = 2.0 * pi * 0.8


@dataclass(frozen=True, slots=True)
class Sway:
    """Endless swinging about a middle along both axes, each at its own pace."""

    middle_mm: tuple[float, float]
    reach_mm: tuple[float, float]
    turn_rad_s: tuple[float, float]
    phase_rad: tuple[float, float]

    def place_mm(self, t_s: float) -> tuple[float, float]:
        """Return where it is at a time."""
        x_mm, y_mm = (
            middle + reach * sin(turn * t_s + phase)
            for middle, reach, turn, phase in zip(
                self.middle_mm, self.reach_mm, self.turn_rad_s, self.phase_rad, strict=True
            )
        )
        return x_mm, y_mm


def sway_within(
    middle_mm: tuple[float, float],
    reach_mm: tuple[float, float],
    speed_mm_s: float,
    rng: np.random.Generator,
) -> Sway:
    """Return a sway within ± reach of the middle that never exceeds the speed.

    A negative reach counts as 0: it stands still along that axis.
    """
    heading_rad = rng.uniform(pi / 6.0, pi / 3.0)
    reach_mm = (max(0.0, reach_mm[0]), max(0.0, reach_mm[1]))
    turns_rad_s = [
        min(MAX_TURN_RAD_S, speed_mm_s * part / reach) if reach > 0.0 else 0.0
        for part, reach in zip((cos(heading_rad), sin(heading_rad)), reach_mm, strict=True)
    ]
    phases_rad = rng.uniform(0.0, 2.0 * pi, 2).tolist()
    return Sway(
        middle_mm, reach_mm, (turns_rad_s[0], turns_rad_s[1]), (phases_rad[0], phases_rad[1])
    )
