"""The settings of the rig, real or simulated: surface, calibration, cameras."""

import re
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, field_validator

from cornertouchd.config.table import Table

CAMERA_IDS = ("C1", "C2", "C3", "C4", "C5", "C6", "C7", "C8")
DEFAULT_CAMERA_IDS = CAMERA_IDS[:4]
USB_PORT = re.compile(r"port:\d+-\d+(\.\d+)*(:\d+\.\d+)?")
"""Bus, ports through the hubs, and the interface where one housing has several cameras."""
CONTROL_VALUES = "a whole number, true, false, or the name of a choice in quotes"


def _control_value(given: object) -> object:
    """Return a value of a control.  One check of all types, so that an error names the control."""
    whole = isinstance(given, int) and -(2**63) <= given < 2**63
    if whole or (isinstance(given, str) and given):
        return given
    raise ValueError(f"must be {CONTROL_VALUES}")


ControlSetting = Annotated[object, AfterValidator(_control_value)]
"""A value of a control: bool, int or str."""


class SurfaceSettings(Table):
    """The touch surface: the rectangle inside the LED frame."""

    width_mm: float = Field(
        350.0,
        ge=100.0,
        le=10_000.0,
        description="Inner width of the frame, from the left to the right LED side. Measure it to "
        "the millimetre before calibrating.",
    )
    height_mm: float = Field(
        400.0,
        ge=100.0,
        le=10_000.0,
        description="Inner height of the frame, from the top to the bottom LED side.",
    )


class CalibrationSettings(Table):
    """Where the calibration of the cameras is kept."""

    file: str = Field(
        "",
        max_length=4096,
        pattern=r"^[^\x00]*$",
        json_schema_extra={"allowed": "the name of a file"},
        description='File that "cornertouchd calibrate" writes and the daemon reads. Empty: '
        "calibration.json in the state directory.",
    )


class CameraSettings(Table):
    """One camera.  `device` is given a default by the camera's name."""

    enabled: bool = Field(
        True,
        description="false takes the camera out, for instance while it is being repaired; touches "
        "are then found with the cameras that remain.",
    )
    device: str = Field(
        min_length=1,
        max_length=4096,
        pattern=r"^[^\x00]*$",
        json_schema_extra={"allowed": "a path, port:1-2.3 or serial:NUMBER"},
        description="The camera's video device: a path such as the lasting names that udev rules "
        "give, or port:1-2.3 for whatever camera hangs on that USB port, or serial:NUMBER for one "
        'camera wherever it is plugged in. "cornertouchd cameras" shows what there is and writes '
        "the rules.",
    )
    row_offset_px: int = Field(
        0,
        ge=0,
        le=8191,
        description="First row of the full image that is used. Cutting the picture to the rows "
        "around the LED strip saves time in every frame.",
    )
    rows_px: int = Field(
        0,
        ge=0,
        le=8192,
        description="Number of rows used, from row_offset_px on. 0: all rows below it. An odd "
        "number of rows cannot be recorded.",
    )
    controls: Mapping[str, ControlSetting] = Field(
        default_factory=dict,
        json_schema_extra={"allowed": "a table of names and values"},
        description="What this camera needs set otherwise than all cameras; what is not named "
        "here is as set there.",
    )

    @field_validator("device")
    @classmethod
    def _check_place(cls, device: str) -> str:
        """Refuse a port or serial number that no camera can have."""
        if device.startswith("port:") and not USB_PORT.fullmatch(device):
            raise ValueError(f"{device!r} is no USB port; ports are written as port:1-2.3")
        if device.startswith("serial:") and not device.removeprefix("serial:").strip():
            raise ValueError("serial: lacks the number; write serial:NUMBER")
        return device


class CamerasSettings(Table):
    """What all cameras have in common.

    `units` maps names to cameras; of C1 to C4 those that are not given keep their defaults.
    """

    source: Literal["v4l2", "opencv", "simulated"] = Field(
        "v4l2",
        description='Where the pictures come from. "v4l2": real cameras. "opencv": real cameras '
        "that only OpenCV's VideoCapture can read; it sets no controls, chooses no format, does "
        "not tell lost and damaged pictures from good ones, and a camera that stalls blocks it for "
        'ten seconds. "simulated": a simulated rig that needs no hardware (see [simulation]).',
    )
    pixel_format: Literal[
        "auto", "GREY", "Y10", "Y12", "Y14", "Y16", "Y10P", "Y12P", "YUYV", "UYVY", "NV12", "MJPG"
    ] = Field(
        "auto",
        description='V4L2 format of the pictures. "auto" takes the first of GREY, Y10 to Y16, '
        "YUYV and its like, MJPG that reaches rate_hz at this size; MJPG takes least of the USB "
        "bus and most of the processor.",
    )
    controls: Mapping[str, ControlSetting] = Field(
        default_factory=dict,
        json_schema_extra={"allowed": "a table of names and values"},
        description="Controls of all cameras, by the names that v4l2-ctl --list-ctrls shows. "
        "Easiest as a table of its own, [cameras.controls], with lines like gain = 0; the choices "
        "of a menu by number or name. They are set at every opening and read back. Automatic "
        "exposure, gain, white balance and focus and the filter against flicker of the mains are "
        "turned off unless they are named here.",
    )
    width_px: int = Field(
        640,
        ge=16,
        le=8192,
        description="Width of the full image. Change it only together with a new calibration.",
    )
    height_px: int = Field(
        480,
        ge=64,
        le=8192,
        description="Height of the full image. Change it only together with a new calibration.",
    )
    rate_hz: float = Field(
        100.0,
        ge=1.0,
        le=1000.0,
        description="Pictures per second asked of every camera. Lower it if USB or processor "
        "cannot keep up.",
    )
    read_timeout_s: float = Field(
        0.5,
        ge=0.05,
        le=60.0,
        description="Time without a picture that counts as one failure of the camera.",
    )
    failures_before_reopen: int = Field(
        5,
        ge=1,
        le=1000,
        description="Failures in a row until a camera is taken out and opened anew. Raise it if "
        "cameras hiccup but recover by themselves.",
    )
    reopen_delay_s: float = Field(
        1.0,
        ge=0.1,
        le=600.0,
        description="Wait before the first attempt to open a lost camera; doubles with every "
        "attempt that fails.",
    )
    reopen_delay_max_s: float = Field(
        30.0,
        ge=0.1,
        le=3600.0,
        description="Longest wait between two attempts to open a lost camera.",
    )
    failures_before_reset: int = Field(
        3,
        ge=1,
        le=1000,
        description="Attempts in vain to bring a lost camera back by opening it until it is reset "
        "over USB. One that is not plugged in is never reset.",
    )
    resets_per_hour: int = Field(
        6,
        ge=0,
        le=60,
        description="Most resets of one camera within an hour. 0: it is never reset.",
    )
    units: Mapping[str, CameraSettings] = Field(
        default_factory=dict,
        validate_default=True,
        description="Each camera has a table of its own: [cameras.C1] top-left, C2 top-right, C3 "
        "bottom-right, C4 bottom-left. Further cameras, C5 to C8, exist only if they are written "
        "here.",
    )

    @field_validator("units", mode="before")
    @classmethod
    def _complete_units(cls, given: object) -> object:
        """Lay the cameras that are given over the four that always exist."""
        if not isinstance(given, Mapping):
            return given
        names = sorted({*DEFAULT_CAMERA_IDS, *map(str, given)})
        return {name: _with_device(name, given.get(name, {})) for name in names}

    @field_validator("units")
    @classmethod
    def _check_names(cls, units: Mapping[str, CameraSettings]) -> Mapping[str, CameraSettings]:
        for name in units:
            if name not in CAMERA_IDS:
                raise ValueError(f"camera {name!r}: cameras are named C1 to C8")
        return units

    def controls_of(self, camera_id: str) -> Mapping[str, bool | int | str]:
        """Return what is to be set on one camera: its own controls over those of all."""
        both = {**self.controls, **self.units[camera_id].controls}
        return {name: value for name, value in both.items() if isinstance(value, bool | int | str)}

    @property
    def enabled_ids(self) -> tuple[str, ...]:
        """Names of the cameras in use, in order."""
        return tuple(name for name, unit in self.units.items() if unit.enabled)


def _with_device(name: str, given: object) -> object:
    if isinstance(given, Mapping):
        return {"device": f"/dev/cornertouch/{name.lower()}", **given}
    return given


class SimulationSettings(Table):
    """The simulated rig; used when cameras.source is "simulated"."""

    seed: int = Field(
        1,
        ge=0,
        le=2**32 - 1,
        description="Start of the random numbers. The same seed gives the same fingers and noise.",
    )
    touches: int = Field(5, ge=0, le=20, description="Number of fingers that move at a time.")
    speed: float = Field(
        1.0,
        ge=0.01,
        le=100.0,
        description="How fast the fingers move; 2.0 is twice the ordinary speed.",
    )
