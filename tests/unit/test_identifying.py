"""Whoever covers a lens, or touches right before one, is understood; nobody else is."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cornertouchd.guiding.identifying import HELD_PICTURES, LEARNED_PICTURES, Identifier
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

CAMERAS = ("C1", "C2", "C3", "C4")
Pictures = dict[str, NDArray[np.uint8]]


@pytest.fixture(scope="module")
def rig() -> SimulatedRig:
    return SimulatedRig((350.0, 400.0), seed=2)


def pictures_of(rig: SimulatedRig, *fingers: Finger) -> Pictures:
    return {frame.camera: frame.pixels for frame in rig.frame_set(7, 0.0, fingers)}


@pytest.fixture
def identifier(rig: SimulatedRig) -> Identifier:
    taught = Identifier()
    for number in range(LEARNED_PICTURES):
        for frame in rig.frame_set(number, 0.0, ()):
            assert taught.feed(frame.camera, frame.pixels) is None
    assert taught.ready
    return taught


def meant(identifier: Identifier, pictures: Pictures, rounds: int = 2 * HELD_PICTURES) -> set[str]:
    told = set()
    for _ in range(rounds):
        told |= {identifier.feed(camera, pixels) for camera, pixels in pictures.items()}
    return {camera for camera in told if camera is not None}


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_covered_lens_is_told(identifier: Identifier, rig: SimulatedRig, camera: str) -> None:
    pictures = pictures_of(rig)
    pictures[camera] = pictures[camera] // 8
    assert meant(identifier, pictures) == {camera}
    assert identifier.hidden[camera] > 0.9
    assert not identifier.all_free
    assert meant(identifier, pictures_of(rig)) == set()
    assert identifier.all_free


@pytest.mark.parametrize(
    ("camera", "place"),
    [("C1", (22.0, 22.0)), ("C2", (328.0, 22.0)), ("C3", (328.0, 378.0)), ("C4", (22.0, 378.0))],
)
def test_a_finger_right_before_a_camera_means_it(
    identifier: Identifier, rig: SimulatedRig, camera: str, place: tuple[float, float]
) -> None:
    assert meant(identifier, pictures_of(rig, Finger(*place, 14.0))) == {camera}


@pytest.mark.parametrize("place", [(175.0, 200.0), (100.0, 120.0), (20.0, 200.0)])
def test_a_finger_elsewhere_means_no_camera(
    identifier: Identifier, rig: SimulatedRig, place: tuple[float, float]
) -> None:
    assert meant(identifier, pictures_of(rig, Finger(*place, 14.0))) == set()


def test_the_light_that_goes_out_means_no_camera(identifier: Identifier, rig: SimulatedRig) -> None:
    out = {camera: pixels // 8 for camera, pixels in pictures_of(rig).items()}
    assert meant(identifier, out) == set()


def test_a_hand_that_passes_by_means_no_camera(identifier: Identifier, rig: SimulatedRig) -> None:
    pictures = pictures_of(rig)
    pictures["C2"] = pictures["C2"] // 8
    assert meant(identifier, pictures, rounds=HELD_PICTURES - 1) == set()
    assert meant(identifier, pictures_of(rig)) == set()


def test_a_camera_that_sees_nothing_is_told_so() -> None:
    identifier = Identifier()
    for _ in range(LEARNED_PICTURES):
        identifier.feed("C1", np.full((64, 640), 100, np.uint8))
        identifier.feed("C2", np.full((64, 640), 3, np.uint8))
    assert identifier.dark_cameras == ("C2",)
