"""Touches in the sun, with pictures without LEDs between those with: as exact as without sun."""

from math import cos, sqrt

import numpy as np
import pytest
from numpy.typing import NDArray

from cornertouchd.calibration.calibration import Calibration
from cornertouchd.config import CamerasSettings, Settings
from cornertouchd.model import Frame, FrameSet
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.flanks import Sun
from cornertouchd.simulation.noise import GAIN, READ_NOISE
from cornertouchd.simulation.rig import EXPOSURE, SimulatedRig

SEED, PERIOD_S = 4, 0.01
SETTINGS = Settings(cameras=CamerasSettings(rate_hz=50.0))
ELEVATION_RAD = 0.35
SUN = Sun(0.0, ELEVATION_RAD, 0.6 * 255.0 / cos(ELEVATION_RAD))
"""On the left side, 60 % of full scale."""
DIMMED = 0.4
"""What automatic brightness leaves of the LEDs then."""
SETS = 20
PLACES_MM = ((120.0, 150.0), (60.0, 330.0), (240.0, 280.0), (300.0, 90.0), (180.0, 220.0))


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    return calibrate_rig(SimulatedRig(seed=SEED), SETTINGS)


def errors_mm(calibration: Calibration, sun: Sun | None, share: float) -> NDArray[np.float64]:
    """Return how far off contacts are, (places, frame sets, 2); every second picture is dark.

    Tracking has no part in it.  The first frame set of a finger does not count: the dark pictures
    before it do not show the sun on the finger, which makes a millimetre or two.
    """
    rig = SimulatedRig(seed=SEED)
    sunny = SimulatedRig(seed=SEED, sun=sun)
    cameras = {camera.id: CameraPipeline(camera, SETTINGS) for camera in calibration.cameras}
    surface = SurfacePipeline(calibration, SETTINGS)
    off_mm, number = [], 0
    for place_mm in PLACES_MM:
        finger = Finger(*place_mm, 11.0)
        truth = rig.truth.section(finger)
        assert truth is not None
        for fingers in ([], [finger]):
            leds = {camera: rig.light(camera, fingers) for camera in cameras}
            from_outside = {
                camera: sunny.light(camera, fingers) - light for camera, light in leds.items()
            }
            for turn in range(SETS + 1):
                at_s = 1000.0 + number * PERIOD_S
                seen = []
                for camera, pipeline in cameras.items():
                    light = np.float32(share) * leds[camera] + from_outside[camera]
                    lit = Frame(camera, number, at_s, 15, rig.expose(camera, number, light))
                    seen.append(pipeline.observe(lit))
                    pixels = rig.expose(camera, number + 1, from_outside[camera])
                    pipeline.learn_dark(Frame(camera, number + 1, at_s + PERIOD_S, 0, pixels))
                number += 2
                contacts = surface.cross(FrameSet(at_s, tuple(seen)))
                if turn > 0:
                    assert len(contacts) == len(fingers)
                    off_mm += [(one.x_mm - truth.x_mm, one.y_mm - truth.y_mm) for one in contacts]
    return np.array(off_mm).reshape(len(PLACES_MM), SETS, 2)


def lasting_mm(off_mm: NDArray[np.float64]) -> float:
    """Return how far off a touch at rest is, the mean of all places."""
    return float(np.mean(np.hypot(*off_mm.mean(axis=1).T)))


def noise_mm(off_mm: NDArray[np.float64]) -> float:
    """Return how much contacts of single frame sets differ."""
    return float(np.sqrt(np.mean(np.var(off_mm, axis=1))))


def edge_noise(share: float, from_outside: float) -> float:
    """Return the noise of photons and reading at the middle of an edge, as a share of its height.

    Nothing that is told from one picture can be exacter (Cramér and Rao).
    """
    leds = share * EXPOSURE
    return sqrt(READ_NOISE**2 + GAIN * (leds + from_outside) / 2.0) / leds


def test_the_sun_on_one_side_moves_no_touch_and_adds_but_the_noise_of_its_photons(
    calibration: Calibration,
) -> None:
    without = errors_mm(calibration, None, 1.0)
    dimmed = errors_mm(calibration, None, DIMMED)
    sunny = errors_mm(calibration, SUN, DIMMED)
    for name, off_mm in (("without", without), ("dimmed", dimmed), ("sun", sunny)):
        print(f"{name:>8}: lasting {lasting_mm(off_mm):.4f} mm, noise {noise_mm(off_mm):.4f} mm")
    assert lasting_mm(dimmed) < 1.1 * lasting_mm(without)
    assert lasting_mm(sunny) < 1.1 * lasting_mm(without)
    more = edge_noise(DIMMED, 0.6 * 255.0) / edge_noise(1.0, 0.0)
    print(f"noise times {noise_mm(sunny) / noise_mm(without):.2f}; by photons alone {more:.2f}")
    assert noise_mm(sunny) < 1.1 * more * noise_mm(without)
