"""Boards as the cameras saw them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.boards import BoardPlan, find_board
from cornertouchd.model import FloatArray, Frame, PictureFormat


@dataclass(frozen=True)
class BoardSight:
    """One board seen by one camera in one frame set.

    `corners_mm` (N, 2) are corners on the board, `pixels_px` (N, 2) their columns and rows in the
    full image of the camera (rows counted from the top of the image, not of the band).
    """

    set: int
    camera: str
    corners_mm: FloatArray
    pixels_px: FloatArray


def find_boards(
    plan: BoardPlan, frame_sets: Iterable[Sequence[Frame]], formats: Mapping[str, PictureFormat]
) -> tuple[BoardSight, ...]:
    """Return every sight of the board, in the order of the frame sets."""
    return tuple(
        sight
        for number, frames in enumerate(frame_sets)
        for sight in sights_in(plan, number, frames, formats)
    )


def sights_in(
    plan: BoardPlan, number: int, frames: Sequence[Frame], formats: Mapping[str, PictureFormat]
) -> tuple[BoardSight, ...]:
    """Return what the cameras see of the board in frame set `number`."""
    sights = []
    for frame in frames:
        found = find_board(plan, frame.pixels)
        if found is not None:
            top = np.array([0.0, formats[frame.camera].row_offset_px])
            sights.append(BoardSight(number, frame.camera, found.corners_mm, found.pixels_px + top))
    return tuple(sights)


def common_corners(a: BoardSight, b: BoardSight) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the corners (N, 2) that both saw, in mm, and their pixels in `a` and in `b`."""
    same = (a.corners_mm[:, None] == b.corners_mm[None]).all(axis=2)
    in_a, in_b = np.nonzero(same)
    return a.corners_mm[in_a], a.pixels_px[in_a], b.pixels_px[in_b]
