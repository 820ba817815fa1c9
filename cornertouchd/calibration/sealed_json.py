"""JSON files with format, version and checksum, refused when they are not as they were written."""

import hashlib
import json
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cornertouchd.calibration.calibration import CalibrationError

LARGEST_BYTES = 64 * 2**20
"""Eight cameras of 1920x1080 pixels, all rows used, take half of it."""

MOST_VALUES = 1_000_000
"""Eight cameras with tables of a thousand points are a twentieth; more only fills the memory."""

LONGEST_VALUE = 60
"""A wrong value is shown if it is no longer than this: a picture would fill the screen."""


class SealedFile(BaseModel):
    """The content of such a file; a subclass adds `format` and `version` as literals."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    FORMAT: ClassVar[str]
    VERSION: ClassVar[int]
    OLDER: ClassVar[tuple[int, ...]] = ()
    """Versions that are read, too, but no longer written."""

    checksum: str = Field(
        pattern="^[0-9a-f]{64}$",
        description="SHA-256 of all other keys as JSON, sorted, without spaces: tells edited files",
    )


_Sealed = TypeVar("_Sealed", bound=SealedFile)


def seal(content: dict[str, Any]) -> bytes:
    """Return a file with this content and its checksum."""
    sealed = {**content, "checksum": _checksum(content)}
    return (json.dumps(sealed, indent=1) + "\n").encode()


def read_bounded(path: Path, remedy: str) -> bytes:
    """Return the bytes of a file of bearable size.  Raises `CalibrationError`, `OSError`."""
    if not path.is_file():
        path.stat()
        raise CalibrationError(f"{path}: is not a file; {remedy}")
    with path.open("rb") as file:
        content = file.read(LARGEST_BYTES + 1)
    if len(content) > LARGEST_BYTES:
        raise CalibrationError(
            f"{path}: is larger than {LARGEST_BYTES >> 20} MiB, so it is not one of ours; {remedy}"
        )
    return content


def unseal(content: bytes, kind: type[_Sealed], path: Path, remedy: str) -> _Sealed:
    """Return what a file holds.  Raises `CalibrationError` naming it, what is wrong, the remedy."""
    raw = _parse(content, path, remedy)
    if raw.get("format") != kind.FORMAT:
        raise CalibrationError(f"{path}: is not a {kind.FORMAT} file; {remedy}")
    if raw.get("version") not in (kind.VERSION, *kind.OLDER):
        raise CalibrationError(
            f"{path}: version {raw.get('version')!r:.20}, this software reads {kind.VERSION}; "
            f"{remedy}"
        )
    try:
        sealed = kind.model_validate_json(content)
    except ValidationError as error:
        raise CalibrationError(f"{path}: {_first_of(error)}; {remedy}") from None
    checksum = raw.pop("checksum")
    if checksum != _checksum(raw):
        raise CalibrationError(f"{path}: has been changed since it was written; {remedy}")
    return sealed


def _parse(content: bytes, path: Path, remedy: str) -> dict[str, Any]:
    if content.count(b",") + content.count(b"[") + content.count(b"{") > MOST_VALUES:
        raise CalibrationError(
            f"{path}: holds more than {MOST_VALUES} values, so it is not one of ours; {remedy}"
        )
    try:
        raw = json.loads(content)
    except RecursionError:
        raise CalibrationError(f"{path}: is nested too deeply; {remedy}") from None
    except ValueError as error:
        raise CalibrationError(f"{path}: is not a whole JSON file ({error}); {remedy}") from None
    return raw if isinstance(raw, dict) else {}


def _first_of(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    place = ".".join(str(part) for part in first["loc"]) or "content"
    value = repr(first["input"])
    shown = first["type"] != "missing" and len(value) <= LONGEST_VALUE
    return f"{place}{f' = {value}' if shown else ''}: {first['msg']}"


def _checksum(content: dict[str, Any]) -> str:
    canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()
