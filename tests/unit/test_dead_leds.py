"""LEDs that die while the daemon runs: masked where the controller says so, no shadow, no touch."""

import numpy as np
import pytest

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import Settings
from cornertouchd.model import Frame, Observation
from cornertouchd.pipeline import CameraPipeline
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

DEAD = slice(400, 431)
FINGER = Finger(120.0, 150.0, 11.0)


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig(seed=4)


@pytest.fixture(scope="module")
def calibration(rig: SimulatedRig) -> Calibration:
    return calibrate_rig(rig, Settings())


class Camera:
    """C4, whose strip may be dark in some columns."""

    def __init__(self, rig: SimulatedRig, calibration: Calibration) -> None:
        self.pipeline = CameraPipeline(calibration.camera("C4"), Settings())
        self._rig = rig
        self.number = 0

    def see(self, *, dead: bool, touched: bool = False) -> Observation:
        light = self._rig.light("C4", [FINGER] if touched else [])
        if dead:
            light[:, DEAD] = np.float32(0.0)
        self.number += 1
        pixels = self._rig.expose("C4", self.number, light)
        return self.pipeline.observe(Frame("C4", self.number, self.number * 0.01, 15, pixels))

    def suspect(self) -> None:
        self.pipeline.suspect_dead_leds(np.arange(640) > 250)


@pytest.fixture
def camera(rig: SimulatedRig, calibration: Calibration) -> Camera:
    camera = Camera(rig, calibration)
    for _ in range(20):
        assert not len(camera.see(dead=False).shadows)
    return camera


def solid(seen: Observation) -> int:
    """Count the shadows that are no more than hidden places."""
    return int(np.count_nonzero(seen.shadows.depth > 0.0))


def test_without_the_word_of_a_controller_darkness_is_a_shadow(camera: Camera) -> None:
    assert solid(camera.see(dead=True)) == 1


def test_dark_columns_of_the_side_are_masked_from_the_next_picture_on(camera: Camera) -> None:
    camera.suspect()
    for _ in range(300):
        assert solid(camera.see(dead=True)) == 0
    (masked,) = camera.pipeline.masked_columns
    assert (masked.first_px, masked.last_px) == pytest.approx((DEAD.start, DEAD.stop - 1), abs=3)
    assert "dead or dim LED" in masked.why


def test_touches_elsewhere_are_as_before(camera: Camera) -> None:
    before = camera.see(dead=False, touched=True).shadows.edges_px
    camera.see(dead=False)
    camera.suspect()
    after = camera.see(dead=True, touched=True)
    edges_px = after.shadows.edges_px[after.shadows.depth > 0.0]
    assert edges_px == pytest.approx(before, abs=0.1)


def test_mended_leds_count_at_once(camera: Camera) -> None:
    camera.suspect()
    camera.see(dead=True)
    camera.see(dead=False)
    assert not camera.pipeline.masked_columns
    assert solid(camera.see(dead=True)) == 1


def test_a_suspicion_without_darkness_masks_nothing(camera: Camera) -> None:
    camera.suspect()
    camera.see(dead=False)
    assert not camera.pipeline.masked_columns
    assert solid(camera.see(dead=True)) == 1
