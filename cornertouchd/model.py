"""The values that flow from pictures to touches: frozen, typed, units in their names.

Positions on the surface are millimetres, origin top-left, x right, y down.  Columns and rows are
continuous pixels: the centre of the first pixel is at 0.5.  Times are CLOCK_MONOTONIC seconds,
taken when the picture was taken.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Picture = NDArray[np.uint8]
ContactKind = Literal["finger", "palm", "pen"]
SEES_EVERYTHING = (-math.inf, math.inf)
"""The view of a camera that looks in all directions."""
NO_EDGES: NDArray[np.intp] = np.empty((2, 0), np.intp)


@dataclass(frozen=True, slots=True)
class PictureFormat:
    """The size of a camera's full image and the band of its rows that a picture holds."""

    width_px: int
    height_px: int
    row_offset_px: int
    rows_px: int

    def __str__(self) -> str:
        last = self.row_offset_px + self.rows_px
        return f"{self.width_px}x{self.height_px}, rows {self.row_offset_px}..{last}"


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of one camera: a band of rows, 8-bit grey, (rows_px, width_px)."""

    camera: str
    sequence: int
    captured_at_s: float
    lit_mask: int | None
    pixels: Picture


@dataclass(frozen=True, slots=True)
class Profile:
    """Brightness along the strip, one value a column.

    `brightness` is 1 where the strip is as bright as when it was empty and 0 where no light of it
    arrives; columns where `known` is False carry no information and are interpolated.
    """

    brightness: FloatArray
    known: BoolArray


@dataclass(frozen=True, slots=True)
class Shadow:
    """A dark interval of a profile between two sub-pixel columns.

    An edge that lies at the border of what the camera can see (or at an unknown column) is not
    valid: the object may reach beyond it.  `depth` is the share of light missing at the darkest
    place, 0..1.
    """

    left_px: float
    right_px: float
    left_valid: bool
    right_valid: bool
    depth: float


@dataclass(frozen=True, slots=True, eq=False)
class Shadows:
    """The K shadows of a profile from left to right, as arrays; to iterate gives each `Shadow`.

    `edges_px` and `valid` are (K, 2), left and right; `depth` is (K,).
    """

    edges_px: FloatArray
    valid: BoolArray
    depth: FloatArray

    @staticmethod
    def of(shadows: Iterable[Shadow]) -> "Shadows":
        """Return shadows that are given one by one."""
        given = tuple(shadows)
        return Shadows(
            np.array([(one.left_px, one.right_px) for one in given], np.float64).reshape(-1, 2),
            np.array([(one.left_valid, one.right_valid) for one in given], np.bool_).reshape(-1, 2),
            np.array([one.depth for one in given], np.float64),
        )

    def __len__(self) -> int:
        return len(self.depth)

    def __iter__(self) -> Iterator[Shadow]:
        for (left, right), (left_valid, right_valid), depth in zip(
            self.edges_px.tolist(), self.valid.tolist(), self.depth.tolist(), strict=True
        ):
            yield Shadow(left, right, left_valid, right_valid, depth)


@dataclass(frozen=True, slots=True, eq=False)
class Outlines:
    """How the K shadows of a picture run up and down the strip and its mirror image.

    Left and right edges were met at `columns_px` on `rows_px`, both (K, 2, L) from the top down;
    NaN where an edge was lost.  `light` (R, N) is what is left of the light, 1 as in the empty
    strip, NaN where that tells nothing, in the columns around shadows: column u is
    `light[:, light_at[u]]`, (width_px,), -1 where it is not kept; its first row is
    `light_row_px[u]`, (width_px,) whole rows.
    """

    columns_px: FloatArray
    rows_px: FloatArray
    light: NDArray[np.float32]
    light_at: NDArray[np.int32]
    light_row_px: NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Observation:
    """What one camera saw in one frame: the only thing that leaves its capture thread.

    `outlines` are those of the shadows, None where the method of finding them knows no rows.
    """

    camera: str
    sequence: int
    captured_at_s: float
    shadows: Shadows
    outlines: Outlines | None = None


@dataclass(frozen=True, slots=True)
class FrameSet:
    """The observations of one instant, at most one a camera, in the order of the cameras."""

    captured_at_s: float
    observations: tuple[Observation, ...]


class DirectingLines(NamedTuple):
    """The K shadows of one camera laid on the surface: lines through (x_mm, y_mm), by angle.

    A shadow lies between `first_rad` and `last_rad` (first < last); `centre_rad` belongs to the
    middle of its columns.  An edge that is not valid bounds nothing.  `sigma_rad` is the standard
    deviation of an edge.  All arrays are (K,), ordered by `first_rad`.  `view_rad` are the first
    and the last angle that the camera looks at, without a jump between them: beside these it shows
    neither shadow nor light.

    `edges` (2, K) are the edges of the picture that first and last angle belong to: twice the
    number of the shadow, and one more for its right edge; empty if there is no picture.  A tuple,
    since one is made for every picture.
    """

    camera: str
    x_mm: float
    y_mm: float
    first_rad: FloatArray
    centre_rad: FloatArray
    last_rad: FloatArray
    first_valid: BoolArray
    last_valid: BoolArray
    sigma_rad: FloatArray
    view_rad: tuple[float, float] = SEES_EVERYTHING
    edges: NDArray[np.intp] = NO_EDGES


class Lean(NamedTuple):
    """How a finger leans: by `angle_rad` from upright, away from its tip towards `azimuth_rad`.

    The azimuth runs from +x towards +y; the sigmas are their standard deviations.  A tuple, as
    contacts and touches are, since a thousand are made in a second.
    """

    angle_rad: float
    azimuth_rad: float
    angle_sigma_rad: float
    azimuth_sigma_rad: float


class Contact(NamedTuple):
    """A place touched in one frame set.

    `cameras` are those whose shadows it explains; `confidence` is 0..1; `sigma_mm` is the
    standard deviation of the position.  The section of a finger at the height of the cameras lies
    `section_shift_mm` beside its tip, because the finger leans; `lean` is None if nothing tells.
    `touching` is False for what hovers.
    """

    x_mm: float
    y_mm: float
    diameter_mm: float
    cameras: tuple[str, ...]
    confidence: float
    sigma_mm: float
    touching: bool = True
    kind: ContactKind = "finger"
    section_shift_mm: tuple[float, float] = (0.0, 0.0)
    lean: Lean | None = None

    @property
    def section_mm(self) -> tuple[float, float]:
        """Where the section is."""
        return self.x_mm + self.section_shift_mm[0], self.y_mm + self.section_shift_mm[1]


class Touch(NamedTuple):
    """A contact followed over time.  `id` is never used twice by the same tracker.

    `diameter_mm` is that of its section at the height of the cameras, 0 if unknown.
    """

    id: int
    x_mm: float
    y_mm: float
    vx_mm_s: float
    vy_mm_s: float
    age_s: float
    diameter_mm: float = 0.0


@dataclass(frozen=True, slots=True)
class TouchFrame:
    """All touches of one instant."""

    captured_at_s: float
    touches: tuple[Touch, ...]
