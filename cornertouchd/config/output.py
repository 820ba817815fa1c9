"""The settings of what is sent: TUIO, to whom, in whose coordinates."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints, field_validator

from cornertouchd.config.table import Table

# Each receiver costs a packet per frame; more are better served by a relay.
MOST_DESTINATIONS = 16
# A name that can be part of the name of a file.
DISPLAY_NAME = r"^[A-Za-z0-9_-]*$"
LONGEST_DISPLAY_NAME = 32


Origin = Annotated[str, StringConstraints(pattern=r"^(\*|null|[a-z][a-z0-9+.-]*://[!-.0-~]*)$")]


class ReceiverSettings(Table):
    """Where a receiver of TUIO is."""

    host: str = Field(
        "127.0.0.1",
        min_length=1,
        max_length=253,
        pattern=r"^[!-~]+$",
        json_schema_extra={"allowed": "a host name or an address"},
        description="Name or address of the computer that receives TUIO.",
    )
    port: int = Field(3333, ge=1, le=65_535, description="Its port; 3333 is what TUIO clients use.")
    transport: Literal["udp", "tcp"] = Field(
        "udp",
        description="How TUIO gets there. Nearly all clients listen on UDP. tcp: the daemon "
        "connects to a server there, and again when it was away.",
    )


class DisplaySettings(Table):
    """Where the display lies whose coordinates a receiver gets."""

    display: str = Field(
        "",
        max_length=LONGEST_DISPLAY_NAME,
        pattern=DISPLAY_NAME,
        json_schema_extra={"allowed": "up to 32 letters, digits, - and _"},
        description="Name of the display, if the surface has several: `cornertouchd calibrate "
        "display --name NAME` finds out where it lies. Empty: the only one.",
    )
    display_left_mm: float = Field(
        0.0,
        ge=0.0,
        le=10_000.0,
        description="Left side of the display, measured from the left side of the surface. Set the "
        "four display values if the picture does not fill the frame, or run `cornertouchd "
        "calibrate display`: what it finds holds wherever the four display values, rotation_deg "
        "and mirror are all at their defaults.",
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


class ToldSettings(Table):
    """What a receiver is told of each touch."""

    profiles: tuple[Literal["2Dcur", "2Dblb"], ...] = Field(
        ("2Dcur",),
        strict=False,  # a TOML array arrives as a list
        json_schema_extra={"allowed": '["2Dcur"], ["2Dblb"] or ["2Dcur", "2Dblb"]'},
        description="2Dcur tells where touches are and how they move, and is what clients expect; "
        "2Dblb also how large they are. Each comes in bundles of its own.",
    )

    @field_validator("profiles")
    @classmethod
    def _refuse_none_and_twins(cls, given: tuple[str, ...]) -> tuple[str, ...]:
        if not given or len(set(given)) < len(given):
            raise ValueError("no profile, or the same one twice")
        return given


class DestinationSettings(ToldSettings, DisplaySettings, ReceiverSettings):
    """One receiver of TUIO and the display whose coordinates it gets."""


class _PortSettings(Table):
    enabled: bool = Field(False, description="Whether clients can connect.")
    host: str = Field(
        "127.0.0.1",
        min_length=1,
        max_length=253,
        pattern=r"^[!-~]+$",
        json_schema_extra={"allowed": "a host name or an address"},
        description="Address of this machine to listen at. The default serves programs on this "
        "machine only; 0.0.0.0 serves everybody who reaches it, without a password.",
    )
    port: int = Field(3333, ge=1, le=65_535, description="TCP port that clients connect to.")
    connections_max: int = Field(
        32, ge=1, le=256, description="So many clients can be connected; more are sent away."
    )


class TcpSettings(ToldSettings, DisplaySettings, _PortSettings):
    """TUIO over TCP: a server; each bundle comes after its length, a big-endian int32."""


class WebSocketSettings(ToldSettings, DisplaySettings, _PortSettings):
    """TUIO over WebSocket: a server for pages in browsers; each bundle is a binary message."""

    port: int = Field(8080, ge=1, le=65_535, description="TCP port that clients connect to.")
    origins: tuple[Origin, ...] = Field(
        ("http://localhost:*", "http://127.0.0.1:*"),
        strict=False,  # a TOML array arrives as a list
        max_length=64,
        json_schema_extra={
            "allowed": 'origins in quotes, such as "https://kiosk.example", "http://localhost:*" '
            '(any port), "null" (pages from files) or "*" (all)'
        },
        description="Pages from here may connect; others are refused, so that no page of the "
        "internet reads touches. Programs that are no browsers always may.",
    )


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
    websocket: WebSocketSettings = WebSocketSettings()
    tcp: TcpSettings = TcpSettings()
