"""One zip for whoever helps: what there is, what is missing and why, and no secrets."""

import os
import re
import tomllib
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Files = Iterable[tuple[str, bytes]]
BLANK = "(left out of the report)"
CONTENTS = "README.txt"
MODE = 0o600
"""It tells a lot of a machine, and nobody else asked for it."""

SHORTEST = 6
"""Shorter ones are no secrets, and part of many a word; the configuration itself has none."""

STORED = (".mkv",)
"""Compressed already."""

SECRET_KEY = re.compile(r"token|secret|password|credential", re.IGNORECASE)
_ASSIGNED = re.compile(
    r"""(\w*(?:token|secret|password|credential)\w*["']?[ \t]*=[ \t]*)"""
    r"""("{3}.*?"{3}|'{3}.*?'{3}|"(?:\\.|[^"\\\n])*"|'[^'\n]*'|[^\s,}#]+)""",
    re.IGNORECASE | re.DOTALL,
)


@dataclass(frozen=True, slots=True)
class Part:
    """Files of a report: what they are, and what gathers them.

    `gather` may raise anything: then they are missing, and the text of what was raised says why.
    """

    about: str
    gather: Callable[[], Files]


@dataclass(frozen=True, slots=True)
class Contents:
    """What a report holds: the parts with their files; and what is missing, with the reason."""

    held: tuple[tuple[str, tuple[str, ...]], ...]
    missing: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        """List it for people."""
        lines = [f"  {about}: {', '.join(names)}" for about, names in self.held]
        if self.missing:
            lines += ["missing:", *(f"  {about}: {why}" for about, why in self.missing)]
        return "\n".join(lines)


def write_report(path: Path, parts: Sequence[Part], secrets: Sequence[str]) -> Contents:
    """Write the zip, in one step: an older one is replaced by a whole one or stays.

    The `secrets` are blanked in every text.  Raises `OSError` if it cannot be written.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, MODE)
        with os.fdopen(descriptor, "wb") as file:
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                contents = _write_parts(archive, path.stem, parts, secrets)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    return contents


def blanked(configuration: str) -> str:
    """Return a configuration without the values of tokens, passwords and the like."""
    return _ASSIGNED.sub(rf'\1"{BLANK}"', configuration)


def secrets_in(configuration: str) -> tuple[str, ...]:
    """Return these values, so that they can be blanked elsewhere; none of a damaged file."""
    try:
        return tuple(_secrets(tomllib.loads(configuration)))
    except tomllib.TOMLDecodeError:
        return ()


def _secrets(table: Mapping[str, Any]) -> Iterator[str]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _secrets(value)
        elif isinstance(value, list):
            yield from (one for part in value if isinstance(part, dict) for one in _secrets(part))
        elif isinstance(value, str) and len(value) >= SHORTEST and SECRET_KEY.search(key):
            yield value


def _write_parts(
    archive: zipfile.ZipFile, folder: str, parts: Sequence[Part], secrets: Sequence[str]
) -> Contents:
    held, missing = [], []
    for part in parts:
        names = []
        try:
            for name, data in part.gather():
                packing = zipfile.ZIP_STORED if name.endswith(STORED) else zipfile.ZIP_DEFLATED
                content = data if name.endswith(STORED) else _without(data, secrets)
                archive.writestr(f"{folder}/{name}", content, packing)
                names.append(name)
        except Exception as error:  # noqa: BLE001  whatever fails, the rest of the report helps
            missing.append((part.about, str(error) or repr(error)))
        if names:
            held.append((part.about, tuple(names)))
    contents = Contents(tuple(held), tuple(missing))
    archive.writestr(f"{folder}/{CONTENTS}", _without(f"{contents}\n".encode(), secrets))
    return contents


def _without(text: bytes, secrets: Sequence[str]) -> bytes:
    for secret in secrets:
        text = text.replace(secret.encode(), BLANK.encode())
    return text
