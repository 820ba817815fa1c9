"""How far touches are from their directing lines, and how that changes with the cameras.

A place that is unknown is eliminated by triangulation (variable projection), so that it costs no
parameters: it moves when the cameras do.  Derivatives are first taken by what a camera can do to
one touch, its `moves`: shift by 1 mm in x, in y, or turn the line by 1 rad.  In the names `D_moves`
is an array (..., cameras, 3) of how D changes by the moves of every camera.
"""

from dataclasses import dataclass

import numpy as np

from cornertouchd.calibration.touch_columns import EDGE_SIGMA_PX, SHAPE_SIGMA_MM, TouchColumns
from cornertouchd.geometry import normals, unit_vectors
from cornertouchd.model import BoolArray, FloatArray

UNDETERMINED = 1e-9
"""Added to the normal equations of a place, so that one without lines is somewhere."""


@dataclass(frozen=True, slots=True)
class Residuals:
    """Residuals (cameras, points): distances and widths in standard deviations.

    Widths compare half the shadow with half the diameter, and are NaN where that is not known.
    `distances_mm` is from the point (known or triangulated) to the line through the middle.
    """

    distances: FloatArray
    widths: FloatArray
    distances_mm: FloatArray


@dataclass(frozen=True, slots=True)
class Slopes:
    """Derivatives of `Residuals` by all parameters, (cameras, points, cameras, parameters)."""

    distances: FloatArray
    widths: FloatArray


@dataclass(frozen=True, slots=True)
class _Directions:
    """Lines from `origins` (cameras, 1, 2); `normal` and `along` (cameras, points, 2)."""

    origins: FloatArray
    normal: FloatArray
    along: FloatArray

    def towards(self, places_mm: FloatArray) -> "_Lines":
        """Return the lines with the places (points, 2) that they are to point at."""
        return _Lines(self.origins, self.normal, self.along, places_mm - self.origins)


@dataclass(frozen=True, slots=True)
class _Lines(_Directions):
    """Lines and places: `away` (cameras, points, 2) leads from the camera to the place."""

    away: FloatArray

    @property
    def off_mm(self) -> FloatArray:
        """How far the place is beside the line."""
        return np.asarray(np.sum(self.normal * self.away, axis=-1))

    @property
    def ahead_mm(self) -> FloatArray:
        """How far along the line the place is."""
        return np.asarray(np.sum(self.along * self.away, axis=-1))

    @property
    def distances_mm(self) -> FloatArray:
        """How far the place is from the camera."""
        return np.asarray(np.linalg.norm(self.away, axis=-1))


@dataclass(frozen=True, slots=True)
class _Located:
    """Lines with first and final places, the weights of the latter, half the shadows' widths."""

    guess: _Lines
    weights: FloatArray
    lines: _Lines
    half_rad: FloatArray


class TouchModel:
    """What cameras make of touches; a camera's parameters are x, y and its angle polynomial's.

    `px_rad` (cameras,) is about how much a column turns the line, to weigh residuals.
    """

    def __init__(
        self,
        touches: TouchColumns,
        widths_px: FloatArray,
        px_rad: FloatArray,
        degree: int,
        tap_sigma_mm: float,
    ) -> None:
        half_px = widths_px[:, None, None] / 2
        seen = touches.seen[..., None]
        w = np.where(seen, (touches.columns_px - half_px) / half_px, 0.0)
        left, right = np.moveaxis(w[..., None] ** np.arange(degree + 1), 2, 0)
        self._to_middle, self._to_half = (left + right) / 2, (right - left) / 2
        self._points = touches.points_mm
        self._known = touches.known
        self._radii = touches.diameters_mm / 2
        self._edge_rad = px_rad[:, None] * EDGE_SIGMA_PX
        self._place_sigma_mm = np.where(self._known, tap_sigma_mm, SHAPE_SIGMA_MM)

    def residuals(self, parameters: FloatArray, used: BoolArray) -> Residuals:
        """Return the residuals; `used` (cameras, points) tells which lines triangulate."""
        located = self._located(parameters, used)
        distances_mm, off_mm = located.lines.distances_mm, located.lines.off_mm
        edge_mm = self._edge_rad * distances_mm
        widths_mm = distances_mm * np.sin(located.half_rad) - self._radii
        return Residuals(
            off_mm / np.hypot(self._place_sigma_mm, edge_mm),
            widths_mm / np.hypot(SHAPE_SIGMA_MM, edge_mm),
            off_mm,
        )

    def slopes(self, parameters: FloatArray, used: BoolArray) -> Slopes:
        """Return how the residuals change with the parameters (cameras, parameters)."""
        located = self._located(parameters, used)
        lines, half_rad = located.lines, located.half_rad
        place_moves = self._place_moves(located, used)
        own = np.arange(len(parameters))
        off_moves = np.einsum("cpi,pidm->cpdm", lines.normal, place_moves)
        off_moves[own, :, own, :2] -= lines.normal
        off_moves[own, :, own, 2] -= lines.ahead_mm
        square_moves = _half_square_moves(lines, place_moves)
        distances_mm = lines.distances_mm
        edge_mm = self._edge_rad * distances_mm

        def weighed(mm: FloatArray, mm_moves: FloatArray, sigma_mm: FloatArray) -> FloatArray:
            """Differentiate mm / hypot(sigma_mm, edge_mm)."""
            total_mm = np.hypot(sigma_mm, edge_mm)
            falling = mm * self._edge_rad**2 / total_mm**3
            moves: FloatArray = _each(1 / total_mm) * mm_moves - _each(falling) * square_moves
            return moves

        sine = np.sin(half_rad)
        widths_mm = distances_mm * sine - self._radii
        widths_moves = _each(sine / np.maximum(distances_mm, UNDETERMINED)) * square_moves
        distances = self._by_parameters(weighed(lines.off_mm, off_moves, self._place_sigma_mm))
        widths = self._by_parameters(
            weighed(widths_mm, widths_moves, np.full(edge_mm.shape, SHAPE_SIGMA_MM))
        )
        growing = distances_mm * np.cos(half_rad) / np.hypot(SHAPE_SIGMA_MM, edge_mm)
        widths[own, :, own, 2:] += growing[..., None] * self._to_half
        return Slopes(distances, widths)

    def _by_parameters(self, moves: FloatArray) -> FloatArray:
        """Return derivatives by all parameters from those by the moves: a polynomial turns."""
        turned = np.einsum("cpd,dpk->cpdk", moves[..., 2], self._to_middle)
        return np.concatenate([moves[..., :2], turned], axis=-1)

    def _located(self, parameters: FloatArray, used: BoolArray) -> _Located:
        """Triangulate the places that are unknown, twice: nearer cameras see more exactly."""
        middle = np.einsum("cpk,ck->cp", self._to_middle, parameters[:, 2:])
        half = np.einsum("cpk,ck->cp", self._to_half, parameters[:, 2:])
        bare = _Directions(parameters[:, None, :2], normals(middle), unit_vectors(middle))
        guess = bare.towards(_meeting(bare, used.astype(np.float64)))
        weights = used / (SHAPE_SIGMA_MM**2 + (self._edge_rad * guess.distances_mm) ** 2)
        places = np.where(self._known[:, None], self._points, _meeting(bare, weights))
        return _Located(guess, weights, bare.towards(places), half)

    def _place_moves(self, located: _Located, used: BoolArray) -> FloatArray:
        """Return how triangulated places move, (points, 2, cameras, 3); known ones do not."""
        guess, weights = located.guess, located.weights
        guess_moves = _meeting_moves(guess, used.astype(np.float64))
        square_moves = _half_square_moves(guess, guess_moves)
        weight_moves = _each(-2 * (weights * self._edge_rad) ** 2) * square_moves
        moves = _meeting_moves(located.lines, weights, weight_moves)
        moves[self._known] = 0.0
        return moves


def _meeting(lines: _Directions, weights: FloatArray) -> FloatArray:
    """Return the points nearest to their lines, (points, 2)."""
    offsets = np.sum(lines.normal * lines.origins, axis=-1)
    b = np.einsum("cp,cpi,cp->pi", weights, lines.normal, offsets)
    return np.asarray(np.linalg.solve(_normal_matrix(lines, weights), b[..., None])[..., 0])


def _meeting_moves(
    lines: _Lines, weights: FloatArray, weight_moves: FloatArray | None = None
) -> FloatArray:
    """Differentiate `_meeting`, whose normal equations are sum(w n off) = 0: (points, 2, c, 3)."""
    shifts = weights[..., None, None] * lines.normal[..., None] * lines.normal[..., None, :]
    turns = weights[..., None] * (
        lines.off_mm[..., None] * lines.along + lines.ahead_mm[..., None] * lines.normal
    )
    pulls = np.concatenate([shifts, turns[..., None]], axis=-1).transpose(1, 2, 0, 3)
    if weight_moves is not None:
        pulls -= np.einsum("cpdm,cpi,cp->pidm", weight_moves, lines.normal, lines.off_mm)
    flat = pulls.reshape(*pulls.shape[:2], -1)
    return np.asarray(np.linalg.solve(_normal_matrix(lines, weights), flat)).reshape(pulls.shape)


def _normal_matrix(lines: _Directions, weights: FloatArray) -> FloatArray:
    a = np.einsum("cp,cpi,cpj->pij", weights, lines.normal, lines.normal)
    return np.asarray(a + UNDETERMINED * np.eye(2))


def _half_square_moves(lines: _Lines, place_moves: FloatArray) -> FloatArray:
    """Differentiate half the squared distance from camera to place, (cameras, points, c, 3)."""
    moves = np.einsum("cpi,pidm->cpdm", lines.away, place_moves)
    own = np.arange(len(moves))
    moves[own, :, own, :2] -= lines.away
    return np.asarray(moves)


def _each(factors: FloatArray) -> FloatArray:
    """Return factors (cameras, points) for arrays of moves."""
    return factors[..., None, None]
