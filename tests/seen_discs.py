"""What four ideal corner cameras see of discs that touch the surface, in columns of their pictures.

The surface is 350x400 mm; the cameras stand 10 mm outside its corners and see 95 degrees on 640
columns through a pinhole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from cornertouchd.calibration.calibration import Calibration, CameraCalibration
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.config import Settings
from cornertouchd.fusion.pairing import frame_set_of
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.line_table import LineTable, tabulate
from cornertouchd.model import Contact, FrameSet, Observation, PictureFormat, Shadows
from cornertouchd.pipeline import SurfacePipeline

SURFACE_MM = (350.0, 400.0)
WIDTH_PX = 640
HALF_VIEW_RAD = np.deg2rad(47.5)
FOCAL_PX = WIDTH_PX / 2.0 / np.tan(HALF_VIEW_RAD)
CORNERS = {
    "C1": (-10.0, -10.0, np.pi / 4),
    "C2": (360.0, -10.0, 3 * np.pi / 4),
    "C3": (360.0, 410.0, 5 * np.pi / 4),
    "C4": (-10.0, 410.0, 7 * np.pi / 4),
}
SMALLEST_GAP_PX = 1.5
"""Light between two shadows that is narrower than this is lost in the blur."""

Disc = tuple[float, float, float]
Columns = tuple[float, float]


def _polynomial(forward_rad: float) -> tuple[float, ...]:
    """Return the angle of a pinhole's columns as a polynomial, exact to 1e-6 rad."""
    w = np.cos(np.linspace(0.0, np.pi, 101))
    fitted = np.polynomial.Polynomial.fit(w, np.arctan(w * np.tan(HALF_VIEW_RAD)), 15, [-1, 1])
    terms = fitted.coef.copy()
    terms[0] += forward_rad
    return tuple(terms.tolist())


MODELS = {
    camera: AnglePolynomial((x_mm, y_mm), _polynomial(forward_rad), WIDTH_PX)
    for camera, (x_mm, y_mm, forward_rad) in CORNERS.items()
}
TABLES: dict[str, LineTable] = {
    camera: tabulate(camera, model, WIDTH_PX) for camera, model in MODELS.items()
}


def surface_pipeline(settings: Settings | None = None) -> SurfacePipeline:
    """Return the pipeline of the four cameras."""
    size = PictureFormat(WIDTH_PX, 480, 200, 64)
    cameras = tuple(
        CameraCalibration(camera, "", size, np.zeros((64, WIDTH_PX)), model, 0.1)
        for camera, model in MODELS.items()
    )
    expected = ErrorMap(np.array([175.0]), np.array([200.0]), np.array([[0.3]]))
    calibration = Calibration("auto", "", "", SURFACE_MM, 16, 0, 0, 0.1, expected, cameras)
    return SurfacePipeline(calibration, settings or Settings())


def column_of(camera: str, x_mm: float, y_mm: float) -> float:
    """Return the column in which a camera sees a place."""
    camera_x, camera_y, forward_rad = CORNERS[camera]
    angle = np.arctan2(y_mm - camera_y, x_mm - camera_x) - forward_rad
    angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    return float(WIDTH_PX / 2.0 + FOCAL_PX * np.tan(np.clip(angle, -1.4, 1.4)))


def shadow_of(camera: str, disc: Disc) -> Columns:
    """Return the columns that a disc darkens, also those beyond the picture."""
    x_mm, y_mm, radius_mm = disc
    camera_x, camera_y, forward_rad = CORNERS[camera]
    angle = np.arctan2(y_mm - camera_y, x_mm - camera_x) - forward_rad
    angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    half = np.arcsin(min(1.0, radius_mm / np.hypot(x_mm - camera_x, y_mm - camera_y)))
    left, right = np.tan(np.clip([angle - half, angle + half], -1.4, 1.4))
    return WIDTH_PX / 2.0 + FOCAL_PX * float(left), WIDTH_PX / 2.0 + FOCAL_PX * float(right)


def observe(
    camera: str,
    discs: Sequence[Disc],
    captured_at_s: float = 0.0,
    dirt: Sequence[Columns] = (),
    rng: np.random.Generator | None = None,
) -> Observation:
    """Return what a camera sees of discs, and of dirt before its strip."""
    merged: list[list[float]] = []
    for left, right in sorted([*(shadow_of(camera, disc) for disc in discs), *dirt]):
        if merged and left - merged[-1][1] < SMALLEST_GAP_PX:
            merged[-1][1] = max(merged[-1][1], right)
        else:
            merged.append([left, right])
    edges = np.array(merged).reshape(-1, 2)
    edges = edges[(edges[:, 1] > 1.0) & (edges[:, 0] < WIDTH_PX - 1.0)]
    valid = (edges > 1.0) & (edges < WIDTH_PX - 1.0)
    noise = 0.0 if rng is None else rng.normal(0.0, 0.1, edges.shape)
    edges = np.clip(edges + valid * noise, 0.0, WIDTH_PX)
    return Observation(camera, 0, captured_at_s, Shadows(edges, valid, np.ones(len(edges))))


def frame_set(
    discs: Sequence[Disc],
    captured_at_s: float = 0.0,
    dirt: Mapping[str, Sequence[Columns]] | None = None,
    rng: np.random.Generator | None = None,
) -> FrameSet:
    """Return what all cameras see at one time."""
    seen = [observe(c, discs, captured_at_s, (dirt or {}).get(c, ()), rng) for c in CORNERS]
    return frame_set_of(seen)


def at_time(seen: FrameSet, captured_at_s: float) -> FrameSet:
    """Return the same, seen at another time."""
    observations = [replace(one, captured_at_s=captured_at_s) for one in seen.observations]
    return FrameSet(captured_at_s, tuple(observations))


def places(contacts: Sequence[Contact]) -> list[tuple[float, float]]:
    """Return where contacts are, in a lasting order."""
    return sorted((contact.x_mm, contact.y_mm) for contact in contacts)
