"""Recordings of simulated rigs: what a person would record to calibrate one, and a test."""

import csv
from collections.abc import Container, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.model import FloatArray
from cornertouchd.simulation.boards import BoardShow, board_poses
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

RATE_HZ = 10.0
EMPTY_SETS = 16
BOARDS = 48
SCRIBBLE_TOUCHES = 150
TEST_TOUCHES = 300
REFERENCE_POINTS = 225
STYLUS_MM = 8.0
"""What taps: a round thing, as in the paper; what scribbles and tests are fingers."""

FINGERS_MM = (8.0, 14.0)
REFERENCE_INSET_MM, FINGER_INSET_MM = 5.0, 8.0


@dataclass(frozen=True)
class RigKind:
    """A rig of which every seed mounts another one."""

    name: str
    barrel: float
    surface_mm: tuple[float, float]
    size_px: tuple[int, int]
    boards: int

    @property
    def lens(self) -> str:
        """What the table calls it."""
        return "barrel" if self.barrel else "pinhole"

    def make(self, seed: int, rows_px: int = 64) -> SimulatedRig:
        """Return the rig of a seed; mounted the same, however many rows its pictures have."""
        return SimulatedRig(self.surface_mm, *self.size_px, rows_px, seed, barrel=self.barrel)


# No board that a printer prints shows enough squares to two cameras 2.4 m apart.
RIGS = tuple(
    RigKind(name, barrel, surface_mm, size_px, boards)
    for name, surface_mm, size_px, boards in (
        ("350x400", (350.0, 400.0), (640, 480), BOARDS),
        ("2400x1350", (2400.0, 1350.0), (1280, 800), 0),
    )
    for barrel in (0.0, 0.3)
)


def grid(surface_mm: tuple[float, float], count: int) -> FloatArray:
    """Return `count` x `count` places in the middles of equal tiles, row by row."""
    shares = (np.arange(count) + 0.5) / count
    x, y = np.meshgrid(shares * surface_mm[0], shares * surface_mm[1])
    return np.stack([x.ravel(), y.ravel()], axis=1)


def along_frame(surface_mm: tuple[float, float], count: int = REFERENCE_POINTS) -> FloatArray:
    """Return places at equal distances along the frame, clockwise from the top-left, (count, 2)."""
    low = REFERENCE_INSET_MM
    right, bottom = (side - low for side in surface_mm)
    corners = np.array([(low, low), (right, low), (right, bottom), (low, bottom), (low, low)])
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners, axis=0)).sum(axis=1))])
    at = (np.arange(count) + 0.5) / count * way[-1]
    return np.stack([np.interp(at, way, corners[:, axis]) for axis in (0, 1)], axis=1)


class RigRecorder:
    """Writes recordings of the rig of a seed, each into a directory of its own."""

    def __init__(self, kind: RigKind, seed: int, directory: Path) -> None:
        self._kind = kind
        self._seed = seed
        self._rig = kind.make(seed)
        self._directory = directory
        self._pictures = 0

    def empty(self) -> None:
        """Record the empty surface."""
        self._touches("empty", [()] * EMPTY_SETS)

    def taps(self, name: str, targets_mm: FloatArray, tap_sigma_mm: float) -> None:
        """Record taps that miss their targets a little; points.csv tells the targets."""
        rng = self._random_for(name)
        places = targets_mm + tap_sigma_mm * rng.standard_normal(targets_mm.shape)
        self._touches(name, [(Finger(x, y, STYLUS_MM),) for x, y in places.tolist()])
        with (self._directory / name / "points.csv").open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["set", "x_mm", "y_mm", "diameter_mm"])
            for index, (x, y) in enumerate(targets_mm.tolist()):
                rows.writerow([index, x, y, STYLUS_MM])

    def fingers(self, name: str, count: int) -> None:
        """Record upright fingers all over the surface; truth.csv tells where they really were."""
        low, high = FINGER_INSET_MM, np.array(self._rig.surface_mm) - FINGER_INSET_MM
        rng = self._random_for(name)
        places = rng.uniform(low, high, (count, 2)).tolist()
        diameters = rng.uniform(*FINGERS_MM, count).tolist()
        fingers = [Finger(x, y, d) for (x, y), d in zip(places, diameters, strict=True)]
        self._touches(name, [(finger,) for finger in fingers])
        self._write_truth(self._directory / name / "truth.csv", fingers)

    def boards(self) -> None:
        """Record boards held before the same rig with all rows of its pictures."""
        rig = self._kind.make(self._seed, rows_px=self._kind.size_px[1])
        plan, count = BoardPlan(), self._kind.boards
        show = BoardShow(rig, plan)
        poses = board_poses(plan, rig.surface_mm, rig.formats, rig.truth.cameras, count, self._seed)
        directory = self._directory / "boards"
        with RecordingWriter(directory, rig.surface_mm, RATE_HZ, rig.formats) as writer:
            for index, pose in enumerate(poses):
                writer.write(show.frame_set(index, pose))

    def _random_for(self, name: str) -> np.random.Generator:
        """Return numbers that are the same whatever else is recorded."""
        what = f"{self._kind.name} {self._kind.lens} {name}"
        return np.random.default_rng([self._seed, *what.encode()])

    def _touches(self, name: str, shown: Sequence[tuple[Finger, ...]]) -> None:
        directory = self._directory / name
        with RecordingWriter(directory, self._rig.surface_mm, RATE_HZ, self._rig.formats) as writer:
            for fingers in shown:
                at_s = self._pictures / RATE_HZ
                writer.write(self._rig.frame_set(self._pictures, at_s, fingers))
                self._pictures += 1

    def _write_truth(self, path: Path, fingers: Sequence[Finger]) -> None:
        with path.open("w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["set", "x_mm", "y_mm", "section_x_mm", "section_y_mm"])
            for index, finger in enumerate(fingers):
                section = self._rig.truth.section(finger)
                assert section is not None
                rows.writerow([index, finger.x_mm, finger.y_mm, section.x_mm, section.y_mm])


def write_sets(
    kind: RigKind, seed: int, tap_sigma_mm: float, wanted: Container[str], directory: Path
) -> dict[str, Path]:
    """Write the wanted recordings of a rig, and the test; return where each is."""
    recorder = RigRecorder(kind, seed, directory)
    recorder.empty()
    for name, targets_mm in (
        ("taps16", grid(kind.surface_mm, 4)),
        ("taps25", grid(kind.surface_mm, 5)),
        ("frame225", along_frame(kind.surface_mm)),
    ):
        if name in wanted:
            recorder.taps(name, targets_mm, tap_sigma_mm)
    if "scribble" in wanted:
        recorder.fingers("scribble", SCRIBBLE_TOUCHES)
    if "boards" in wanted and kind.boards:
        recorder.boards()
    recorder.fingers("test", TEST_TOUCHES)
    return {path.name: path for path in directory.iterdir()}
