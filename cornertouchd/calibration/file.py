"""The calibration file: versioned JSON, written atomically, refused when it is not whole."""

import base64
import contextlib
import json
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal

import cv2
import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    CameraCalibration,
    Method,
)
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.vanishing_point import Projection
from cornertouchd.model import FloatArray, PictureFormat

FORMAT = "cornertouchd-calibration"
VERSION = 1

SMALLEST_DETERMINANT = 1e-12
"""A projection is normalised; under this it maps the surface to a point."""

GREY_SCALE = 256
"""The mean empty picture is kept in 1/256 grey levels, as a 16-bit PNG that any viewer shows."""

_Place = Annotated[FiniteFloat, Field(ge=-100_000.0, le=100_000.0)]
_Side = Annotated[FiniteFloat, Field(ge=20.0, le=100_000.0)]
_Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
_Point = tuple[_Place, _Place]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=False)


class _Picture(_Part):
    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    row_offset_px: int = Field(ge=0)
    rows_px: int = Field(gt=0)


class _AnglePolynomial(_Part):
    kind: Literal["angle-polynomial"] = "angle-polynomial"
    position_mm: _Point
    coefficients_rad: tuple[FiniteFloat, ...] = Field(min_length=2)


class _Projection(_Part):
    kind: Literal["projection"] = "projection"
    matrix: tuple[_Row, _Row]
    towards_mm: _Point


class _Camera(_Part):
    id: str
    picture: _Picture
    model: Annotated[_AnglePolynomial | _Projection, Field(discriminator="kind")]
    residual_mm: FiniteFloat
    empty_png: str


class _File(_Part):
    format: Literal["cornertouchd-calibration"] = "cornertouchd-calibration"
    version: Literal[1] = 1
    method: Method
    created_at: str
    software: str
    surface_mm: tuple[_Side, _Side]
    reference_points: int
    residual_mm: FiniteFloat
    cameras: tuple[_Camera, ...] = Field(min_length=2)


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write the calibration atomically; one that stood there is kept as `NAME.previous`.

    Raises `CalibrationError` if the disk refuses; what stood there is then untouched.
    """
    content = _to_file(calibration).model_dump_json(indent=1) + "\n"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.exists():
            _replace(path.with_name(path.name + ".previous"), path.read_bytes())
        _replace(path, content.encode())
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be written: {error.strerror}") from error


def load_calibration(path: Path) -> Calibration:
    """Read a calibration.  Raises `CalibrationError` naming the file, what is wrong, the remedy."""
    remedy = "run `cornertouchd calibrate`"
    try:
        raw = json.loads(path.read_text())
    except FileNotFoundError:
        raise CalibrationError(f"{path}: no calibration is there; {remedy}") from None
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise CalibrationError(
            f"{path}: not a whole JSON file ({error}); restore {path.name}.previous or {remedy}"
        ) from None
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise CalibrationError(f"{path}: not a cornertouchd calibration; {remedy}")
    if raw.get("version") != VERSION:
        raise CalibrationError(
            f"{path}: version {raw.get('version')!r}, this software reads {VERSION}; {remedy}"
        )
    try:
        return _from_file(_File.model_validate(raw))
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise CalibrationError(f"{path}: {place}: {first['msg']}; {remedy}") from None
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}; {remedy}") from None


def _replace(path: Path, content: bytes) -> None:
    """Put `content` at `path` so that a power cut leaves the old or the new file, whole."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fchmod(file.fileno(), 0o644)
            os.fsync(file.fileno())
        Path(name).replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            Path(name).unlink()
        raise
    directory = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(directory)
    finally:
        os.close(directory)


def _to_file(calibration: Calibration) -> _File:
    return _File(
        method=calibration.method,
        created_at=calibration.created_at,
        software=calibration.software,
        surface_mm=calibration.surface_mm,
        reference_points=calibration.reference_points,
        residual_mm=round(calibration.residual_mm, 4),
        cameras=tuple(
            _Camera(
                id=camera.id,
                picture=_Picture(
                    width_px=camera.format.width_px,
                    height_px=camera.format.height_px,
                    row_offset_px=camera.format.row_offset_px,
                    rows_px=camera.format.rows_px,
                ),
                model=_MODEL_TO_FILE[type(camera.model)](camera.model),
                residual_mm=round(camera.residual_mm, 4),
                empty_png=_to_png(camera.empty),
            )
            for camera in calibration.cameras
        ),
    )


def _from_file(file: _File) -> Calibration:
    return Calibration(
        method=file.method,
        created_at=file.created_at,
        software=file.software,
        surface_mm=file.surface_mm,
        reference_points=file.reference_points,
        residual_mm=file.residual_mm,
        cameras=tuple(_camera_from_file(camera) for camera in file.cameras),
    )


def _camera_from_file(camera: _Camera) -> CameraCalibration:
    picture = camera.picture
    size = PictureFormat(
        picture.width_px, picture.height_px, picture.row_offset_px, picture.rows_px
    )
    model: AnglePolynomial | Projection
    if isinstance(camera.model, _AnglePolynomial):
        model = AnglePolynomial(
            camera.model.position_mm, camera.model.coefficients_rad, size.width_px
        )
    else:
        model = Projection(camera.model.matrix, camera.model.towards_mm)
        if abs(np.linalg.det(np.array(camera.model.matrix)[:, :2])) < SMALLEST_DETERMINANT:
            raise CalibrationError(f"camera {camera.id}: its projection is singular")
    empty = _from_png(camera.empty_png)
    if empty is None or empty.shape != (size.rows_px, size.width_px):
        raise CalibrationError(f"camera {camera.id}: its empty picture is damaged")
    return CameraCalibration(camera.id, size, empty, model, camera.residual_mm)


def _angle_polynomial_to_file(model: AnglePolynomial) -> _AnglePolynomial:
    return _AnglePolynomial(position_mm=model.position_mm, coefficients_rad=model.coefficients_rad)


def _projection_to_file(model: Projection) -> _Projection:
    return _Projection(matrix=model.matrix, towards_mm=model.towards_mm)


_MODEL_TO_FILE: dict[type, Callable[..., _AnglePolynomial | _Projection]] = {
    AnglePolynomial: _angle_polynomial_to_file,
    Projection: _projection_to_file,
}


def _to_png(empty: FloatArray) -> str:
    levels = np.clip(np.rint(empty * GREY_SCALE), 0, 65535).astype(np.uint16)
    _, png = cv2.imencode(".png", levels)
    return base64.b64encode(png.tobytes()).decode()


def _from_png(text: str) -> FloatArray | None:
    try:
        data = np.frombuffer(base64.b64decode(text, validate=True), np.uint8)
        levels = cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except (ValueError, cv2.error):
        return None
    if levels is None or levels.dtype != np.uint16 or levels.ndim != 2:
        return None
    return levels.astype(np.float64) / GREY_SCALE
