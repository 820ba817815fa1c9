"""The calibration file: versioned JSON, written atomically, refused when it is not whole."""

import base64
import struct
from dataclasses import asdict
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cornertouchd.calibration.atomic_file import previous_of, replace_file, roll_back_file
from cornertouchd.calibration.calibration import (
    Calibration,
    CalibrationError,
    CameraCalibration,
    Model,
)
from cornertouchd.calibration.error_map import ErrorMap
from cornertouchd.calibration.file_schema import (
    AnglePolynomialEntry,
    CalibrationFile,
    CameraEntry,
    ErrorMapEntry,
    LookupTableEntry,
    ProjectionEntry,
)
from cornertouchd.calibration.heights import heights_of_empty
from cornertouchd.calibration.sealed_json import read_bounded, seal, unseal
from cornertouchd.locating.angle_polynomial import AnglePolynomial
from cornertouchd.locating.height_table import Heights
from cornertouchd.locating.lookup_table import LookupTable
from cornertouchd.locating.reconstruction import BoardLens, Reconstruction
from cornertouchd.locating.vanishing_point import Projection
from cornertouchd.model import FloatArray, PictureFormat

GREY_SCALE = 256
"""The mean empty picture is kept in 1/256 grey levels, as a 16-bit PNG that any viewer shows."""

ERROR_DIGITS = 4
"""Expected errors and residuals are estimates; a tenth of a micrometre is more than they are."""

WITH_HEIGHTS = 3
"""From this version on a file has heights."""

ANEW = "run `cornertouchd calibrate`"
REMEDY = f"{ANEW}, or `cornertouchd calibrate --rollback` for the one before"


def same_calibration(one: Calibration, other: Calibration) -> bool:
    """Tell whether two calibrations would be saved as the same file."""
    return one is other or seal(_to_file(one)) == seal(_to_file(other))


def save_calibration(calibration: Calibration, path: Path) -> None:
    """Write the calibration atomically; one that stood there is kept as `NAME.previous`.

    Raises `CalibrationError` if it could not be read again, or the disk refuses; what stood there
    is then untouched.
    """
    content = seal(_to_file(calibration))
    _from_bytes(content, path, ANEW)
    try:
        replace_file(path, content)
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be written: {error.strerror}") from error


def load_calibration(path: Path) -> Calibration:
    """Read a calibration.  Raises `CalibrationError` naming the file, what is wrong, the remedy."""
    try:
        content = read_bounded(path, REMEDY)
    except FileNotFoundError:
        raise CalibrationError(f"{path}: no calibration is there; {ANEW}") from None
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be read: {error.strerror}") from error
    return _from_bytes(content, path, REMEDY)


def rollback_calibration(path: Path) -> Calibration:
    """Put the former calibration in force and keep the one it replaces as the previous one.

    A second rollback undoes the first.  Returns what is in force now.  Raises `CalibrationError` if
    there is no former one or it is not whole; nothing is changed then.
    """
    previous = previous_of(path)
    try:
        roll_back_file(path, lambda content: _from_bytes(content, previous, ANEW))
    except FileNotFoundError:
        raise CalibrationError(f"{previous}: no former calibration is there; {ANEW}") from None
    except OSError as error:
        raise CalibrationError(f"{path}: cannot be rolled back: {error.strerror}") from error
    return load_calibration(path)


def _to_file(calibration: Calibration) -> dict[str, Any]:
    expected = calibration.expected
    return {
        "format": CalibrationFile.FORMAT,
        "version": CalibrationFile.VERSION,
        "method": calibration.method,
        "created_at": calibration.created_at,
        "software": calibration.software,
        "surface_mm": list(calibration.surface_mm),
        "reference_points": calibration.reference_points,
        "scribble_points": calibration.scribble_points,
        "dropped": calibration.dropped,
        "residual_mm": _rounded(calibration.residual_mm),
        "expected": {
            "x_mm": expected.x_mm.tolist(),
            "y_mm": expected.y_mm.tolist(),
            "errors_mm": [_without_nan(row) for row in expected.errors_mm.round(ERROR_DIGITS)],
        },
        "cameras": [
            {
                "id": camera.id,
                "identity": camera.identity,
                "picture": {
                    "width_px": camera.format.width_px,
                    "height_px": camera.format.height_px,
                    "row_offset_px": camera.format.row_offset_px,
                    "rows_px": camera.format.rows_px,
                },
                "model": _model_to_file(camera.model),
                "residual_mm": _rounded(camera.residual_mm),
                "heights": None if camera.heights is None else asdict(camera.heights),
                "empty_png": _to_png(camera.empty),
            }
            for camera in calibration.cameras
        ],
    }


def _model_to_file(model: Model) -> dict[str, Any]:
    if isinstance(model, AnglePolynomial):
        return {
            "kind": "angle-polynomial",
            "position_mm": model.position_mm,
            "coefficients_rad": model.coefficients_rad,
        }
    if isinstance(model, Projection):
        return {"kind": "projection", "matrix": model.matrix, "towards_mm": model.towards_mm}
    if isinstance(model, LookupTable):
        return {
            "kind": "lookup-table",
            "position_mm": model.position_mm,
            "points_mm": model.points_mm,
            "columns_px": _without_nan(np.array(model.columns_px)),
        }
    return {
        "kind": "reconstruction",
        "position_mm": model.position_mm,
        "rotation": model.rotation,
        "lens": {
            "kind": model.lens.kind,
            "focal_px": model.lens.focal_px,
            "centre_px": model.lens.centre_px,
            "distortion": model.lens.distortion,
        },
    }


def _from_bytes(content: bytes, path: Path, remedy: str) -> Calibration:
    file = unseal(content, CalibrationFile, path, remedy)
    try:
        cameras = tuple(_camera_from_file(camera, file) for camera in file.cameras)
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}; {remedy}") from None
    return Calibration(
        method=file.method,
        created_at=file.created_at,
        software=file.software,
        surface_mm=file.surface_mm,
        reference_points=file.reference_points,
        scribble_points=file.scribble_points,
        dropped=file.dropped,
        residual_mm=_known(file.residual_mm),
        expected=_map_from_file(file.expected),
        cameras=cameras,
    )


def _map_from_file(entry: ErrorMapEntry) -> ErrorMap:
    errors_mm = np.array([_with_nan(row) for row in entry.errors_mm])
    return ErrorMap(np.array(entry.x_mm), np.array(entry.y_mm), errors_mm)


def _camera_from_file(camera: CameraEntry, file: CalibrationFile) -> CameraCalibration:
    picture = camera.picture
    size = PictureFormat(
        picture.width_px, picture.height_px, picture.row_offset_px, picture.rows_px
    )
    empty = _from_png(camera.empty_png, size)
    if empty is None:
        raise CalibrationError(f"camera {camera.id}: its empty picture is damaged")
    model = _model_from_file(camera, size.width_px)
    if file.version < WITH_HEIGHTS:
        heights = heights_of_empty(camera.id, empty, model, file.surface_mm)
    else:
        heights = Heights(**dict(camera.heights)) if camera.heights else None
    return CameraCalibration(
        camera.id, camera.identity, size, empty, model, _known(camera.residual_mm), heights
    )


def _model_from_file(camera: CameraEntry, width_px: int) -> Model:
    model = camera.model
    if isinstance(model, AnglePolynomialEntry):
        return AnglePolynomial(model.position_mm, model.coefficients_rad, width_px)
    if isinstance(model, ProjectionEntry):
        return Projection(model.matrix, model.towards_mm)
    if isinstance(model, LookupTableEntry):
        return LookupTable(model.position_mm, model.points_mm, _with_nan(model.columns_px))
    lens = BoardLens(
        model.lens.kind, model.lens.focal_px, model.lens.centre_px, model.lens.distortion
    )
    return Reconstruction(model.position_mm, model.rotation, lens, width_px)


def _rounded(residual_mm: float) -> float | None:
    return None if np.isnan(residual_mm) else round(residual_mm, ERROR_DIGITS)


def _known(value: float | None) -> float:
    return np.nan if value is None else value


def _without_nan(values: FloatArray) -> list[float | None]:
    return [value if np.isfinite(value) else None for value in values.tolist()]


def _with_nan(values: tuple[float | None, ...]) -> tuple[float, ...]:
    return tuple(_known(value) for value in values)


def _to_png(empty: FloatArray) -> str:
    levels = np.clip(np.rint(empty * GREY_SCALE), 0, 65535).astype(np.uint16)
    _, png = cv2.imencode(".png", levels)
    return base64.b64encode(png.tobytes()).decode()


def _from_png(text: str, size: PictureFormat) -> FloatArray | None:
    """Return the picture, None if it is none or has another size; that is seen before decoding."""
    try:
        png = base64.b64decode(text, validate=True)
        width_px, rows_px = struct.unpack_from(">II", png, 16)  # IHDR is always the first chunk
        if (width_px, rows_px) != (size.width_px, size.rows_px):
            return None
        levels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_UNCHANGED)
    except (ValueError, struct.error, cv2.error):
        return None
    if levels is None or levels.dtype != np.uint16 or levels.shape != (rows_px, width_px):
        return None
    return levels.astype(np.float64) / GREY_SCALE
