"""Cameras that see nothing but light deny what others make up."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.denial import Darkness, without_denied
from cornertouchd.model import Contact, DirectingLines


@dataclass(frozen=True)
class Corner:
    x_mm: float
    y_mm: float
    sees_all: bool = True

    def sees(self, x_mm: float, y_mm: float) -> bool:
        return self.sees_all


C1, C2, C3, C4 = (Corner(x, y) for x, y in [(0, 0), (350, 0), (350, 400), (0, 400)])
BLIND = Corner(0, 400, sees_all=False)


def crossed(x_mm: float, y_mm: float) -> Crossed:
    contact = Contact(x_mm, y_mm, 12.0, ("C1", "C2"), 1.0, 0.1)
    return Crossed.unsupported((contact,), np.array([10.0]))


@pytest.mark.parametrize(
    ("silent", "others", "is_kept"),
    [
        ([], [C1, C2, C3, C4], True),
        ([C3], [C1, C2, C4], True),
        ([C3, C4], [C1, C2], False),
        ([C2, C3, C4], [C1, C1], False),
        ([C3], [C1, C2], False),
        ([BLIND, C3], [C1, C2, C4], True),
        ([C3], [C1, C2, BLIND], False),
    ],
)
def test_two_of_four_cameras_that_look_deny_and_one_of_three(
    silent: list[Corner], others: list[Corner], is_kept: bool
) -> None:
    kept = without_denied(crossed(100.0, 120.0), silent, [*silent, *others])
    assert len(kept.contacts) == len(kept.supports) == len(kept.predictions) == is_kept


def test_two_cameras_that_look_at_each_other_past_a_pen_do_not_deny_it() -> None:
    assert len(without_denied(crossed(175.0, 200.0), [C2, C4], [C1, C2, C3, C4]).contacts) == 1
    assert len(without_denied(crossed(175.0, 120.0), [C2, C4], [C1, C2, C3, C4]).contacts) == 0


def seen_from(corner: Corner, *discs: tuple[float, float, float]) -> DirectingLines:
    """Return one shadow of a camera, cast by discs beside each other."""
    ends = []
    for x_mm, y_mm, radius_mm in discs:
        away = (x_mm - corner.x_mm, y_mm - corner.y_mm)
        angle, half = math.atan2(away[1], away[0]), math.asin(radius_mm / math.hypot(*away))
        ends += [angle - half, angle + half]
    first, last, seen = np.array([min(ends)]), np.array([max(ends)]), np.array([True])
    return DirectingLines(
        "C",
        corner.x_mm,
        corner.y_mm,
        first,
        0.5 * (first + last),
        last,
        seen,
        seen.copy(),
        np.array([3e-4]),
    )


class TestDarkness:
    """Where a touch is missed, light says that it was lifted."""

    BIG = (150.0, 180.0, 20.0)

    def shadows_of(self, *discs: tuple[float, float, float]) -> list[DirectingLines]:
        return [seen_from(corner, *discs) for corner in (C1, C2, C3, C4)]

    def test_hides_a_finger_where_every_camera_sees_a_shadow(self) -> None:
        assert Darkness(self.shadows_of(self.BIG), []).hides(150.0, 180.0, 6.0, 1.0)

    @pytest.mark.parametrize(("x_mm", "y_mm"), [(150.0, 240.0), (60.0, 180.0), (250.0, 300.0)])
    def test_hides_none_where_a_camera_sees_light(self, x_mm: float, y_mm: float) -> None:
        assert not Darkness(self.shadows_of(self.BIG), []).hides(x_mm, y_mm, 6.0, 1.0)

    def test_hides_none_where_one_camera_of_four_sees_light(self) -> None:
        lines = self.shadows_of(self.BIG)
        lines[2] = seen_from(C3, (60.0, 300.0, 6.0))
        assert not Darkness(lines, []).hides(150.0, 180.0, 6.0, 1.0)

    def test_hides_none_where_a_camera_sees_no_shadow_at_all(self) -> None:
        lines = self.shadows_of(self.BIG)
        assert not Darkness(lines[:3], [C4]).hides(150.0, 180.0, 6.0, 1.0)
        assert Darkness(lines[:3], [Corner(0, 400, sees_all=False)]).hides(150.0, 180.0, 6.0, 1.0)

    def test_the_less_the_place_is_known_the_farther_it_may_be(self) -> None:
        darkness = Darkness(self.shadows_of(self.BIG), [])
        assert not darkness.hides(150.0, 210.0, 6.0, 1.0)
        assert darkness.hides(150.0, 210.0, 6.0, 49.0)

    def test_an_edge_that_is_not_valid_bounds_nothing(self) -> None:
        lines = [
            one._replace(first_valid=np.array([False]), last_valid=np.array([False]))
            for one in self.shadows_of(self.BIG)
        ]
        assert Darkness(lines, []).hides(150.0, 240.0, 6.0, 1.0)


def test_a_shadow_where_a_camera_has_no_lines_hides_nothing_and_denies_nothing() -> None:
    some = seen_from(C1, (100.0, 120.0, 6.0))
    none = some._replace(
        first_rad=np.empty(0),
        centre_rad=np.empty(0),
        last_rad=np.empty(0),
        first_valid=np.empty(0, np.bool_),
        last_valid=np.empty(0, np.bool_),
        sigma_rad=np.empty(0),
    )
    assert Darkness([some, none], []).hides(100.0, 120.0, 6.0, 1.0)
