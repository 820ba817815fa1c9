"""Taps that are kept come back, on the rig that they belong to."""

from pathlib import Path

import numpy as np
import pytest

from cornertouchd.guiding.progress import TapStore
from cornertouchd.guiding.targets import calibration_targets
from cornertouchd.model import PictureFormat

SURFACE_MM = (350.0, 400.0)
FORMATS = {"C1": PictureFormat(640, 480, 200, 64), "C2": PictureFormat(640, 480, 210, 64)}
TARGETS = calibration_targets(SURFACE_MM)
TAPS = {
    0: np.array([[10.0, 20.5], [30.25, 40.0]]),
    5: np.array([[np.nan, np.nan], [300.0, 310.0]]),
}


@pytest.fixture
def store(tmp_path: Path) -> TapStore:
    return TapStore(tmp_path / "state" / "calibration.json.taps", SURFACE_MM, FORMATS)


def test_kept_taps_come_back(store: TapStore) -> None:
    store.save(TARGETS, TAPS)
    loaded = store.load(TARGETS)
    assert loaded.keys() == TAPS.keys()
    for number, edges in TAPS.items():
        np.testing.assert_array_equal(loaded[number], edges)


def test_nothing_is_there_before_and_after(store: TapStore) -> None:
    assert store.load(TARGETS) == {}
    store.forget()
    store.save(TARGETS, TAPS)
    store.forget()
    assert store.load(TARGETS) == {}
    assert list(store.path.parent.iterdir()) == []


def test_taps_at_other_targets_do_not_count(store: TapStore) -> None:
    store.save(TARGETS, TAPS)
    assert store.load(TARGETS + 7.0) == {}
    assert store.load(TARGETS[1:]).keys() == {4}


@pytest.mark.parametrize("damage", [b"", b"{", b"null", b'{"format": "else"}', b"\xff\xfe"])
def test_a_damaged_file_counts_as_none(store: TapStore, damage: bytes) -> None:
    store.save(TARGETS, TAPS)
    store.path.write_bytes(damage)
    assert store.load(TARGETS) == {}


def test_taps_of_another_rig_count_as_none(store: TapStore) -> None:
    store.save(TARGETS, TAPS)
    moved = {**FORMATS, "C2": PictureFormat(640, 480, 212, 64)}
    assert TapStore(store.path, SURFACE_MM, moved).load(TARGETS) == {}
    assert TapStore(store.path, (350.0, 410.0), FORMATS).load(TARGETS) == {}
    other = {"C1": "0c45:6366 SN7", "C2": ""}
    assert TapStore(store.path, SURFACE_MM, FORMATS, lambda: other).load(TARGETS) == {}
