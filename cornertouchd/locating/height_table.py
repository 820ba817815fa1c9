"""Which way the rows of a camera look: how high it stands, where its horizon lies, how it tilts.

Everything is read from the strip, whose place is known.  A ray on the horizon h(u) runs level; one
on another row rises by 1 / F for each row, F = (u - N/2) / sin(theta(u) - theta(N/2)): so it is for
every lens that bends rays towards its axis only, as long as the horizon passes near the axis.  The
strip's face is D away, so that with g = F / D

    surface line = h + camera g,  upper end = h + (camera - top) g,  mirrored end = h + (camera +
    top) g

and h, a parabola, the camera's height and the strip's come out of one linear fit.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import Polynomial

from cornertouchd.model import BoolArray, FloatArray

FACE_MM = 3.0
"""The face of a strip lies so far outside the border of the surface.  A millimetre more or less
changes the heights by a quarter of a percent."""

ANGLE_DEGREE = 7
"""Of the polynomial that smooths the angles of methods whose lines do not run smoothly."""

FREE_PER_CURVE = 10
"""The strip's rows are smooth curves, with so many free coefficients each: that is how many
independent rows a curve counts for, however many columns it has."""

ROW_SIGMA_PX = 0.03
"""A strip's row is not better known than this, however well the curve fits (path-traced and
simulated empty pictures: the blur at the rim, the dark line beside a dimmer mirror image)."""

LARGEST_CONDITION = 1e7
LARGEST_SIGMA_MM = 2.0
LARGEST_RESIDUAL_PX = 2.0
"""Beyond these the heights are guesses: rigs that work have .1 to .25 mm and .01 to .04 px."""

HEIGHT_RANGE_MM = (0.5, 100.0)

LOWER_END_MM = 0.8
"""Light begins so far above the screen.  With a mirror image that makes a dark line around z = 0;
on a matt screen heights are measured from the strip's lower end, and this is added."""

ROLL_SIGMA = 0.01
SHEAR_SLOPE_SIGMA = 0.03
"""How much the shear differs from what the slope of the horizon says, columns a row: in the middle,
and by its change over half the picture's width.  Up to .002 and .007 on path-traced cameras; lenses
may be worse."""

FEWEST_LINES = 6
LINE_SIGMA = 0.01
"""Lines of upright discs scatter by .004, of fingers as they come by .2 (path-traced)."""


class HeightsError(Exception):
    """The strip does not tell how high the camera stands; the message says why."""


@dataclass(frozen=True, slots=True, eq=False)
class StripRows:
    """Rows at which a camera sees the strip, (width_px,): upper end, surface line, mirrored end.

    `bottom_px` is None on a matt screen; `surface_px` is then the strip's lower end.
    """

    top_px: FloatArray
    surface_px: FloatArray
    bottom_px: FloatArray | None
    visible: BoolArray


@dataclass(frozen=True, slots=True)
class Heights:
    """What the strip tells of heights, in the words of `HeightTable`.

    `horizon_px` are the coefficients of 1, w and w², w = (u - width/2) / (width/2), `shear` those
    of 1 and w.  `residual_px` is by how much (RMS) the strip's rows are off; the sigmas are
    standard deviations.
    """

    camera_mm: float
    strip_top_mm: float
    horizon_px: tuple[float, float, float]
    shear: tuple[float, float]
    residual_px: float
    camera_sigma_mm: float
    strip_top_sigma_mm: float


@dataclass(frozen=True, slots=True, eq=False)
class HeightTable:
    """Which way the rows of one camera look: beside the LineTable, what places above z = 0 need.

    The camera stands at (x_mm, y_mm), `camera_mm` above the surface.  All arrays are by column,
    (width_px,), at the centres of the pixels: `horizon_px` is the row on which rays run level; a
    ray on row v rises by (horizon_px - v) / rows_per_slope_px for each millimetre it goes along the
    surface, so that after d mm it is at z = camera_mm + d * (horizon_px - v) / rows_per_slope_px
    (negative: the mirrored ray, of height -z, below the surface as if the screen were not there).
    `strip_mm` is the distance of the strip's face, `shear` the columns by which an upright line
    moves right for each row down, so that column u on row v looks the way of column
    u - shear * (v - horizon_px) on the horizon.  `angles_rad` (width_px + 1,) is as in LineTable,
    `bottom_px` the last row of the mirror image, of the strip without one, `visible` where the
    strip is seen (not behind the far camera).

    For a camera that hangs upside down `rows_per_slope_px` is negative, and the mirror image ends
    at `bottom_px` above the surface line.
    """

    camera: str
    x_mm: float
    y_mm: float
    camera_mm: float
    horizon_px: FloatArray
    rows_per_slope_px: FloatArray
    strip_mm: FloatArray
    shear: FloatArray
    angles_rad: FloatArray
    bottom_px: FloatArray
    visible: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """What the angles tell of each column, (width_px,); `w` runs from -1 to 1."""

    w: FloatArray
    rows_per_slope_px: FloatArray
    strip_mm: FloatArray
    known: BoolArray


def measure_heights(
    rows: StripRows,
    angles_rad: FloatArray,
    position_mm: tuple[float, float],
    surface_mm: tuple[float, float],
    face_mm: float = FACE_MM,
    top_mm: float | None = None,
) -> Heights:
    """Return the heights that a strip tells; the shear is that of the camera's roll.

    `angles_rad` (width_px + 1,) are those of a LineTable, the camera is at `position_mm`;
    `face_mm` is how far the strip's face lies outside the surface, `top_mm` how high the strip's
    upper end is, if that is known.  Raises `HeightsError` if the strip cannot tell.
    """
    view = _view(angles_rad, position_mm, surface_mm, face_mm)
    rows = _upright(rows, view)
    used = rows.visible & view.known
    if np.count_nonzero(used) < 4 * FREE_PER_CURVE:
        raise HeightsError(
            f"the strip is seen in {np.count_nonzero(used)} columns with a directing line, "
            f"{4 * FREE_PER_CURVE} are needed"
        )
    terms, seen = _equations(rows, view, used)
    lowest_mm = LOWER_END_MM if rows.bottom_px is None else 0.0
    known_mm = None if top_mm is None else top_mm - lowest_mm
    parameters, covariance, residual_px = _solve(terms, seen, known_mm)
    sigmas = np.sqrt(np.diag(covariance))
    camera_mm, top = float(parameters[3]) + lowest_mm, float(parameters[4]) + lowest_mm
    _require_sense(camera_mm, float(sigmas[3]), residual_px)
    h0, h1, h2 = parameters[:3].tolist()
    roll = -h1 / (len(view.w) / 2)
    return Heights(
        camera_mm, top, (h0, h1, h2), (roll, 0.0), residual_px, float(sigmas[3]), float(sigmas[4])
    )


def tabulate_heights(
    camera: str,
    heights: Heights,
    rows: StripRows,
    angles_rad: FloatArray,
    position_mm: tuple[float, float],
    surface_mm: tuple[float, float],
    face_mm: float = FACE_MM,
) -> HeightTable:
    """Return the table of a camera whose heights were measured; the rest is as it was for that."""
    view = _view(angles_rad, position_mm, surface_mm, face_mm)
    rows = _upright(rows, view)
    return HeightTable(
        camera,
        *position_mm,
        heights.camera_mm,
        horizon_rows(heights, len(view.w)),
        view.rows_per_slope_px,
        view.strip_mm,
        heights.shear[0] + heights.shear[1] * view.w,
        np.ascontiguousarray(angles_rad),
        np.ascontiguousarray(rows.surface_px if rows.bottom_px is None else rows.bottom_px),
        np.ascontiguousarray(rows.visible & view.known),
    )


def horizon_rows(heights: Heights, width_px: int) -> FloatArray:
    """Return the row of the horizon in every column, (width_px,)."""
    h0, h1, h2 = heights.horizon_px
    w = _across(width_px)
    rows: FloatArray = h0 + h1 * w + h2 * w * w
    return rows


def fit_shear(
    heights: Heights, width_px: int, columns_px: FloatArray, rows_px: FloatArray
) -> Heights:
    """Return heights with the shear that lines of upright fingers show.

    `columns_px` and `rows_px` are (lines, L), points of lines that are upright in truth, NaN where
    one was lost.  What the camera's roll says counts as much as one good line; fingers that lean
    scatter, and then count for little.
    """
    middles, slopes = _slopes(columns_px, rows_px, width_px)
    if len(slopes) < FEWEST_LINES:
        return heights
    prior = np.array([-heights.horizon_px[1] / (width_px / 2), 0.0])
    certain = np.diag([1.0 / ROLL_SIGMA**2, 1.0 / SHEAR_SLOPE_SIGMA**2])
    terms = np.stack([np.ones_like(middles), middles], axis=1)
    shear = prior
    for _ in range(6):
        off = slopes - terms @ shear
        sigma = max(LINE_SIGMA, 1.4826 * float(np.median(np.abs(off))))
        weights = 1.0 / (sigma**2 * (1.0 + np.square(off / (2.0 * sigma))))
        normal = terms.T @ (terms * weights[:, None]) + certain
        shear = np.linalg.solve(normal, terms.T @ (weights * slopes) + certain @ prior)
    return replace(heights, shear=(float(shear[0]), float(shear[1])))


def _across(width_px: int) -> FloatArray:
    """Return w at the centres of the columns."""
    return np.asarray((np.arange(width_px) + 0.5) / (width_px / 2) - 1.0, np.float64)


def _view(
    angles_rad: FloatArray,
    position_mm: tuple[float, float],
    surface_mm: tuple[float, float],
    face_mm: float,
) -> _View:
    width = len(angles_rad) - 1
    known = np.isfinite(angles_rad)
    if np.count_nonzero(known) <= 2 * ANGLE_DEGREE:
        raise HeightsError(
            f"only {np.count_nonzero(known)} of {width} columns have a directing line"
        )
    w = _across(width)
    borders = np.arange(width + 1) / (width / 2) - 1.0
    angle = Polynomial.fit(borders[known], np.unwrap(angles_rad[known]), ANGLE_DEGREE, [-1.0, 1.0])
    angles = angle(w)
    off_axis = angles - float(angle(0.0))
    middle = np.abs(w) < 0.5 / width  # the very middle of an odd picture: there F is 1 / theta'
    with np.errstate(divide="ignore", invalid="ignore"):
        rows_per_slope = np.where(middle, 1.0 / angle.deriv()(w), w / np.sin(off_axis)) * width / 2
    strip_mm = _distance_to_strip(angles, position_mm, surface_mm, face_mm)
    seen = known[:-1] & known[1:] & np.isfinite(rows_per_slope) & np.isfinite(strip_mm)
    return _View(w, rows_per_slope, strip_mm, seen)


def _distance_to_strip(
    angles_rad: FloatArray,
    position_mm: tuple[float, float],
    surface_mm: tuple[float, float],
    face_mm: float,
) -> FloatArray:
    """Return how far level rays (...) go to the far sides' strips; infinite if they meet none."""
    distances: list[FloatArray] = []
    for along, at, side in zip(
        (np.cos(angles_rad), np.sin(angles_rad)), position_mm, surface_mm, strict=True
    ):
        wall = side + face_mm if at < side / 2 else -face_mm
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (wall - at) / along
        distances.append(np.where(distance > 0.0, distance, np.inf))
    nearest: FloatArray = np.min(distances, axis=0)
    return nearest


def _upright(rows: StripRows, view: _View) -> StripRows:
    """Return the rows as they are meant: a camera that hangs upside down sees the ends exchanged.

    It counts its columns against the angle, so that F is negative.
    """
    if not np.nanmedian(view.rows_per_slope_px) < 0.0:
        return rows
    if rows.bottom_px is None:
        return replace(rows, top_px=rows.surface_px, surface_px=rows.top_px)
    return replace(rows, top_px=rows.bottom_px, bottom_px=rows.top_px)


def _equations(rows: StripRows, view: _View, used: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the terms (E, P) of h0 h1 h2 camera top (offsets of the ends), and the rows (E,).

    An end of the strip, at the rim of the diffuser, is measured off by the same everywhere.
    """
    w, g = view.w[used], (view.rows_per_slope_px / view.strip_mm)[used]
    one, none = np.ones_like(w), np.zeros_like(w)
    level = (one, w, w * w, g)
    if rows.bottom_px is None:
        terms = [np.stack([*level, none, none], 1), np.stack([*level, -g, one], 1)]
        seen = [rows.surface_px[used], rows.top_px[used]]
    else:
        terms = [
            np.stack([*level, none, none, none], 1),
            np.stack([*level, -g, one, none], 1),
            np.stack([*level, g, none, one], 1),
        ]
        seen = [rows.surface_px[used], rows.top_px[used], rows.bottom_px[used]]
    return np.concatenate(terms), np.concatenate(seen)


def _solve(
    terms: FloatArray, seen: FloatArray, top_mm: float | None
) -> tuple[FloatArray, FloatArray, float]:
    """Return parameters, their covariance and the RMS of what is left, in rows."""
    curves = 3 if terms.shape[1] == 7 else 2
    counts = np.full(len(seen), curves * FREE_PER_CURVE / len(seen))
    if top_mm is not None:  # a thousand rows' worth: as good as exact
        terms = np.vstack([terms, np.eye(terms.shape[1])[4]])
        seen, counts = np.append(seen, top_mm), np.append(counts, 1000.0)
    scale = np.maximum(np.sqrt(np.mean(terms**2, axis=0)), 1e-12)
    scaled = terms / scale
    normal = scaled.T @ (scaled * counts[:, None])
    if not np.linalg.cond(normal) < LARGEST_CONDITION:
        raise HeightsError(
            "the strip looks equally far away in all columns, so it does not tell how high the "
            "camera stands"
        )
    parameters = np.linalg.solve(normal, scaled.T @ (counts * seen)) / scale
    off = (terms @ parameters - seen)[: len(seen) - (top_mm is not None)]
    residual_px = float(np.sqrt(np.mean(off**2)))
    variance = max(residual_px, ROW_SIGMA_PX) ** 2
    return parameters, variance * np.linalg.inv(normal) / np.outer(scale, scale), residual_px


def _require_sense(camera_mm: float, sigma_mm: float, residual_px: float) -> None:
    if not residual_px <= LARGEST_RESIDUAL_PX:
        raise HeightsError(
            f"the strip's rows are {residual_px:.1f} px off those of a strip of even height around "
            f"the surface, {LARGEST_RESIDUAL_PX:g} are allowed"
        )
    if not sigma_mm <= LARGEST_SIGMA_MM:
        raise HeightsError(
            f"the strip tells the camera's height only to {sigma_mm:.1f} mm, "
            f"{LARGEST_SIGMA_MM:g} are needed"
        )
    low, high = HEIGHT_RANGE_MM
    if not low <= camera_mm <= high:
        raise HeightsError(
            f"the camera's height comes out at {camera_mm:.1f} mm; {low:g} to {high:g} make sense"
        )


def _slopes(
    columns_px: FloatArray, rows_px: FloatArray, width_px: int
) -> tuple[FloatArray, FloatArray]:
    """Return where lines are (w) and by how many columns they move right for each row down."""
    known = np.isfinite(columns_px) & np.isfinite(rows_px)
    count = known.sum(axis=1)
    columns = np.where(known, columns_px, 0.0)
    rows = np.where(known, rows_px, 0.0)
    share = 1.0 / np.maximum(count, 1)
    middle = columns.sum(axis=1) * share
    off_rows = np.where(known, rows - (rows.sum(axis=1) * share)[:, None], 0.0)
    spread = np.sum(off_rows**2, axis=1)
    good = (count >= 4) & (spread > 1.0)
    slopes = np.sum(off_rows * columns, axis=1)[good] / spread[good]
    return middle[good] / (width_px / 2) - 1.0, slopes
