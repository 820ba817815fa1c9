"""`cornertouchd listen`: a TUIO client in the terminal, to see what any tracker says."""

import contextlib
import io
import logging
import math
import time
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import click
from rich.console import Console
from rich.live import Live

from cornertouchd.cli.listen_check import check_stream
from cornertouchd.cli.monitor_view import THEME, MonitorView
from cornertouchd.cli.packets import RecordingInput, Stream, StreamAddress
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.devices.tuio_listening import StreamEndedError, TuioInput
from cornertouchd.errors import ReportedError
from cornertouchd.wire.tuio_reader import TouchEvent, TuioReader
from cornertouchd.wire.tuio_rules import Transport

# Smooth to the eye; a screen of 140 x 40 takes 11 ms to draw, so a fifth of one core.
REDRAW_EVERY_S = 0.06
# How large the picture is when there is no terminal to take its size from.
PICTURE_COLUMNS, PICTURE_ROWS = 116, 30


@click.command()
@click.argument("stream", required=False, type=StreamAddress())
@click.option(
    "--transport",
    type=click.Choice(["udp", "tcp", "websocket"]),
    help="udp listens at the port; tcp and websocket connect to a server there.  [default: udp]",
)
@click.option("--port", type=click.IntRange(1, 65535), help="[default: 3333; websocket: 8080]")
@click.option("--host", help="Address to listen on, or of the server.  [default: 127.0.0.1]")
@click.option("--seconds", type=FiniteRange(min=0.0), help="End after so long.")
@click.option("--plain", is_flag=True, help="One line per event, for pipes.")
@click.option("--check", is_flag=True, help="Tell what breaks the rules of TUIO 1.1; status 1.")
@click.option(
    "--record",
    type=click.Path(dir_okay=False, writable=True, path_type=Path),
    help="Keep the stream in a file.",
)
@click.option(
    "--svg",
    type=click.Path(dir_okay=False, writable=True, path_type=Path),
    help="Save the last screen as a picture.",
)
def listen(
    stream: Stream | None,
    transport: Transport | None,
    port: int | None,
    host: str | None,
    seconds: float | None,
    plain: bool,
    check: bool,
    record: Path | None,
    svg: Path | None,
) -> None:
    """Show the touches that a TUIO tracker sends, whichever it is.

    STREAM is udp://HOST:PORT, tcp://HOST:PORT, ws://HOST:PORT, or a file that --record has made;
    --transport, --host and --port say the same.

    Where the output is not a terminal, or with --plain, prints one line per event: what happened
    (add, update, remove), the id, x and y, the tracker.  With --check, one line for each violation:
    the packet (from 1), its byte (from 0), the rule and what is wrong; the exit status is 1 if
    there were any, or if nothing came.
    """
    if stream is None:
        stream = Stream.of(transport or "udp", host, port)
    elif transport or host or port:
        raise click.UsageError("STREAM says all that --transport, --host and --port say")
    if check and (plain or svg):
        raise click.UsageError("--check prints violations; leave out --plain and --svg")
    try:
        paced = not (plain or check) and Console().is_terminal
        with stream.opened(paced=paced) as packets, _recorded(packets, record, stream) as taken:
            if check:
                click.echo(f"checking {stream}", err=True)
                check_stream(taken, stream.transport, seconds)
            else:
                _show(taken, stream, seconds, plain, svg)
    except ReportedError as error:
        raise click.ClickException(str(error)) from error


def _recorded(
    packets: TuioInput, record: Path | None, stream: Stream
) -> AbstractContextManager[TuioInput]:
    """Return the packets, kept in a file if one is given."""
    if record is None:
        return contextlib.nullcontext(packets)
    return RecordingInput(packets, record, stream.transport)


def _show(
    packets: TuioInput, stream: Stream, seconds: float | None, plain: bool, svg: Path | None
) -> None:
    reader = TuioReader()
    view = MonitorView(reader, stream.shown)
    console = Console()
    with _quiet_parser():
        try:
            if plain or not console.is_terminal:
                click.echo(f"listening on {stream}", err=True)
                _watch(packets, reader, view, None, seconds)
            else:
                with Live(console=console, screen=True, auto_refresh=False) as live:
                    _watch(packets, reader, view, live, seconds)
        except KeyboardInterrupt:
            pass
        except StreamEndedError as ended:
            click.echo(f"{ended}", err=True)
        if svg is not None:
            _save_picture(view, console, svg)


def _watch(
    packets: TuioInput,
    reader: TuioReader,
    view: MonitorView,
    live: Live | None,
    seconds: float | None,
) -> None:
    """Take packets in until the time is over; draw on `live`, or print lines if there is none."""
    now_s = time.monotonic()
    end_s = math.inf if seconds is None else now_s + seconds
    draw_at_s = now_s
    while now_s < end_s:
        events = _receive(packets, reader, min(draw_at_s, end_s) - now_s)
        now_s = time.monotonic()
        events += reader.forget_silent(now_s)
        view.note(events, now_s)
        if live is None:
            _print_lines(events)
        if now_s >= draw_at_s:
            draw_at_s = now_s + REDRAW_EVERY_S
            if live is not None:
                live.update(view.render(now_s, *live.console.size), refresh=True)


def _receive(packets: TuioInput, reader: TuioReader, wait_s: float) -> list[TouchEvent]:
    """Return what the next packet changed; nothing if none comes in time."""
    came = packets.receive(wait_s)
    return [] if came is None else reader.feed(*came, time.monotonic())


def _print_lines(events: Iterable[TouchEvent]) -> None:
    for event in events:
        cursor = event.cursor
        click.echo(f"{event.kind} {cursor.id} {cursor.x:.4f} {cursor.y:.4f} {event.source}")


def _save_picture(view: MonitorView, console: Console, path: Path) -> None:
    """Save the screen as it is now; as large as the terminal, if there is one."""
    columns, rows = console.size if console.is_terminal else (PICTURE_COLUMNS, PICTURE_ROWS)
    recorder = Console(
        record=True, width=columns, height=rows, file=io.StringIO(), force_terminal=True,
        color_system="truecolor",
    )  # fmt: skip
    recorder.print(view.render(time.monotonic(), columns, rows), end="")
    try:
        recorder.save_svg(str(path), title="cornertouchd listen", theme=THEME)
    except OSError as error:
        raise click.ClickException(f"picture {path}: {error.strerror}") from error


@contextlib.contextmanager
def _quiet_parser() -> Iterator[None]:
    """Keep python-osc from logging about odd packets, which would tear the screen apart."""
    root = logging.getLogger()

    def is_not_of_the_parser(record: logging.LogRecord) -> bool:
        return "pythonosc" not in record.pathname

    root.addFilter(is_not_of_the_parser)
    try:
        yield
    finally:
        root.removeFilter(is_not_of_the_parser)
