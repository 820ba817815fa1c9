"""How much of the surface a scribble has covered, and which of its touches to keep."""

from math import ceil

import numpy as np

from cornertouchd.model import BoolArray, FloatArray

CELLS = 6
"""Cells along the shorter side.  A camera's angles bend over a third of the view at least, so
touches a sixth apart pin them down."""

ENOUGH_SHARE = 0.9
"""Of the cells; the last corners cost more patience than they bring."""

MOST_IN_CELL = 5
"""More touches in one place tell nothing new."""

APART_SHARE = 0.25
"""Of a cell: touches nearer than this to the last one kept are the same touch."""


class ScribbleCoverage:
    """Keeps count of the cells of a surface, nearly square, that a finger has been in."""

    def __init__(self, surface_mm: tuple[float, float]) -> None:
        self._cell_mm = min(surface_mm) / CELLS
        self._surface = np.array(surface_mm)
        shape = (ceil(surface_mm[1] / self._cell_mm), ceil(surface_mm[0] / self._cell_mm))
        self._counts = np.zeros(shape, int)
        self._last_mm = np.full(2, np.inf)

    @property
    def visited(self) -> BoolArray:
        """Which cells have been visited, (rows, columns)."""
        return self._counts > 0

    @property
    def share(self) -> float:
        """Share of what suffices, 0..1."""
        return min(1.0, float(np.mean(self.visited)) / ENOUGH_SHARE)

    @property
    def is_enough(self) -> bool:
        """Whether the scribble suffices."""
        return self.share >= 1.0

    def wants(self, place_mm: FloatArray) -> bool:
        """Note a touch at about this place (2,); tell whether it is worth keeping."""
        if not np.all((place_mm > 0) & (place_mm < self._surface)):
            return False
        if np.linalg.norm(place_mm - self._last_mm) < APART_SHARE * self._cell_mm:
            return False
        column, row = np.minimum(place_mm // self._cell_mm, np.array(self._counts.shape)[::-1] - 1)
        cell = int(row), int(column)
        if self._counts[cell] >= MOST_IN_CELL:
            return False
        self._counts[cell] += 1
        self._last_mm = place_mm
        return True
