"""Which camera is it?  Someone covers its lens, or puts a finger right before it.

Cameras look along the same surface: a hand before one lens takes nearly all of its light, and but a
few degrees of the others' views.
"""

from collections import deque

import numpy as np

from cornertouchd.model import FloatArray, Picture

LEARNED_PICTURES = 15
"""The usual light is the median of so many: a quarter of a second, and no flicker counts."""

DARK_SHARE = 0.6
"""A column counts as hidden below this share of its usual light; dust and flicker leave .8."""

NEAR_SHARE = 0.1
"""A finger of 12 mm hides 23 % of the view from 30 mm away, 4 % from the middle of a tabletop."""

STANDS_OUT = 2.5
"""Times more than any other camera.  A hand before a lens hides up to 20 % of the others' views."""

HELD_PICTURES = 10
"""Pictures in a row until it is believed: a hand that passes by is meant for no camera."""

DARKEST_USUAL = 8.0
"""Grey levels.  Columns that are darker anyway tell nothing."""

FEWEST_COLUMNS = 0.2
"""Share of the columns that must be lit; else the camera cannot tell that it was covered."""


class Identifier:
    """Fed the pictures of several cameras, in any order; tells which of them someone means."""

    def __init__(self) -> None:
        self._learned: dict[str, deque[FloatArray]] = {}
        self._usual: dict[str, FloatArray] = {}
        self._hidden: dict[str, float] = {}
        self._held: dict[str, int] = {}

    @property
    def ready(self) -> bool:
        """Whether the usual light of all cameras is known."""
        return bool(self._learned) and self._usual.keys() == self._learned.keys()

    @property
    def dark_cameras(self) -> tuple[str, ...]:
        """Cameras that see too little light to tell that they are covered."""
        return tuple(
            camera
            for camera, usual in self._usual.items()
            if np.mean(usual >= DARKEST_USUAL) < FEWEST_COLUMNS
        )

    @property
    def hidden(self) -> dict[str, float]:
        """The share of each camera's view that is hidden, 0..1."""
        return dict(self._hidden)

    @property
    def all_free(self) -> bool:
        """Whether nobody stands before any camera."""
        return all(share < NEAR_SHARE for share in self._hidden.values())

    def feed(self, camera: str, picture: Picture) -> str | None:
        """Take a picture; return the camera that is meant, None while that is not clear."""
        columns = picture.max(axis=0).astype(np.float64)
        if camera not in self._usual:
            self._learn(camera, columns)
            return None
        usual = self._usual[camera]
        lit = usual >= DARKEST_USUAL
        dark = columns[lit] < DARK_SHARE * usual[lit]
        self._hidden[camera] = float(np.mean(dark)) if dark.size else 0.0
        stands_out = self.ready and self._stands_out(camera)
        self._held[camera] = self._held.get(camera, 0) + 1 if stands_out else 0
        return camera if self._held[camera] >= HELD_PICTURES else None

    def _learn(self, camera: str, columns: FloatArray) -> None:
        learned = self._learned.setdefault(camera, deque(maxlen=LEARNED_PICTURES))
        learned.append(columns)
        if len(learned) == LEARNED_PICTURES:
            self._usual[camera] = np.median(learned, axis=0)

    def _stands_out(self, camera: str) -> bool:
        share = self._hidden[camera]
        others = [hidden for other, hidden in self._hidden.items() if other != camera]
        return share >= NEAR_SHARE and share >= STANDS_OUT * max(others, default=0.0)
