"""Accuracy and speed of crossing: random discs on two sizes of frame, two methods side by side.

    python benchmarks/fusion.py [--scenes 200] [--seed 1] [--contacts 1 2 5 10] [--method default]

Each scene is a set of discs of radius 4..8 mm, at least 20 mm apart.  Cameras stand 10 mm outside
the corners, see 95 degrees on 640 columns through a pinhole and measure edges with 0.1 px of noise.
Shadows that touch are merged, and cut at the border of the view.  A contact counts as found within
6 mm (350x400) or 10 mm (2400x1350).
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from cornertouchd.config import CrossingSettings
from cornertouchd.fusion.crossing import Crossing, make_crossing
from cornertouchd.model import DirectingLines, FloatArray

EDGE_SIGMA_PX = 0.1
# Light between two shadows that is narrower than this is lost in the blur.
SMALLEST_GAP_PX = 1.5
SMALLEST_SHADOW_PX = 0.6
VIEW_RAD = np.deg2rad(95.0)
CAMERA_OUTSIDE_MM = 10.0
SMALLEST_DISTANCE_MM = 20.0
MARGIN_MM = 6.0
RADII_MM = (4.0, 8.0)


@dataclass(frozen=True, slots=True)
class Rig:
    """A surface with a camera at each corner."""

    name: str
    surface_mm: tuple[float, float]
    found_within_mm: float
    width_px: int = 640

    @property
    def focal_px(self) -> float:
        """Focal length of the pinhole."""
        return float(self.width_px / 2.0 / np.tan(VIEW_RAD / 2.0))

    def cameras(self) -> Iterator[tuple[str, float, float, float]]:
        """Yield name, x, y and the direction of view of each camera."""
        width, height = self.surface_mm
        near, right, bottom = (
            -CAMERA_OUTSIDE_MM,
            width + CAMERA_OUTSIDE_MM,
            height + CAMERA_OUTSIDE_MM,
        )
        corners = [(near, near), (right, near), (right, bottom), (near, bottom)]
        for number, (x, y) in enumerate(corners):
            yield f"C{number + 1}", x, y, np.deg2rad(45.0 + 90.0 * number)


@dataclass(frozen=True, slots=True)
class Score:
    """How well contacts were found over many scenes; distances of the found ones in millimetres."""

    precision: float
    recall: float
    exact: float
    rmse_mm: float
    p95_mm: float
    median_ms: float


SMALL = Rig("350x400", (350.0, 400.0), 6.0)
LARGE = Rig("2400x1350", (2400.0, 1350.0), 10.0)


def random_discs(rig: Rig, count: int, rng: np.random.Generator) -> FloatArray:
    """Return discs (count, 3) as x, y, r, no two of them too near."""
    discs = np.empty((0, 3))
    low, high = np.full(2, MARGIN_MM), np.asarray(rig.surface_mm) - MARGIN_MM
    while len(discs) < count:
        centre = rng.uniform(low, high)
        apart = np.hypot(*(discs[:, :2] - centre).T)
        if np.all(apart > SMALLEST_DISTANCE_MM):
            discs = np.vstack([discs, [*centre, rng.uniform(*RADII_MM)]])
    return discs


def observed(rig: Rig, discs: FloatArray, rng: np.random.Generator) -> list[DirectingLines]:
    """Return what the cameras of the rig measure of the discs."""
    return [
        _bearings(rig, *camera, _shadows_px(rig, discs, camera[1:]), rng)
        for camera in rig.cameras()
    ]


def _shadows_px(rig: Rig, discs: FloatArray, camera: tuple[float, float, float]) -> FloatArray:
    """Return the merged shadows (K, 2) in columns from the middle, not yet cut at the border."""
    x_mm, y_mm, forward_rad = camera
    away = discs[:, :2] - (x_mm, y_mm)
    distance = np.hypot(away[:, 0], away[:, 1])
    angle = np.arctan2(away[:, 1], away[:, 0]) - forward_rad
    angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    half = np.arcsin(np.minimum(discs[:, 2] / distance, 1.0))
    # tangents beyond 80 degrees are far outside the view; the tangent function must stay monotonic
    edges = np.clip(np.stack([angle - half, angle + half], axis=1), *np.deg2rad([-80.0, 80.0]))
    intervals = rig.focal_px * np.tan(edges[np.argsort(edges[:, 0])])
    merged: list[list[float]] = []
    for first, last in intervals:
        if merged and first - merged[-1][1] < SMALLEST_GAP_PX:
            merged[-1][1] = max(merged[-1][1], last)
        else:
            merged.append([first, last])
    return np.array(merged).reshape(-1, 2)


def _bearings(
    rig: Rig,
    camera: str,
    x_mm: float,
    y_mm: float,
    forward_rad: float,
    shadows_px: FloatArray,
    rng: np.random.Generator,
) -> DirectingLines:
    border = rig.width_px / 2.0 - 1.0
    cut = np.clip(shadows_px, -border, border)
    shadows_px = shadows_px[cut[:, 1] - cut[:, 0] > SMALLEST_SHADOW_PX]
    valid = np.abs(shadows_px) < border
    noisy = shadows_px + rng.normal(0.0, EDGE_SIGMA_PX, shadows_px.shape)
    edges = np.where(valid, noisy, np.clip(shadows_px, -border, border))
    angles = forward_rad + np.arctan(edges / rig.focal_px)
    middles = edges.mean(axis=1)
    rad_per_px = np.cos(np.arctan(middles / rig.focal_px)) ** 2 / rig.focal_px
    return DirectingLines(
        camera=camera,
        x_mm=x_mm,
        y_mm=y_mm,
        first_rad=angles[:, 0],
        centre_rad=forward_rad + np.arctan(middles / rig.focal_px),
        last_rad=angles[:, 1],
        first_valid=valid[:, 0],
        last_valid=valid[:, 1],
        sigma_rad=EDGE_SIGMA_PX * rad_per_px,
    )


def measure(rig: Rig, crossing: Crossing, count: int, scenes: int, seed: int) -> Score:
    """Cross so many scenes of so many contacts and compare with the truth."""
    rng = np.random.default_rng(seed)
    errors_mm: list[FloatArray] = []
    seconds: list[float] = []
    reported = exact = 0
    for _ in range(scenes):
        discs = random_discs(rig, count, rng)
        directing_lines = observed(rig, discs, rng)
        started = time.perf_counter()
        contacts = crossing.cross(directing_lines).contacts
        seconds.append(time.perf_counter() - started)
        points = np.array([(contact.x_mm, contact.y_mm) for contact in contacts]).reshape(-1, 2)
        found = _distances_of_found(points, discs[:, :2], rig.found_within_mm)
        errors_mm.append(found)
        reported += len(contacts)
        exact += len(found) == len(contacts) == count
    errors = np.concatenate(errors_mm)
    return Score(
        precision=len(errors) / max(reported, 1),
        recall=len(errors) / (count * scenes),
        exact=exact / scenes,
        rmse_mm=float(np.sqrt(np.mean(errors**2))),
        p95_mm=float(np.percentile(errors, 95.0)),
        median_ms=1000.0 * float(np.median(seconds)),
    )


def _distances_of_found(points: FloatArray, truth: FloatArray, within_mm: float) -> FloatArray:
    distances = np.hypot(*np.moveaxis(points[:, None] - truth[None], -1, 0))
    rows, columns = linear_sum_assignment(np.where(distances < within_mm, distances, 1e3))
    matched: FloatArray = distances[rows, columns]
    return matched[matched < within_mm]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--contacts", type=int, nargs="+", default=[1, 2, 5, 10])
    parser.add_argument("--method", nargs="+", default=["paper", "default"])
    options = parser.parse_args(arguments)
    print(
        "| frame | method | contacts | precision | recall | exact | RMSE mm | p95 mm | median ms |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for rig in (SMALL, LARGE):
        for method in options.method:
            crossing = make_crossing(CrossingSettings(method=method), rig.surface_mm)
            for count in options.contacts:
                score = measure(rig, crossing, count, options.scenes, options.seed)
                print(
                    f"| {rig.name} | {method} | {count} | {score.precision:.3f}"
                    f" | {score.recall:.3f} | {score.exact:.3f} | {score.rmse_mm:.3f}"
                    f" | {score.p95_mm:.3f} | {score.median_ms:.2f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
