"""The configuration file with every setting at its default, each explained."""

import json
import textwrap
from collections.abc import Iterator
from inspect import getdoc

from cornertouchd.config.layout import allowed, child_table, header, table_at, tables_of
from cornertouchd.config.settings import Settings
from cornertouchd.config.table import Location, Table

INTRODUCTION = """\
Settings of cornertouchd: all of them, each at its default.

To change a setting, remove the # in front of its key and write the new value. What stays
commented out follows the defaults of the installed version. A value out of its bounds or a
misspelt key is told when the daemon starts; nothing is guessed."""
LINE_LENGTH = 96


def render_default_toml() -> str:
    """Return the text of config/cornertouchd.toml; read back it gives `Settings()`."""
    lines = list(_comment(INTRODUCTION))
    for location, table in tables_of(Settings()):
        if location:
            lines += ["", "", *_render_table(location, table)]
    return "\n".join(lines) + "\n"


def _render_table(location: Location, table: Table) -> Iterator[str]:
    yield header(location)
    explained = not _repeats(location)
    if explained:
        yield from _comment(_purpose(location, table))
    for key in type(table).model_fields:
        if child_table(type(table), key) is None:
            if explained:
                yield ""
                yield from _explain((*location, key), table)
            yield f"#{key} = {json.dumps(getattr(table, key))}"


def _repeats(location: Location) -> bool:
    """Whether the keys of this table have been explained before, at the first camera."""
    return location[:2] == ("cameras", "units") and location[2] != "C1"


def _purpose(location: Location, table: Table) -> str:
    """Return what a table is for: as the list says that it is an entry of, else its model."""
    *holder, field, _ = ("", *location)
    entry_of = table_at(tuple(holder)).model_fields.get(str(field))
    if entry_of and entry_of.description:
        return entry_of.description
    return (getdoc(type(table)) or "").splitlines()[0]


def _explain(location: Location, table: Table) -> Iterator[str]:
    key = str(location[-1])
    yield from _comment(type(table).model_fields[key].description or "")
    yield from _comment(f"Allowed: {allowed(location)}.")


def _comment(text: str) -> Iterator[str]:
    for paragraph in text.split("\n"):
        for line in textwrap.wrap(paragraph, LINE_LENGTH - 2) or [""]:
            yield f"# {line}".rstrip()
