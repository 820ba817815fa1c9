"""Kinds: which contacts are palms, which are pens.

The crossing believes in discs about the size of fingertips.  What is larger shows as several of
them, in places that mean little; what gives it away is that no camera shows a narrow shadow there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import hypot
from typing import Literal

import numpy as np

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.sections import Section, find_section, shadow_at
from cornertouchd.model import Contact, DirectingLines

VAGUE_MM = 1.0
"""Sigma of a contact that is but a part of something: those of palms and arms have 1.1 mm and more,
fingers seldom."""

LARGEST_FINGER_MM = 17.0
"""What the crossing takes for a fingertip, as it knows them, is no wider."""

EDGES_OF_A_FINGER = 4
"""A contact of a finger's size that owns so many edges is one: fingers in a row look like a palm to
cameras that all see them askew."""

FEWEST_EDGES_OF_A_NEW_FINGER = 2
"""One edge leaves it anywhere along a line: a third of those are ghosts (random crowds)."""

CAMERAS_OF_A_PALM = 3
CAMERAS_OF_AN_ARM = 2
"""A finger that a crowd hides from most cameras stands amid wide shadows, too."""

PEN_SIGMA_MM = 0.5
"""A contact known no better than this may be a finger of which too few edges are seen."""

PALM_SIGMA_MM = 1.0
"""How well the middle of a palm is known: in path-traced pictures within 1 mm."""

LONGEST_PALM_MM = 200.0
"""Both palms side by side.  What is longer is many things in line."""


@dataclass(frozen=True, slots=True)
class _Palm:
    """A palm and the numbers of the contacts that are parts of it, the best supported first."""

    section: Section
    parts: tuple[int, ...]


class KindsOfContacts:
    """Tells palms and pens from fingers.  Keeps nothing from one frame set to the next."""

    def __init__(self, settings: CrossingSettings, surface_mm: tuple[float, float]) -> None:
        self._palm_mm = settings.palm_diameter_mm
        self._reach_mm = settings.palm_reach_mm
        self._pen_mm = settings.pen_diameter_mm
        self._surface_mm = surface_mm

    def tell(self, crossed: Crossed, directing_lines: Sequence[DirectingLines]) -> Crossed:
        """Return the contacts with their kinds; those that are parts of one palm become one.

        A palm is wider than `palm_diameter_mm` in every direction; an arm is that, too, and reaches
        in from the border of a picture.  What lies within `palm_reach_mm` of them is palm as well.
        """
        if not crossed.contacts:
            return crossed
        suspects = [
            number
            for number, contact in enumerate(crossed.contacts)
            if contact.sigma_mm > VAGUE_MM or contact.diameter_mm > LARGEST_FINGER_MM
        ]
        if suspects:
            crossed = self._with_palms(crossed, directing_lines, suspects)
        if any(contact.diameter_mm < self._pen_mm for contact in crossed.contacts):
            crossed = replace(crossed, contacts=tuple(map(self._or_pen, crossed.contacts)))
        return _without_guesses(crossed)

    def _or_pen(self, contact: Contact) -> Contact:
        is_pen = (
            contact.kind == "finger"
            and contact.diameter_mm < self._pen_mm
            and contact.sigma_mm <= PEN_SIGMA_MM
        )
        return contact._replace(kind="pen") if is_pen else contact

    def _with_palms(
        self, crossed: Crossed, directing_lines: Sequence[DirectingLines], suspects: Sequence[int]
    ) -> Crossed:
        contacts = crossed.contacts
        around = {n: self._wide_shadows_around(contacts[n], directing_lines) for n in suspects}
        wide = [n for n in suspects if around[n] != "narrow"]
        if not wide:
            return crossed
        sections = _sections({n: contacts[n] for n in wide}, directing_lines)
        palms = self._find_palms(crossed, sections, len(directing_lines))
        parts = {part for palm in palms for part in palm.parts}
        others = [number for number in range(len(contacts)) if number not in parts]
        arms = [
            contacts[number]
            for number in set(wide) - parts
            if len(contacts[number].cameras) >= CAMERAS_OF_AN_ARM
            and not self._is_slim(sections[number])
            and not _is_clear_finger(crossed, number)
            and (around[number] == "cut off" or contacts[number].diameter_mm > self._palm_mm)
        ]
        if not palms and not arms:
            return crossed
        told = [self._palm(palm, contacts) for palm in palms]
        told += [self._or_palm(contacts[number], palms, arms) for number in others]
        return _joined(crossed, tuple(told), [palm.parts for palm in palms], others)

    def _wide_shadows_around(
        self, contact: Contact, directing_lines: Sequence[DirectingLines]
    ) -> Literal["wide", "cut off", "narrow"]:
        """Tell whether all shadows around a contact are as wide as a palm, or reach beyond a view.

        A camera that sees light there sees no palm.
        """
        around: Literal["wide", "cut off"] = "wide"
        for camera in directing_lines:
            shadow = shadow_at(contact.x_mm, contact.y_mm, camera)
            if shadow is None:
                return "narrow"
            is_first, is_last = shadow == 0, shadow == len(camera.first_rad) - 1
            if camera.first_valid[shadow] and camera.last_valid[shadow]:
                width_rad = camera.last_rad[shadow] - camera.first_rad[shadow]
                distance_mm = hypot(contact.x_mm - camera.x_mm, contact.y_mm - camera.y_mm)
                if distance_mm * width_rad <= self._palm_mm:
                    return "narrow"
            elif (camera.last_valid[shadow] and is_first) or (
                camera.first_valid[shadow] and is_last
            ):
                around = "cut off"
        return around

    def _find_palms(
        self, crossed: Crossed, sections: Mapping[int, Section | None], cameras: int
    ) -> list[_Palm]:
        """Return the palms among the sections around contacts, with all parts of each."""
        palms: list[_Palm] = []
        left = np.argsort(-crossed.supports, kind="stable").tolist()
        for number, section in sections.items():
            if number not in left or section is None or not self._is_palm(section):
                continue
            parts = [
                n
                for n in left
                if n == number or self._is_part(crossed.contacts[n], section, is_wide=n in sections)
            ]
            if any(_is_clear_finger(crossed, part) for part in parts) or not _is_shown(
                [crossed.contacts[part] for part in parts], cameras
            ):
                continue
            left = [n for n in left if n not in parts]
            palms.append(_Palm(section, tuple(parts)))
        return palms

    def _is_slim(self, section: Section | None) -> bool:
        return section is not None and 2.0 * section.short_mm <= self._palm_mm

    def _is_palm(self, section: Section) -> bool:
        return not self._is_slim(section) and 2.0 * section.long_mm <= LONGEST_PALM_MM

    def _is_part(self, contact: Contact, section: Section, *, is_wide: bool) -> bool:
        """Tell whether a contact is where the palm is; one of wide shadows may lie beside it."""
        reach_mm = self._reach_mm + contact.diameter_mm / 2.0 if is_wide else 0.0
        return section.distance_mm(contact.x_mm, contact.y_mm) <= reach_mm

    def _palm(self, palm: _Palm, contacts: Sequence[Contact]) -> Contact:
        """Return one contact for all parts of a palm."""
        section, parts = palm.section, [contacts[part] for part in palm.parts]
        width_mm, height_mm = self._surface_mm
        return Contact(
            x_mm=min(max(section.x_mm, 0.0), width_mm),
            y_mm=min(max(section.y_mm, 0.0), height_mm),
            diameter_mm=section.mean_diameter_mm,
            cameras=tuple(sorted({camera for part in parts for camera in part.cameras})),
            confidence=max(part.confidence for part in parts),
            sigma_mm=PALM_SIGMA_MM,
            touching=any(part.touching for part in parts),
            kind="palm",
        )

    def _or_palm(
        self, contact: Contact, palms: Sequence[_Palm], arms: Sequence[Contact]
    ) -> Contact:
        """Return a contact as palm if it is an arm, or near to one or to a palm."""
        reach_mm = self._reach_mm + contact.diameter_mm / 2.0
        belongs = any(
            palm.section.distance_mm(contact.x_mm, contact.y_mm) <= reach_mm for palm in palms
        ) or any(
            arm is contact
            or hypot(arm.x_mm - contact.x_mm, arm.y_mm - contact.y_mm)
            <= reach_mm + arm.diameter_mm / 2.0
            for arm in arms
        )
        return contact._replace(kind="palm") if belongs else contact


def _without_guesses(crossed: Crossed) -> Crossed:
    """Leave out new fingers that own hardly an edge, and are no part of a palm either."""
    guessed = [
        own_edges < FEWEST_EDGES_OF_A_NEW_FINGER and prediction < 0
        for own_edges, prediction in zip(
            crossed.own_edges.tolist(), crossed.predictions.tolist(), strict=True
        )
    ]
    if not any(guessed):
        return crossed
    kept = [
        number
        for number, contact in enumerate(crossed.contacts)
        if contact.kind == "palm" or not guessed[number]
    ]
    return crossed.take(kept)


def _is_clear_finger(crossed: Crossed, number: int) -> bool:
    return bool(
        crossed.own_edges[number] >= EDGES_OF_A_FINGER
        and crossed.contacts[number].diameter_mm <= LARGEST_FINGER_MM
    )


def _is_shown(parts: Sequence[Contact], cameras: int) -> bool:
    """Tell whether so many of the cameras see edges of the parts that no crowd hides them."""
    seeing = {camera for part in parts for camera in part.cameras}
    return len(seeing) >= min(CAMERAS_OF_A_PALM, cameras)


def _sections(
    contacts: Mapping[int, Contact], directing_lines: Sequence[DirectingLines]
) -> dict[int, Section | None]:
    """Return the section around each contact, by their numbers; those amid the same shadows share.

    Each costs some tenths of a millisecond.
    """
    by_shadows: dict[tuple[int | None, ...], Section | None] = {}
    sections: dict[int, Section | None] = {}
    for number, contact in contacts.items():
        x_mm, y_mm = contact.x_mm, contact.y_mm
        shadows = tuple(shadow_at(x_mm, y_mm, camera) for camera in directing_lines)
        if shadows not in by_shadows:
            by_shadows[shadows] = find_section(x_mm, y_mm, directing_lines)
        sections[number] = by_shadows[shadows]
    return sections


def _joined(
    crossed: Crossed,
    told: tuple[Contact, ...],
    groups: Sequence[tuple[int, ...]],
    others: Sequence[int],
) -> Crossed:
    """Return contacts in place of others: one for each group, then those that stay, in order.

    What joins several continues the prediction of the best supported one that has any.
    """
    members = [list(group) for group in groups] + [[number] for number in others]
    edges = crossed.edges[[group[0] for group in members]]
    edges[: len(groups)] = -1  # a palm has no tip
    continued = [[int(p) for p in crossed.predictions[group] if p >= 0] for group in members]
    return Crossed(
        told,
        supports=np.array([crossed.supports[group].sum() for group in members]),
        own_edges=np.array([crossed.own_edges[group].sum() for group in members], np.intp),
        predictions=np.array([(of_group or [-1])[0] for of_group in continued], np.intp),
        edges=edges,
    )
