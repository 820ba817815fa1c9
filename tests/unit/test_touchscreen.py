"""What programs see on the touchscreen: where, in which slot, how large, since when."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernel_screen import KernelScreen

from cornertouchd.model import Touch, TouchFrame
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.touchscreen import (
    ABS_MT_POSITION_X,
    ABS_MT_POSITION_Y,
    ABS_MT_TOUCH_MAJOR,
    ABS_MT_TRACKING_ID,
    ABS_X,
    ABS_Y,
    UNITS_PER_MM,
    TouchscreenSession,
)

SURFACE = DisplayMapping(0.0, 0.0, 400.0, 200.0)


def touch(number: int, x_mm: float, y_mm: float = 50.0, age_s: float = 0.0) -> Touch:
    return Touch(number, x_mm, y_mm, 0.0, 0.0, age_s, 8.0)


class Screen:
    """A session, and the kernel that it tells."""

    def __init__(self, mapping: DisplayMapping = SURFACE, slots: int = 10) -> None:
        self.session = TouchscreenSession(mapping, slots)
        self.kernel = KernelScreen(self.session.axes)
        self.now_s = 100.0

    def show(self, *touches: Touch) -> bool:
        """Tell these touches; whether there was anything to tell."""
        self.now_s += 0.01
        return self._write(self.session.frame(TouchFrame(self.now_s, touches)))

    def lift_all(self) -> bool:
        return self._write(self.session.lift_all(self.now_s))

    def _write(self, events: bytes) -> bool:
        if events:
            self.kernel.write(events)
        return bool(events)

    @property
    def places_mm(self) -> dict[int, tuple[float, float]]:
        return {
            slot: (
                values[ABS_MT_POSITION_X] / UNITS_PER_MM,
                values[ABS_MT_POSITION_Y] / UNITS_PER_MM,
            )
            for slot, values in self.kernel.touches.items()
        }

    def tracking_id(self, slot: int) -> int:
        return self.kernel.slots[slot][ABS_MT_TRACKING_ID]


def test_the_axes_have_the_size_of_the_display() -> None:
    axes = TouchscreenSession(SURFACE, 10).axes
    assert (axes[ABS_MT_POSITION_X].largest + 1) / axes[ABS_MT_POSITION_X].per_mm == 400.0
    assert (axes[ABS_MT_POSITION_Y].largest + 1) / axes[ABS_MT_POSITION_Y].per_mm == 200.0
    turned = TouchscreenSession(DisplayMapping(0.0, 0.0, 400.0, 200.0, 90), 10).axes
    assert turned[ABS_X].largest + 1 == 200 * UNITS_PER_MM


def test_two_fingers_land_move_and_lift_each_in_its_slot() -> None:
    screen = Screen()
    screen.show(touch(7, 10.0), touch(9, 30.0))
    assert screen.places_mm == {0: (10.0, 50.0), 1: (30.0, 50.0)}
    assert screen.tracking_id(0) != screen.tracking_id(1)
    screen.show(touch(9, 31.5), touch(7, 11.0))
    assert screen.places_mm == {0: (11.0, 50.0), 1: (31.5, 50.0)}
    screen.show(touch(9, 31.5))
    assert screen.places_mm == {1: (31.5, 50.0)}
    assert screen.kernel.is_touched
    screen.show()
    assert not screen.kernel.touches
    assert not screen.kernel.is_touched


def test_nothing_is_written_while_nothing_changes() -> None:
    screen = Screen()
    assert not screen.show()
    assert not screen.lift_all()
    assert screen.show(touch(1, 10.0))
    assert not screen.show(touch(1, 10.0))
    assert screen.lift_all()
    assert not screen.lift_all()


def test_a_new_touch_has_a_tracking_id_of_its_own() -> None:
    screen = Screen()
    screen.show(touch(1, 10.0))
    first = screen.tracking_id(0)
    screen.show()
    screen.show(touch(2, 10.0))
    assert screen.tracking_id(0) not in {first, -1}


def test_a_slot_that_was_just_freed_is_not_taken_in_the_same_report() -> None:
    screen = Screen(slots=2)
    screen.show(touch(1, 10.0))
    screen.show(touch(2, 20.0))
    assert screen.places_mm == {1: (20.0, 50.0)}
    screen.show(touch(3, 30.0))
    assert screen.places_mm == {0: (30.0, 50.0)}


def test_who_is_too_many_waits_and_the_oldest_are_kept() -> None:
    screen = Screen(slots=2)
    young, old, oldest = touch(3, 30.0), touch(2, 20.0, age_s=1.0), touch(1, 10.0, age_s=2.0)
    screen.show(young, old, oldest)
    assert sorted(screen.places_mm.values()) == [(10.0, 50.0), (20.0, 50.0)]
    screen.show(young, old, oldest)
    assert screen.session.touches_left_out == 1
    screen.show(young, old)
    screen.show(young, old)
    assert sorted(screen.places_mm.values()) == [(20.0, 50.0), (30.0, 50.0)]


def test_programs_that_know_one_touch_are_told_the_first_one() -> None:
    screen = Screen()
    screen.show(touch(1, 10.0), touch(2, 20.0))
    assert (screen.kernel.state[ABS_X], screen.kernel.state[ABS_Y]) == (1000, 5000)
    screen.show(touch(2, 20.0))
    assert screen.kernel.state[ABS_X] == 2000
    screen.show(touch(2, 20.0), touch(3, 5.0))
    assert screen.kernel.state[ABS_X] == 2000


def test_the_size_of_the_contact_is_told_to_the_millimetre() -> None:
    screen = Screen()
    screen.show(Touch(1, 10.0, 10.0, 0.0, 0.0, 0.0, 8.4))
    assert screen.kernel.touches[0][ABS_MT_TOUCH_MAJOR] == 8 * UNITS_PER_MM
    assert not screen.show(Touch(1, 10.0, 10.0, 0.0, 0.0, 0.0, 8.1))
    screen.show(Touch(1, 10.0, 10.0, 0.0, 0.0, 0.0, math.nan))
    assert screen.kernel.touches[0][ABS_MT_TOUCH_MAJOR] == 0


def test_a_touch_beside_the_display_is_lifted_and_lands_anew() -> None:
    screen = Screen(DisplayMapping(100.0, 0.0, 100.0, 200.0))
    screen.show(touch(1, 150.0))
    before = screen.tracking_id(0)
    screen.show(touch(1, 250.0))
    assert not screen.kernel.touches
    screen.show(touch(1, 199.0))
    assert screen.places_mm == {0: (99.0, 50.0)}
    assert screen.tracking_id(0) != before


@pytest.mark.parametrize("edge_mm", [400.0, 401.5])
def test_the_very_edge_is_the_last_place_of_the_axis(edge_mm: float) -> None:
    screen = Screen()
    screen.show(touch(1, edge_mm))
    assert screen.places_mm[0][0] == pytest.approx(400.0, abs=1.5 / UNITS_PER_MM)


@pytest.mark.parametrize(
    ("rotation_deg", "mirror", "place_mm"),
    [(90, False, (190.0, 30.0)), (180, False, (370.0, 190.0)), (0, True, (370.0, 10.0))],
)
def test_a_turned_or_mirrored_display_gets_its_own_places(
    rotation_deg: int, mirror: bool, place_mm: tuple[float, float]
) -> None:
    mapping = DisplayMapping(0.0, 0.0, 400.0, 200.0, rotation_deg, mirror)
    screen = Screen(mapping)
    x_mm, y_mm = 30.0, 10.0
    screen.show(touch(1, x_mm, y_mm))
    share = mapping.to_display(x_mm, y_mm)
    sides = mapping.picture_mm
    assert screen.places_mm[0] == pytest.approx((share[0] * sides[0], share[1] * sides[1]))
    if rotation_deg != 90:
        assert screen.places_mm[0] == pytest.approx(place_mm)


def test_a_place_that_is_no_number_is_no_touch() -> None:
    screen = Screen()
    assert not screen.show(touch(1, math.nan), touch(2, math.inf))


def test_events_have_the_time_of_the_picture_and_never_go_back() -> None:
    screen = Screen()
    screen.kernel.write(screen.session.frame(TouchFrame(5.25, (touch(1, 1.0),))))
    screen.kernel.write(screen.session.frame(TouchFrame(5.125, (touch(1, 2.0),))))
    screen.kernel.write(screen.session.frame(TouchFrame(math.nan, (touch(1, 3.0),))))
    assert screen.kernel.times_s == [5.25, 5.25, 5.25]


def test_a_new_device_is_told_everything() -> None:
    screen = Screen()
    screen.show(touch(1, 10.0))
    screen.session.forget()
    screen.kernel = KernelScreen(screen.session.axes)
    screen.show(touch(1, 10.0))
    assert screen.places_mm == {0: (10.0, 50.0)}
    assert screen.kernel.is_touched


def test_a_screen_without_slots_is_refused() -> None:
    with pytest.raises(ValueError, match="0 slots"):
        TouchscreenSession(SURFACE, 0)


@given(
    st.lists(
        st.dictionaries(
            st.integers(0, 8), st.tuples(st.floats(-5.0, 405.0), st.floats(-5.0, 205.0)), max_size=8
        ),
        max_size=30,
    )
)
def test_after_every_report_the_kernel_holds_touches_that_are_there(
    shows: list[dict[int, tuple[float, float]]],
) -> None:
    screen = Screen(slots=4)
    for show in shows:
        screen.show(*(touch(number, x, y) for number, (x, y) in show.items()))
        on_display = [place for place in show.values() if SURFACE.contains(*place)]
        assert len(screen.kernel.touches) <= min(len(on_display), 4)
        assert screen.kernel.is_touched == bool(screen.kernel.touches)
        for x_mm, y_mm in screen.places_mm.values():
            assert any(
                math.isclose(min(max(x, 0.0), 400.0), x_mm, abs_tol=0.02)
                and math.isclose(min(max(y, 0.0), 200.0), y_mm, abs_tol=0.02)
                for x, y in on_display
            )
        ids = [values[ABS_MT_TRACKING_ID] for values in screen.kernel.touches.values()]
        assert len(set(ids)) == len(ids)
    screen.lift_all()
    assert not screen.kernel.touches
