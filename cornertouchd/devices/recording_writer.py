"""Recordings written, so that a crash or a full disk costs the last moment only."""

import csv
import math
import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType, TracebackType
from typing import Self

import cv2
import numpy as np
from pydantic import ValidationError

from cornertouchd.devices.recording_format import (
    ALL_SIDES_LIT,
    DESCRIPTION_FILE,
    FORMAT,
    FRAME_COLUMNS,
    FRAMES_FILE,
    VERSION,
    Description,
    RecordedCamera,
    RecordingError,
)
from cornertouchd.devices.recording_video import inspect_video, open_video_writer
from cornertouchd.model import Frame, PictureFormat

# OpenCV does not tell when a video cannot be written, so a recording ends while there is room
# for what its videos still hold in memory (less than 1 MiB each) and for other programs.
LEAST_FREE_BYTES = 16 * 2**20

NOT_KNOWN: Mapping[str, str] = MappingProxyType({})


class RecordingWriter:
    """Writes a recording frame set by frame set, in one thread.

    A crash costs what the videos hold in memory (see `open_video_writer`): with pictures of
    640x64 the last 30 frame sets or less.  The recording then ends with the last frame set that
    is whole.  All methods raise `RecordingError` if something cannot be recorded.
    """

    def __init__(
        self,
        directory: Path,
        surface_mm: tuple[float, float],
        rate_hz: float,
        formats: Mapping[str, PictureFormat],
        notes: str = "",
        identities: Mapping[str, str] = NOT_KNOWN,
    ) -> None:
        self._directory = directory
        self._description = _describe(directory, surface_mm, rate_hz, formats, notes, identities)
        self._frame_sets = 0
        self._failed = False
        self._closed = False
        self._make_empty_directory()
        self._check_room()
        with ExitStack() as opening:
            self._videos: dict[str, cv2.VideoWriter] = {}
            for camera in self._description.cameras:
                path = directory / camera.file
                self._videos[camera.id] = open_video_writer(path, camera.format, rate_hz)
                opening.callback(self._videos[camera.id].release)
            try:
                # Line by line, so that frames.csv is never behind the videos on the disk.
                rows_file = (directory / FRAMES_FILE).open(
                    "w", encoding="utf-8", newline="", buffering=1
                )
                self._rows = csv.writer(opening.enter_context(rows_file), lineterminator="\n")
                self._rows.writerow(FRAME_COLUMNS)
                _write_description(directory, self._description)
            except OSError as error:
                raise self._failure(error) from error
            self._files = opening.pop_all()

    def write(self, frame_set: Sequence[Frame]) -> None:
        """Append the frames of one instant, one of each camera."""
        frames = self._by_camera(frame_set)
        self._check_room()
        try:
            for name, frame in frames.items():
                self._videos[name].write(frame.pixels)
            for name, frame in frames.items():
                self._rows.writerow(self._row(name, frame))
        except OSError as error:
            raise self._failure(error) from error
        self._frame_sets += 1

    def close(self) -> None:
        """End the recording and mark it as complete, if all that was written is really there.

        May be called twice.
        """
        if self._closed:
            return
        self._closed = True
        try:
            self._files.close()
            if not self._failed:
                self._check_videos()
                self._mark_complete()
        except OSError as error:
            if not self._failed:
                raise self._failure(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def _make_empty_directory(self) -> None:
        try:
            self._directory.mkdir(parents=True, exist_ok=True)
            occupied = any(self._directory.iterdir())
        except OSError as error:
            raise self._failure(error) from error
        if occupied:
            raise RecordingError(
                f"{self._directory}: is not empty; name a new directory for the recording"
            )

    def _check_room(self) -> None:
        try:
            free_bytes = shutil.disk_usage(self._directory).free
        except OSError as error:
            raise self._failure(error) from error
        if free_bytes < LEAST_FREE_BYTES:
            self._failed = True
            raise RecordingError(
                f"{self._directory}: the disk is full, {free_bytes} bytes are free, must be "
                f"{LEAST_FREE_BYTES}; make room or record elsewhere"
            )

    def _by_camera(self, frame_set: Sequence[Frame]) -> dict[str, Frame]:
        """Return the frames in the order of the cameras, all checked before any is written."""
        if self._failed or self._closed:
            raise RecordingError(f"{self._directory}: the recording has ended; start another one")
        given = sorted(frame.camera for frame in frame_set)
        if given != sorted(self._videos):
            raise RecordingError(
                f"{self._directory}: frame set {self._frame_sets}: frames of {given}, must be one "
                f"of each of {sorted(self._videos)}"
            )
        frames = {frame.camera: frame for frame in frame_set}
        for camera in self._description.cameras:
            _check_frame(self._directory / camera.file, camera.format, frames[camera.id])
        return {camera.id: frames[camera.id] for camera in self._description.cameras}

    def _row(self, name: str, frame: Frame) -> tuple[str, int, int, float, int | str]:
        lit_mask = "" if frame.lit_mask is None else frame.lit_mask
        return name, self._frame_sets, frame.sequence, float(frame.captured_at_s), lit_mask

    def _check_videos(self) -> None:
        for camera in self._description.cameras:
            path = self._directory / camera.file
            video = inspect_video(path)
            there = video.pictures if video else 0
            if there != self._frame_sets:
                raise RecordingError(
                    f"{path}: only {there} of {self._frame_sets} pictures could be written; is the "
                    "disk full or the size of files limited? make room and record anew"
                )

    def _mark_complete(self) -> None:
        for name in (FRAMES_FILE, *(camera.file for camera in self._description.cameras)):
            _sync(self._directory / name)
        complete = self._description.model_copy(update={"complete": True})
        _write_description(self._directory, complete)

    def _failure(self, error: OSError) -> RecordingError:
        self._failed = True
        return RecordingError(
            f"{error.filename or self._directory}: cannot be written: {error.strerror}; "
            "check permissions and room on the disk"
        )


def _describe(
    directory: Path,
    surface_mm: tuple[float, float],
    rate_hz: float,
    formats: Mapping[str, PictureFormat],
    notes: str,
    identities: Mapping[str, str],
) -> Description:
    try:
        return Description(
            format=FORMAT,
            version=VERSION,
            complete=False,
            surface_mm=surface_mm,
            rate_hz=rate_hz,
            cameras=tuple(
                _recorded(name, form, identities.get(name, "")) for name, form in formats.items()
            ),
            notes=notes,
        )
    except ValidationError as error:
        raise RecordingError(f"{directory}: cannot record: {error}") from error


def _recorded(name: str, form: PictureFormat, identity: str) -> RecordedCamera:
    return RecordedCamera(
        id=name,
        file=f"{name.lower()}.mkv",
        width_px=form.width_px,
        height_px=form.height_px,
        row_offset_px=form.row_offset_px,
        rows_px=form.rows_px,
        identity=identity,
    )


def _check_frame(path: Path, form: PictureFormat, frame: Frame) -> None:
    pixels = frame.pixels
    if pixels.shape != (form.rows_px, form.width_px) or pixels.dtype != np.uint8:
        raise RecordingError(
            f"{path}: a picture is {pixels.shape} {pixels.dtype}, must be "
            f"({form.rows_px}, {form.width_px}) uint8"
        )
    if not math.isfinite(frame.captured_at_s) or frame.sequence < 0:
        raise RecordingError(
            f"{path}: captured_at_s = {frame.captured_at_s}, sequence = {frame.sequence}: must be "
            "a finite time and a number from 0"
        )
    if frame.lit_mask is not None and not 0 <= frame.lit_mask <= ALL_SIDES_LIT:
        raise RecordingError(
            f"{path}: lit_mask = {frame.lit_mask}: must be from 0 to {ALL_SIDES_LIT}"
        )


def _write_description(directory: Path, description: Description) -> None:
    """Replace recording.json in one step, so that a crash leaves the old or the new one."""
    new = directory / f"{DESCRIPTION_FILE}.new"
    new.write_text(description.model_dump_json(indent=1) + "\n", encoding="utf-8")
    _sync(new)
    new.replace(directory / DESCRIPTION_FILE)


def _sync(path: Path) -> None:
    """Return when what was written to a file has arrived on the disk."""
    with path.open("rb") as file:
        os.fsync(file.fileno())
