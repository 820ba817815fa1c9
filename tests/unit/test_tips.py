"""From pictures of a simulated rig to the tips of leaning fingers, through the whole pipeline."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot

import numpy as np
import pytest

from cornertouchd.config import (
    PaperVisionSettings,
    Settings,
    TouchPointSettings,
    VisionSettings,
)
from cornertouchd.fusion.pairing import frame_set_of
from cornertouchd.model import Contact
from cornertouchd.pipeline import CameraPipeline, SurfacePipeline, find_tips
from cornertouchd.runtime.bench_show import BenchRig, bench_rig
from cornertouchd.runtime.simulated_rig import calibrate_rig
from cornertouchd.simulation.fingers import Finger, section
from cornertouchd.simulation.rig import SimulatedRig

CAMERA_HEIGHT_MM = 6.0
LEANING = [
    Finger(90.0, 130.0, 12.0, lean_rad=0.6, lean_azimuth_rad=1.0),
    Finger(250.0, 290.0, 14.0, lean_rad=0.4, lean_azimuth_rad=-2.0),
]


@dataclass
class Bench:
    rig: BenchRig

    def contacts(
        self, fingers: Sequence[Finger], settings: Settings | None = None, without: str = ""
    ) -> list[Contact]:
        """Return what one frame set shows of fingers; one camera may be without a picture."""
        settings = settings or Settings()
        calibration = self.rig.calibration
        cameras = {one.id: CameraPipeline(one, settings) for one in calibration.cameras}
        seen = [
            cameras[frame.camera].find(frame)
            for frame in self.rig.rig.frame_set(1, 1.0, fingers)
            if frame.camera != without
        ]
        found = SurfacePipeline(calibration, settings).cross(frame_set_of(seen))
        return sorted(found, key=lambda contact: contact.x_mm)


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(bench_rig(Settings(), os.environ))


def off_mm(contact: Contact, finger: Finger) -> float:
    return hypot(contact.x_mm - finger.x_mm, contact.y_mm - finger.y_mm)


@pytest.mark.parametrize("without", ["", "C2"])
def test_a_leaning_finger_is_told_where_its_tip_is(bench: Bench, without: str) -> None:
    found = bench.contacts(LEANING, without=without)
    assert [contact.touching for contact in found] == [True, True]
    for contact, finger in zip(found, LEANING, strict=True):
        assert off_mm(contact, finger) < 0.35
        assert contact.lean is not None
        assert contact.lean.angle_rad == pytest.approx(finger.lean_rad, abs=np.deg2rad(6))
        assert contact.lean.azimuth_rad == pytest.approx(finger.lean_azimuth_rad, abs=0.25)


def test_its_section_stays_known(bench: Bench) -> None:
    for contact, finger in zip(bench.contacts(LEANING), LEANING, strict=True):
        true = section(finger, CAMERA_HEIGHT_MM)
        assert true is not None
        x_mm, y_mm = contact.section_mm
        assert hypot(x_mm - true.x_mm, y_mm - true.y_mm) < 0.5


def test_switched_off_or_with_the_papers_edges_it_is_the_section(bench: Bench) -> None:
    switched_off = Settings(touch_point=TouchPointSettings(enabled=False))
    of_the_paper = Settings(vision=VisionSettings(edges="paper", paper=PaperVisionSettings()))
    for settings in (switched_off, of_the_paper):
        found = bench.contacts(LEANING, settings)
        assert [contact.lean for contact in found] == [None, None]
        assert all(contact.section_mm == (contact.x_mm, contact.y_mm) for contact in found)
        camera = CameraPipeline(bench.rig.calibration.cameras[0], settings)
        frame, *_ = bench.rig.rig.frame_set(1, 1.0, LEANING)
        assert camera.find(frame).outlines is None  # what nobody asks for costs nothing


@pytest.mark.parametrize("height_mm", [0.5, 2.0, 4.0])
def test_a_finger_above_the_surface_does_not_touch(bench: Bench, height_mm: float) -> None:
    hovering = Finger(150.0, 220.0, 12.0, lean_rad=0.3, height_mm=height_mm)
    pressing = Finger(260.0, 120.0, 12.0, lean_rad=0.3)
    found = bench.contacts([hovering, pressing])
    assert [contact.touching for contact in found] == [False, True]


def test_how_high_counts_as_touching_can_be_set(bench: Bench) -> None:
    low = Settings(touch_point=TouchPointSettings(touch_height_mm=0.4))
    hovering = [Finger(150.0, 220.0, 12.0, lean_rad=0.3, height_mm=0.15)]
    assert [contact.touching for contact in bench.contacts(hovering)] == [False]
    assert [contact.touching for contact in bench.contacts(hovering, low)] == [True]


def test_a_matt_screen_and_a_camera_without_heights_are_told(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    calibration = bench.rig.calibration
    first, *others = calibration.cameras
    lacking = replace(calibration, cameras=(replace(first, heights=None), *others))
    assert find_tips(lacking, Settings()) is not None
    assert "camera C1: tells nothing about heights" in caplog.text
    settings = Settings()
    rig = SimulatedRig(calibration.surface_mm, 640, 480, 64, seed=1, reflectance=0.0)
    caplog.clear()
    assert find_tips(calibrate_rig(rig, settings), settings) is not None
    assert "camera C1, C2, C3, C4: sees no mirror image" in caplog.text
