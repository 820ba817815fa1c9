"""A daemon that tests of its health look at: what it counts is what they say."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.runtime.capture import CaptureCounts
from cornertouchd.runtime.fusing import FusionCounts
from cornertouchd.runtime.led_light import LightState
from cornertouchd.wire.live import Moment

GAME = DestinationStatus("127.0.0.1", 3333, 10, 0, None)
RATE_HZ = 100.0


class FakeSink:
    destinations = (GAME,)


class WatchedDaemon:
    """A daemon as far as its health goes, and the clock by which it is seen."""

    def __init__(self, *cameras: str) -> None:
        self.time_s = 50.0
        self.cameras = cameras
        self.lost: set[str] = set()
        self.pictures = 0
        self.fusion = FusionCounts(0, 0, 0, 0, 0, 0, 0, 0)
        self.pipeline = SimpleNamespace(blind_columns=(), masked_columns=())
        self.moment: Moment | None = None
        self.supports = np.empty(0)
        self.sink = FakeSink()
        self.drift, self.dirt = None, ()
        self.light: LightState | None = None

    def now_s(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        raise AssertionError("nobody sleeps here")

    @property
    def stages(self) -> Any:
        return SimpleNamespace(
            captures={
                name: SimpleNamespace(pipeline=self.pipeline, light=None) for name in self.cameras
            },
            fusion=SimpleNamespace(
                sinks=[self.sink], pipeline=SimpleNamespace(supports=self.supports)
            ),
            settings=SimpleNamespace(
                cameras=SimpleNamespace(rate_hz=RATE_HZ),
                led_frame=SimpleNamespace(enabled=False),
            ),
            calibration=SimpleNamespace(created_at="2026-01-02T03:04:05+00:00", residual_mm=0.1),
        )

    def strip_shifts(self) -> dict[str, str]:
        return {}

    def light_state(self) -> LightState | None:
        return self.light

    def camera_counts(self) -> dict[str, CaptureCounts]:
        return {
            name: CaptureCounts(self.pictures, 0, 2, name not in self.lost, 1)
            for name in self.cameras
        }

    def fusion_counts(self) -> FusionCounts:
        return self.fusion

    def go_on(
        self, seconds: float, frame_sets: int, turns: int = 1, pictures: int | None = None
    ) -> None:
        self.time_s += seconds
        self.pictures += frame_sets if pictures is None else pictures
        self.fusion = replace(
            self.fusion,
            frame_sets=self.fusion.frame_sets + frame_sets,
            turns=self.fusion.turns + turns,
        )
