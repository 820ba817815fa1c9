"""A finger that comes down and goes up again is one touch, and only while it is down."""

import os

import pytest

from cornertouchd.config import Settings
from cornertouchd.fusion.pairing import frame_set_of
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline
from cornertouchd.runtime.bench_show import BenchRig, bench_rig
from cornertouchd.simulation.fingers import Finger

PERIOD_S = 0.01
HIGHEST_MM = 7.0


@pytest.fixture(scope="module")
def bench() -> BenchRig:
    return bench_rig(Settings(), os.environ)


@pytest.mark.parametrize(("diameter_mm", "speed_mm_s"), [(11.0, 25.0), (11.0, 100.0), (5.0, 50.0)])
def test_it_is_one_touch_and_ends_in_the_air(
    bench: BenchRig, diameter_mm: float, speed_mm_s: float
) -> None:
    steps = int(HIGHEST_MM / speed_mm_s / PERIOD_S)
    coming = [HIGHEST_MM - speed_mm_s * PERIOD_S * step for step in range(steps)]
    heights_mm = [*coming, *[0.0] * 12, *reversed(coming)]
    settings = Settings()
    cameras = {one.id: CameraPipeline(one, settings) for one in bench.calibration.cameras}
    surface = SurfacePipeline(bench.calibration, settings)
    told = []
    for index, height_mm in enumerate(heights_mm):
        finger = Finger(140.0, 170.0, diameter_mm, 0.3, 1.0, max(height_mm, 0.0))
        frames = bench.rig.frame_set(index, index * PERIOD_S, [finger])
        seen = [cameras[frame.camera].observe(frame) for frame in frames]
        _, touches = surface.follow(frame_set_of(seen))
        told += [(touch.id, height_mm) for touch in touches]
    assert len({id_ for id_, _ in told}) == 1
    late_mm = 0.05 * speed_mm_s  # three frame sets and the two that bridge a dropout
    assert max(height_mm for _, height_mm in told) <= 1.0 + late_mm
    assert sum(height_mm == 0.0 for _, height_mm in told) == 12
