"""A finger on a simulated rig that goes where it is told, and a person who tells it."""

from dataclasses import replace
from math import ceil

import numpy as np

from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.scripts import PLAIN_FINGER, TimedFinger

TAP_S, LIFTED_S = 0.55, 0.35
"""An unhurried tap, and the time that the hand takes to the next place."""

AIM_SIGMA_MM = 0.3
"""A careful person hits a marked place to this (standard deviation per axis)."""

SCRIBBLE_SPEED_MM_S = 800.0
SIDE_MM = 12.0
ROWS_APART_SHARE = 1 / 7
"""Of the shorter side: a person fills a table in rows a finger's length apart, a wall in wider
ones, but always nearer than the cells of the plan that is to be filled, which are a sixth."""


class Hand:
    """One finger; any thread may move it, the pictures show it from then on."""

    def __init__(self, finger: Finger = PLAIN_FINGER) -> None:
        self._finger = finger
        self._touching: tuple[TimedFinger, ...] = ()
        self._touches = 0

    def touch(self, x_mm: float, y_mm: float) -> None:
        """Put the finger down there, or move it there."""
        if not self._touching:
            self._touches += 1
        finger = replace(self._finger, x_mm=x_mm, y_mm=y_mm)
        self._touching = (TimedFinger(self._touches, finger),)

    def lift(self) -> None:
        """Take the finger away."""
        self._touching = ()

    def fingers_at(self, _: float) -> tuple[TimedFinger, ...]:
        """Return what touches now; fills `scripts.Script`, whatever time is asked for."""
        return self._touching


class Person:
    """Does with a hand what a calibration asks for; told often how things stand."""

    def __init__(self, hand: Hand, surface_mm: tuple[float, float], seed: int) -> None:
        self._hand = hand
        self._rng = np.random.default_rng(seed)
        self._wanted: tuple[float, float] | None = None
        self._down_at_s = 0.0
        self._aim_mm = (0.0, 0.0)
        self._surface_mm = surface_mm
        self._scribbles_since_s: float | None = None

    def tap(self, target_mm: tuple[float, float] | None, now_s: float) -> None:
        """Tap a place, and again after a while if it is still asked for."""
        if target_mm is None:
            self._hand.lift()
            return
        if target_mm != self._wanted or now_s > self._down_at_s + TAP_S + LIFTED_S:
            self._wanted = target_mm
            self._down_at_s = now_s + LIFTED_S
            x_mm, y_mm = (target_mm + self._rng.normal(0.0, AIM_SIGMA_MM, 2)).tolist()
            self._aim_mm = x_mm, y_mm
        if self._down_at_s <= now_s < self._down_at_s + TAP_S:
            self._hand.touch(*self._aim_mm)
        else:
            self._hand.lift()

    def scribble(self, now_s: float) -> None:
        """Move the finger to and fro, row by row, all over the surface."""
        if self._scribbles_since_s is None:
            self._scribbles_since_s = now_s
        way_mm = (now_s - self._scribbles_since_s) * SCRIBBLE_SPEED_MM_S
        self._hand.touch(*place_on_rows(self._surface_mm, way_mm))

    def rest(self) -> None:
        """Keep the hand away."""
        self._hand.lift()


def place_on_rows(surface_mm: tuple[float, float], way_mm: float) -> tuple[float, float]:
    """Return where a finger is after so long a way over rows that fill the surface, for ever."""
    length_mm, height_mm = (side_mm - 2.0 * SIDE_MM for side_mm in surface_mm)
    last = ceil(height_mm / (ROWS_APART_SHARE * min(surface_mm)))
    row, along_mm = divmod(way_mm, length_mm)
    x_mm = SIDE_MM + (along_mm if row % 2 == 0 else length_mm - along_mm)
    down = row % (2 * last)  # down to the last row and up again
    return x_mm, SIDE_MM + min(down, 2 * last - down) / last * height_mm
