"""Cameras whose pictures are lit by the emulated board: what its pins say shines, is seen."""

import queue
import random
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from led_board import Board

from cornertouchd.model import Frame, PictureFormat
from cornertouchd.ports import CameraError
from cornertouchd.simulation.fingers import Finger
from cornertouchd.simulation.flanks import Sun
from cornertouchd.simulation.noise import Light
from cornertouchd.simulation.rig import SimulatedRig

FULL_LEVEL = 128
"""The level at which a side shines as the simulated rig does."""

STAMP_AFTER_S = 0.003
"""A driver's stamp at the end of a picture."""

ASK_EVERY_S = 0.004


@dataclass(frozen=True)
class Flash:
    number: int
    at_s: float
    mask: int
    levels: tuple[int, ...]
    touched: bool


class Lights:
    """What every camera sees of each side and of the sun, with fingers or without."""

    def __init__(self, seed: int, sun: Sun | None, fingers: Sequence[Finger]) -> None:
        self.rig = SimulatedRig(seed=seed)
        sides = [
            SimulatedRig(seed=seed, leds=tuple(float(side == lit) for side in range(4)))
            for lit in range(4)
        ]
        sunny = SimulatedRig(seed=seed, sun=sun) if sun else None
        self._sides: dict[tuple[str, bool], list[Light]] = {}
        self._sun: dict[tuple[str, bool], Light] = {}
        self.dead_columns: dict[str, list[slice]] = {}
        for camera in self.rig.formats:
            for touched in (False, True):
                shown = fingers if touched else ()
                key = camera, touched
                self._sides[key] = [rig.light(camera, shown) for rig in sides]
                plain = self.rig.light(camera, shown)
                self._sun[key] = (sunny.light(camera, shown) if sunny else plain) - plain

    def light(self, camera: str, flash: Flash) -> Light:
        light = self._sun[camera, flash.touched].copy()
        for side, seen in enumerate(self._sides[camera, flash.touched]):
            if flash.mask >> side & 1:
                light += np.float32(flash.levels[side] / FULL_LEVEL) * seen
        for columns in self.dead_columns.get(camera, ()):
            light[:, columns] = self._sun[camera, flash.touched][:, columns]
        return light


class LitCamera:
    """Fills `CameraPort` and `Camera`: a picture for each flash, some are dropped."""

    def __init__(self, rig: "LitRig", camera: str) -> None:
        self.id = camera
        self.identity = ""
        self.format: PictureFormat = rig.lights.rig.formats[camera]
        self._rig = rig
        self.flashes: queue.Queue[Flash] = queue.Queue(maxsize=4)

    def open(self) -> "LitCamera":
        return self

    def close(self) -> None:
        pass

    def read(self, timeout_s: float) -> Frame | None:
        try:
            flash = self.flashes.get(timeout=timeout_s)
        except queue.Empty:
            return None
        if self._rig.ended:
            raise CameraError(self.id, "the board has ended")
        light = self._rig.lights.light(self.id, flash)
        pixels = self._rig.lights.rig.expose(self.id, flash.number, light)
        return Frame(self.id, flash.number, flash.at_s + STAMP_AFTER_S, None, pixels)


class LitRig:
    """Four cameras that the board triggers."""

    def __init__(self, board: Board, lights: Lights, dropped: float = 0.01) -> None:
        self.lights = lights
        self.touched = False
        self.ended = False
        self.flashes: dict[int, Flash] = {}
        self._board = board
        self._dropped = dropped
        self._random = random.Random(1)
        self.ports = [LitCamera(self, camera) for camera in lights.rig.formats]
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._follow, daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._stop.set()
        self._thread.join(10.0)
        self.ended = True

    def _follow(self) -> None:
        following = 0
        while not self._stop.wait(ASK_EVERY_S):
            for number, at_s, mask, *levels in self._board.do(f"flashes {following}")["flashes"]:
                following = number + 1
                flash = Flash(number, at_s, mask, tuple(levels), self.touched)
                self.flashes[number] = flash
                if time.monotonic() - at_s < 0.2:
                    self._hand_on(flash)

    def _hand_on(self, flash: Flash) -> None:
        for port in self.ports:
            if self._random.random() >= self._dropped and not port.flashes.full():
                port.flashes.put(flash)
