"""Tips: from contacts as the crossing finds them, at the cameras' height, to where they touch.

The crossing and the tracker go on with sections, which every contact has.  By how much a tip lies
beside its section is followed on its own: it changes slowly, and is not always seen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from cornertouchd.config import TouchPointSettings
from cornertouchd.fusion.crossed import Crossed, IntArray
from cornertouchd.fusion.hover import THINNEST_FINGER_MM
from cornertouchd.fusion.rays import SeesHeights
from cornertouchd.fusion.touch_point import TouchPointFinder, TouchPoints
from cornertouchd.fusion.touch_table import SECTION
from cornertouchd.model import Contact, DirectingLines, FloatArray, Lean, Observation

# The gap of a finger so high above the surface, in units of what touches: 2.1 to 2.8 up to .25 mm,
# 3.4 up to .5, 4 to 6.5 up to 1 (simulated rigs).  1 of 100 touches shows more than 1, up to 1.2.
GAP_AT_THE_SURFACE, GAP_PER_MM = 1.5, 4.7


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
        points = self._finder.find(
            np.array([(one.x_mm, one.y_mm, 0.5 * one.diameter_mm) for one in contacts]),
            np.array([one.sigma_mm for one in contacts]),
            self._owned(crossed.edges, lines),
            [outlines.get(camera) for camera in self._cameras],
        )
        tips = self._tips(contacts, points)
        return self._moved(contacts, points, tips), tips

    def _owned(self, edges: IntArray, lines: Sequence[DirectingLines]) -> IntArray:
        """Return which outline's left and right edge are each contact's, (N, cameras, 2)."""
        owned = np.full((len(edges), len(self._cameras), 2), -1, np.intp)
        cameras = [self._numbers.get(one.camera, -1) for one in lines]
        edges_of_pictures = [one.edges.tolist() for one in lines]
        is_owned = (edges >= 0) & (np.array(cameras) >= 0)[:, None]
        contact, camera, side = np.nonzero(is_owned)
        shadow = edges[contact, camera, side]
        edge = np.array(
            [
                edges_of_pictures[c][s][k]
                for c, s, k in zip(camera.tolist(), side.tolist(), shadow.tolist(), strict=True)
            ],
            np.intp,
        )
        owned[contact, np.array(cameras, np.intp)[camera], edge % 2] = edge // 2
        return owned

    def _tips(self, contacts: Sequence[Contact], points: TouchPoints) -> Tips:
        sections_mm = np.array([(one.x_mm, one.y_mm) for one in contacts])
        places_mm = np.clip(np.column_stack([points.x_mm, points.y_mm]), 0.0, self._surface_mm)
        is_known = (points.methods != SECTION) & [one.kind != "palm" for one in contacts]
        variances = 0.5 * (points.covariances_mm2[:, 0] + points.covariances_mm2[:, 2])
        radii_mm = np.array([0.5 * one.diameter_mm for one in contacts])
        # all the light there is makes but 2.1 of the gap below what is thin
        largest = np.where(radii_mm < THINNEST_FINGER_MM, GAP_AT_THE_SURFACE, self._largest_gap)
        return Tips(
            np.where(is_known[:, None], places_mm - sections_mm, 0.0),
            np.where(is_known, variances, np.inf),
            np.where([one.kind == "palm" for one in contacts], np.nan, points.gaps / largest),
        )

    def _moved(
        self, contacts: Sequence[Contact], points: TouchPoints, tips: Tips
    ) -> tuple[Contact, ...]:
        sigmas_mm = np.sqrt(np.max(points.covariances_mm2[:, (0, 2)], axis=1)).tolist()
        return tuple(
            contact
            if contact.kind == "palm"
            else Contact(
                contact.x_mm + dx_mm,
                contact.y_mm + dy_mm,
                contact.diameter_mm,
                contact.cameras,
                contact.confidence,
                sigma_mm,
                not gap > 1.0,
                contact.kind,
                (-dx_mm, -dy_mm),
                Lean(*lean) if variance < inf else None,
            )
            for contact, (dx_mm, dy_mm), sigma_mm, gap, variance, lean in zip(
                contacts,
                tips.shifts_mm.tolist(),
                sigmas_mm,
                tips.gaps.tolist(),
                tips.variances_mm2.tolist(),
                zip(
                    points.lean_rad.tolist(),
                    points.azimuth_rad.tolist(),
                    points.lean_sigma_rad.tolist(),
                    points.azimuth_sigma_rad.tolist(),
                    strict=True,
                ),
                strict=True,
            )
        )
