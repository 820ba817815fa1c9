"""Shadow edges as linear equations: an edge is a tangent to the disc that casts it.

A line through a camera at P with unit normal n, pointing into the shadow, touches a disc (x, y, r)
when n.(x, y) - n.P - r = 0, which is linear in all three unknowns.  The left side is the slack of
the disc: positive when it lies deeper in the shadow, negative when it reaches into the light.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cornertouchd.fusion.crossed import IntArray
from cornertouchd.fusion.edge_rows import MOST_SHADOWS
from cornertouchd.fusion.limits import ROUNDING_MM
from cornertouchd.geometry import angles_and_distances, normals, wrap_angle
from cornertouchd.model import BoolArray, DirectingLines, FloatArray


@dataclass(frozen=True, slots=True)
class EdgeRows:
    """The S shadows of C cameras, two edges each, as rows n.(x, y) - offset - r = 0.

    Shadows are numbered through all cameras; camera c owns those from `first_shadow[c]` up to
    `first_shadow[c + 1]`, in ascending order of angle.  Edge e of shadow s has number 2 s + e.
    `forward_rad` (C,) lies amid a camera's shadows, so that angles are unwrapped around it.
    `bounds_rad`, `offsets_mm` and `valid` are (S, 2), `normals` (S, 2, 2), `sigma_rad` (S,).
    `views_rad` (C, 2) are the first and the last angle of each camera's view.
    """

    cameras: tuple[str, ...]
    positions_mm: FloatArray
    forward_rad: FloatArray
    views_rad: FloatArray
    first_shadow: IntArray
    camera_of_shadow: IntArray
    bounds_rad: FloatArray
    sigma_rad: FloatArray
    normals: FloatArray
    offsets_mm: FloatArray
    valid: BoolArray

    @property
    def edge_count(self) -> int:
        """Number of edges, valid or not."""
        return 2 * len(self.sigma_rad)

    def unwrap(self, angles_rad: FloatArray) -> FloatArray:
        """Return angles (..., C), as seen from each camera, comparable with its `bounds_rad`."""
        return self.forward_rad + wrap_angle(angles_rad - self.forward_rad)

    def in_view(self, points_mm: FloatArray) -> BoolArray:
        """Tell which cameras look at points (P, 2), (P, C); on a line of view they do not."""
        angles, distances = angles_and_distances(points_mm, self.positions_mm)
        first, last = self.views_rad.T
        everything = ~(last - first < 2.0 * np.pi)
        behind_first = (angles - np.where(everything, 0.0, first)) % (2.0 * np.pi)
        before_last = last - first - behind_first
        rounding_rad = ROUNDING_MM / distances
        seen: BoolArray = (np.minimum(behind_first, before_last) > rounding_rad) | everything
        return seen


def edge_rows(directing_lines: Sequence[DirectingLines]) -> EdgeRows:
    """Collect the rows of all cameras that have a usable shadow; the others are left out."""
    most = MOST_SHADOWS // max(len(directing_lines), 1)
    usable = [_usable(camera, most) for camera in directing_lines]
    seeing = [camera for camera in usable if len(camera.first_rad)]
    counts = np.array([len(camera.first_rad) for camera in seeing], dtype=np.intp)
    camera_of_shadow = np.repeat(np.arange(len(seeing)), counts)
    positions = np.array([(c.x_mm, c.y_mm) for c in seeing], dtype=np.float64).reshape(-1, 2)
    bounds = np.stack(
        [_joined([c.first_rad for c in seeing]), _joined([c.last_rad for c in seeing])], axis=-1
    )
    valid = np.stack(
        [_joined([c.first_valid for c in seeing]), _joined([c.last_valid for c in seeing])], axis=-1
    )
    inward = normals(bounds) * np.array([[1.0], [-1.0]])
    return EdgeRows(
        cameras=tuple(camera.camera for camera in seeing),
        positions_mm=positions,
        forward_rad=np.array([(c.first_rad[0] + c.last_rad[-1]) / 2.0 for c in seeing]),
        views_rad=np.array([camera.view_rad for camera in seeing], np.float64).reshape(-1, 2),
        first_shadow=np.concatenate([[0], np.cumsum(counts)]).astype(np.intp),
        camera_of_shadow=camera_of_shadow,
        bounds_rad=bounds,
        sigma_rad=_joined([c.sigma_rad for c in seeing]),
        normals=inward,
        offsets_mm=np.einsum("sei,si->se", inward, positions[camera_of_shadow]),
        valid=valid.astype(np.bool_),
    )


def without_cameras(rows: EdgeRows, cameras: Sequence[int]) -> tuple[EdgeRows, IntArray]:
    """Return the rows of all other cameras, and the numbers that their shadows have in `rows`."""
    kept_cameras = np.delete(np.arange(len(rows.cameras)), cameras)
    shadows = np.flatnonzero(~np.isin(rows.camera_of_shadow, cameras))
    counts = np.diff(rows.first_shadow)[kept_cameras]
    others = EdgeRows(
        cameras=tuple(rows.cameras[c] for c in kept_cameras),
        positions_mm=rows.positions_mm[kept_cameras],
        views_rad=rows.views_rad[kept_cameras],
        forward_rad=rows.forward_rad[kept_cameras],
        first_shadow=np.concatenate([[0], np.cumsum(counts)]).astype(np.intp),
        camera_of_shadow=np.repeat(np.arange(len(kept_cameras)), counts),
        bounds_rad=rows.bounds_rad[shadows],
        sigma_rad=rows.sigma_rad[shadows],
        normals=rows.normals[shadows],
        offsets_mm=rows.offsets_mm[shadows],
        valid=rows.valid[shadows],
    )
    return others, shadows


def _joined(parts: Sequence[NDArray[np.generic]]) -> FloatArray:
    return np.concatenate([np.empty(0), *parts])


def _usable(camera: DirectingLines, most: int) -> DirectingLines:
    """Drop shadows that are no interval of finite angles; keep the widest, in order of angle."""
    sound = np.flatnonzero(
        np.isfinite(camera.first_rad)
        & np.isfinite(camera.last_rad)
        & (camera.first_rad < camera.last_rad)
        & (camera.last_rad < camera.first_rad + 2.0 * np.pi)
        & np.isfinite(camera.sigma_rad)
        & (camera.sigma_rad > 0.0)
    )
    widths = camera.last_rad[sound] - camera.first_rad[sound]
    kept = sound[np.argsort(-widths, kind="stable")[:most]]
    kept = kept[np.argsort(camera.first_rad[kept], kind="stable")]
    return camera._replace(
        first_rad=camera.first_rad[kept],
        centre_rad=camera.centre_rad[kept],
        last_rad=camera.last_rad[kept],
        first_valid=camera.first_valid[kept],
        last_valid=camera.last_valid[kept],
        sigma_rad=camera.sigma_rad[kept],
    )
