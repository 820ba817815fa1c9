"""The settings of touchscreens that the kernel makes for the daemon."""

from pydantic import Field

from cornertouchd.config.output import DisplaySettings
from cornertouchd.config.table import Table

MOST_SCREENS = 8
"""More displays than lie under one surface."""

MOST_SLOTS = 60
"""More touches than are followed."""


class OwnScreenSettings(Table):
    """What a touchscreen has of its own."""

    enabled: bool = Field(
        False,
        description="Makes this computer's own programs see the surface as a touchscreen: "
        "browsers, GTK, Qt and kiosk shells need no TUIO then. The daemon must be allowed to open "
        "/dev/uinput; docs/desktop-touch.md says how.",
    )
    name: str = Field(
        "",
        max_length=60,
        pattern=r"^[A-Za-z0-9_. -]*$",
        json_schema_extra={"allowed": "up to 60 letters, digits, spaces, - _ and ."},
        description="Name under which desktops know the touchscreen. Empty: cornertouchd, with the "
        "name of the configuration file if that is another, the name of the display, and a number "
        "if it is not the first: the same after every restart.",
    )
    touches_max: int = Field(
        20,
        ge=1,
        le=MOST_SLOTS,
        description="Touches that the touchscreen tells at once; those beyond wait until others "
        "have lifted. Some programs ignore touchscreens that promise more than they can take.",
    )


class ScreenSettings(DisplaySettings, OwnScreenSettings):
    """A touchscreen of this computer and the display that it belongs to."""
