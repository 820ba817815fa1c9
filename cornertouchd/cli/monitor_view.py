"""The screen of `cornertouchd listen`: the surface on the left, numbers on the right."""

from collections import deque
from collections.abc import Iterable

from rich import box
from rich.color import Color
from rich.console import Group, RenderableType
from rich.layout import Layout
from rich.panel import Panel
from rich.style import Style
from rich.styled import Styled
from rich.table import Table
from rich.terminal_theme import TerminalTheme
from rich.text import Text

from cornertouchd.cli.monitor_plan import BACKGROUND, Head, Plan, Trails, style_of
from cornertouchd.wire.tuio_reader import TouchEvent, TrackedSource, TuioReader

# A tracker at rest repeats itself every second; three times unheard it is called silent.
SILENT_AFTER_S = 3.0
_RATE_OVER_S = 2.0
_RATE_SAMPLE_S = 0.1
_NUMBERS_WIDTH = 58
_BORDER = "#565f89"
_DIM = "#8089b3"
_TEXT = "#c0caf5"
_GOOD = "#9ece6a"
_BAD = "#f7768e"
_GROUND = Style(color=_TEXT, bgcolor=Color.from_triplet(BACKGROUND))
# For pictures of the screen; everything on it names its colours, so the palette is never used.
_RED, _GREEN, _BLUE = BACKGROUND
THEME = TerminalTheme((_RED, _GREEN, _BLUE), (192, 202, 245), [(_RED, _GREEN, _BLUE)] * 8)


class MonitorView:
    """Draws what a `TuioReader` knows; `address` is where it listens."""

    def __init__(self, reader: TuioReader, address: str) -> None:
        self._reader = reader
        self._address = address
        self._trails = Trails()
        self._counts: dict[str, deque[tuple[float, int]]] = {}

    def note(self, events: Iterable[TouchEvent], now_s: float) -> None:
        """Take in what changed, for the trails and the rates; call it often."""
        self._trails.note(events, now_s)
        for source in self._reader.sources.values():
            counts = self._counts.setdefault(source.name, deque())
            if not counts or now_s - counts[-1][0] >= _RATE_SAMPLE_S:
                counts.append((now_s, source.packets))
            while now_s - counts[0][0] > _RATE_OVER_S:
                counts.popleft()

    def render(self, now_s: float, width: int, height: int) -> RenderableType:
        """Return the screen, `width` x `height` characters."""
        self._trails.fade(now_s)
        sources = list(self._reader.sources.values())
        screen = Layout()
        plan = Layout(self._plan(sources, now_s))
        numbers = Layout(self._numbers(sources, now_s), size=_NUMBERS_WIDTH)
        body = Layout()
        if width >= 2 * _NUMBERS_WIDTH - 10:
            body.split_row(plan, numbers)
        else:
            numbers.size = height // 3
            body.split_column(plan, numbers)
        screen.split_column(body, Layout(self._footer(), size=1))
        return Styled(screen, _GROUND)

    def _plan(self, sources: list[TrackedSource], now_s: float) -> Panel:
        heads = [
            Head(cursor.id, cursor.x, cursor.y, _is_silent(source, now_s))
            for source in sources
            for cursor in source.cursors.values()
        ]
        title = Text.assemble(("TUIO 1.1 ", f"bold {_TEXT}"), (f"on {self._address}", _DIM))
        return Panel(
            Plan(heads, self._trails, now_s),
            title=title,
            title_align="left",
            box=box.ROUNDED,
            border_style=_BORDER,
            padding=0,
        )

    def _numbers(self, sources: list[TrackedSource], now_s: float) -> Panel:
        parts: list[RenderableType] = []
        for source in sources:
            parts += [self._source_line(source, now_s), _touch_table(source, now_s), Text()]
        if not parts:
            parts = [Text("waiting for a tracker", style=_DIM)]
        return Panel(Group(*parts), box=box.ROUNDED, border_style=_BORDER, padding=(0, 1))

    def _source_line(self, source: TrackedSource, now_s: float) -> Text:
        rate_hz = self._rate_hz(source, now_s)
        silent = _is_silent(source, now_s)
        state = f"silent for {now_s - source.heard_at_s:.0f} s" if silent else f"{rate_hz:.0f}/s"
        fseq = "-" if source.fseq is None else str(source.fseq)
        lost = f"{source.lost_frames} lost"
        late = f", {source.late_frames} late" if source.late_frames else ""
        return Text.assemble(
            ("● ", _BAD if silent else _GOOD),
            (source.name, f"bold {_TEXT}"),
            "\n",
            (f"  {state}   fseq {fseq}   ", _DIM),
            (lost + late, _BAD if source.lost_frames or source.late_frames else _DIM),
            overflow="ellipsis",
        )

    def _rate_hz(self, source: TrackedSource, now_s: float) -> float:
        """Return packets per second over the last two seconds."""
        began_s, packets = self._counts[source.name][0]
        elapsed_s = now_s - began_s
        return (source.packets - packets) / elapsed_s if elapsed_s > 0.0 else 0.0

    def _footer(self) -> Text:
        reader = self._reader
        malformed = f"{reader.malformed} malformed"
        if reader.last_malformed:
            malformed += f" ({reader.last_malformed})"
        return Text.assemble(
            (f" {reader.packets} packets   ", _DIM),
            (malformed, _BAD if reader.malformed else _DIM),
            ("   Ctrl-C ends", _DIM),
            no_wrap=True,
            overflow="ellipsis",
        )


def _is_silent(source: TrackedSource, now_s: float) -> bool:
    return now_s - source.heard_at_s > SILENT_AFTER_S


def _touch_table(source: TrackedSource, now_s: float) -> Table:
    table = Table(box=None, padding=(0, 0, 0, 1), header_style=_DIM, expand=True)
    for name in ("id", "x", "y", "X", "Y", "m", "age"):
        table.add_column(name, justify="right", no_wrap=True)
    for cursor in source.cursors.values():
        table.add_row(
            str(cursor.id),
            f"{cursor.x:.3f}",
            f"{cursor.y:.3f}",
            f"{cursor.x_speed:+.2f}",
            f"{cursor.y_speed:+.2f}",
            f"{cursor.acceleration:+.1f}",
            f"{now_s - source.since_s[cursor.id]:6.1f} s",
            style=style_of(cursor.id),
        )
    return table
