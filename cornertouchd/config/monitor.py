"""The settings of the live page: who may see it, how much it keeps."""

import ipaddress
from typing import Annotated

from pydantic import Field, StringConstraints

from cornertouchd.config.table import Table

HostName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9._-]{1,253}$")]


class MonitorSettings(Table):
    """The live page, for browsers: what the cameras see, touches, health, metrics."""

    enabled: bool = Field(
        True,
        description="Serve the live page. It runs in a process of its own and costs nothing while "
        "nobody looks.",
    )
    host: str = Field(
        "127.0.0.1",
        min_length=1,
        max_length=253,
        pattern=r"^[A-Za-z0-9.:_-]+$",
        json_schema_extra={"allowed": "a host name or an address of this machine"},
        description="Address to serve at. The default is for browsers on this machine only; "
        "0.0.0.0 serves whoever reaches it and demands a token.",
    )
    port: int = Field(
        8333, ge=1, le=65_535, description="TCP port; the page is at http://127.0.0.1:8333/."
    )
    token: str = Field(
        "",
        max_length=256,
        pattern=r"^([A-Za-z0-9._~-]{16,})?$",
        json_schema_extra={"allowed": "empty, or 16 to 256 letters, digits and - . _ ~"},
        description="What a viewer must know to see anything; required unless host is an address "
        "of this machine only. `openssl rand -hex 16` makes a good one. Keep this file unreadable "
        "to others then.",
    )
    names: tuple[HostName, ...] = Field(
        (),
        strict=False,  # a TOML array arrives as a list
        max_length=16,
        json_schema_extra={"allowed": "at most 16 host names in quotes"},
        description="Further names by which browsers may call this machine, such as kiosk.local. "
        "Requests for names that are neither these nor the address in host are refused: so pages "
        "of others cannot read this one through a name of theirs (DNS rebinding).",
    )
    allow_actions: bool = Field(
        False,
        description="Whether viewers may act: save what just happened as a recording in the state "
        "directory. false: they may look only.",
    )
    viewers_max: int = Field(
        20, ge=1, le=100, description="So many browsers may look at once; more are turned away."
    )
    keep_s: int = Field(
        30,
        ge=0,
        le=600,
        description="The pictures of this time are kept in memory, so that what just happened can "
        "be recorded. 0: none.",
    )
    keep_mb: int = Field(
        512,
        ge=16,
        le=16_384,
        description="They take at most so many megabytes; where that is too little for keep_s, the "
        "daemon says what it keeps. For more than the default, raise MemoryMax of the service.",
    )

    @property
    def is_for_this_machine_only(self) -> bool:
        """Whether nobody else can reach the page."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False
