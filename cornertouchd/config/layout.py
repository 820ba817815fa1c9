"""How settings stand in the TOML file: table headers, keys, what values are allowed."""

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from cornertouchd.config.output import MOST_DESTINATIONS
from cornertouchd.config.rig import CAMERA_IDS, CONTROL_VALUES
from cornertouchd.config.screens import MOST_SCREENS
from cornertouchd.config.settings import Settings
from cornertouchd.config.table import Location, Table

# Units by the endings of the keys; the longest ending that fits counts.
UNITS = {
    "_mm_s2": "mm/s²",
    "_mm": "mm",
    "_px": "pixels",
    "_hz": "Hz",
    "_ms": "ms",
    "_us": "µs",
    "_s": "s",
    "_deg": "degrees",
}
# How often a table may be repeated.
MOST_TABLES: Mapping[Location, int] = {
    ("tuio", "destinations"): MOST_DESTINATIONS,
    ("screens",): MOST_SCREENS,
}
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
# Longer values are cut in messages: enough to recognise, and one line in a terminal.
LONGEST_SHOWN = 60


def tables_of(table: Table, location: Location = ()) -> Iterator[tuple[Location, Table]]:
    """Yield a table and all tables in it, each with its location, in the order of the file."""
    yield location, table
    for field in type(table).model_fields:
        value, here = getattr(table, field), (*location, field)
        if isinstance(value, Table):
            yield from tables_of(value, here)
        elif isinstance(value, Mapping):
            for name, child in value.items():
                if isinstance(child, Table):
                    yield from tables_of(child, (*here, name))
        elif isinstance(value, tuple):
            for index, child in enumerate(value):
                if isinstance(child, Table):
                    yield from tables_of(child, (*here, index))


def child_table(model: type[Table], field: str) -> type[Table] | None:
    """Return the model of the table or tables that `field` holds, None if it is a value."""
    annotation = model.model_fields[field].annotation
    for candidate in (annotation, *get_args(annotation)):
        if isinstance(candidate, type) and issubclass(candidate, Table):
            return candidate
    return None


def table_at(location: Location) -> type[Table]:
    """Return the model of the innermost table on the way to `location`."""
    model: type[Table] = Settings
    for part in location:
        if isinstance(part, str) and part in model.model_fields:
            model = child_table(model, part) or model
    return model


def keys_of(model: type[Table]) -> tuple[str, ...]:
    """Return the keys that the file may have in a table, those of its sub-tables included."""
    fields = tuple(field for field in model.model_fields if field != "units")
    return fields if "units" not in model.model_fields else (*fields, *CAMERA_IDS)


def header(location: Location) -> str:
    """Return the line that begins the table at `location`, empty for the top of the file."""
    names = ".".join(str(part) for part in location if isinstance(part, str) and part != "units")
    if any(isinstance(part, int) for part in location):
        return f"[[{names}]]"
    return f"[{names}]" if names else ""


def setting_name(location: Location) -> str:
    """Return table and key of a setting as a person would look for it in the file."""
    *table, key = location
    if isinstance(key, int):
        *above, field = table
        if child_table(table_at(tuple(above)), str(field)) is None:
            return f"{setting_name(tuple(table))} number {key + 1}"
        return f"{header(location)} number {key + 1}"
    number = f"number {table[-1] + 1}" if table and isinstance(table[-1], int) else ""
    return " ".join(part for part in (header(tuple(table)), number, shown_key(key)) if part)


def allowed(location: Location) -> str:
    """Return in words which values the setting at `location` may have, with bounds and unit."""
    if location[-1] in table_at(location).model_fields:
        key = str(location[-1])
        return _in_words(key, table_at(location).model_json_schema()["properties"][key])
    if "controls" in location[:-1]:
        return CONTROL_VALUES
    if location[:-1] == ("monitor", "names"):
        return "a host name in quotes"
    if isinstance(location[-1], int) and location[-2] in {"profiles", "origins"}:
        return allowed(location[:-1])
    for tables, most in MOST_TABLES.items():
        if tables in {location, location[:-1]}:
            return f"at most {most} tables, each written as {header((*tables, 0))}"
    return f"a table, written as {header(location)}"


def _in_words(key: str, schema: dict[str, Any]) -> str:
    if "allowed" in schema:
        return str(schema["allowed"])
    unit = max((ending for ending in UNITS if key.endswith(ending)), key=len, default="")
    return f"{_values(schema)} {UNITS.get(unit, '')}".rstrip()


def _values(schema: dict[str, Any]) -> str:
    if "enum" in schema:
        return "one of " + ", ".join(shown(choice) for choice in schema["enum"])
    if schema["type"] == "boolean":
        return "true or false"
    kind = "a whole number" if schema["type"] == "integer" else "a number"
    return f"{kind} from {schema['minimum']} to {schema['maximum']}"


def shown_key(key: str) -> str:
    """Return a key as TOML writes it, cut to a length that fits a message."""
    return _cut(key if BARE_KEY.fullmatch(key) else json.dumps(key))


def shown(value: object) -> str:
    """Return a value as TOML writes it, cut to a length that fits a message."""
    match value:
        case bool():
            return str(value).lower()
        case str():
            return _cut(json.dumps(value, ensure_ascii=False))
        case dict():
            return "(a table)"
        case list():
            return "(an array)"
        case int() if value.bit_length() > 64:
            return _cut(hex(value))  # Python refuses to write thousands of decimal digits
    return _cut(str(value))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 3] + "..."
