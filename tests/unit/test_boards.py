"""Boards: printed true to size, found in pictures, gathered while a person moves them."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from cornertouchd.calibration.board_sights import BoardSight, common_corners, find_boards
from cornertouchd.calibration.boards import BoardPlan, find_board
from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.cli.print_board import print_board
from cornertouchd.guiding.board_gathering import BoardGathering, BoardProgress
from cornertouchd.model import Frame, Picture, PictureFormat

CHARUCO = BoardPlan()
CHECKERS = BoardPlan("checkerboard", (7, 6), 22.0)
MM_PER_INCH = 25.4
CAMERAS = ("C1", "C2", "C3", "C4")


def flat_picture(plan: BoardPlan, px_per_mm: float = 4.0, border_px: int = 60) -> Picture:
    """The board straight from before, its first square at (border, border)."""
    size = tuple(round(side * px_per_mm) + 2 * border_px for side in reversed(plan.size_mm))
    picture = np.full(size, 220, np.uint8)
    for x0, y0, x1, y1 in np.rint(plan.dark_mm() * px_per_mm).astype(int) + border_px:
        picture[y0:y1, x0:x1] = 25
    return picture


def test_the_drawing_is_the_board_that_opencv_knows() -> None:
    plan = BoardPlan(square_mm=24.0, marker_mm=18.0)
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    board = cv2.aruco.CharucoBoard(plan.squares, plan.square_mm, plan.marker_mm, dictionary)
    theirs = board.generateImage((9 * 96, 6 * 96))
    ours = flat_picture(plan, border_px=0)
    assert np.mean((theirs > 127) == (ours > 127)) > 0.999


@pytest.mark.parametrize("plan", [CHARUCO, CHECKERS], ids=["charuco", "checkerboard"])
def test_corners_of_a_flat_picture_are_where_they_were_drawn(plan: BoardPlan) -> None:
    found = find_board(plan, flat_picture(plan))
    assert found is not None
    assert len(found.corners_mm) == len(plan.corners_mm)
    np.testing.assert_allclose(found.pixels_px, found.corners_mm * 4.0 + 60, atol=0.1)


@pytest.mark.parametrize("plan", [CHARUCO, CHECKERS], ids=["charuco", "checkerboard"])
def test_a_board_that_hangs_upside_down_keeps_its_corners(plan: BoardPlan) -> None:
    picture = np.ascontiguousarray(flat_picture(plan)[::-1, ::-1])
    found = find_board(plan, picture)
    assert found is not None
    upright = np.array(picture.shape[::-1]) - found.pixels_px
    np.testing.assert_allclose(upright, found.corners_mm * 4.0 + 60, atol=0.1)


def test_ink_that_is_pale_in_infrared_is_found() -> None:
    pale = (100 + flat_picture(CHARUCO).astype(float) * 0.06).astype(np.uint8)
    assert np.ptp(pale) < 13  # grey levels
    found = find_board(CHARUCO, pale)
    assert found is not None
    np.testing.assert_allclose(found.pixels_px, found.corners_mm * 4.0 + 60, atol=0.3)


def test_a_part_of_a_charuco_board_is_enough() -> None:
    part = np.ascontiguousarray(flat_picture(CHARUCO)[:, :600])
    found = find_board(CHARUCO, part)
    assert found is not None
    assert 8 <= len(found.corners_mm) < len(CHARUCO.corners_mm)
    np.testing.assert_allclose(found.pixels_px, found.corners_mm * 4.0 + 60, atol=0.1)


@pytest.mark.parametrize("plan", [CHARUCO, CHECKERS], ids=["charuco", "checkerboard"])
def test_pictures_without_a_board_have_none(plan: BoardPlan) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (120, 160)).astype(np.uint8)
    assert find_board(plan, noise) is None
    assert find_board(plan, np.zeros((64, 640), np.uint8)) is None


@pytest.mark.parametrize(
    ("plan", "message"),
    [
        ({"squares": (2, 6)}, "2x6 squares.*at least 3x3"),
        ({"square_mm": float("nan")}, "nan mm"),
        ({"marker_mm": 28.0}, "markers of 28 mm in squares of 29 mm; give 14.5 to 23.2 mm"),
        ({"dictionary": "detail"}, "detail is not one of OpenCV's"),
        ({"squares": (11, 10)}, "need 55 markers, DICT_4X4_50 has 50"),
        ({"kind": "checkerboard", "squares": (8, 6)}, "look the same upside down.*8x7"),
    ],
)
def test_boards_that_cannot_be_are_refused(plan: dict[str, object], message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        BoardPlan(**plan)  # type: ignore[arg-type]


@pytest.mark.parametrize("plan", [CHARUCO, CHECKERS], ids=["charuco", "checkerboard"])
def test_a_printed_board_is_true_to_size(plan: BoardPlan, tmp_path: Path) -> None:
    print_board(plan, tmp_path / "board.png")
    page = cv2.imread(str(tmp_path / "board.png"), cv2.IMREAD_GRAYSCALE)
    assert page is not None
    assert page.shape == (2480, 3508)  # A4 across at 300 dots an inch
    found = find_board(plan, cv2.resize(page, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA))
    assert found is not None
    assert len(found.corners_mm) == len(plan.corners_mm)
    off = found.pixels_px * 4.0 * MM_PER_INCH / 300.0 - found.corners_mm
    assert np.abs(off - off.mean(axis=0)).max() < 0.08


@pytest.mark.parametrize(
    ("plan", "page_mm"),
    [
        (CHARUCO, (297, 210)),
        (BoardPlan(squares=(6, 9)), (210, 297)),
        (BoardPlan(square_mm=44.0, marker_mm=35.0), (420, 297)),
        (BoardPlan(square_mm=100.0, marker_mm=79.0), (1189, 841)),
    ],
    ids=["A4", "A4 upright", "A3", "A0"],
)
def test_a_pdf_has_the_smallest_page_that_holds_the_board(
    plan: BoardPlan, page_mm: tuple[int, int], tmp_path: Path
) -> None:
    print_board(plan, tmp_path / "board.pdf")
    box = re.search(
        rb"/MediaBox \[ *0 0 ([\d.]+) ([\d.]+) *\]", (tmp_path / "board.pdf").read_bytes()
    )
    assert box is not None
    size_mm = [float(points) / 72.0 * MM_PER_INCH for points in box.groups()]
    assert size_mm == pytest.approx(page_mm, abs=0.1)


def test_boards_that_cannot_be_printed_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="1350 x 900 mm do not fit on A0"):
        print_board(BoardPlan(square_mm=150.0, marker_mm=115.0), tmp_path / "board.pdf")
    with pytest.raises(CalibrationError, match=r"board.gif: .* as .pdf or .png"):
        print_board(CHARUCO, tmp_path / "board.gif")
    with pytest.raises(CalibrationError, match="cannot be written"):
        print_board(CHARUCO, tmp_path / "nowhere" / "board.png")


def test_rows_are_those_of_the_full_image() -> None:
    picture = flat_picture(CHARUCO)
    size = PictureFormat(picture.shape[1], picture.shape[0] + 300, 300, picture.shape[0])
    (sight,) = find_boards(CHARUCO, [[Frame("C1", 0, 0.0, 15, picture)]], {"C1": size})
    np.testing.assert_allclose(sight.pixels_px, sight.corners_mm * 4.0 + (60, 360), atol=0.1)


def test_common_corners_are_matched_by_their_place_on_the_board() -> None:
    corners, pixels = CHARUCO.corners_mm, np.arange(80.0).reshape(40, 2)
    a = BoardSight(0, "C1", corners[:20], pixels[:20])
    b = BoardSight(0, "C2", corners[30:9:-1], pixels[30:9:-1])
    mm, in_a, in_b = common_corners(a, b)
    np.testing.assert_array_equal(mm, corners[10:20])
    np.testing.assert_array_equal(in_a, pixels[10:20])
    np.testing.assert_array_equal(in_b, pixels[10:20])


class Person:
    """Holds a board before the cameras, here or there."""

    def __init__(self) -> None:
        self._board = flat_picture(CHARUCO, 1.0, border_px=10)
        self.formats = {camera: PictureFormat(480, 240, 0, 240) for camera in CAMERAS}
        self.gathering = BoardGathering(CHARUCO, self.formats)

    def shows(self, column: int, cameras: str = "C1 C2") -> BoardProgress:
        empty = np.full((240, 480), 10, np.uint8)
        with_board = empty.copy()
        height, width = self._board.shape
        with_board[20 : 20 + height, column : column + width] = self._board
        return self.gathering.feed(
            [
                Frame(camera, 0, 0.0, 15, with_board if camera in cameras.split() else empty)
                for camera in CAMERAS
            ]
        )


def test_a_board_counts_when_it_is_held_still_at_a_new_place() -> None:
    person = Person()
    first = person.shows(20)
    assert not first.holds_still
    assert first.views["C1"] == 0
    second = person.shows(20)
    assert second.holds_still
    assert second.kept
    assert (second.views["C1"], second.common["C1", "C2"], second.common["C2", "C3"]) == (1, 1, 0)
    third = person.shows(20)
    assert third.holds_still
    assert not third.kept  # nothing new
    assert not person.shows(120).holds_still
    assert person.shows(120).views == {"C1": 2, "C2": 2, "C3": 0, "C4": 0}
    assert {sight.set for sight in person.gathering.sights} == {0, 1}


def test_a_known_place_counts_anew_when_another_camera_sees_it() -> None:
    person = Person()
    person.shows(20, "C1 C2")
    assert person.shows(20, "C1 C2").common["C1", "C2"] == 1
    assert person.shows(20, "C1 C4").common["C4", "C1"] == 1


def test_it_names_what_is_missing_until_it_is_enough() -> None:
    some = BoardProgress(
        {"C1": 15, "C2": 4, "C3": 15, "C4": 20},
        {("C1", "C2"): 6, ("C2", "C3"): 0, ("C3", "C4"): 5, ("C4", "C1"): 9},
        holds_still=True,
        kept=True,
    )
    assert some.missing == (("C2", "C3"), ("C2",), ("C3", "C4"))
    assert not some.enough
    chained = BoardProgress(
        dict.fromkeys(("C1", "C2", "C3", "C4"), 15),
        {("C1", "C2"): 6, ("C2", "C3"): 0, ("C3", "C4"): 6, ("C4", "C1"): 6},
        holds_still=True,
        kept=False,
    )
    assert chained.enough  # C3 is reached by way of C4
