"""Tips: from contacts as the crossing finds them, at the cameras' height, to where they touch.

The crossing and the tracker go on with sections, which every contact has.  By how much a tip lies
beside its section is followed on its own: it changes slowly, and is not always seen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from cornertouchd.compiling import compiled
from cornertouchd.config import TouchPointSettings
from cornertouchd.fusion.crossed import Crossed, IntArray
from cornertouchd.fusion.hover import THINNEST_FINGER_MM
from cornertouchd.fusion.rays import SeesHeights
from cornertouchd.fusion.touch_point import TouchPointFinder
from cornertouchd.fusion.touch_table import AT_X, AT_Y, GAP, LEAN, METHOD, SECTION, XX, YY
from cornertouchd.model import Contact, DirectingLines, FloatArray, Lean, Observation

# The gap of a finger so high above the surface, in units of what touches: 2.1 to 2.8 up to .25 mm,
# 3.4 up to .5, 4 to 6.5 up to 1 (simulated rigs).  1 of 100 touches shows more than 1, up to 1.2.
GAP_AT_THE_SURFACE, GAP_PER_MM = 1.5, 4.7

# Columns of the table of tips; the last four are those of `Lean`.
SHIFT_X, SHIFT_Y, VARIANCE, GAP_SHARE, TIP_SIGMA, LEANS = range(6)
TIP_COLUMNS = 9


@dataclass(frozen=True, slots=True, eq=False)
class Tips:
    """Of N contacts: how far the tip lies beside the section, and the light below it.

    `shifts_mm` (N, 2), with `variances_mm2` (N,) for x as for y, infinite where nothing tells.  A
    contact touches where `gaps` (N,) is at most 1; NaN where nothing tells.
    """

    shifts_mm: FloatArray
    variances_mm2: FloatArray
    gaps: FloatArray

    @staticmethod
    def unknown(count: int) -> "Tips":
        """Return the tips of contacts of which only the section is known."""
        return Tips(np.zeros((count, 2)), np.full(count, np.inf), np.full(count, np.nan))


class TipFinder:
    """Finds the tips of contacts; keeps nothing from one frame set to the next.

    `cameras` are the tables of the cameras by name.
    """

    def __init__(
        self,
        cameras: Mapping[str, SeesHeights],
        settings: TouchPointSettings,
        surface_mm: tuple[float, float],
    ) -> None:
        self._cameras = tuple(cameras)
        self._numbers = {camera: number for number, camera in enumerate(cameras)}
        self._finder = TouchPointFinder(list(cameras.values()))
        self._largest_gap = GAP_AT_THE_SURFACE + GAP_PER_MM * settings.touch_height_mm
        self._surface_mm = surface_mm

    def find(
        self,
        crossed: Crossed,
        lines: Sequence[DirectingLines],
        observations: Sequence[Observation],
    ) -> tuple[tuple[Contact, ...], Tips]:
        """Return the contacts where they touch, and their tips.

        `lines` are those that were crossed, of the shadows of these observations.  Cameras without
        a table tell nothing.
        """
        contacts = crossed.contacts
        if not contacts or not crossed.edges.shape[1]:
            return contacts, Tips.unknown(len(contacts))
        outlines = {one.camera: one.outlines for one in observations}
        sections = np.array(
            [
                (one.x_mm, one.y_mm, 0.5 * one.diameter_mm, one.sigma_mm, one.kind == "palm")
                for one in contacts
            ],
            np.float64,
        )
        points = self._finder.table(
            sections,
            self._owned(crossed.edges, lines),
            [outlines.get(camera) for camera in self._cameras],
        )
        found = _tips(points, sections, *self._surface_mm, self._largest_gap)
        tips = Tips(found[:, SHIFT_X : SHIFT_Y + 1], found[:, VARIANCE], found[:, GAP_SHARE])
        return tuple(map(_moved, contacts, found.tolist())), tips

    def _owned(self, edges: IntArray, lines: Sequence[DirectingLines]) -> IntArray:
        """Return which outline's left and right edge are each contact's, (N, cameras, 2)."""
        return _owned_outlines(
            edges,
            np.array([self._numbers.get(one.camera, -1) for one in lines], np.intp),
            np.array([one.edges.shape[1] for one in lines], np.intp),
            np.concatenate([one.edges for one in lines], axis=1),
            len(self._cameras),
        )


def _moved(contact: Contact, found: Sequence[float]) -> Contact:
    """Return a contact where it touches, by its row of what was found; palms stay."""
    if contact.kind == "palm":
        return contact
    dx_mm, dy_mm, variance_mm2, gap, sigma_mm, lean, azimuth, lean_sigma, azimuth_sigma = found
    return Contact(
        contact.x_mm + dx_mm,
        contact.y_mm + dy_mm,
        contact.diameter_mm,
        contact.cameras,
        contact.confidence,
        sigma_mm,
        not gap > 1.0,
        contact.kind,
        (-dx_mm, -dy_mm),
        Lean(lean, azimuth, lean_sigma, azimuth_sigma) if variance_mm2 < inf else None,
    )


@compiled("i8[:,:,::1](i8[:,:,:], i8[::1], i8[::1], i8[:,:], i8)")
def _owned_outlines(
    edges: IntArray,
    camera_of_lines: IntArray,
    counts: IntArray,
    edges_of_pictures: IntArray,
    cameras: int,
) -> IntArray:
    """Return which outline's left and right edge are each contact's, (N, cameras, 2), -1 for none.

    `edges` are those of `Crossed`; L cameras were crossed, with the numbers `camera_of_lines` (-1
    for one without a table) and so many shadows each, whose `DirectingLines.edges` (2, K) follow
    each other.
    """
    owned = np.full((len(edges), cameras, 2), -1)
    first = 0
    for number in range(len(counts)):
        camera, count = camera_of_lines[number], counts[number]
        for contact in range(len(edges) if camera >= 0 else 0):
            for side in range(2):
                shadow = edges[contact, number, side]
                if 0 <= shadow < count:
                    edge = edges_of_pictures[side, first + shadow]
                    owned[contact, camera, edge % 2] = edge // 2
        first += count
    return owned


@compiled("f8[:,::1](f8[:,::1], f8[:,::1], f8, f8, f8)")
def _tips(
    points: FloatArray,
    sections: FloatArray,
    width_mm: float,
    height_mm: float,
    largest_gap: float,
) -> FloatArray:
    """Return the table of N tips, (N, 9), with the columns `SHIFT_X` .. `LEANS`.

    `points` are those of `touch_points`, `sections` (N, 5) x, y, r, the sigma, and 1 for palms; the
    surface is so large.
    """
    found = np.empty((len(points), TIP_COLUMNS))
    for number in range(len(points)):
        point, section, tip = points[number], sections[number], found[number]
        is_palm = section[4] > 0.0
        tip[SHIFT_X] = tip[SHIFT_Y] = 0.0
        tip[VARIANCE], tip[GAP_SHARE] = np.inf, np.nan
        if point[METHOD] != SECTION and not is_palm:
            tip[SHIFT_X] = min(max(point[AT_X], 0.0), width_mm) - section[0]
            tip[SHIFT_Y] = min(max(point[AT_Y], 0.0), height_mm) - section[1]
            tip[VARIANCE] = 0.5 * (point[XX] + point[YY])
        if not is_palm:
            # all the light there is makes but 2.1 of the gap below what is thin
            is_thin = section[2] < THINNEST_FINGER_MM
            tip[GAP_SHARE] = point[GAP] / (GAP_AT_THE_SURFACE if is_thin else largest_gap)
        tip[TIP_SIGMA] = np.sqrt(max(point[XX], point[YY]))
        for angle in range(4):
            tip[LEANS + angle] = point[LEAN + angle]
    return found
