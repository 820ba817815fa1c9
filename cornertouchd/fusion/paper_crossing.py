"""The crossing of Wang, Liu and Zhang 2011, section 6.2.1: directing lines through shadow centres.

Every group of one line from each camera is solved for the point nearest to its lines (eq. 8).  The
point is accepted if it is near to all of them (eq. 10) and not the same as one accepted before
(eq. 11).

Both inequalities are misprinted.  Eq. 10 has the least distance, where the text says that "the
distances to all lines fall below" Th1: the largest is meant.  Eq. 11 wants at most Th2 between a
point and the accepted ones, where the text wants "no redundant answers": more than Th2 is meant.

Beyond the paper, a camera without a whole shadow is left out instead of ending the search, points
beside the surface are no contacts, and a frame set with too many groups is refused.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import floor, hypot, prod

import numpy as np

from cornertouchd.config import PaperCrossingSettings
from cornertouchd.fusion.crossed import Crossed, IntArray, Predictions
from cornertouchd.fusion.limits import DiscLimits
from cornertouchd.geometry import angles_and_distances, normals
from cornertouchd.model import Contact, DirectingLines, FloatArray

# 21 shadows in each of four cameras.  Ten contacts make at most 10 000 groups.
MOST_GROUPS = 200_000
# The determinant of eq. 8 is the sum of the squared sines between its lines: 0.6 degrees for two.
SMALLEST_DETERMINANT = 1e-4
# Two lines cross exactly, whether or not something touches there: every other crossing is a ghost,
# and the tracker must not take one for sure.
CONFIDENCE_OF_TWO_LINES = 0.25


@dataclass(frozen=True, slots=True)
class Groups:
    """G groups of one directing line from each of C cameras, the last camera's changing fastest.

    `origins_mm` is (C, 2), `normals` (C, G, 2), the others (C, G).
    """

    cameras: tuple[str, ...]
    origins_mm: FloatArray
    normals: FloatArray
    offsets_mm: FloatArray
    width_rad: FloatArray
    sigma_rad: FloatArray

    def take(self, index: IntArray) -> "Groups":
        """Return the groups with these numbers."""
        return replace(
            self,
            normals=self.normals[:, index],
            offsets_mm=self.offsets_mm[:, index],
            width_rad=self.width_rad[:, index],
            sigma_rad=self.sigma_rad[:, index],
        )


@dataclass(frozen=True, slots=True)
class Located:
    """Where groups say that something touches: `points_mm` (G, 2), NaN where they cannot say.

    `misfit_mm` (G,) is what Th1 bounds; `spread` (G,) the sigma of a point per sigma of its lines.
    """

    points_mm: FloatArray
    misfit_mm: FloatArray
    spread: FloatArray


class PaperCrossing:
    """Accepts every group of directing lines that meet closely enough, ghosts and all.

    `locate` says where the lines of groups meet.  `confidence` of a contact falls from 1, where its
    lines meet in a point, to 0 at Th1.  `diameter_mm` is what its shadows span at its distance, on
    average; `sigma_mm` comes from the angles between the lines and from how far they pass by the
    contact.
    """

    def __init__(
        self,
        settings: PaperCrossingSettings,
        limits: DiscLimits,
        locate: Callable[[Groups], Located],
    ) -> None:
        self._settings = settings
        self._limits = limits
        self._locate = locate
        self._refused_sets = 0

    @property
    def refused_sets(self) -> int:
        """Number of frame sets that had more than `MOST_GROUPS` groups and so gave no contacts."""
        return self._refused_sets

    def cross(
        self,
        directing_lines: Sequence[DirectingLines],
        predictions: Predictions | None = None,  # noqa: ARG002  the paper knows single frames only
    ) -> Crossed:
        """Return the accepted points in the order in which the paper's iteration meets them."""
        seeing = [
            camera for camera in map(_with_whole_shadows, directing_lines) if len(camera.centre_rad)
        ]
        if len(seeing) < 2:
            return Crossed.nothing()
        if prod(len(camera.centre_rad) for camera in seeing) > MOST_GROUPS:
            self._refused_sets += 1
            return Crossed.nothing()
        groups = _all_groups(seeing)
        located = self._locate(groups)
        points = located.points_mm
        near = located.misfit_mm <= self._settings.th1_mm
        accepted = np.flatnonzero(near & self._limits.on_surface(points))
        accepted = accepted[_not_redundant(points[accepted], self._settings.th2_mm)]
        contacts = self._contacts(groups.take(accepted))
        return Crossed.unsupported(contacts, np.array([c.confidence for c in contacts]))

    def _contacts(self, groups: Groups) -> tuple[Contact, ...]:
        located = self._locate(groups)
        points = located.points_mm
        centres = np.clip(points, 0.0, self._limits.surface_mm)
        _, distances = angles_and_distances(points, groups.origins_mm)
        diameters_mm = np.mean(groups.width_rad * distances.T, axis=0)
        noise_mm = np.sqrt(np.mean((groups.sigma_rad * distances.T) ** 2, axis=0))
        sigmas_mm = located.spread * np.hypot(noise_mm, located.misfit_mm)
        confidences = 1.0 - located.misfit_mm / self._settings.th1_mm
        if len(groups.cameras) == 2:
            confidences = np.full(len(points), CONFIDENCE_OF_TWO_LINES)
        return tuple(
            Contact(
                x_mm=float(centre[0]),
                y_mm=float(centre[1]),
                diameter_mm=float(diameter_mm),
                cameras=groups.cameras,
                confidence=float(confidence),
                sigma_mm=float(sigma_mm),
            )
            for centre, diameter_mm, confidence, sigma_mm in zip(
                centres, diameters_mm, confidences, sigmas_mm, strict=True
            )
        )


def _with_whole_shadows(camera: DirectingLines) -> DirectingLines:
    """Keep the shadows of which both edges are seen: only those have a centre."""
    whole = camera.first_valid & camera.last_valid & np.isfinite(camera.centre_rad)
    return camera._replace(
        first_rad=camera.first_rad[whole],
        centre_rad=camera.centre_rad[whole],
        last_rad=camera.last_rad[whole],
        first_valid=camera.first_valid[whole],
        last_valid=camera.last_valid[whole],
        sigma_rad=camera.sigma_rad[whole],
    )


def _all_groups(cameras: Sequence[DirectingLines]) -> Groups:
    line_of = np.indices([len(camera.centre_rad) for camera in cameras]).reshape(len(cameras), -1)
    chosen = list(zip(cameras, line_of, strict=True))
    origins = np.array([(camera.x_mm, camera.y_mm) for camera in cameras])
    n = np.stack([normals(camera.centre_rad)[lines] for camera, lines in chosen])
    return Groups(
        cameras=tuple(camera.camera for camera in cameras),
        origins_mm=origins,
        normals=n,
        offsets_mm=np.einsum("cgi,ci->cg", n, origins),
        width_rad=np.stack([(c.last_rad - c.first_rad)[lines] for c, lines in chosen]),
        sigma_rad=np.stack([camera.sigma_rad[lines] for camera, lines in chosen]),
    )


def nearest_points(groups: Groups) -> Located:
    """Solve eq. 8; the misfit is how far the farthest line passes by, as eq. 10 has it.

    The point is NaN where all lines of a group are parallel.
    """
    x, y, h = groups.normals[:, :, 0], groups.normals[:, :, 1], groups.offsets_mm
    xx, xy, yy = (x * x).sum(axis=0), (x * y).sum(axis=0), (y * y).sum(axis=0)
    xh, yh = (x * h).sum(axis=0), (y * h).sum(axis=0)
    determinant = xx * yy - xy * xy
    determinant[determinant < SMALLEST_DETERMINANT] = np.nan
    points = np.stack([yy * xh - xy * yh, xx * yh - xy * xh], axis=-1) / determinant[:, None]
    smallest_eigenvalue = (xx + yy) / 2.0 - np.hypot((xx - yy) / 2.0, xy)
    spread = 1.0 / np.sqrt(np.maximum(smallest_eigenvalue, SMALLEST_DETERMINANT))
    return Located(points, _largest_distances(groups, points), spread)


def _largest_distances(groups: Groups, points_mm: FloatArray) -> FloatArray:
    """Return how far each point is from the farthest line of its group, (G,)."""
    across = np.einsum("cgi,gi->cg", groups.normals, points_mm)
    largest: FloatArray = np.max(np.abs(across - groups.offsets_mm), axis=0)
    return largest


def _not_redundant(points_mm: FloatArray, apart_mm: float) -> IntArray:
    """Return the points that are farther than `apart_mm` from all that are returned before them.

    A grid of squares of that size leaves only the neighbouring squares to look at.
    """
    accepted: list[int] = []
    in_square: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for number, (x, y) in enumerate(points_mm.tolist()):
        column, row = floor(x / apart_mm), floor(y / apart_mm)
        neighbours = (
            other
            for square in product((column - 1, column, column + 1), (row - 1, row, row + 1))
            for other in in_square.get(square, ())
        )
        if all(hypot(x - other[0], y - other[1]) > apart_mm for other in neighbours):
            accepted.append(number)
            in_square.setdefault((column, row), []).append((x, y))
    return np.array(accepted, dtype=np.intp)
