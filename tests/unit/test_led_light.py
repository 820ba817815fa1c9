"""The LED frame in the daemon: what is sent to the controller, what pictures are labelled."""

from typing import Any

import numpy as np
import pytest

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import CamerasSettings, LedFrameSettings, Settings
from cornertouchd.model import Frame
from cornertouchd.pipeline import CameraPipeline
from cornertouchd.ports import FaultReport, LedFrameListener, LedFrameStatus
from cornertouchd.runtime.led_light import LedLight, make_light
from cornertouchd.runtime.light_levels import IdleWatch, LevelControl
from cornertouchd.runtime.side_light import SideLight, sides_of_columns
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig
from cornertouchd.vision.background import MaskedColumns
from cornertouchd.wire.ledframe import Fault, Request, State
from cornertouchd.wire.ledframe_reports import ControllerStatus, FrameLit
from cornertouchd.wire.ledframe_session import Light

PERIOD_S = 0.01
START_S = 1000.0
FINGER = Finger(120.0, 150.0, 11.0)


class FakeLink:
    """Remembers what is wanted of the LED frame; `SerialLedFrame` is tested against the board."""

    def __init__(self, port: str, listener: LedFrameListener, faults: FaultReport) -> None:
        self.lights: list[Light] = []
        self.armed = self.started = self.closed = False
        self.status = LedFrameStatus()

    def start(self) -> None:
        self.started = True

    def configure(self, light: Light) -> None:
        self.lights.append(light)

    def arm(self) -> None:
        self.armed = True

    def disarm(self) -> None:
        self.armed = False

    def ask(self, request: Request) -> None:
        pass

    def close(self) -> None:
        self.closed = True


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig(seed=4)


@pytest.fixture(scope="module")
def calibration(rig: SimulatedRig) -> Calibration:
    return calibrate_rig(rig, Settings())


def settings_with(**led_frame: Any) -> Settings:
    given = {"enabled": True, "automatic_brightness": False, "dim_after_s": 0.0} | led_frame
    return Settings(
        cameras=CamerasSettings(source="simulated"), led_frame=LedFrameSettings(**given)
    )


def status() -> ControllerStatus:
    return ControllerStatus(State.ARMED, Fault(0), 0, 0, 15, 25.0, 0, 0, 0, 0)


class Shining:
    """A light with a fake link, and pictures of camera C1 as its controller reports them."""

    def __init__(self, rig: SimulatedRig, calibration: Calibration, **led_frame: Any) -> None:
        self.links: list[FakeLink] = []
        self.settings = settings_with(**led_frame)
        self.light = LedLight(self.settings, calibration, self._link)
        self.light.start()
        self.lit = {False: rig.light("C1"), True: rig.light("C1", [FINGER])}
        self.rig = rig
        self.number = 0

    def _link(self, *given: Any) -> FakeLink:
        self.links.append(FakeLink(*given))
        return self.links[-1]

    @property
    def levels(self) -> tuple[int, ...]:
        return self.links[-1].lights[-1].levels.levels

    @property
    def now_s(self) -> float:
        return START_S + self.number * PERIOD_S

    def picture(
        self, *, mask: int | None = None, reported: bool = True, share: float = 1.0,
        touched: bool = False,
    ) -> Frame | None:  # fmt: skip
        """Report a frame and return what becomes of its picture."""
        masks = self.settings.led_frame.masks
        true = masks[self.number % len(masks)] if mask is None else mask
        if reported:
            self.light(FrameLit(self.number, true, 0), self.now_s + 0.001)
        share *= float(true == 15)
        pixels = self.rig.expose("C1", self.number, np.float32(share) * self.lit[touched])
        captured_at_s = self.now_s + 0.004
        self.number += 1
        return self.light.of("C1").label(Frame("C1", self.number, captured_at_s, None, pixels))


@pytest.fixture
def shine(rig: SimulatedRig, calibration: Calibration) -> Any:
    return lambda **led_frame: Shining(rig, calibration, **led_frame)


def test_it_is_set_up_and_armed_before_it_is_looked_for(shine: Any) -> None:
    shining = shine(level_top=40, strobe_us=300, pattern="ambient", dark_every=2)
    link = shining.links[0]
    assert (link.armed, link.started) == (True, True)
    light = link.lights[-1]
    assert light.levels.levels == (40, 128, 128, 128)
    assert (light.timing.period_us, light.timing.strobe_us) == (10_000, 300)
    assert light.pattern.masks == (15, 0)
    shining.light.close()
    assert link.closed


def test_an_always_on_strip_needs_no_controller(calibration: Calibration) -> None:
    assert make_light(Settings(), calibration) is None


def test_dark_pictures_are_told_from_lit_ones(shine: Any) -> None:
    shining = shine(pattern="ambient", dark_every=4)
    told = [shining.picture() for _ in range(200)]
    masks = [frame.lit_mask for frame in told[60:] if frame is not None]
    assert masks == [15, 15, 15, 0] * 35
    assert shining.light.state({}).pictures["C1"].known >= 140


def test_pictures_with_some_sides_are_left_out(shine: Any) -> None:
    shining = shine(pattern="sides")
    told = [shining.picture() for _ in range(200)]
    assert {frame.lit_mask for frame in told[80:] if frame is not None} == {15}
    assert sum(frame is None for frame in told[80:]) == 60


def test_without_reports_an_always_lit_strip_goes_on_and_a_dark_one_does_not(shine: Any) -> None:
    shining = shine()
    frame = shining.picture(reported=False)
    assert frame is not None
    assert frame.lit_mask is None
    assert shining.picture(reported=False, share=0.1) is None


def test_unknown_pictures_of_the_ambient_pattern_are_left_out_until_it_is_dark(shine: Any) -> None:
    shining = shine(pattern="ambient")
    for _ in range(100):
        shining.picture()
    assert [shining.picture(mask=15, reported=False) for _ in range(60)][20:] == [None] * 40
    shining.number += 100
    frame = shining.picture(mask=15, reported=False)
    assert frame is not None
    assert frame.lit_mask is None


def test_dimmed_when_nobody_touches_and_awake_with_the_first_shadow(shine: Any) -> None:
    shining = shine(dim_after_s=10.0, dim_level=0.5)
    camera = shining.light.of("C1")
    camera.note_shadows(0, START_S)
    shining.light(status(), START_S + 9.0)
    assert shining.levels == (128, 128, 128, 128)
    shining.light(status(), START_S + 10.1)
    assert shining.levels == (64, 64, 64, 64)
    assert shining.light.state({}).dimmed
    camera.note_shadows(0, START_S + 11.0)
    assert shining.levels == (64, 64, 64, 64)
    camera.note_shadows(1, START_S + 12.0)
    assert shining.levels == (128, 128, 128, 128)


def test_dimming_makes_no_shadow_and_is_not_learned(
    rig: SimulatedRig, calibration: Calibration
) -> None:
    pipeline = CameraPipeline(calibration.camera("C1"), Settings())
    empty, touched = rig.light("C1"), rig.light("C1", [FINGER])

    def seen(light: Any, share: float, number: int) -> list[float]:
        pixels = rig.expose("C1", number, np.float32(share) * light)
        frame = Frame("C1", number, START_S + 0.05 * number, 15, pixels)
        return pipeline.observe(frame).shadows.edges_px.ravel().tolist()

    before = seen(touched, 1.0, 0)
    number = 1
    for share in (1.0, 0.5, 1.0):
        for _ in range(200):  # ten seconds
            assert seen(empty, share, number) == []
            number += 1
    assert seen(touched, 0.5, number) == pytest.approx(before, abs=0.3)
    assert seen(touched, 1.0, number + 1) == pytest.approx(before, abs=0.3)


def test_a_blind_led_is_told_with_its_side(shine: Any) -> None:
    shining = shine()
    masked = MaskedColumns(100, 118, "dead or dim LED, 2% of the strip's light", "replace the LED")
    told = shining.light.state({"C1": [masked]}).masked
    assert len(told) == 1
    assert told[0].startswith("camera C1: right side: columns 100..118")


def test_every_camera_looks_at_its_two_far_sides(
    rig: SimulatedRig, calibration: Calibration
) -> None:
    sides = {
        camera.id: set(SideLight(camera, calibration.surface_mm, Settings().vision).sides)
        for camera in calibration.cameras
    }
    assert sides == {"C1": {1, 2}, "C2": {2, 3}, "C3": {0, 3}, "C4": {0, 1}}


def test_a_column_without_a_line_looks_at_no_side() -> None:
    angles_rad = np.array([0.1, 1.4, np.nan])
    assert sides_of_columns(angles_rad, (0.0, 0.0), (350.0, 400.0)).tolist() == [1, 2, -1]


class TestBrightness:
    def stepped(self, control: LevelControl, grey: float, dark: float, steps: int) -> None:
        for step in range(steps):
            for _ in range(6):
                own = control.levels[1] / 128.0 * grey
                control.see_dark(1, dark)
                seen = min(own + dark, 255.0)
                control.see_lit("C1", 1, seen, saturated=seen >= 250.0)
            control.step(START_S + 2.5 * step)

    @pytest.mark.parametrize("grey", [100.0, 180.0, 240.0])
    def test_a_side_comes_to_three_quarters_of_full_scale(self, grey: float) -> None:
        control = LevelControl(LedFrameSettings())
        self.stepped(control, grey, 0.0, 120)
        assert control.levels[1] / 128.0 * grey == pytest.approx(0.75 * 255.0, rel=0.06)
        assert control.levels[0] == 128  # nobody sees it

    def test_it_moves_slowly_and_within_limits(self) -> None:
        control = LevelControl(LedFrameSettings(level_max=140))
        self.stepped(control, 20.0, 0.0, 3)
        assert control.levels[1] <= 134
        self.stepped(control, 20.0, 0.0, 50)
        assert control.levels[1] == 140

    def test_in_the_sun_room_is_left_for_it(self) -> None:
        control = LevelControl(LedFrameSettings())
        self.stepped(control, 190.0, 0.6 * 255.0, 150)
        both = control.levels[1] / 128.0 * 190.0 + 0.6 * 255.0
        assert 0.85 * 255.0 < both < 0.96 * 255.0

    def test_a_side_that_the_sun_alone_saturates_is_not_raised(self) -> None:
        control = LevelControl(LedFrameSettings())
        self.stepped(control, 190.0, 255.0, 20)
        assert control.levels[1] == 128


class TestIdle:
    def test_shadows_that_stay_are_dirt(self) -> None:
        idle = IdleWatch(10.0)
        for at_s in range(60):
            idle.see("C1", 1, START_S + at_s)
        assert idle.is_idle(START_S + 60.0)
        assert idle.see("C1", 2, START_S + 61.0)
        assert not idle.is_idle(START_S + 61.0)

    def test_never_idle_when_switched_off(self) -> None:
        idle = IdleWatch(0.0)
        idle.see("C1", 0, START_S)
        assert not idle.is_idle(START_S + 1e6)
