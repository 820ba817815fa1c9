"""A plan of the surface in characters: touches with their ids and the way they came."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import groupby, product
from operator import itemgetter

from rich.color import Color, blend_rgb
from rich.color_triplet import ColorTriplet
from rich.console import Console, ConsoleOptions, RenderResult
from rich.segment import Segment
from rich.style import Style

from cornertouchd.wire.tuio_reader import TouchEvent

TRAIL_S = 0.8
BACKGROUND = ColorTriplet(26, 27, 38)
_GRID = Style(color="#363b52")
_BOLD = Style(bold=True)
# Ten hues that keep apart on a dark ground, fingers of two hands; neighbours differ most.
_HUES = ("#7aa2f7", "#ff9e64", "#9ece6a", "#f7768e", "#7dcfff",
         "#e0af68", "#bb9af7", "#73daca", "#ff7eb6", "#c0caf5")  # fmt: skip
# A braille character is 2 x 4 dots; the bit of each, by row and column.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
_BRAILLE = 0x2800
_BLANK = (" ", None)
# In braille dots, which are about as wide as high: a ring just outside the disc's character.
_RING_RADIUS = 4.5
_RING_DOTS = 28
_LABEL_DISTANCE = 4


@dataclass(frozen=True, slots=True)
class _Place:
    x: float
    y: float
    at_s: float


def style_of(session_id: int, faded: float = 0.0) -> Style:
    """Return the colour of a touch, the same wherever it is shown; faded 0..1 into the ground."""
    return _style(session_id % len(_HUES), round(10.0 * faded))


@cache
def _style(hue: int, faded_tenths: int) -> Style:
    color = Color.parse(_HUES[hue]).get_truecolor()
    return Style(color=Color.from_triplet(blend_rgb(color, BACKGROUND, faded_tenths / 10.0)))


class Trails:
    """Where each touch was during the last moments; touches that went leave theirs to fade."""

    def __init__(self) -> None:
        self._places: dict[tuple[str, int], deque[_Place]] = {}

    def note(self, events: Iterable[TouchEvent], now_s: float) -> None:
        """Remember where touches are."""
        for event in events:
            cursor = event.cursor
            if event.kind != "remove":
                places = self._places.setdefault((event.source, cursor.id), deque())
                # Beyond the border, where some trackers go, there is nothing to draw on.
                places.append(_Place(_within(cursor.x), _within(cursor.y), now_s))

    def fade(self, now_s: float) -> None:
        """Forget what is too old to be shown."""
        for key, places in list(self._places.items()):
            while places and now_s - places[0].at_s > TRAIL_S:
                places.popleft()
            if not places:
                del self._places[key]

    def dots(
        self, columns: int, rows: int, now_s: float
    ) -> Iterator[tuple[float, float, int, float]]:
        """Yield x, y, session id and age (0..1) of dots that leave no gap in columns x rows."""
        for (_, session_id), places in self._places.items():
            for before, after in zip(places, list(places)[1:], strict=False):
                age = min(max((now_s - after.at_s) / TRAIL_S, 0.0), 1.0)
                run = max(abs(after.x - before.x) * columns, abs(after.y - before.y) * rows)
                steps = max(round(run), 1)
                for step in range(steps):
                    share = step / steps
                    x = before.x + share * (after.x - before.x)
                    y = before.y + share * (after.y - before.y)
                    yield x, y, session_id, age


@dataclass(frozen=True, slots=True)
class Head:
    """A touch as it is drawn: where, its id, and whether its tracker still speaks."""

    session_id: int
    x: float
    y: float
    silent: bool


class Plan:
    """The surface as wide and high as the place it is given, seen from above."""

    def __init__(self, heads: list[Head], trails: Trails, now_s: float) -> None:
        self._heads = heads
        self._trails = trails
        self._now_s = now_s

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        canvas = _Canvas(options.max_width, options.height or 20)
        canvas.draw_grid()
        for x, y, session_id, age in self._trails.dots(
            2 * canvas.columns, 4 * canvas.rows, self._now_s
        ):
            canvas.draw_dot(x, y, style_of(session_id, 0.15 + 0.75 * age))
        for head in self._heads:
            canvas.draw_ring(head.x, head.y, style_of(head.session_id, 0.8 if head.silent else 0.4))
        for head in self._heads:
            style = style_of(head.session_id, 0.6 if head.silent else 0.0) + _BOLD
            canvas.draw_disc(head.x, head.y, str(head.session_id), style)
        yield from canvas.segments()


class _Canvas:
    """Characters of a plan, and braille dots within them; places are shares of both axes."""

    def __init__(self, columns: int, rows: int) -> None:
        self.columns = columns
        self.rows = rows
        self._cells: dict[tuple[int, int], tuple[str, Style | None]] = {}
        self._bits: dict[tuple[int, int], int] = {}

    def draw_grid(self) -> None:
        """Mark the crossings of a grid of eighths, its quarters stronger."""
        for i, j in product(range(1, 8), repeat=2):
            mark = "+" if i % 2 == j % 2 == 0 else "·"
            self._cells[self._cell(i / 8, j / 8)] = (mark, _GRID)

    def draw_dot(self, x: float, y: float, style: Style) -> None:
        """Set the braille dot at a place; its character takes the style."""
        dot_column = _index(x, 2 * self.columns)
        dot_row = _index(y, 4 * self.rows)
        cell = (dot_column // 2, dot_row // 4)
        self._bits[cell] = self._bits.get(cell, 0) | _DOTS[dot_row % 4][dot_column % 2]
        self._cells[cell] = (chr(_BRAILLE + self._bits[cell]), style)

    def draw_ring(self, x: float, y: float, style: Style) -> None:
        """Draw a ring of dots around the character at a place."""
        column, row = self._cell(x, y)
        for step in range(_RING_DOTS):
            angle_rad = 2.0 * math.pi * (step + 0.5) / _RING_DOTS
            ring_x = (2 * column + 1 + _RING_RADIUS * math.cos(angle_rad)) / (2 * self.columns)
            ring_y = (4 * row + 2 + _RING_RADIUS * math.sin(angle_rad)) / (4 * self.rows)
            if 0.0 <= ring_x < 1.0 and 0.0 <= ring_y < 1.0:
                self.draw_dot(ring_x, ring_y, style)

    def draw_disc(self, x: float, y: float, label: str, style: Style) -> None:
        """Draw a disc at a place, its label to the right, or to the left where there is no room."""
        column, row = self._cell(x, y)
        self._cells[column, row] = ("●", style)
        right = column + _LABEL_DISTANCE
        left = column - _LABEL_DISTANCE - len(label) + 1
        first = right if right + len(label) <= self.columns else left
        for offset, character in enumerate(label):
            self._cells[first + offset, row] = (character, style)

    def segments(self) -> Iterator[Segment]:
        """Yield the characters row by row, neighbours of one style together."""
        for row in range(self.rows):
            cells = (self._cells.get((column, row), _BLANK) for column in range(self.columns))
            for style, run in groupby(cells, key=itemgetter(1)):
                yield Segment("".join(text for text, _ in run), style)
            yield Segment.line()

    def _cell(self, x: float, y: float) -> tuple[int, int]:
        return _index(x, self.columns), _index(y, self.rows)


def _index(share: float, count: int) -> int:
    return min(int(_within(share) * count), count - 1)


def _within(share: float) -> float:
    return min(max(share, 0.0), 1.0)
