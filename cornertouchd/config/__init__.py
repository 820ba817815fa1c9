"""Every setting with default, unit and bounds; TOML in, frozen settings out."""

from cornertouchd.config.output import DestinationSettings, TuioSettings
from cornertouchd.config.reading import ConfigError, find_settings, read_settings
from cornertouchd.config.rig import (
    CalibrationSettings,
    CameraSettings,
    CamerasSettings,
    SimulationSettings,
    SurfaceSettings,
)
from cornertouchd.config.settings import Settings
from cornertouchd.config.stages import (
    CrossingSettings,
    PairingSettings,
    PaperCrossingSettings,
    PaperVisionSettings,
    TrackingSettings,
    VisionSettings,
)
from cornertouchd.config.writing import render_default_toml

__all__ = [
    "CalibrationSettings",
    "CameraSettings",
    "CamerasSettings",
    "ConfigError",
    "CrossingSettings",
    "DestinationSettings",
    "PairingSettings",
    "PaperCrossingSettings",
    "PaperVisionSettings",
    "Settings",
    "SimulationSettings",
    "SurfaceSettings",
    "TrackingSettings",
    "TuioSettings",
    "VisionSettings",
    "find_settings",
    "read_settings",
    "render_default_toml",
]
