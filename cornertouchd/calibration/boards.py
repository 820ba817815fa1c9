"""Boards to calibrate lenses and poses with: their plans, and finding them in pictures.

ChArUco boards carry a marker in every white square: partial views count, and no corner is taken
for another.  Plain checkerboards must be seen whole.

Ink matters.  Cameras that see only infrared see what is black there: laser toner and pigment inks
hold carbon and stay black; the dyes of most inkjet printers are as clear as the paper.
"""

from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np

from cornertouchd.calibration.calibration import CalibrationError
from cornertouchd.model import FloatArray, Picture

FEWEST_SQUARES = 3
MARKER_SHARES = (0.5, 0.8)
"""A marker's side over its square's: smaller ones are not read, and the white around larger ones
is narrower than OpenCV advises."""

FEWEST_CORNERS = 8
"""Six coordinates fix a pose.  With fewer than eight corners it is left to a few bad ones."""

PIXEL_CENTRE_PX = 0.5
"""OpenCV counts pixels from the centre of the first one, we from its edge."""

FEWEST_MARKERS = 4
"""Fewer cannot tell which of them is false."""

BORDER_PX = 3.0
"""Corners nearer to the border of the picture have no room to be refined."""

FARTHEST_PX = 1.5
"""A corner that is farther from where the markers around it say is another edge."""

ENLARGED = 2
"""Markers are looked for in a picture so many times as large: those of 10 pixels a side are then
read, and neighbouring cameras have up to twice as many corners in common."""

WINDOW_SHARE = 0.1
SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX = 2, 10
"""Half the window in which a corner is refined, as a share of the distance to the next corner.
With .2 the markers come into the window, which nearly doubles the errors of .1 px."""

PRECISELY = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 0.001)


@dataclass(frozen=True, slots=True)
class BoardPlan:
    """What is printed: `squares` in a row and in a column, black in the top-left corner.

    `marker_mm` and `dictionary` (a name of OpenCV's) are those of a ChArUco board.  The default
    fits A4: of the boards that do, it gave neighbouring cameras most corners in common on the
    simulated 350x400 mm rigs with 640x480 pictures.  Raises `CalibrationError` for a board that
    cannot be.
    """

    kind: Literal["charuco", "checkerboard"] = "charuco"
    squares: tuple[int, int] = (9, 6)
    square_mm: float = 29.0
    marker_mm: float = 23.0
    dictionary: str = "DICT_4X4_50"

    def __post_init__(self) -> None:
        columns, rows = self.squares
        if min(self.squares) < FEWEST_SQUARES or not 0.0 < self.square_mm < np.inf:
            raise CalibrationError(
                f"board: {columns}x{rows} squares of {self.square_mm:g} mm; "
                f"give at least {FEWEST_SQUARES}x{FEWEST_SQUARES} of more than 0 mm"
            )
        if self.kind == "checkerboard":
            if (columns + rows) % 2 == 0:
                raise CalibrationError(
                    f"checkerboard: {columns}x{rows} squares look the same upside down; "
                    f"give an odd and an even number, as {columns}x{rows + 1}"
                )
            return
        smallest, largest = (share * self.square_mm for share in MARKER_SHARES)
        if not smallest <= self.marker_mm <= largest:
            raise CalibrationError(
                f"board: markers of {self.marker_mm:g} mm in squares of {self.square_mm:g} mm; "
                f"give {smallest:g} to {largest:g} mm"
            )
        if not (self.dictionary.startswith("DICT_") and hasattr(cv2.aruco, self.dictionary)):
            raise CalibrationError(
                f"board: dictionary {self.dictionary} is not one of OpenCV's; give DICT_4X4_50"
            )
        there = len(_dictionary(self).bytesList)
        if columns * rows // 2 > there:
            raise CalibrationError(
                f"board: {columns}x{rows} squares need {columns * rows // 2} markers, "
                f"{self.dictionary} has {there}; give fewer squares or a larger dictionary"
            )

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height of the pattern."""
        return self.squares[0] * self.square_mm, self.squares[1] * self.square_mm

    @property
    def corners_mm(self) -> FloatArray:
        """The inner corners (N, 2), row by row, from the top-left corner of the pattern."""
        x, y = np.meshgrid(*(self.square_mm * np.arange(1, count) for count in self.squares))
        return np.stack([x.ravel(), y.ravel()], axis=1)

    def dark_mm(self) -> FloatArray:
        """Return what is black: rectangles (N, 4) of left, top, right, bottom."""
        column, row = np.meshgrid(*map(np.arange, self.squares))
        black = (column + row) % 2 == 0
        left_top = np.stack([column[black], row[black]], axis=1) * self.square_mm
        squares = np.hstack([left_top, left_top + self.square_mm])
        if self.kind == "checkerboard":
            return squares
        return np.vstack([squares, self._dark_cells_mm()])

    def _dark_cells_mm(self) -> FloatArray:
        dictionary = _dictionary(self)
        cells = dictionary.markerSize + 2
        cell_mm = self.marker_mm / cells
        dark = []
        for number, outline_mm in enumerate(self.marker_outlines_mm()):
            rows, columns = np.nonzero(
                cv2.aruco.generateImageMarker(dictionary, number, cells) == 0
            )
            left_top = outline_mm[0] + cell_mm * np.stack([columns, rows], axis=1)
            dark.append(np.hstack([left_top, left_top + cell_mm]))
        return np.vstack(dark)

    def marker_outlines_mm(self) -> FloatArray:
        """Return the corners (M, 4, 2) of the markers, clockwise from the top-left, by number."""
        columns, rows = self.squares
        white = [(c, r) for r in range(rows) for c in range(columns) if (c + r) % 2 == 1]
        middles = (np.array(white) + 0.5) * self.square_mm
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * self.marker_mm / 2.0
        outlines: FloatArray = middles[:, None] + corners
        return outlines


@dataclass(frozen=True)
class BoardCorners:
    """Corners of a board in a picture: `corners_mm` (N, 2) on the board, `pixels_px` (N, 2)."""

    corners_mm: FloatArray
    pixels_px: FloatArray


def find_board(plan: BoardPlan, picture: Picture) -> BoardCorners | None:
    """Return the corners that are seen, columns and rows of the picture, or None without a board.

    A picture in which nothing is found is tried again with its contrast spread, for inks that are
    pale in infrared.
    """
    find = _find_charuco if plan.kind == "charuco" else _find_checkerboard
    spread = cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8))
    found = find(plan, picture)
    return found if found is not None else find(plan, np.asarray(spread.apply(picture), np.uint8))


def _dictionary(plan: BoardPlan) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, plan.dictionary))


@dataclass(frozen=True)
class _Markers:
    """Markers that were read: their corners on the board and in the picture, (M, 4, 2) each."""

    outlines_mm: FloatArray
    outlines_px: FloatArray


def _find_charuco(plan: BoardPlan, picture: Picture) -> BoardCorners | None:
    """Look for the markers, then for the corners that have one beside them.

    OpenCV's own detector of these boards differs from version to version: by half a pixel, and in
    whether one marker read wrongly in the screen's mirror makes it throw the board away.
    """
    markers = _on_one_board(_find_markers(plan, picture))
    if len(markers.outlines_mm) < FEWEST_MARKERS:
        return None
    corners_mm, guesses_px = _beside_markers(plan, markers)
    size_px = np.array(picture.shape[::-1])
    inside = np.all((guesses_px > BORDER_PX) & (guesses_px < size_px - BORDER_PX), axis=1)
    corners_mm, guesses_px = corners_mm[inside], guesses_px[inside]
    if len(corners_mm) < FEWEST_CORNERS:
        return None
    pixels_px = _refined(picture, guesses_px)
    near = np.hypot(*(pixels_px - guesses_px).T) < FARTHEST_PX
    corners_mm, pixels_px = corners_mm[near], pixels_px[near]
    if len(corners_mm) < FEWEST_CORNERS or np.any(np.ptp(corners_mm, axis=0) == 0.0):
        return None
    return BoardCorners(corners_mm, pixels_px)


def _find_markers(plan: BoardPlan, picture: Picture) -> _Markers:
    enlarged = cv2.resize(picture, None, fx=ENLARGED, fy=ENLARGED, interpolation=cv2.INTER_CUBIC)
    outlines, numbers, _ = cv2.aruco.ArucoDetector(_dictionary(plan)).detectMarkers(enlarged)
    if not outlines:  # then numbers is None
        return _Markers(np.zeros((0, 4, 2)), np.zeros((0, 4, 2)))
    places_mm = plan.marker_outlines_mm()
    known = [
        (places_mm[number], (outline.reshape(4, 2) + PIXEL_CENTRE_PX) / ENLARGED)
        for number, outline in zip(np.ravel(numbers).astype(int), outlines, strict=True)
        if number < len(places_mm)
    ]
    return _Markers(
        np.reshape([on_board for on_board, _ in known], (-1, 4, 2)),
        np.reshape([seen for _, seen in known], (-1, 4, 2)),
    )


def _on_one_board(markers: _Markers) -> _Markers:
    """Leave out markers that do not lie where the others say.

    The screen shows the board a second time, with its markers turned over; one of these may be
    taken for another marker.
    """
    sides_px = np.linalg.norm(np.diff(markers.outlines_px, axis=1), axis=2)
    if len(sides_px) < FEWEST_MARKERS:
        return markers
    _, fits = cv2.findHomography(
        markers.outlines_mm.reshape(-1, 2),
        markers.outlines_px.reshape(-1, 2),
        cv2.RANSAC,
        float(np.median(sides_px)),
    )
    fitting = np.reshape(fits, (-1, 4)).all(axis=1)
    return _Markers(markers.outlines_mm[fitting], markers.outlines_px[fitting])


def _beside_markers(plan: BoardPlan, markers: _Markers) -> tuple[FloatArray, FloatArray]:
    """Return the corners (N, 2) with a marker beside them, and where that and the next ones say.

    So near by, a plane is a plane even in a lens that bends lines.
    """
    middles_mm = markers.outlines_mm.mean(axis=1)
    corners, guesses = [], []
    onto_picture: Any
    for corner in plan.corners_mm:
        away_mm = np.abs(middles_mm - corner).max(axis=1)
        nearest = np.argsort(away_mm)[:FEWEST_MARKERS]
        if away_mm[nearest[0]] > plan.square_mm:
            continue
        onto_picture, _ = cv2.findHomography(
            markers.outlines_mm[nearest].reshape(-1, 2),
            markers.outlines_px[nearest].reshape(-1, 2),
        )
        if onto_picture is not None:  # None for a board seen edge-on
            x, y, w = onto_picture @ (*corner, 1.0)
            corners.append(corner)
            guesses.append((x / w, y / w))
    return np.reshape(corners, (-1, 2)), np.reshape(guesses, (-1, 2))


def _refined(picture: Picture, pixels_px: FloatArray) -> FloatArray:
    """Return the corners (N, 2) where black squares meet, to a fraction of a pixel."""
    apart = np.linalg.norm(pixels_px[:, None] - pixels_px, axis=2)
    np.fill_diagonal(apart, np.inf)
    halves = np.clip(WINDOW_SHARE * apart.min(axis=1), SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX)
    starts = (pixels_px - PIXEL_CENTRE_PX).astype(np.float32).reshape(-1, 1, 1, 2)
    refined = [
        cv2.cornerSubPix(picture, start, (half, half), (-1, -1), PRECISELY)
        for start, half in zip(starts, halves.astype(int).tolist(), strict=True)
    ]
    return np.reshape(refined, (-1, 2)).astype(np.float64) + PIXEL_CENTRE_PX


def _find_checkerboard(plan: BoardPlan, picture: Picture) -> BoardCorners | None:
    columns, rows = plan.squares[0] - 1, plan.squares[1] - 1
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    for tried in (picture, 255 - picture):
        found, pixels = cv2.findChessboardCornersSB(tried, (columns, rows), flags=flags)
        if found:
            grid = np.reshape(pixels, (rows, columns, 2)).astype(np.float64)
            if not _first_square_is_dark(grid, tried):
                grid = grid[::-1, ::-1]
            return BoardCorners(plan.corners_mm, grid.reshape(-1, 2) + PIXEL_CENTRE_PX)
    return None


def _first_square_is_dark(grid_px: FloatArray, picture: Picture) -> bool:
    """Tell whether the first inner square is as it should be: of the colour of the corner square.

    `grid_px` is (rows, columns, 2).  The squares to its right are of the other colour.
    """
    middles = (grid_px[:-1, :-1] + grid_px[1:, :-1] + grid_px[:-1, 1:] + grid_px[1:, 1:]) / 4.0
    column, row = np.moveaxis(np.rint(middles).astype(int), -1, 0)
    grey = picture[row, column].astype(np.float64)
    same = np.add(*np.indices(grey.shape)) % 2 == 0
    return bool(grey[same].mean() < grey[~same].mean())
