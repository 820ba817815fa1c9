"""Pictures painted in another process are those painted here."""

from functools import partial

import numpy as np
import pytest

from cornertouchd.config import CamerasSettings, Settings, SimulationSettings
from cornertouchd.ports import CameraError
from cornertouchd.simulation.painting import PaintingProcess, painter
from cornertouchd.simulation.show import make_show

SETTINGS = Settings(
    cameras=CamerasSettings(source="simulated"), simulation=SimulationSettings(seed=3, touches=2)
)


@pytest.fixture(scope="module")
def painting() -> PaintingProcess:
    rig, _ = make_show(SETTINGS)
    return PaintingProcess(partial(make_show, SETTINGS), rig.formats)


def test_the_pictures_are_the_same(painting: PaintingProcess) -> None:
    rig, script = make_show(SETTINGS)
    for camera in rig.formats:
        for index in (0, 7):
            there = painting.painter(camera)(index, 0.01 * index)
            assert np.array_equal(there, painter(rig, script, camera)(index, 0.01 * index))


def test_an_end_of_the_process_is_a_lost_camera(painting: PaintingProcess) -> None:
    painting.end()
    with pytest.raises(CameraError, match="camera C1: the simulation has ended"):
        painting.painter("C1")(1, 0.01)
