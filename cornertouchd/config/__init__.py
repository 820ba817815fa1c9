"""Every setting with default, unit and bounds; TOML in, frozen settings out."""

from cornertouchd.config.led_frame import LedFrameSettings
from cornertouchd.config.monitor import MonitorSettings
from cornertouchd.config.output import (
    DestinationSettings,
    DisplaySettings,
    TcpSettings,
    TuioSettings,
    WebSocketSettings,
)
from cornertouchd.config.reading import ConfigError, find_settings, read_settings
from cornertouchd.config.rig import (
    CalibrationSettings,
    CameraSettings,
    CamerasSettings,
    SimulationSettings,
    SurfaceSettings,
)
from cornertouchd.config.running import RuntimeSettings
from cornertouchd.config.screens import ScreenSettings
from cornertouchd.config.settings import Settings
from cornertouchd.config.stages import (
    BackgroundSettings,
    CrossingSettings,
    DirtSettings,
    MotionSettings,
    PairingSettings,
    PaperCrossingSettings,
    PaperVisionSettings,
    TouchPointSettings,
    TrackingSettings,
    VisionSettings,
)
from cornertouchd.config.writing import render_default_toml

__all__ = [
    "BackgroundSettings",
    "CalibrationSettings",
    "CameraSettings",
    "CamerasSettings",
    "ConfigError",
    "CrossingSettings",
    "DestinationSettings",
    "DirtSettings",
    "DisplaySettings",
    "LedFrameSettings",
    "MonitorSettings",
    "MotionSettings",
    "PairingSettings",
    "PaperCrossingSettings",
    "PaperVisionSettings",
    "RuntimeSettings",
    "ScreenSettings",
    "Settings",
    "SimulationSettings",
    "SurfaceSettings",
    "TcpSettings",
    "TouchPointSettings",
    "TrackingSettings",
    "TuioSettings",
    "VisionSettings",
    "WebSocketSettings",
    "find_settings",
    "read_settings",
    "render_default_toml",
]
