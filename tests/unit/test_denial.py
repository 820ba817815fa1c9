"""Cameras that see nothing but light deny what others make up."""

from dataclasses import dataclass

import numpy as np
import pytest

from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.denial import without_denied
from cornertouchd.model import Contact


@dataclass(frozen=True)
class Corner:
    x_mm: float
    y_mm: float
    sees_all: bool = True

    def sees(self, x_mm: float, y_mm: float) -> bool:
        return self.sees_all


C1, C2, C3, C4 = (Corner(x, y) for x, y in [(0, 0), (350, 0), (350, 400), (0, 400)])


def crossed(x_mm: float, y_mm: float) -> Crossed:
    contact = Contact(x_mm, y_mm, 12.0, ("C1", "C2"), 1.0, 0.1)
    return Crossed.unsupported((contact,), np.array([10.0]))


@pytest.mark.parametrize(
    ("silent", "cameras", "is_kept"),
    [
        ([], 4, True),
        ([C3], 4, True),
        ([C3, C4], 4, False),
        ([C2, C3, C4], 5, False),
        ([C3], 3, False),
        ([Corner(0, 400, sees_all=False), C3], 4, True),
    ],
)
def test_two_of_four_cameras_deny_and_one_of_three(
    silent: list[Corner], cameras: int, is_kept: bool
) -> None:
    kept = without_denied(crossed(100.0, 120.0), silent, cameras)
    assert len(kept.contacts) == len(kept.supports) == len(kept.predictions) == is_kept


def test_two_cameras_that_look_at_each_other_past_a_pen_do_not_deny_it() -> None:
    assert len(without_denied(crossed(175.0, 200.0), [C2, C4], 4).contacts) == 1
    assert len(without_denied(crossed(175.0, 120.0), [C2, C4], 4).contacts) == 0
