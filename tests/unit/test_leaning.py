"""A touch is told where its tip is, however that is found, and ends when the finger is lifted."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pytest

from cornertouchd.config import TrackingSettings
from cornertouchd.fusion.crossed import Crossed
from cornertouchd.fusion.tips import Tips
from cornertouchd.fusion.tracking import Tracker
from cornertouchd.model import Contact, Touch

SECTION = Contact(100.0, 120.0, 12.0, ("C1", "C2", "C3", "C4"), 1.0, 0.1)
SURFACE_MM = (350.0, 400.0)


@dataclass(frozen=True)
class Tip:
    """What one frame set tells of the tip."""

    shift_mm: tuple[float, float] = (1.2, -0.8)
    sigma_mm: float = 0.08
    gap: float = 0.3


UNSEEN = Tip((0.0, 0.0), np.inf, np.nan)


def follow(frame_sets: Iterable[Tip], section: Contact = SECTION) -> list[tuple[Touch, ...]]:
    """Return the touches of a finger at one place, of which each frame set tells something else."""
    tracker = Tracker(TrackingSettings(smoothing=False, dead_band_mm=0.0), SURFACE_MM)
    crossed = Crossed.unsupported((section,), np.array([20.0]))
    return [
        tracker.update(
            100.0 + 0.01 * number,
            crossed,
            tips=Tips(np.array([tip.shift_mm]), np.array([tip.sigma_mm**2]), np.array([tip.gap])),
        )
        for number, tip in enumerate(frame_sets)
    ]


def off_tip_mm(touches: tuple[Touch, ...], shift_mm: tuple[float, float]) -> float:
    (touch,) = touches
    return float(
        np.hypot(
            touch.x_mm - SECTION.x_mm - shift_mm[0],
            touch.y_mm - SECTION.y_mm - shift_mm[1],
        )
    )


def test_the_first_report_is_where_the_tip_was_measured() -> None:
    (touches,) = follow([Tip()])
    assert off_tip_mm(touches, (1.2, -0.8)) < 0.03


def test_a_tip_that_is_not_seen_for_a_while_is_where_it_was() -> None:
    reports = follow([Tip()] * 5 + [UNSEEN] * 20 + [Tip()] * 5)
    assert max(off_tip_mm(touches, (1.2, -0.8)) for touches in reports) < 0.05


def test_a_tip_that_is_found_less_exactly_moves_the_touch_but_a_little() -> None:
    vague = Tip((0.2, 0.4), sigma_mm=0.8)
    reports = follow([Tip()] * 20 + [vague] * 3)
    assert off_tip_mm(reports[-1], (1.2, -0.8)) < 0.1


def test_a_finger_that_leans_over_is_followed() -> None:
    leaning = [Tip((1.2 - 0.01 * step, -0.8)) for step in range(100)]
    assert off_tip_mm(follow(leaning)[-1], leaning[-1].shift_mm) < 0.1


def test_no_tip_lies_beside_the_surface() -> None:
    section = Contact(0.3, 399.5, 12.0, ("C1", "C2", "C3", "C4"), 1.0, 0.1)
    for touches in follow([Tip((-1.0, 1.5))] * 5, section):
        assert (touches[0].x_mm, touches[0].y_mm) == (0.0, SURFACE_MM[1])


def test_what_hovers_is_no_touch_until_it_presses() -> None:
    reports = follow([Tip(gap=3.0)] * 10 + [Tip(gap=0.4)] * 3)
    assert [len(touches) for touches in reports] == [0] * 10 + [1] * 3


def test_a_touch_ends_when_the_finger_is_lifted_though_it_is_still_seen() -> None:
    reports = follow([Tip()] * 10 + [Tip(gap=3.0)] * 6 + [Tip()] * 3)
    counts = [len(touches) for touches in reports]
    assert counts[:10] == [1] * 10
    assert counts[13:16] == [0] * 3
    assert counts[16:] == [1] * 3
    assert reports[-1][0].id != reports[0][0].id


@pytest.mark.parametrize("gaps", [[3.0], [1.1] * 20, [np.nan] * 20])
def test_light_below_it_for_a_moment_or_hardly_any_or_unknown_lifts_no_finger(
    gaps: list[float],
) -> None:
    reports = follow([Tip()] * 10 + [Tip(gap=gap) for gap in gaps] + [Tip()] * 5)
    assert {touch.id for touches in reports for touch in touches} == {1}
    assert all(len(touches) == 1 for touches in reports)
