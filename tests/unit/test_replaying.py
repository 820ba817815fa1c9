"""A replay follows what the daemon would follow, and skips what the daemon would skip."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cornertouchd.calibration.file import load_calibration
from cornertouchd.config import Settings
from cornertouchd.devices.recording import Recording, open_recording
from cornertouchd.model import Frame
from cornertouchd.runtime.fusing import SILENCE_S
from cornertouchd.runtime.replaying import Replay

PERIOD_S = 0.01
WHOLE_SETS = 5


class OneTouchHeld:
    """The first frame set of a recording again and again; some cameras break after a while."""

    def __init__(self, recording: Recording, broken: int, sets: int) -> None:
        self._recording = recording
        self._broken = broken
        self._sets = sets
        self.formats, self.identities = recording.formats, recording.identities
        self.surface_mm, self.directory = recording.surface_mm, recording.directory

    def __len__(self) -> int:
        return self._sets

    def __iter__(self) -> Iterator[tuple[Frame, ...]]:
        first = next(iter(self._recording))
        for number in range(self._sets):
            broken = self._broken if number >= WHOLE_SETS else 0
            yield tuple(
                replace(
                    frame,
                    sequence=number,
                    captured_at_s=number * PERIOD_S,
                    pixels=np.zeros_like(frame.pixels[:, :-1]) if place < broken else frame.pixels,
                )
                for place, frame in enumerate(first)
            )


@pytest.fixture
def recording(recordings: Path) -> Recording:
    return open_recording(recordings / "single_small")


def ids(recording: Recording, calibration_file: Path, broken: int, sets: int) -> list[list[int]]:
    held = OneTouchHeld(recording, broken, sets)
    replay = Replay(held, load_calibration(calibration_file), Settings())
    return [[touch.id for touch in replayed.touches] for replayed in replay]


def test_three_of_four_cameras_go_on(recording: Recording, calibration_file: Path) -> None:
    assert ids(recording, calibration_file, broken=1, sets=20)[WHOLE_SETS:] == [[1]] * 15


def test_two_of_four_change_nothing_until_the_silence_lifts_all(
    recording: Recording, calibration_file: Path
) -> None:
    told = ids(recording, calibration_file, broken=2, sets=60)
    lifted = WHOLE_SETS + round(SILENCE_S / PERIOD_S)
    assert told[WHOLE_SETS : lifted - 1] == [[1]] * (lifted - 1 - WHOLE_SETS)
    assert told[lifted + 1 :] == [[]] * (len(told) - lifted - 1)
