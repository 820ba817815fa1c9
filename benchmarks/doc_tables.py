"""Tables in Markdown, printed or put into their place in a page of the documentation."""

from collections.abc import Sequence
from pathlib import Path


def table(titles: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    return [_line(titles), _line(["---"] * len(titles)), *map(_line, rows)]


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def put_into(page: Path, name: str, lines: Sequence[str]) -> None:
    """Replace what stands in a page between `<!-- name -->` and `<!-- end of name -->`.

    Raises `SystemExit`, saying what to do, if the page has no such place.
    """
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    text = page.read_text()
    before, found_begin, rest = text.partition(begin)
    _, found_end, after = rest.partition(end)
    if not (found_begin and found_end):
        raise SystemExit(f"{page}: has no place for the table; write {begin} and {end} into it")
    page.write_text("\n".join([before + begin, "", *lines, "", end + after]))
