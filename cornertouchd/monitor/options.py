"""What the daemon tells the process of the live page when it starts it."""

import json
from dataclasses import asdict, dataclass
from typing import Self


@dataclass(frozen=True, slots=True)
class PageOptions:
    """Where to serve, whom, and what viewers may do.

    `socket` is where the daemon is asked; `recordings` is the directory of what viewers save.

    """

    socket: str
    host: str = "127.0.0.1"
    port: int = 8333
    token: str = ""
    names: tuple[str, ...] = ()
    allow_actions: bool = False
    viewers_max: int = 20
    recordings: str = ""

    def as_line(self) -> bytes:
        """Return the options as a line of JSON.

        They go through a pipe, for the arguments of a process can be read by everyone.
        """
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def from_line(cls, line: bytes) -> Self:
        """Return the options of such a line."""
        told = json.loads(line)
        return cls(**{**told, "names": tuple(told.get("names", ()))})

    @property
    def address(self) -> str:
        """Where a browser finds the page."""
        wildcards = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # noqa: S104  known, not bound to
        host = wildcards.get(self.host, self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/"
