"""What a check of the installation finds: one thing looked at, how it is, what to do."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at; `remedy` is empty where all is well."""

    subject: str
    level: Level
    text: str
    remedy: str = ""


def well(subject: str, text: str) -> Finding:
    """Return the finding that something is as it should be."""
    return Finding(subject, "ok", text)


def doubtful(subject: str, text: str, remedy: str) -> Finding:
    """Return the finding of something that touches work with, but not well or not for ever."""
    return Finding(subject, "warning", text, remedy)


def wrong(subject: str, text: str, remedy: str) -> Finding:
    """Return the finding of something without which touches do not work."""
    return Finding(subject, "error", text, remedy)
