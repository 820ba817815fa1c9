"""Recordings read back: frame set by frame set, exactly as they were taken."""

from collections import Counter
from collections.abc import Generator, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

from cornertouchd.devices.recording_format import (
    DESCRIPTION_FILE,
    FRAMES_FILE,
    POINTS_FILE,
    Description,
    FrameRow,
    RecordedCamera,
    RecordedPoint,
    RecordingError,
    read_description,
    read_frame_rows,
    read_points,
)
from cornertouchd.devices.recording_video import inspect_video, missing_bytes, read_pictures
from cornertouchd.model import Frame, PictureFormat

__all__ = ["RecordedPoint", "Recording", "RecordingError", "open_recording", "read_points"]


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording that has been checked; `len` is its number of frame sets.

    Iterating yields frame set k, which is the frames with index k, in the order of the cameras.
    It holds one frame set in memory at a time and may be done again.
    """

    directory: Path
    description: Description
    points: tuple[RecordedPoint, ...]
    frame_sets: int

    @property
    def surface_mm(self) -> tuple[float, float]:
        """Width and height of the surface."""
        return self.description.surface_mm

    @property
    def rate_hz(self) -> float:
        """Frame sets per second."""
        return self.description.rate_hz

    @property
    def formats(self) -> dict[str, PictureFormat]:
        """Size and rows of the pictures by camera."""
        return {camera.id: camera.format for camera in self.description.cameras}

    @property
    def identities(self) -> dict[str, str]:
        """What tells each camera from others of its kind, empty where that is not known."""
        return {camera.id: camera.identity for camera in self.description.cameras}

    @property
    def notes(self) -> str:
        """What whoever recorded wanted to say."""
        return self.description.notes

    @property
    def complete(self) -> bool:
        """Whether it was closed; if not, it ends where a crash or a full disk cut it off."""
        return self.description.complete

    def __len__(self) -> int:
        return self.frame_sets

    def __iter__(self) -> Iterator[tuple[Frame, ...]]:
        with ExitStack() as opened:
            streams = [
                (opened.enter_context(closing(self._frames(camera))), camera)
                for camera in self.description.cameras
            ]
            for index in range(self.frame_sets):
                yield tuple(self._frame(frames, camera, index) for frames, camera in streams)

    def _frames(self, camera: RecordedCamera) -> Generator[Frame]:
        """Yield the frames of one camera as long as both its rows and its pictures go on."""
        rows = _rows(self.directory, self.description)
        pictures = read_pictures(self.directory / camera.file, camera.format)
        with closing(rows), closing(pictures):
            own_rows = (row for row in rows if row.camera == camera.id)
            for row, picture in zip(own_rows, pictures, strict=False):
                yield Frame(camera.id, row.sequence, row.captured_at_s, row.lit_mask, picture)

    def _frame(self, frames: Iterator[Frame], camera: RecordedCamera, index: int) -> Frame:
        frame = next(frames, None)
        if frame is None:
            raise RecordingError(
                f"{self.directory / camera.file}: picture {index} of {self.frame_sets} cannot be "
                "read; the file is damaged or has been changed, copy it or record anew"
            )
        return frame


def open_recording(directory: Path) -> Recording:
    """Return the recording in a directory, with all checked that needs no decoding.

    One that was cut off has the frame sets that are whole.  Raises `RecordingError`.
    """
    description = read_description(directory)
    rows = Counter(row.camera for row in _rows(directory, description))
    pictures = {camera.id: _count_pictures(directory, camera) for camera in description.cameras}
    if description.complete:
        _check_whole(directory, description, rows, pictures)
    frame_sets = min(min(rows[camera], pictures[camera]) for camera in pictures)
    points = _points(directory, frame_sets, complete=description.complete)
    return Recording(directory, description, points, frame_sets)


def _rows(directory: Path, description: Description) -> Generator[FrameRow]:
    cameras = [camera.id for camera in description.cameras]
    return read_frame_rows(directory / FRAMES_FILE, cameras, cut_off=not description.complete)


def _count_pictures(directory: Path, camera: RecordedCamera) -> int:
    path, form = directory / camera.file, camera.format
    if not path.is_file():
        raise RecordingError(f"{path}: no such file, the video of {camera.id}; copy it here")
    video = inspect_video(path)
    if video is None or video.pictures == 0:
        return 0
    if (video.width_px, video.height_px) != (form.width_px, form.rows_px):
        raise RecordingError(
            f"{path}: pictures are {video.width_px}x{video.height_px}, must be "
            f"{form.width_px}x{form.rows_px} as {DESCRIPTION_FILE} says; correct one of them"
        )
    if not video.grey:
        raise RecordingError(f"{path}: is not 8-bit grey; record anew, or convert it losslessly")
    return video.pictures


def _check_whole(
    directory: Path, description: Description, rows: Counter[str], pictures: dict[str, int]
) -> None:
    """Refuse a recording that says it is complete and is not."""
    first = description.cameras[0].id
    for camera in description.cameras:
        path, count = directory / camera.file, pictures[camera.id]
        lacking = missing_bytes(path)
        if lacking:
            raise RecordingError(
                f"{path}: is truncated after {count} pictures, {lacking} bytes are missing; "
                "copy it anew"
            )
        if count != rows[camera.id]:
            raise RecordingError(
                f"{path}: has {count} pictures, {FRAMES_FILE} {rows[camera.id]} rows of "
                f"{camera.id}; copy the file that is too short anew"
            )
        if count != pictures[first]:
            raise RecordingError(
                f"{path}: has {count} pictures, {first} has {pictures[first]}; every frame set "
                "needs a picture of every camera"
            )


def _points(directory: Path, frame_sets: int, *, complete: bool) -> tuple[RecordedPoint, ...]:
    path = directory / POINTS_FILE
    if not path.exists():
        return ()
    points = read_points(path)
    if complete:
        for row, point in enumerate(points, start=1):
            if point.set >= frame_sets:
                raise RecordingError(
                    f"{path}: row {row}: set = {point.set}: must be less than {frame_sets}, "
                    "the number of frame sets; correct the row"
                )
    return tuple(point for point in points if point.set < frame_sets)
