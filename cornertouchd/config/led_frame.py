"""The settings of the LED frame's controller."""

from typing import Literal

from pydantic import Field

from cornertouchd.config.table import Table

SHORTEST_PERIOD_US, LONGEST_PERIOD_US = 4_000, 32_000
"""What the firmware takes."""
STROBE_SHARE = 0.2
"""Longest strobe as a share of the period: the limit of the firmware, for LEDs and eyes."""


def _level(side: str) -> int:
    level: int = Field(
        128,
        ge=0,
        le=255,
        description=f"Current of the {side} side, 255: full. With automatic_brightness, the level "
        "that it starts from.",
    )
    return level


class LedFrameSettings(Table):
    """The LED frame, if a controller on a serial line strobes it (docs/led-frame.md)."""

    enabled: bool = Field(
        False,
        description="true: a controller strobes the LEDs and triggers the cameras. false: the "
        "strip is always on and needs no controller.",
    )
    port: str = Field(
        "/dev/cornertouch/ledframe",
        min_length=1,
        max_length=4096,
        pattern=r"^[^\x00]+$",
        json_schema_extra={"allowed": "the name of a serial port"},
        description="Serial port of the controller: a name that udev gives, or one of those in "
        "/dev/serial/by-id/.",
    )
    level_top: int = _level("top")
    level_right: int = _level("right")
    level_bottom: int = _level("bottom")
    level_left: int = _level("left")
    rate_hz: float = Field(
        0.0,
        ge=0.0,
        le=250.0,
        description="Strobes and triggers per second, 31.25 to 250. 0: as cameras.rate_hz.",
    )
    strobe_us: int = Field(
        400,
        ge=50,
        le=2000,
        description="Length of a flash; at most a fifth of the period. Not longer than the "
        "exposure of the cameras.",
    )
    lead_us: int = Field(
        50,
        ge=-1000,
        le=1000,
        description="How long before the flash the cameras are triggered: as long as they need to "
        "begin their exposure.",
    )
    pattern: Literal["constant", "ambient", "sides"] = Field(
        "constant",
        description='Which sides shine. "constant": all, in every picture. "ambient": all, but in '
        "every dark_every-th picture none: that one shows sun and lamps, which are subtracted from "
        'the others. "sides": every second picture all, between them one side after the other; '
        "only the pictures with all sides show touches.",
    )
    dark_every: int = Field(
        4,
        ge=2,
        le=8,
        description='With pattern "ambient", every so many pictures one is dark. 2 follows '
        "changing light best and halves the rate of touches.",
    )
    automatic_brightness: bool = Field(
        True,
        description="Hold the strip at target_share of full scale, each side by itself, slowly.",
    )
    target_share: float = Field(
        0.75,
        ge=0.3,
        le=0.9,
        description="Brightness of the uncovered strip as a share of full scale.",
    )
    level_min: int = Field(
        20,
        ge=1,
        le=255,
        description="Lowest level that automatic_brightness goes to; below 20 the controller does "
        "not notice open LEDs.",
    )
    level_max: int = Field(
        255, ge=1, le=255, description="Highest level that automatic_brightness goes to."
    )
    dim_after_s: float = Field(
        300.0,
        ge=0.0,
        le=86_400.0,
        description="The LEDs are dimmed when nothing has touched for so long, and shine again "
        "with the first shadow. 0: never.",
    )
    dim_level: float = Field(
        0.5,
        ge=0.4,
        le=1.0,
        description="How bright they are then, as a share of their level.",
    )

    def period_us(self, cameras_rate_hz: float) -> int:
        """Return the time from flash to flash, for cameras of this rate."""
        return round(1e6 / (self.rate_hz or cameras_rate_hz))

    @property
    def levels(self) -> tuple[int, int, int, int]:
        """Of top, right, bottom and left side."""
        return self.level_top, self.level_right, self.level_bottom, self.level_left

    @property
    def masks(self) -> tuple[int, ...]:
        """The sides that shine in one picture after the other, bits 0 to 3 top to left."""
        match self.pattern:
            case "constant":
                return (15,)
            case "ambient":
                return (15,) * (self.dark_every - 1) + (0,)
            case "sides":
                return (15, 1, 15, 2, 15, 4, 15, 8)
