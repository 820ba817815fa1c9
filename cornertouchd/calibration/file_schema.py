"""What a calibration file may hold, key by key."""

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from cornertouchd.calibration.calibration import LONGEST_IDENTITY, Method
from cornertouchd.calibration.sealed_json import SealedFile

SMALLEST_DETERMINANT = 1e-12
"""A projection is normalised; under this it maps the surface to a point."""

LARGEST_SKEW = 1e-3
"""Rotations are written with all their digits; rows further from square than this are no axes."""

DISTORTION_TERMS = {"pinhole": 8, "fisheye": 4}
"""How many coefficients a lens of each kind has."""

_Place = Annotated[FiniteFloat, Field(ge=-100_000.0, le=100_000.0)]
_Column = Annotated[FiniteFloat, Field(ge=-100_000.0, le=100_000.0)]
_Side = Annotated[FiniteFloat, Field(ge=20.0, le=100_000.0)]
_Millimetres = Annotated[FiniteFloat, Field(ge=0.0)]
_Count = Annotated[int, Field(ge=0)]
_Height = Annotated[FiniteFloat, Field(ge=-1000.0, le=1000.0)]
_Focal = Annotated[FiniteFloat, Field(gt=0.0)]
_Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
_Point = tuple[_Place, _Place]
_Axis = Annotated[tuple[_Place, ...], Field(min_length=1, max_length=1000)]


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class PictureEntry(_Part):
    """The full image of a camera, and the band of its rows that is used."""

    model_config = ConfigDict(title="Picture")

    width_px: int = Field(ge=1, le=8192)
    height_px: int = Field(ge=1, le=8192)
    row_offset_px: int = Field(ge=0, description="First row of the band.")
    rows_px: int = Field(ge=1, description="Rows of the band.")

    @model_validator(mode="after")
    def _refuse_rows_below_the_image(self) -> Self:
        end_px = self.row_offset_px + self.rows_px
        if end_px > self.height_px:
            raise ValueError(f"its rows end at {end_px}, the image at {self.height_px}")
        return self


class AnglePolynomialEntry(_Part):
    """Method auto: angle = sum of a_k w^k, w = (column - width/2) / (width/2)."""

    model_config = ConfigDict(title="Angle polynomial")

    kind: Literal["angle-polynomial"]
    position_mm: _Point = Field(description="The projection centre on the surface.")
    coefficients_rad: tuple[FiniteFloat, ...] = Field(
        min_length=2, max_length=32, description="a_0, a_1, ...: angles from +x towards +y."
    )


class ProjectionEntry(_Part):
    """Method vanishing-point: s (column, 1) = P (x, y, 1)."""

    model_config = ConfigDict(title="Projection")

    kind: Literal["projection"]
    matrix: tuple[_Row, _Row] = Field(description="P, row by row.")
    towards_mm: _Point = Field(description="A place that the camera sees.")

    @model_validator(mode="after")
    def _refuse_singular(self) -> Self:
        if abs(np.linalg.det(np.array(self.matrix)[:, :2])) < SMALLEST_DETERMINANT:
            raise ValueError("the projection is singular")
        return self


class LookupTableEntry(_Part):
    """Method lookup-table: at which column the camera sees which reference point."""

    model_config = ConfigDict(title="Lookup table")

    kind: Literal["lookup-table"]
    position_mm: _Point = Field(description="The projection centre on the surface.")
    points_mm: tuple[_Point, ...] = Field(
        min_length=2, max_length=10_000, description="The reference points along the far sides."
    )
    columns_px: tuple[_Column | None, ...] = Field(
        min_length=2, max_length=10_000, description="Their columns; null where a point is unseen."
    )

    @model_validator(mode="after")
    def _refuse_odd_ends(self) -> Self:
        if len(self.points_mm) != len(self.columns_px):
            raise ValueError(f"{len(self.points_mm)} points, {len(self.columns_px)} columns")
        return self


class LensEntry(_Part):
    """Intrinsics as OpenCV calibrates them."""

    model_config = ConfigDict(title="Lens")

    kind: Literal["pinhole", "fisheye"]
    focal_px: tuple[_Focal, _Focal] = Field(description="Focal length along columns and rows.")
    centre_px: tuple[_Column, _Column] = Field(description="Principal point, column and row.")
    distortion: tuple[FiniteFloat, ...] = Field(
        description="pinhole: k1 k2 p1 p2 k3 k4 k5 k6; fisheye: k1 k2 k3 k4."
    )

    @model_validator(mode="after")
    def _refuse_odd_terms(self) -> Self:
        allowed = DISTORTION_TERMS[self.kind]
        if len(self.distortion) != allowed:
            raise ValueError(
                f"{len(self.distortion)} distortion terms; a {self.kind} lens has {allowed}"
            )
        return self


class ReconstructionEntry(_Part):
    """Method reconstruction: a camera with lens and pose."""

    model_config = ConfigDict(title="Reconstruction")

    kind: Literal["reconstruction"]
    position_mm: _Point = Field(description="The projection centre on the surface.")
    rotation: tuple[_Row, _Row, _Row] = Field(
        description="The camera's axes right, down, forward in surface coordinates."
    )
    lens: LensEntry

    @model_validator(mode="after")
    def _refuse_skew_axes(self) -> Self:
        rows = np.array(self.rotation)
        off = np.abs(rows @ rows.T - np.eye(3)).max()
        if not off <= LARGEST_SKEW:
            raise ValueError("the rotation's rows are not three axes at right angles")
        return self


class HeightsEntry(_Part):
    """What the strip tells of heights; w = (column - width/2) / (width/2)."""

    model_config = ConfigDict(title="Heights")

    camera_mm: _Height = Field(description="Height of the camera above the surface.")
    strip_top_mm: _Height = Field(description="Height of the strip's upper end.")
    horizon_px: _Row = Field(
        description="Row on which rays run level: coefficients of 1, w and w squared."
    )
    shear: tuple[FiniteFloat, FiniteFloat] = Field(
        description="Columns by which an upright line moves right for each row down: coefficients "
        "of 1 and w."
    )
    residual_px: _Millimetres = Field(description="RMS by which the strip's rows are off.")
    camera_sigma_mm: _Millimetres = Field(description="Standard deviation of the first.")
    strip_top_sigma_mm: _Millimetres = Field(description="Standard deviation of the second.")


class CameraEntry(_Part):
    """One camera in its place."""

    model_config = ConfigDict(title="Camera")

    id: str = Field(min_length=1, max_length=32, description="C1, C2, ...")
    identity: str = Field(
        max_length=LONGEST_IDENTITY,
        description="Tells this very camera from others; empty if unknown.",
    )
    picture: PictureEntry
    model: Annotated[
        AnglePolynomialEntry | LookupTableEntry | ProjectionEntry | ReconstructionEntry,
        Field(discriminator="kind"),
    ]
    residual_mm: _Millimetres | None = Field(
        description="RMS distance of directing lines from touches at known places, of all if none "
        "was; null where there is none to go by."
    )
    heights: HeightsEntry | None = Field(
        None, description="Null where the strip does not tell them."
    )
    empty_png: str = Field(
        description="Mean picture of the empty surface, in 1/256 grey levels: a 16-bit PNG, base64."
    )


class ErrorMapEntry(_Part):
    """Expected RMS error of a touch at a grid of places."""

    model_config = ConfigDict(title="Error map")

    x_mm: _Axis
    y_mm: _Axis
    errors_mm: tuple[tuple[_Millimetres | None, ...], ...] = Field(
        description="Row by row, one row for each y; null where a touch cannot be located."
    )

    @model_validator(mode="after")
    def _refuse_other_shapes(self) -> Self:
        widths = {len(row) for row in self.errors_mm}
        if len(self.errors_mm) != len(self.y_mm) or widths != {len(self.x_mm)}:
            raise ValueError(f"errors_mm must be {len(self.y_mm)} rows of {len(self.x_mm)}")
        return self


class CalibrationFile(SealedFile):
    """What is known about an installed rig."""

    model_config = ConfigDict(title="cornertouchd calibration")

    FORMAT: ClassVar[str] = "cornertouchd-calibration"
    VERSION: ClassVar[int] = 3
    OLDER: ClassVar[tuple[int, ...]] = (2,)

    format: Literal["cornertouchd-calibration"]
    version: Literal[2, 3] = Field(
        description="2 had no heights: these are measured anew from the empty pictures."
    )
    method: Method = Field(description="How the cameras were calibrated.")
    created_at: str = Field(max_length=64, description="UTC, ISO 8601.")
    software: str = Field(max_length=64, description="Version of cornertouchd that wrote it.")
    surface_mm: tuple[_Side, _Side] = Field(description="Width and height of the surface.")
    reference_points: _Count = Field(description="Touches at known places.")
    scribble_points: _Count = Field(description="Touches at unknown places.")
    dropped: _Count = Field(description="Views of single cameras that did not fit.")
    residual_mm: _Millimetres | None = Field(
        description="RMS over all cameras of their residuals; null where there are none."
    )
    expected: ErrorMapEntry
    cameras: tuple[CameraEntry, ...] = Field(min_length=2, max_length=8)

    @model_validator(mode="after")
    def _refuse_shared_ids(self) -> Self:
        if len({camera.id for camera in self.cameras}) < len(self.cameras):
            raise ValueError("two cameras have the same id")
        return self


def calibration_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of the calibration file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **CalibrationFile.model_json_schema(),
    }
