"""Where the picture of a display lies on the surface, from taps on its four corners."""

from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, FiniteFloat, field_validator

from cornertouchd.calibration.atomic_file import replace_file
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.calibration.sealed_json import SealedFile, read_bounded, seal, unseal
from cornertouchd.geometry import homography_between, is_convex
from cornertouchd.model import BoolArray, FloatArray

CORNERS = ("top-left", "top-right", "bottom-right", "bottom-left")
"""The order of the taps, as the user sees the picture."""

LARGEST_OFF_MM = 5.0
"""A finger misses a target by 2 mm, behind 4 mm of glass by twice that."""

SMALLEST_SIDE_MM = 20.0

DIGITS = 2
"""A hundredth of a millimetre is less than any tap tells."""

LARGEST_OVERHANG_MM = 10.0
"""A picture may reach this far beyond the surface: under the edge of the frame."""

SMALLEST_TURN_RAD = np.deg2rad(0.2)
"""Taps alone make the smallest picture look turned by this much."""

REMEDY = "run `cornertouchd calibrate display`"

# The corners of a picture in its own coordinates: x right, y down, 0..1.
_PICTURE = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])

Corners = tuple[tuple[float, float], ...]
"""Of a picture on the surface, in the order of `CORNERS`, in millimetres."""

Rotation = Literal[0, 90, 180, 270]
_ROTATIONS: tuple[Rotation, ...] = (0, 90, 180, 270)

_Length = Annotated[FiniteFloat, Field(ge=SMALLEST_SIDE_MM, le=100_000.0)]
_Place = Annotated[FiniteFloat, Field(ge=-100_000.0, le=100_000.0)]


@dataclass(frozen=True, slots=True)
class DisplayPlace:
    """The rectangle that the picture fills, along the sides of the surface, and how it lies in it.

    `rotation_deg` and `mirror` are those of `wire.mapping.DisplayMapping`.  `residual_mm` is the
    RMS distance of the taps from their targets, `created_at` UTC in ISO 8601.  `corners_mm` are
    those of a picture that is no such rectangle, in the order of `CORNERS`; the rest then says
    which one comes nearest.
    """

    left_mm: float
    top_mm: float
    width_mm: float
    height_mm: float
    rotation_deg: Rotation
    mirror: bool
    created_at: str
    residual_mm: float
    corners_mm: Corners | None = None

    def require_on(self, surface_mm: tuple[float, float]) -> None:
        """Raise `CalibrationError` unless the picture lies on a surface of this size."""
        right_mm, bottom_mm = self.left_mm + self.width_mm, self.top_mm + self.height_mm
        corners = self.corners_mm or ((self.left_mm, self.top_mm), (right_mm, bottom_mm))
        if _overhang_mm(np.array(corners), surface_mm) > LARGEST_OVERHANG_MM:
            raise CalibrationError(
                f"the display lies at {self.left_mm:.0f}, {self.top_mm:.0f} mm and is "
                f"{self.width_mm:.0f}x{self.height_mm:.0f} mm, the surface is "
                f"{surface_mm[0]:g}x{surface_mm[1]:g} mm; {REMEDY}"
            )


def fit_perspective(
    points_mm: FloatArray,
    surface_mm: tuple[float, float],
    inset_share: float,
    created_at: str,
) -> DisplayPlace:
    """Return where a picture lies that may be turned by any angle, or be a trapezium.

    As `fit_display`, but four taps fix it wholly, so that none of them can be found wrong unless
    they are not the corners of a convex quadrangle.
    """
    points = _four(points_mm)
    targets = inset_share + (1 - 2 * inset_share) * _PICTURE
    if not is_convex(points):
        raise CalibrationError(
            f"the taps do not go around a picture: tap {', '.join(CORNERS)}, in this order"
        )
    corners = _through(homography_between(targets, points), _PICTURE)
    best = _best_fit(points, inset_share, np.full(4, True))
    if not is_convex(corners) or min(best.size_mm) < SMALLEST_SIDE_MM:
        raise CalibrationError(
            "the taps are too near to each other; tap the corners of the picture"
        )
    place = replace(
        _place(best, created_at),
        residual_mm=0.0,
        corners_mm=tuple((round(x, DIGITS), round(y, DIGITS)) for x, y in corners.tolist()),
    )
    place.require_on(surface_mm)
    return place


def fit_display(
    points_mm: FloatArray,
    surface_mm: tuple[float, float],
    inset_share: float,
    created_at: str,
) -> DisplayPlace:
    """Return where the picture lies whose corners were tapped at `points_mm` (4, 2).

    In the order of `CORNERS`; targets lie `inset_share` of the picture's sides inside its corners.
    Raises `CalibrationError` unless the taps are the corners of a rectangle along the sides of the
    surface: it says which corner is off, or by how much the picture is turned.
    """
    points = _four(points_mm)
    best = _best_fit(points, inset_share, np.full(4, True))
    if np.max(best.off_mm) > LARGEST_OFF_MM:
        raise CalibrationError(_explain(points, best, inset_share))
    if min(best.size_mm) < SMALLEST_SIDE_MM:
        raise CalibrationError(
            f"one side of the picture is but {abs(min(best.size_mm)):.0f} mm long, "
            f"{SMALLEST_SIDE_MM:.0f} mm at least are needed; tap the corners of the picture"
        )
    place = _place(best, created_at)
    place.require_on(surface_mm)
    return place


def _overhang_mm(corners: FloatArray, surface_mm: tuple[float, float]) -> float:
    """Return how far corners (N, 2) lie beyond a surface, below 0 if they do not."""
    return float(max(-corners.min(), *(corners.max(axis=0) - surface_mm)))


def _four(points_mm: FloatArray) -> FloatArray:
    points = np.asarray(points_mm, np.float64)
    if points.shape != (4, 2) or not np.isfinite(points).all():
        raise CalibrationError("four taps are needed, one on each corner of the picture")
    return points


def _through(homography: FloatArray, points: FloatArray) -> FloatArray:
    """Return the images of points (N, 2)."""
    images = np.column_stack([points, np.ones(len(points))]) @ homography.T
    return images[:, :2] / images[:, 2:]


def _place(best: "_Fit", created_at: str) -> DisplayPlace:
    return DisplayPlace(
        round(best.corner_mm[0], DIGITS),
        round(best.corner_mm[1], DIGITS),
        round(best.size_mm[0], DIGITS),
        round(best.size_mm[1], DIGITS),
        best.rotation_deg,
        best.mirror,
        created_at,
        round(best.rms_mm, DIGITS),
    )


@dataclass(frozen=True, slots=True)
class _Fit:
    """A rectangle laid through taps, with the distances (4,) of all taps from their targets."""

    corner_mm: tuple[float, float]
    size_mm: tuple[float, float]
    rotation_deg: Rotation
    mirror: bool
    off_mm: FloatArray

    @property
    def rms_mm(self) -> float:
        return float(np.sqrt(np.mean(self.off_mm**2)))


def _best_fit(points: FloatArray, inset_share: float, used: BoolArray) -> _Fit:
    """Return the fit of the picture that lies so that the used taps are nearest to its corners."""
    fits = (
        _fit(points, rotation_deg, mirror, inset_share, used)
        for rotation_deg, mirror in product(_ROTATIONS, (False, True))
    )
    return min(fits, key=lambda fit: float(np.max(fit.off_mm[used])))


def _fit(
    points: FloatArray, rotation_deg: Rotation, mirror: bool, inset_share: float, used: BoolArray
) -> _Fit:
    """Lay a rectangle through the used taps (4,), for a picture that lies in it so."""
    targets = _on_surface(inset_share + (1 - 2 * inset_share) * _PICTURE, rotation_deg, mirror)
    along = [np.stack([np.ones(4), targets[:, axis]], axis=1) for axis in (0, 1)]
    (left, width), (top, height) = (
        np.linalg.lstsq(rows[used], points[used, axis])[0].tolist()
        for axis, rows in enumerate(along)
    )
    fitted = [along[0] @ (left, max(width, 0.0)), along[1] @ (top, max(height, 0.0))]
    off_mm = np.linalg.norm(points - np.stack(fitted, axis=1), axis=1)
    return _Fit((left, top), (width, height), rotation_deg, mirror, off_mm)


def _on_surface(picture: FloatArray, rotation_deg: int, mirror: bool) -> FloatArray:
    """Return places of the picture in shares of the rectangle: mirrored, then turned clockwise."""
    x, y = picture[:, 0], picture[:, 1]
    if mirror:
        x = 1 - x
    for _ in range(rotation_deg // 90):
        x, y = 1 - y, x
    return np.stack([x, y], axis=1)


def _explain(points: FloatArray, best: _Fit, inset_share: float) -> str:
    """Say why the taps are no rectangle along the sides of the surface."""
    turn_rad = _turn_rad(points, best)
    straight = (points - points.mean(axis=0)) @ np.array(
        [[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]]
    )
    turned_back = _best_fit(straight, inset_share, np.full(4, True))
    if np.max(turned_back.off_mm) <= LARGEST_OFF_MM and abs(turn_rad) >= SMALLEST_TURN_RAD:
        direction = "clockwise" if turn_rad > 0 else "anticlockwise"
        return (
            f"the picture is turned {direction} by {abs(np.rad2deg(turn_rad)):.1f} degrees against "
            "the surface: straighten the display in the frame and tap again, or add --perspective"
        )
    without = [_best_fit(points, inset_share, np.arange(4) != corner) for corner in range(4)]
    agreement_mm = [
        float(np.max(np.delete(fit.off_mm, corner))) for corner, fit in enumerate(without)
    ]
    missed = int(np.argmin(agreement_mm))
    if agreement_mm[missed] <= LARGEST_OFF_MM:
        return (
            f"the tap on the {CORNERS[missed]} corner is {without[missed].off_mm[missed]:.0f} mm "
            f"from where the other three say that it is ({LARGEST_OFF_MM:g} mm are allowed): tap "
            "it again"
        )
    return (
        f"the taps are not the corners of a rectangle, they are off by up to "
        f"{np.max(best.off_mm):.0f} mm ({LARGEST_OFF_MM:g} mm are allowed): tap "
        f"{', '.join(CORNERS)}, in this order"
    )


def _turn_rad(points: FloatArray, best: _Fit) -> float:
    """Return by how much the picture is turned clockwise against how it lies in the best fit."""
    lying = _on_surface(_PICTURE, best.rotation_deg, best.mirror)
    sides = np.roll(points, -1, axis=0) - points
    as_fitted = np.roll(lying, -1, axis=0) - lying
    along = np.sum(sides * as_fitted, axis=1).sum()
    across = np.sum(as_fitted[:, 0] * sides[:, 1] - as_fitted[:, 1] * sides[:, 0])
    return float(np.arctan2(across, along))


class _DisplayFile(SealedFile):
    """Where a picture lies on the surface."""

    FORMAT: ClassVar[str] = "cornertouchd-display"
    VERSION: ClassVar[int] = 2
    OLDER: ClassVar[tuple[int, ...]] = (1,)

    format: Literal["cornertouchd-display"]
    version: Literal[1, 2]
    left_mm: _Place
    top_mm: _Place
    width_mm: _Length
    height_mm: _Length
    rotation_deg: Rotation
    mirror: bool
    created_at: str = Field(max_length=64)
    residual_mm: FiniteFloat = Field(ge=0.0)
    corners_mm: tuple[tuple[_Place, _Place], ...] | None = Field(
        None, min_length=4, max_length=4, strict=False
    )

    @field_validator("corners_mm")
    @classmethod
    def _refuse_what_is_no_picture(cls, corners: Corners | None) -> Corners | None:
        if corners is not None and not is_convex(np.array(corners)):
            raise ValueError("not the corners of a picture")
        return corners


def save_display(place: DisplayPlace, path: Path) -> None:
    """Write it atomically; one that stood there is kept as `NAME.previous`.

    Raises `CalibrationError` if the disk refuses; what stood there is then untouched.
    """
    content: dict[str, Any] = {
        "format": _DisplayFile.FORMAT,
        "version": _DisplayFile.VERSION,
        **asdict(place),
    }
    try:
        replace_file(path, seal(content))
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be written: {error.strerror}") from error


def load_display(path: Path) -> DisplayPlace:
    """Read where the picture lies.

    Raises `CalibrationError` naming the file, what is wrong and the remedy; `FileNotFoundError` if
    there is none.
    """
    try:
        content = read_bounded(path, REMEDY)
    except FileNotFoundError:
        raise
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    file = unseal(content, _DisplayFile, path, REMEDY)
    return DisplayPlace(
        file.left_mm,
        file.top_mm,
        file.width_mm,
        file.height_mm,
        file.rotation_deg,
        file.mirror,
        file.created_at,
        file.residual_mm,
        file.corners_mm,
    )
