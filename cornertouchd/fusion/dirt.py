"""Dirt that hangs before the strip: a shadow that stands still and that no touch explains.

Its edges would cross with those of fingers, and make ghosts or spoil touches.  Once it is known for
dirt, its own edges are not valid any more: the crossing takes such a shadow for a place where
something may be, which bounds nothing and needs no explanation.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from cornertouchd.config import DirtSettings
from cornertouchd.geometry import half_angles_of_discs, wrap_angle
from cornertouchd.model import (
    BoolArray,
    Contact,
    FloatArray,
    FrameSet,
    Observation,
    Shadows,
)

LOOK_EVERY_S = 0.25
"""Between two looks the cameras are left alone; dirt takes a minute to be believed anyway."""

LONGEST_STEP_S = 1.0
"""What was before the strip between two looks that are further apart is not known."""

STILL_PX = 0.7
"""How far the edges of one piece may stray: an edge's noise is 0.1 px, and more where the piece is
thin and lets light through."""

OWN_EDGE_PX = 1.0
"""An edge this near to that of the dirt is the dirt's: of a shadow that a finger and the dirt cast
together only the other one tells where the finger is."""

COVERED_PX = 3.0
"""A shadow as near as this may have swallowed the dirt's: the blur fills the gap between them."""

JUMP_BACK_S = 1.0
"""A recording that begins anew goes back by more; a driver that corrects a time by less."""

LOOKS_TO_BE_GONE = 3
"""Looks in a row at a bright strip until a piece is believed to be gone."""

FOLLOWED_AFTER_S = 1.0
"""What is younger is dropped at once when it moves or is covered: fingers on their way."""

EXPLAINED_COUNTS = 4.0
"""How much quicker a touch that explains a piece takes the suspicion away than it grew.  So dirt is
found in spite of ghosts that it makes with fingers now and then, and a finger that rests is safe as
long as it is found one time in five."""

FOLLOWED_SHARE = 0.1
"""What the known place of dirt takes up of what is seen at a look: gum creeps, LEDs warm up."""

CAMERAS_OF_A_TOUCH = 2
"""What only one camera shows explains nothing."""

COVERED, GONE = -1, -2
"""Where a piece is when no shadow stands in its place."""


class ColumnLines(Protocol):
    """Where a camera looks with each of its columns."""

    @property
    def camera(self) -> str:
        """Name of the camera."""
        ...

    @property
    def x_mm(self) -> float:
        """Where it stands."""
        ...

    @property
    def y_mm(self) -> float:
        """Where it stands."""
        ...

    @property
    def angles_rad(self) -> FloatArray:
        """The angle of the line at columns 0, 1, 2, ...; NaN where there is none."""
        ...


@dataclass(frozen=True, slots=True)
class Dirt:
    """Something before the strip of a camera, at these columns since `since_s`."""

    camera: str
    left_px: float
    right_px: float
    since_s: float
    after_s: float

    def __str__(self) -> str:
        return (
            f"camera {self.camera}: something has hung before the strip at columns "
            f"{self.left_px:.0f}..{self.right_px:.0f} for {self.after_s:.0f} s; "
            "touches go on without it: clean the strip, or replace the LED that has died there"
        )


@dataclass(slots=True, eq=False)
class _Piece:
    """A shadow that stands still: where, since when, and how long without an explanation."""

    edges_px: FloatArray
    since_s: float
    unexplained_s: float = 0.0
    looks_gone: int = 0
    dirt: Dirt | None = None

    def stand(self, edges_px: FloatArray, step_s: float, now_s: float, *, explained: bool) -> None:
        """Take note that it is still there."""
        self.looks_gone = 0
        if self.dirt is not None:
            self.edges_px = self.edges_px + FOLLOWED_SHARE * (edges_px - self.edges_px)
        elif explained:
            self.unexplained_s = max(self.unexplained_s - EXPLAINED_COUNTS * step_s, 0.0)
            if self.unexplained_s == 0.0:
                self.since_s = now_s
        else:
            self.unexplained_s += step_s

    @property
    def is_missed(self) -> bool:
        """Whether it is worth waiting for while it is not seen."""
        return self.unexplained_s >= FOLLOWED_AFTER_S and self.looks_gone < LOOKS_TO_BE_GONE


@dataclass(slots=True, eq=False)
class _Strip:
    """The strip as one camera sees it, what stands still before it, and which of that is dirt.

    It is looked at `ahead_s` before others are, so that no frame set has to wait for all looks.
    """

    lines: ColumnLines
    ahead_s: float
    pieces: list[_Piece] = field(default_factory=list)
    dirty: list[_Piece] = field(default_factory=list)
    looked_at_s: float | None = None


class DirtWatch:
    """Finds dirt and keeps it out of the way.  Owned by the fusion thread.

    Goes by the times of the pictures alone; where they jump back by a second, it begins anew.
    """

    def __init__(self, settings: DirtSettings, tables: Iterable[ColumnLines]) -> None:
        self._after_s = settings.after_s
        lines_of_all = tuple(tables)
        self._strips = {
            lines.camera: _Strip(lines, ahead_s=LOOK_EVERY_S * number / len(lines_of_all))
            for number, lines in enumerate(lines_of_all)
        }
        self._dirt: tuple[Dirt, ...] = ()

    @property
    def dirt(self) -> tuple[Dirt, ...]:
        """What hangs before the strips at present: the same objects until something changes."""
        return self._dirt

    def set_aside(self, frame_set: FrameSet) -> FrameSet:
        """Return the frame set with the edges of dirt not valid."""
        if not self._dirt:
            return frame_set
        observations = tuple(self._without_dirt(one) for one in frame_set.observations)
        return FrameSet(frame_set.captured_at_s, observations)

    def learn(self, frame_set: FrameSet, contacts: Sequence[Contact]) -> None:
        """Look at a frame set as the cameras saw it, and at the contacts that explain it."""
        looks = [self._look(one, contacts) for one in frame_set.observations]
        if any(looks):
            self._dirt = tuple(
                piece.dirt
                for strip in self._strips.values()
                for piece in strip.dirty
                if piece.dirt is not None
            )

    def _without_dirt(self, observation: Observation) -> Observation:
        dirty, shadows = self._strips[observation.camera].dirty, observation.shadows
        if not dirty or not len(shadows):
            return observation
        valid = shadows.valid.copy()
        for piece in dirty:
            valid &= np.abs(shadows.edges_px - piece.edges_px) > OWN_EDGE_PX
        return replace(observation, shadows=Shadows(shadows.edges_px, valid, shadows.depth))

    def _look(self, seen: Observation, contacts: Sequence[Contact]) -> bool:
        """Look at what stands still, if it is time; tell whether the dirt has changed."""
        strip, now_s = self._strips[seen.camera], seen.captured_at_s
        if strip.looked_at_s is None or now_s < strip.looked_at_s - JUMP_BACK_S:
            strip.pieces = []
            strip.looked_at_s = now_s - strip.ahead_s
        elif now_s - strip.looked_at_s < LOOK_EVERY_S:
            return False
        else:
            step_s = min(now_s - strip.looked_at_s, LONGEST_STEP_S)
            strip.looked_at_s = now_s
            self._follow_pieces(strip, seen, step_s, contacts)
        before, strip.dirty = strip.dirty, [piece for piece in strip.pieces if piece.dirt]
        return strip.dirty != before

    def _follow_pieces(
        self, strip: _Strip, seen: Observation, step_s: float, contacts: Sequence[Contact]
    ) -> None:
        edges_px = seen.shadows.edges_px
        places = _places(strip.pieces, edges_px)
        explained = _explained(strip.lines, edges_px, contacts)
        followed = []
        for piece, place in zip(strip.pieces, places, strict=True):
            if place >= 0:
                piece.stand(
                    edges_px[place], step_s, seen.captured_at_s, explained=bool(explained[place])
                )
                if piece.dirt is None and piece.unexplained_s >= self._after_s:
                    left_px, right_px = piece.edges_px.tolist()
                    piece.dirt = Dirt(seen.camera, left_px, right_px, piece.since_s, self._after_s)
            elif place == GONE:
                piece.looks_gone += 1
            if place >= 0 or piece.is_missed:
                followed.append(piece)
        taken = set(places)
        followed += [
            _Piece(edges_px[shadow], seen.captured_at_s)
            for shadow in np.flatnonzero(seen.shadows.valid.any(axis=1)).tolist()
            if shadow not in taken
        ]
        strip.pieces = followed


def _places(pieces: Sequence[_Piece], edges_px: FloatArray) -> list[int]:
    """Return for each piece the shadow that stands in its place, or `COVERED`, or `GONE`."""
    if not pieces or not len(edges_px):
        return [GONE] * len(pieces)
    known_px = np.array([piece.edges_px for piece in pieces])
    away_px = np.abs(edges_px[None] - known_px[:, None]).max(axis=2)
    nearest = away_px.argmin(axis=1)
    stands = away_px[np.arange(len(pieces)), nearest] <= STILL_PX
    covered = np.any(
        (edges_px[None, :, 0] < known_px[:, None, 0] + COVERED_PX)
        & (edges_px[None, :, 1] > known_px[:, None, 1] - COVERED_PX),
        axis=1,
    )
    places: list[int] = np.where(stands, nearest, np.where(covered, COVERED, GONE)).tolist()
    return places


def _explained(lines: ColumnLines, edges_px: FloatArray, contacts: Sequence[Contact]) -> BoolArray:
    """Tell which shadows (K,) are those of contacts.

    A shadow is that of a contact if the middle of the one lies within the other.
    """
    discs = np.array(
        [
            (contact.x_mm, contact.y_mm, contact.diameter_mm / 2.0)
            for contact in contacts
            if lines.camera in contact.cameras and len(contact.cameras) >= CAMERAS_OF_A_TOUCH
        ]
    ).reshape(-1, 3)
    dx_mm, dy_mm = discs[:, 0] - lines.x_mm, discs[:, 1] - lines.y_mm
    half_discs = half_angles_of_discs(discs[:, 2], np.hypot(dx_mm, dy_mm))
    ends = np.interp(edges_px, np.arange(len(lines.angles_rad)), lines.angles_rad)
    middles, half_shadows = ends.mean(axis=1), np.abs(ends[:, 1] - ends[:, 0]) / 2.0
    apart = np.abs(wrap_angle(np.arctan2(dy_mm, dx_mm) - middles[:, None]))
    explained: BoolArray = np.any(apart <= np.maximum(half_shadows[:, None], half_discs), axis=1)
    return explained
