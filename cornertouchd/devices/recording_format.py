"""What the files of a recording hold: recording.json, frames.csv and points.csv.

A recording is a directory with one grey video per camera (`recording_video`), a description
(recording.json), one row per picture (frames.csv) and, if somebody noted them, the places that
were touched (points.csv).  Keys and columns that are unknown are ignored.
"""

import csv
import math
from collections.abc import Collection, Generator, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from cornertouchd.calibration.calibration import LONGEST_IDENTITY
from cornertouchd.errors import ReportedError
from cornertouchd.model import PictureFormat

FORMAT: Literal["cornertouchd-recording"] = "cornertouchd-recording"
VERSION: Literal[1] = 1
DESCRIPTION_FILE = "recording.json"
FRAMES_FILE = "frames.csv"
POINTS_FILE = "points.csv"
FRAME_COLUMNS = ("camera", "index", "sequence", "captured_at_s", "lit_mask")
POINT_COLUMNS = ("set", "x_mm", "y_mm", "diameter_mm")
ALL_SIDES_LIT = 15


class RecordingError(ReportedError):
    """A recording cannot be read or written; the message names file, row and remedy."""


class _Entry(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", strict=True, allow_inf_nan=False)


class RecordedCamera(_Entry):
    """A camera of a recording and the video with its pictures; no identity: not known."""

    id: str = Field(min_length=1)
    file: str = Field(pattern=r"^[^/\x00]+$")
    width_px: int = Field(ge=1, le=65_536)
    height_px: int = Field(ge=1, le=65_536)
    row_offset_px: int = Field(ge=0)
    rows_px: int = Field(ge=1)
    identity: str = Field("", max_length=LONGEST_IDENTITY)

    @model_validator(mode="after")
    def _refuse_rows_below_the_image(self) -> Self:
        end_px = self.row_offset_px + self.rows_px
        if end_px > self.height_px:
            raise ValueError(f"its rows end at {end_px}, the image at {self.height_px}")
        return self

    @property
    def format(self) -> PictureFormat:
        """Size and rows of the camera's pictures."""
        return PictureFormat(self.width_px, self.height_px, self.row_offset_px, self.rows_px)


def _refuse_shared_names(cameras: tuple[RecordedCamera, ...]) -> tuple[RecordedCamera, ...]:
    for what in ("id", "file"):
        if len({getattr(camera, what) for camera in cameras}) < len(cameras):
            raise ValueError(f"two cameras have the same {what}")
    return cameras


_Length = Annotated[float, Field(gt=0.0)]


class Description(_Entry):
    """What recording.json says.  `complete` is False until the recording has been closed."""

    format: Literal["cornertouchd-recording"]
    version: Literal[1]
    complete: bool = True
    surface_mm: tuple[_Length, _Length]
    rate_hz: float = Field(gt=0.0)
    cameras: Annotated[tuple[RecordedCamera, ...], AfterValidator(_refuse_shared_names)] = Field(
        min_length=1
    )
    notes: str = ""


@dataclass(frozen=True, slots=True)
class FrameRow:
    """One row of frames.csv: when the picture `index` of `camera` was taken, and how lit."""

    camera: str
    index: int
    sequence: int
    captured_at_s: float
    lit_mask: int | None


@dataclass(frozen=True, slots=True)
class RecordedPoint:
    """A place that was touched in a frame set; the diameter is None if nobody knows it."""

    set: int
    x_mm: float
    y_mm: float
    diameter_mm: float | None


def read_description(directory: Path) -> Description:
    """Return what recording.json says.  Raises `RecordingError`."""
    path = directory / DESCRIPTION_FILE
    try:
        return Description.model_validate_json(path.read_bytes())
    except OSError as error:
        raise RecordingError(
            f"{path}: cannot be read: {error.strerror}; name the directory of a recording"
        ) from error
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in first["loc"])
        found = f"{key} = {first['input']!r:.60}: " if key and first["type"] != "missing" else ""
        missing = f"{key}: " if key and not found else ""
        raise RecordingError(
            f"{path}: {found or missing}{first['msg']}; correct the file or record anew"
        ) from error


def read_frame_rows(path: Path, cameras: Collection[str], *, cut_off: bool) -> Generator[FrameRow]:
    """Yield the rows of frames.csv in file order; of a file that is cut off, the whole ones.

    Raises `RecordingError` at the first row that does not parse, is of another camera, or does
    not follow on the camera's row before.
    """
    expected = dict.fromkeys(cameras, 0)
    for row in _rows(path, FRAME_COLUMNS, cut_off=cut_off):
        camera = row.text("camera")
        if camera not in expected:
            raise row.error("camera", f"must be one of {', '.join(cameras)}")
        if row.count("index") != expected[camera]:
            raise row.error("index", f"must be {expected[camera]}, the next picture of {camera}")
        expected[camera] += 1
        yield FrameRow(
            camera=camera,
            index=row.count("index"),
            sequence=row.count("sequence"),
            captured_at_s=row.number("captured_at_s"),
            lit_mask=row.count("lit_mask", ALL_SIDES_LIT) if row.text("lit_mask") else None,
        )


def read_points(path: Path) -> tuple[RecordedPoint, ...]:
    """Return the places of a points.csv in file order.

    Raises `RecordingError` at the first row that does not parse.
    """
    return tuple(
        RecordedPoint(
            set=row.count("set"),
            x_mm=row.number("x_mm"),
            y_mm=row.number("y_mm"),
            diameter_mm=row.number("diameter_mm") if row.text("diameter_mm") else None,
        )
        for row in _rows(path, POINT_COLUMNS, cut_off=False)
    )


@dataclass(frozen=True, slots=True)
class _Row:
    """One row of a table with its place for messages."""

    place: str
    values: Mapping[str, str]

    def text(self, column: str) -> str:
        return self.values[column].strip()

    def count(self, column: str, largest: int | None = None) -> int:
        text = self.text(column)
        # isdecimal refuses signs and what int() would forgive, such as underscores
        if not (text.isascii() and text.isdecimal() and len(text) <= 18):
            raise self.error(column, "must be a whole number, 0 or more")
        if largest is not None and int(text) > largest:
            raise self.error(column, f"must be at most {largest}")
        return int(text)

    def number(self, column: str) -> float:
        try:
            value = float(self.text(column))
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise self.error(column, "must be a number")
        return value

    def error(self, column: str, bound: str) -> RecordingError:
        return RecordingError(
            f"{self.place}: {column} = {self.text(column)!r:.60}: {bound}; correct the row"
        )


def _rows(path: Path, columns: tuple[str, ...], *, cut_off: bool) -> Iterator[_Row]:
    try:
        # Spreadsheets put a byte order mark in front; "utf-8-sig" takes files with and without.
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(_whole_lines(file) if cut_off else file, strict=True)
            first = next(reader, None)
            if first is None and cut_off:
                return
            header = [name.strip() for name in first or []]
            missing = [column for column in columns if column not in header]
            if missing:
                raise RecordingError(
                    f"{path}: line 1: no column {missing[0]!r}; must be {','.join(columns)}"
                )
            for number, values in enumerate((row for row in reader if row), start=1):
                place = f"{path}: row {number} (line {reader.line_num})"
                if len(values) < len(header):
                    raise RecordingError(
                        f"{place}: {len(values)} values for {len(header)} columns; correct the row"
                    )
                yield _Row(place, dict(zip(header, values, strict=False)))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise RecordingError(f"{path}: is not UTF-8 at byte {error.start}") from error
    except csv.Error as error:
        raise RecordingError(f"{path}: line {reader.line_num}: {error}; correct it") from error


def _whole_lines(lines: Iterable[str]) -> Iterator[str]:
    """Yield the lines that end; one without an end was cut off while it was written."""
    return (line for line in lines if line.endswith("\n"))
