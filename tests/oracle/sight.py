"""What cameras around a small surface see of discs: the scenes of the tests of crossing."""

from collections.abc import Mapping, Sequence

import numpy as np

from cornertouchd.model import DirectingLines

SURFACE_MM = (350.0, 400.0)
CORNERS = {
    "C1": (-10.0, -10.0, 45.0),
    "C2": (360.0, -10.0, 135.0),
    "C3": (360.0, 410.0, 225.0),
    "C4": (-10.0, 410.0, 315.0),
}
SIDES = {
    "C5": (175.0, -10.0, 90.0),
    "C6": (175.0, 410.0, 270.0),
    "C7": (-10.0, 200.0, 0.0),
    "C8": (360.0, 200.0, 180.0),
}
HALF_VIEW_RAD = {
    **dict.fromkeys(CORNERS, np.deg2rad(47.5)),
    **dict.fromkeys(SIDES, np.deg2rad(89.0)),
}
NARROW_HALF_VIEW_RAD = np.deg2rad(35.0)
# A tenth of a pixel of 640 that share 95 degrees.
SIGMA_RAD = 3e-4
SMALLEST_GAP_RAD = 0.004

Disc = tuple[float, float, float]


def bearings_of(
    discs: Sequence[Disc],
    cameras: Sequence[str] = tuple(CORNERS),
    rng: np.random.Generator | None = None,
    half_views_rad: Mapping[str, float] = HALF_VIEW_RAD,
) -> list[DirectingLines]:
    """Return what the cameras see of the discs (x, y, r): merged shadows, cut at the view."""
    return [one_camera(discs, camera, rng, half_views_rad[camera]) for camera in cameras]


def one_camera(
    discs: Sequence[Disc],
    camera: str,
    rng: np.random.Generator | None = None,
    half_view_rad: float | None = None,
) -> DirectingLines:
    x_mm, y_mm, forward_deg = (CORNERS | SIDES)[camera]
    forward_rad = np.deg2rad(forward_deg)
    half_view_rad = HALF_VIEW_RAD[camera] if half_view_rad is None else half_view_rad
    merged: list[list[float]] = []
    for first, last in sorted(_interval(disc, x_mm, y_mm, forward_rad) for disc in discs):
        if merged and first - merged[-1][1] < SMALLEST_GAP_RAD:
            merged[-1][1] = max(merged[-1][1], last)
        else:
            merged.append([first, last])
    edges = np.array(merged).reshape(-1, 2)
    edges = edges[(edges[:, 0] < half_view_rad) & (edges[:, 1] > -half_view_rad)]
    valid = np.abs(edges) < half_view_rad
    noise = 0.0 if rng is None else rng.normal(0.0, SIGMA_RAD, edges.shape)
    edges = forward_rad + np.clip(edges + valid * noise, -half_view_rad, half_view_rad)
    return DirectingLines(
        camera=camera,
        x_mm=x_mm,
        y_mm=y_mm,
        first_rad=edges[:, 0],
        centre_rad=edges.mean(axis=1),
        last_rad=edges[:, 1],
        first_valid=valid[:, 0],
        last_valid=valid[:, 1],
        sigma_rad=np.full(len(edges), SIGMA_RAD),
        view_rad=(float(forward_rad - half_view_rad), float(forward_rad + half_view_rad)),
    )


def _interval(disc: Disc, x_mm: float, y_mm: float, forward_rad: float) -> tuple[float, float]:
    x, y, radius = disc
    angle = np.arctan2(y - y_mm, x - x_mm) - forward_rad
    angle = (angle + np.pi) % (2.0 * np.pi) - np.pi
    half = np.arcsin(min(1.0, radius / np.hypot(x - x_mm, y - y_mm)))
    return float(angle - half), float(angle + half)


def shadows(directing_lines: DirectingLines, kept: Sequence[int]) -> DirectingLines:
    names = ("first_rad", "centre_rad", "last_rad", "first_valid", "last_valid", "sigma_rad")
    return directing_lines._replace(
        **{name: getattr(directing_lines, name)[list(kept)] for name in names}
    )


def random_discs(count: int, rng: np.random.Generator, apart_mm: float = 20.0) -> list[Disc]:
    discs: list[Disc] = []
    while len(discs) < count:
        x, y = rng.uniform((6.0, 6.0), (SURFACE_MM[0] - 6.0, SURFACE_MM[1] - 6.0))
        if all(np.hypot(x - other[0], y - other[1]) > apart_mm for other in discs):
            discs.append((float(x), float(y), float(rng.uniform(4.0, 8.0))))
    return discs
