"""The settings of what is sent: TUIO, to whom, in whose coordinates."""

from typing import Literal

from pydantic import Field, field_validator

from cornertouchd.config.table import Table

# Each receiver costs a packet per frame; more are better served by a relay.
MOST_DESTINATIONS = 16


class DestinationSettings(Table):
    """One receiver of TUIO and the display whose coordinates it gets."""

    host: str = Field(
        "127.0.0.1",
        min_length=1,
        max_length=253,
        pattern=r"^[!-~]+$",
        json_schema_extra={"allowed": "a host name or an address"},
        description="Name or address of the computer that receives TUIO.",
    )
    port: int = Field(3333, ge=1, le=65_535, description="UDP port; 3333 is what TUIO clients use.")
    display_left_mm: float = Field(
        0.0,
        ge=0.0,
        le=10_000.0,
        description="Left side of the display, measured from the left side of the surface. Set the "
        "four display values if the picture does not fill the frame, or run `cornertouchd "
        "calibrate display`: what it finds holds for every destination whose four display values, "
        "rotation_deg and mirror are all at their defaults.",
    )
    display_top_mm: float = Field(
        0.0,
        ge=0.0,
        le=10_000.0,
        description="Top side of the display, measured from the top side of the surface.",
    )
    display_width_mm: float = Field(
        0.0,
        ge=0.0,
        le=10_000.0,
        description="Width of the display. 0: up to the right side of the surface.",
    )
    display_height_mm: float = Field(
        0.0,
        ge=0.0,
        le=10_000.0,
        description="Height of the display. 0: down to the bottom side of the surface.",
    )
    rotation_deg: Literal[0, 90, 180, 270] = Field(
        0,
        description="Turns the coordinates clockwise, for a display that is mounted turned. "
        "`cornertouchd calibrate display` finds it out.",
    )
    mirror: bool = Field(
        False,
        description="Swaps left and right before turning, for projection from behind. "
        "`cornertouchd calibrate display` finds it out.",
    )

    @field_validator("rotation_deg", mode="before")
    @classmethod
    def _refuse_other_types(cls, given: object) -> object:
        """Refuse false and 90.0, which Python finds equal to 0 and 90."""
        if type(given) is not int:
            raise ValueError("not a whole number")
        return given


class TuioSettings(Table):
    """What is sent, and to whom."""

    source_name: str = Field(
        "",
        max_length=64,
        pattern=r"^[ -~]*$",
        json_schema_extra={"allowed": "up to 64 plain characters (ASCII)"},
        description="Name under which clients see this surface. Empty: made from host name and "
        "configuration file, the same after every restart.",
    )
    destinations: tuple[DestinationSettings, ...] = Field(
        (DestinationSettings(),),
        strict=False,  # a TOML array arrives as a list
        max_length=MOST_DESTINATIONS,
        description="A receiver of TUIO. Repeat the table for each further one; to send to nobody, "
        'replace it by "destinations = []" in [tuio].',
    )
