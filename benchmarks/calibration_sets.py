"""Recordings of simulated rigs: what a person would record to calibrate one, and a test."""

import csv
from collections.abc import Container, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cornertouchd.calibration.boards import BoardPlan
from cornertouchd.devices.recording_writer import RecordingWriter
from cornertouchd.guiding.targets import targets_for
from cornertouchd.model import FloatArray
from cornertouchd.simulation.boards import BoardShow, board_poses
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.rig import SimulatedRig

RATE_HZ = 10.0
EMPTY_SETS = 16
BOARDS = 48
SCRIBBLE_TOUCHES = 150
TEST_TOUCHES = 300
STYLUS_MM = 8.0
"""What taps: a round thing, as in the paper; what scribbles and tests are fingers."""

FINGERS_MM = (8.0, 14.0)
FINGER_INSET_MM = 8.0


@dataclass(frozen=True)
class RigKind:
    """A rig of which every seed mounts another one."""

    name: str
    barrel: float
    surface_mm: tuple[float, float]
    size_px: tuple[int, int]
    board: BoardPlan

    @property
    def lens(self) -> str:
        """What the table calls it."""
        return "barrel" if self.barrel else "pinhole"

    def make(self, seed: int, rows_px: int = 64) -> SimulatedRig:
        """Return the rig of a seed; mounted the same, however many rows its pictures have."""
        return SimulatedRig(self.surface_mm, *self.size_px, rows_px, seed, barrel=self.barrel)


# On the large rig a board has to be as large as A0: two cameras 2.4 m apart see too few squares of
# a smaller one.
RIGS = tuple(
    RigKind(name, barrel, surface_mm, size_px, board)
    for name, surface_mm, size_px, board in (
        ("350x400", (350.0, 400.0), (640, 480), BoardPlan()),
        ("2400x1350", (2400.0, 1350.0), (1280, 800), BoardPlan(square_mm=100.0, marker_mm=78.0)),
    )
    for barrel in (0.0, 0.3)
)


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

    def fingers(self, name: str, count: int, most_lean_rad: float = 0.0) -> None:
        """Record fingers all over the surface; truth.csv tells where they really were.

        They stand upright, or lean by up to so much towards any side.
        """
        low, high = FINGER_INSET_MM, np.array(self._rig.surface_mm) - FINGER_INSET_MM
        rng = self._random_for(name)
        places = rng.uniform(low, high, (count, 2)).tolist()
        diameters = rng.uniform(*FINGERS_MM, count).tolist()
        leans = (most_lean_rad * rng.uniform(0.0, 1.0, count)).tolist()
        azimuths = rng.uniform(-np.pi, np.pi, count).tolist()
        fingers = [
            Finger(x, y, diameter, lean, azimuth)
            for (x, y), diameter, lean, azimuth in zip(
                places, diameters, leans, azimuths, strict=True
            )
        ]
        self._touches(name, [(finger,) for finger in fingers])
        self._write_truth(self._directory / name / "truth.csv", fingers)

    def boards(self) -> None:
        """Record boards held before the same rig with all rows of its pictures."""
        rig = self._kind.make(self._seed, rows_px=self._kind.size_px[1])
        plan = self._kind.board
        show = BoardShow(rig, plan)
        cameras = rig.truth.cameras
        poses = board_poses(plan, rig.surface_mm, rig.formats, cameras, BOARDS, self._seed)
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
        ("taps16", targets_for("auto", kind.surface_mm)),
        ("taps25", targets_for("vanishing-point", kind.surface_mm)),
        ("frame225", targets_for("lookup-table", kind.surface_mm)),
    ):
        if name in wanted:
            recorder.taps(name, targets_mm, tap_sigma_mm)
    if "scribble" in wanted:
        recorder.fingers("scribble", SCRIBBLE_TOUCHES)
    if "boards" in wanted:
        recorder.boards()
    recorder.fingers("test", TEST_TOUCHES)
    return {path.name: path for path in directory.iterdir()}
