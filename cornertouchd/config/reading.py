"""From a TOML file to settings, with every error of the file told at once."""

import difflib
import re
import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from cornertouchd.config.consistency import Contradiction, ContradictionError
from cornertouchd.config.layout import (
    LONGEST_SHOWN,
    allowed,
    header,
    keys_of,
    setting_name,
    shown,
    table_at,
    tables_of,
)
from cornertouchd.config.rig import CAMERA_IDS
from cornertouchd.config.settings import Settings
from cornertouchd.config.table import Location
from cornertouchd.errors import ReportedError

ENVIRONMENT_VARIABLE = "CORNERTOUCHD_CONFIG"
SYSTEM_FILE = Path("/etc/cornertouchd/cornertouchd.toml")
# Fifty times the file with all settings and their descriptions; whatever is larger is no such file.
LARGEST_FILE_BYTES = 1_000_000


class ConfigError(ReportedError):
    """The configuration cannot be used; the message has one line for each error."""


@dataclass(frozen=True, slots=True)
class _Fault:
    location: Location
    value: object
    unknown: bool


def find_settings(explicit: Path | None, environ: Mapping[str, str]) -> Path | None:
    """Return the configuration file to read, None if the defaults are to be used.

    Looks at `explicit`, $CORNERTOUCHD_CONFIG and /etc/cornertouchd/cornertouchd.toml, in this
    order.  Raises `ConfigError` if a file that was asked for by name does not exist.
    """
    if explicit is not None:
        return _existing(explicit, "given on the command line")
    named = environ.get(ENVIRONMENT_VARIABLE, "")
    if named:
        return _existing(Path(named), f"named by ${ENVIRONMENT_VARIABLE}")
    return SYSTEM_FILE if _exists(SYSTEM_FILE) else None


def _existing(path: Path, origin: str) -> Path:
    if not _exists(path):
        raise ConfigError(f"{path}: no such file, {origin}; correct the name or create the file")
    return path


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except PermissionError:
        return True  # reading it will say that it may not be read


def read_settings(path: Path) -> Settings:
    """Return the settings of a file; what it does not mention has its default.

    Raises `ConfigError` with all errors of the file, a line each.
    """
    tables = _parse(path)
    problems = list(_problems(tables))
    if problems:
        raise ConfigError("\n".join(f"{path}: {problem}" for problem in problems))
    return Settings.model_validate(_in_the_form_of_settings(tables))


def _parse(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE_BYTES + 1)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ConfigError(
            f"{path}: cannot be read: {reason}; check name and permissions"
        ) from error
    if len(content) > LARGEST_FILE_BYTES:
        raise ConfigError(
            f"{path}: is larger than {LARGEST_FILE_BYTES} bytes; name a configuration file"
        )
    try:
        # Some editors put a byte order mark in front, which TOML does not know.
        return tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ConfigError(f"{path}: line {line}: is not UTF-8; save the file as UTF-8") from error
    except ValueError as error:
        raise ConfigError(_syntax_error(path, content, str(error))) from error
    except RecursionError as error:
        raise ConfigError(f"{path}: arrays or tables are nested too deeply") from error


def _syntax_error(path: Path, content: bytes, message: str) -> str:
    place = re.search(r" \(at line (\d+), column (\d+)\)$", message)
    if place:
        where = f"line {place[1]}, column {place[2]}"
        return f"{path}: {where}: {message[: place.start()]}; correct the TOML there"
    if message.endswith(" (at end of document)"):
        reason = message.removesuffix(" (at end of document)")
        last = len(content.splitlines())
        return f"{path}: line {last}: {reason} at the end of the file; correct the TOML there"
    return f"{path}: {message}; correct the TOML"


def _in_the_form_of_settings(tables: dict[str, Any]) -> dict[str, Any]:
    """Return the tables with [cameras.C1] and its like gathered in `units`."""
    cameras = tables.get("cameras")
    if not isinstance(cameras, dict):
        return tables
    units = {key: value for key, value in cameras.items() if key in CAMERA_IDS}
    others = {key: value for key, value in cameras.items() if key not in units}
    return {**tables, "cameras": {**others, "units": units}}


def _problems(tables: dict[str, Any]) -> Iterator[str]:
    """Yield all errors: first single values, then what does not fit among the values left."""
    settings = _in_the_form_of_settings(tables)
    faults = _faults(settings)
    yield from map(_describe, [*_units_as_key(tables), *faults])
    wrong = {fault.location for fault in faults if not fault.unknown}
    for contradiction in _contradictions(_without(settings, {each.location for each in faults})):
        if not any(_concerns(contradiction, location) for location in wrong):
            yield contradiction.message


def _units_as_key(tables: dict[str, Any]) -> list[_Fault]:
    """Return the fault of a file that takes our name for the cameras' tables for a key."""
    cameras = tables.get("cameras")
    if isinstance(cameras, dict) and "units" in cameras:
        return [_Fault(("cameras", "units"), cameras["units"], unknown=True)]
    return []


def _faults(settings: dict[str, Any]) -> list[_Fault]:
    return [
        _Fault(each["loc"], each["input"], each["type"] == "extra_forbidden")
        for each in _validation_errors(settings)
        if each["loc"]  # contradictions belong to no single place
    ]


def _contradictions(settings: dict[str, Any]) -> list[Contradiction]:
    causes = [each.get("ctx", {}).get("error") for each in _validation_errors(settings)]
    return [
        contradiction
        for cause in causes
        if isinstance(cause, ContradictionError)
        for contradiction in cause.contradictions
    ]


def _validation_errors(settings: dict[str, Any]) -> list[ErrorDetails]:
    try:
        Settings.model_validate(settings)
    except ValidationError as error:
        return error.errors(include_url=False)
    return []


def _concerns(contradiction: Contradiction, faulty: Location) -> bool:
    return any(location[: len(faulty)] == faulty for location in contradiction.locations)


def _without(node: Any, faulty: Collection[Location]) -> Any:
    """Return the tables without what is faulty; in arrays, defaults take its place."""
    if not faulty:
        return node
    entries = enumerate(node) if isinstance(node, list) else node.items()
    kept = {
        key: _without(value, {place[1:] for place in faulty if place[0] == key})
        for key, value in entries
        if (key,) not in faulty
    }
    if isinstance(node, list):
        return [kept.get(index, {}) for index in range(len(node))]
    return kept


def _describe(fault: _Fault) -> str:
    if fault.unknown:
        return _describe_unknown(fault)
    name, words = setting_name(fault.location), allowed(fault.location)
    return f"{name} = {shown(fault.value)}: must be {words}"


def _describe_unknown(fault: _Fault) -> str:
    name, key = setting_name(fault.location), str(fault.location[-1])
    known = keys_of(table_at(fault.location[:-1]))
    near = _nearest(key, known)
    if near:
        remedy = f"did you mean {near}?"
    elif home := _nearest_elsewhere(key, fault.location[0]):
        remedy = f"did you mean {home}?"
    else:
        remedy = f"known here: {', '.join(known)}"
    return f"{name} = {shown(fault.value)}: unknown key; {remedy}"


def _nearest(key: str, known: Collection[str]) -> str | None:
    lower = {each.lower(): each for each in known}
    near = difflib.get_close_matches(key.lower()[:LONGEST_SHOWN], lower, n=1)
    return lower[near[0]] if near else None


def _nearest_elsewhere(key: str, top: str | int) -> str | None:
    """Return the setting of any table whose key is nearest, as a person would look for it.

    Of tables that have the same key, those in the table `top` come first.
    """
    homes: dict[str, Location] = {}
    for location, table in sorted(tables_of(Settings()), key=lambda one: one[0][:1] != (top,)):
        for known in keys_of(type(table)):
            homes.setdefault(known, location)
    near = _nearest(key, homes)
    return f"{near} in {header(homes[near])}" if near else None
