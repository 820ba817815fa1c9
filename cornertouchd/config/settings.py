"""All settings of the daemon in one frozen value."""

from typing import Self

from pydantic import Field, model_validator

from cornertouchd.config.consistency import ContradictionError, find_contradictions
from cornertouchd.config.led_frame import LedFrameSettings
from cornertouchd.config.monitor import MonitorSettings
from cornertouchd.config.output import TuioSettings
from cornertouchd.config.rig import (
    CalibrationSettings,
    CamerasSettings,
    SimulationSettings,
    SurfaceSettings,
)
from cornertouchd.config.running import RuntimeSettings
from cornertouchd.config.screens import MOST_SCREENS, ScreenSettings
from cornertouchd.config.stages import (
    BackgroundSettings,
    CrossingSettings,
    DirtSettings,
    MotionSettings,
    PairingSettings,
    TouchPointSettings,
    TrackingSettings,
    VisionSettings,
)
from cornertouchd.config.table import Table


class Settings(Table):
    """All settings of the daemon."""

    surface: SurfaceSettings = SurfaceSettings()
    calibration: CalibrationSettings = CalibrationSettings()
    cameras: CamerasSettings = CamerasSettings()
    led_frame: LedFrameSettings = LedFrameSettings()
    simulation: SimulationSettings = SimulationSettings()
    vision: VisionSettings = VisionSettings()
    background: BackgroundSettings = BackgroundSettings()
    pairing: PairingSettings = PairingSettings()
    motion: MotionSettings = MotionSettings()
    dirt: DirtSettings = DirtSettings()
    crossing: CrossingSettings = CrossingSettings()
    touch_point: TouchPointSettings = TouchPointSettings()
    tracking: TrackingSettings = TrackingSettings()
    tuio: TuioSettings = TuioSettings()
    screens: tuple[ScreenSettings, ...] = Field(
        (ScreenSettings(),),
        strict=False,  # a TOML array arrives as a list
        max_length=MOST_SCREENS,
        description="A touchscreen of this computer. Repeat the table for each further display.",
    )
    monitor: MonitorSettings = MonitorSettings()
    runtime: RuntimeSettings = RuntimeSettings()

    @model_validator(mode="after")
    def _refuse_contradictions(self) -> Self:
        found = find_contradictions(
            surface=self.surface,
            cameras=self.cameras,
            led_frame=self.led_frame,
            vision=self.vision,
            pairing=self.pairing,
            crossing=self.crossing,
            tuio=self.tuio,
            screens=self.screens,
            monitor=self.monitor,
        )
        if found:
            raise ContradictionError(found)
        return self
