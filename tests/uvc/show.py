"""What the simulated cameras show: three fingers in a loop, as pictures and as the truth.

A folder holds it: c1.npy .. c4.npy, truth.json, calibration.json of that rig.
"""

import json
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from pathlib import Path
from typing import Self

WIDTH_PX, HEIGHT_PX = 640, 120
RATE_HZ = 60.0
LOOP_S = 4.0
SURFACE_MM = (350.0, 400.0)
CAMERAS = ("C1", "C2", "C3", "C4")

Place = tuple[float, float]


def fingers_at(time_s: float) -> tuple[Place, ...]:
    """Return where fingers touch: one circles for ever, one lifts and lands, one stands a while."""
    time_s %= LOOP_S
    turn = 2.0 * pi * time_s / LOOP_S
    places = [(115.0 + 30.0 * cos(turn), 130.0 + 30.0 * sin(turn))]
    if time_s < 3.0:
        places.append((230.0 + 35.0 * cos(turn), 280.0 - 35.0 * sin(turn)))
    if 1.0 <= time_s < 3.5:
        places.append((255.0, 100.0))
    return tuple(places)


@dataclass(frozen=True, slots=True)
class Show:
    """The truth of a loop: where fingers touch, picture by picture."""

    folder: Path
    places_mm: tuple[tuple[Place, ...], ...]

    @classmethod
    def load(cls, folder: Path) -> Self:
        """Read what `save` wrote."""
        sets = json.loads((folder / "truth.json").read_text())
        return cls(folder, tuple(tuple((x, y) for x, y in places) for places in sets))

    def save(self) -> None:
        """Write the truth into the folder."""
        (self.folder / "truth.json").write_text(json.dumps(self.places_mm))

    @property
    def pictures(self) -> dict[str, Path]:
        """The loop of each camera."""
        return {camera: self.folder / f"{camera.lower()}.npy" for camera in CAMERAS}

    @property
    def calibration(self) -> Path:
        """The calibration of the rig that is shown."""
        return self.folder / "calibration.json"

    def between(self, first_s: float, last_s: float) -> tuple[tuple[Place, ...], ...]:
        """Return the places of all pictures between two times since the loop began."""
        first, last = int(first_s * RATE_HZ), int(last_s * RATE_HZ)
        return tuple(
            self.places_mm[number % len(self.places_mm)] for number in range(first, last + 1)
        )


def distance_mm(one: Place, other: Place) -> float:
    """Return how far two places are apart."""
    return hypot(one[0] - other[0], one[1] - other[1])
