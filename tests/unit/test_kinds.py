"""Palms, arms and pens are told from fingers, and fingers are never taken for them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from seen_discs import SURFACE_MM, TABLES, Disc, frame_set, surface_pipeline

from cornertouchd.config import CrossingSettings, Settings
from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.kinds import KindsOfContacts
from cornertouchd.fusion.sections import Section, find_section
from cornertouchd.model import Contact, DirectingLines

FINGER = (90.0, 120.0, 6.0)


def settings(**crossing: float) -> Settings:
    return Settings(crossing=CrossingSettings.model_validate(crossing))


def found(discs: Sequence[Disc], noise: int | None = 1, **crossing: float) -> tuple[Contact, ...]:
    """Return the contacts that stand for discs, each frame set on its own."""
    rng = None if noise is None else np.random.default_rng(noise)
    return surface_pipeline(settings(**crossing)).cross(frame_set(discs, rng=rng))


def lines_of(discs: Sequence[Disc]) -> list[DirectingLines]:
    seen = frame_set(discs)
    return [TABLES[one.camera].lay(one.shadows, 0.1) for one in seen.observations]


def kinds(contacts: Sequence[Contact]) -> list[str]:
    return sorted(contact.kind for contact in contacts)


def capsule(from_mm: Disc, to_mm: Disc, count: int = 25) -> list[Disc]:
    """Return discs in a row, so close that they are one thing."""
    first, last = np.array(from_mm), np.array(to_mm)
    return [tuple((first + (last - first) * t).tolist()) for t in np.linspace(0.0, 1.0, count)]


def palm_at(x_mm: float, y_mm: float, turned_rad: float = 0.6) -> list[Disc]:
    """Return the ball of a hand: 58 mm long and 30 mm wide."""
    dx, dy = 14.0 * np.cos(turned_rad), 14.0 * np.sin(turned_rad)
    return capsule((x_mm - dx, y_mm - dy, 15.0), (x_mm + dx, y_mm + dy, 15.0))


class TestPalms:
    @pytest.mark.parametrize("place", [(120.0, 150.0), (200.0, 260.0), (260.0, 90.0)])
    @pytest.mark.parametrize("turned_rad", [0.0, 0.8, 1.6, 2.4])
    def test_a_palm_is_one_palm(self, place: tuple[float, float], turned_rad: float) -> None:
        (palm,) = found(palm_at(*place, turned_rad))
        assert palm.kind == "palm"
        assert (palm.x_mm, palm.y_mm) == pytest.approx(place, abs=1.5)
        assert palm.diameter_mm == pytest.approx(48.0, abs=4.0)

    @pytest.mark.parametrize("radius_mm", [14.0, 25.0, 40.0])
    def test_a_cup_is_a_palm(self, radius_mm: float) -> None:
        (cup,) = found([(180.0, 200.0, radius_mm)])
        assert cup.kind == "palm"
        assert (cup.x_mm, cup.y_mm) == pytest.approx((180.0, 200.0), abs=0.5)
        assert cup.diameter_mm == pytest.approx(2 * radius_mm, abs=1.0)

    def test_an_arm_that_reaches_in_from_the_border_is_palm(self) -> None:
        for arm in (
            capsule((200.0, 425.0, 35.0), (190.0, 300.0, 28.0)),
            capsule((320.0, 430.0, 35.0), (250.0, 330.0, 30.0)),
            capsule((-25.0, 200.0, 22.0), (60.0, 210.0, 20.0)),
        ):
            contacts = found(arm)
            assert contacts
            assert set(kinds(contacts)) == {"palm"}

    def test_a_finger_of_which_every_camera_sees_one_edge_is_none(self) -> None:
        seen = frame_set([(175.0, 200.0, 6.0)], rng=np.random.default_rng(1))
        hidden = {"C1": 1, "C2": 1, "C3": 0, "C4": 0}  # each by the camera in the far corner
        observations = []
        for one in seen.observations:
            valid = one.shadows.valid.copy()
            valid[0, hidden[one.camera]] = False
            observations.append(replace(one, shadows=replace(one.shadows, valid=valid)))
        (finger,) = surface_pipeline().cross(replace(seen, observations=tuple(observations)))
        assert finger.kind == "finger"
        assert (finger.x_mm, finger.y_mm) == pytest.approx((175.0, 200.0), abs=3.0)

    def test_a_finger_far_from_the_palm_stays_a_finger(self) -> None:
        contacts = found([*palm_at(230.0, 280.0), FINGER])
        assert kinds(contacts) == ["finger", "palm"]
        (finger,) = (contact for contact in contacts if contact.kind == "finger")
        assert (finger.x_mm, finger.y_mm) == pytest.approx(FINGER[:2], abs=0.5)

    @pytest.mark.parametrize(("gap_mm", "kind"), [(3.0, "palm"), (7.5, "palm"), (8.5, "finger")])
    def test_a_finger_beside_the_palm_belongs_to_it(self, gap_mm: float, kind: str) -> None:
        lines = lines_of([(230.0, 280.0, 20.0)])
        palm = Contact(230.0, 280.0, 40.0, ("C1", "C2", "C3", "C4"), 1.0, 0.1)
        beside = Contact(230.0 + 20.0 + gap_mm + 6.0, 280.0, 12.0, ("C1", "C2", "C3"), 1.0, 0.1)
        crossed = Crossed.unsupported((palm, beside), np.array([9.0, 9.0]))
        told = KindsOfContacts(CrossingSettings(), SURFACE_MM).tell(crossed, lines)
        assert [contact.kind for contact in told.contacts] == ["palm", kind]
        reach = CrossingSettings(palm_reach_mm=gap_mm + 0.5)
        told = KindsOfContacts(reach, SURFACE_MM).tell(crossed, lines)
        assert [contact.kind for contact in told.contacts] == ["palm", "palm"]

    def test_the_setting_says_how_large_a_palm_is(self) -> None:
        cup = [(180.0, 200.0, 14.0)]
        assert kinds(found(cup, palm_diameter_mm=27.0)) == ["palm"]
        assert kinds(found(cup, palm_diameter_mm=29.0)) == ["finger"]

    def test_a_palm_is_no_touch(self) -> None:
        pipeline = surface_pipeline()
        for number in range(10):
            rng = np.random.default_rng(number)
            scene = frame_set([*palm_at(230.0, 280.0), FINGER], number / 100.0, rng=rng)
            contacts, touches = pipeline.follow(scene)
            assert "palm" in kinds(contacts)
            (touch,) = touches
            assert (touch.x_mm, touch.y_mm) == pytest.approx(FINGER[:2], abs=1.0)


class TestFingersAreNoPalms:
    def test_a_thumb_laid_flat_is_a_finger(self) -> None:
        assert kinds(found([(180.0, 200.0, 10.0)])) == ["finger"]

    @pytest.mark.parametrize("turned_rad", np.linspace(0.0, np.pi, 7)[:-1].tolist())
    @pytest.mark.parametrize("count", [2, 3])
    def test_neither_are_fingers_side_by_side(self, turned_rad: float, count: int) -> None:
        row = [
            (180.0 + n * 15.0 * np.cos(turned_rad), 190.0 + n * 15.0 * np.sin(turned_rad), 7.0)
            for n in range(count)
        ]
        assert "palm" not in kinds(found(row))

    @pytest.mark.parametrize("count", [5, 10, 15])
    def test_nor_are_those_of_a_crowd(self, count: int) -> None:
        rng = np.random.default_rng(count)
        for scene in range(10):
            discs: list[Disc] = []
            while len(discs) < count:
                x, y = rng.uniform((8.0, 8.0), (342.0, 392.0))
                if all(np.hypot(x - other[0], y - other[1]) > 20.0 for other in discs):
                    discs.append((float(x), float(y), float(rng.uniform(4.0, 8.0))))
            assert "palm" not in kinds(found(discs, noise=scene))

    def test_with_fingers_alone_nothing_is_touched(self) -> None:
        crossed = Crossed.unsupported(
            (Contact(100.0, 100.0, 12.0, ("C1", "C2"), 1.0, 0.1),), np.array([9.0])
        )
        telling = KindsOfContacts(CrossingSettings(), SURFACE_MM)
        assert telling.tell(crossed, []) is crossed
        assert telling.tell(Crossed.nothing(), []).contacts == ()

    def test_the_method_of_the_paper_knows_but_fingers(self) -> None:
        pipeline = surface_pipeline(
            Settings(crossing=CrossingSettings(method="paper", palm_diameter_mm=17.0))
        )
        assert set(kinds(pipeline.cross(frame_set([FINGER])))) == {"finger"}


class TestPens:
    @pytest.mark.parametrize("radius_mm", [2.0, 2.5, 2.9])
    @pytest.mark.parametrize("place", [(90.0, 120.0), (240.0, 300.0), (175.0, 60.0)])
    def test_what_is_thin_is_a_pen(self, radius_mm: float, place: tuple[float, float]) -> None:
        (pen,) = found([(*place, radius_mm)], smallest_radius_mm=1.5)
        assert pen.kind == "pen"
        assert (pen.x_mm, pen.y_mm) == pytest.approx(place, abs=0.3)

    def test_a_small_finger_is_none(self) -> None:
        assert kinds(found([(90.0, 120.0, 3.5)], smallest_radius_mm=1.5)) == ["finger"]

    def test_what_is_not_known_well_is_none(self) -> None:
        vague = Contact(100.0, 100.0, 4.0, ("C1", "C2"), 1.0, 0.9)
        crossed = Crossed.unsupported((vague,), np.array([9.0]))
        told = KindsOfContacts(CrossingSettings(), SURFACE_MM).tell(crossed, [])
        assert kinds(told.contacts) == ["finger"]


class TestJoining:
    """What is said of the parts of a palm is said of the palm."""

    @pytest.fixture
    def lines(self) -> list[DirectingLines]:
        return lines_of([*palm_at(230.0, 280.0, 0.0), FINGER])

    def test_it_stands_on_all_and_continues_what_the_best_of_them_did(
        self, lines: list[DirectingLines]
    ) -> None:
        parts = [
            Contact(214.0, 280.0, 18.0, ("C1", "C3"), 0.5, 1.5),
            Contact(*FINGER[:2], 12.0, ("C1", "C2", "C3", "C4"), 1.0, 0.1),
            Contact(246.0, 280.0, 17.5, ("C2",), 0.9, 1.5),
            Contact(230.0, 272.0, 12.0, ("C2",), 0.3, 0.4),
        ]
        crossed = Crossed(
            tuple(parts),
            supports=np.array([6.0, 20.0, 9.0, 5.5]),
            own_edges=np.array([2, 8, 3, 1]),
            predictions=np.array([4, 7, -1, 2]),
            edges=np.zeros((4, 4, 2), np.intp),
        )
        told = KindsOfContacts(CrossingSettings(), SURFACE_MM).tell(crossed, lines)
        assert [contact.kind for contact in told.contacts] == ["palm", "finger"]
        assert told.contacts[0].cameras == ("C1", "C2", "C3")
        assert told.contacts[0].confidence == 0.9
        assert told.contacts[1] is parts[1]
        assert told.supports.tolist() == [20.5, 20.0]
        assert told.own_edges.tolist() == [6, 8]
        assert told.predictions.tolist() == [4, 7]


class TestSections:
    def test_an_ellipse_is_found_from_its_tangents(self) -> None:
        lines = lines_of([(180.0, 200.0, 20.0)])
        section = find_section(175.0, 205.0, lines)
        assert section is not None
        assert (section.x_mm, section.y_mm) == pytest.approx((180.0, 200.0), abs=0.1)
        assert (section.long_mm, section.short_mm) == pytest.approx((20.0, 20.0), abs=0.2)

    def test_a_shadow_that_something_else_lengthens_does_not_spoil_it(self) -> None:
        lines = lines_of([(180.0, 200.0, 20.0), (262.0, 300.0, 7.0)])
        assert any(len(camera.first_rad) == 1 for camera in lines)
        section = find_section(175.0, 205.0, lines)
        assert section is not None
        assert (section.x_mm, section.y_mm) == pytest.approx((180.0, 200.0), abs=1.5)

    def test_there_is_none_in_the_light_or_with_too_few_edges(self) -> None:
        lines = lines_of([(180.0, 200.0, 20.0)])
        assert find_section(50.0, 50.0, lines) is None
        assert find_section(180.0, 200.0, lines[:2]) is None
        assert find_section(180.0, 200.0, []) is None

    def test_distances_to_the_outline(self) -> None:
        section = Section.from_terms(100.0, 100.0, 20.0, 0.0, 8.0)
        assert (section.long_mm, section.short_mm) == pytest.approx((28.0, 12.0))
        diagonal = np.sqrt(0.5)
        tip = (100.0 + 28.0 * diagonal, 100.0 + 28.0 * diagonal)
        assert section.distance_mm(*tip) == pytest.approx(0.0)
        side = (100.0 + 22.0 * diagonal, 100.0 - 22.0 * diagonal)
        assert section.distance_mm(*side) == pytest.approx(10.0)
        assert section.distance_mm(100.0, 100.0) < -11.0
