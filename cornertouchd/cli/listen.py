"""`cornertouchd listen`: a TUIO client in the terminal, to see what any tracker says."""

import contextlib
import errno
import io
import logging
import math
import socket
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

import click
from rich.console import Console
from rich.live import Live

from cornertouchd.cli.monitor_view import THEME, MonitorView
from cornertouchd.cli.targets import FiniteRange
from cornertouchd.wire.tuio_reader import TouchEvent, TuioReader

# Smooth to the eye; a screen of 140 x 40 takes 11 ms to draw, so a fifth of one core.
REDRAW_EVERY_S = 0.06
MAX_DATAGRAM_BYTES = 65536
# A thousand large bundles, should drawing take long; the kernel grants at most net.core.rmem_max.
RECEIVE_BUFFER_BYTES = 2 * 1024 * 1024
# How large the picture is when there is no terminal to take its size from.
PICTURE_COLUMNS, PICTURE_ROWS = 116, 30


@click.command()
@click.option(
    "--port", default=3333, show_default=True, type=click.IntRange(1, 65535), help="UDP port."
)
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on.")
@click.option("--seconds", type=FiniteRange(min=0.0), help="End after so long.")
@click.option("--plain", is_flag=True, help="One line per event, for pipes.")
@click.option(
    "--svg",
    type=click.Path(dir_okay=False, writable=True, path_type=Path),
    help="Save the last screen as a picture.",
)
def listen(port: int, host: str, seconds: float | None, plain: bool, svg: Path | None) -> None:
    """Show the touches that a TUIO tracker sends, whichever it is.

    Where the output is not a terminal, or with --plain, prints one line per event: what happened
    (add, update, remove), the id, x and y, the tracker.
    """
    reader = TuioReader()
    view = MonitorView(reader, f"{host}:{port}")
    console = Console()
    with _bound_socket(host, port) as receiver, _quiet_parser():
        with contextlib.suppress(KeyboardInterrupt):
            if plain or not console.is_terminal:
                click.echo(f"listening on {host}:{port}", err=True)
                _watch(receiver, reader, view, None, seconds)
            else:
                with Live(console=console, screen=True, auto_refresh=False) as live:
                    _watch(receiver, reader, view, live, seconds)
        if svg is not None:
            _save_picture(view, console, svg)


def _watch(
    receiver: socket.socket,
    reader: TuioReader,
    view: MonitorView,
    live: Live | None,
    seconds: float | None,
) -> None:
    """Take datagrams in until the time is over; draw on `live`, or print lines if there is none."""
    now_s = time.monotonic()
    end_s = math.inf if seconds is None else now_s + seconds
    draw_at_s = now_s
    while now_s < end_s:
        events = _receive(receiver, reader, min(draw_at_s, end_s) - now_s)
        now_s = time.monotonic()
        events += reader.forget_silent(now_s)
        view.note(events, now_s)
        if live is None:
            _print_lines(events)
        if now_s >= draw_at_s:
            draw_at_s = now_s + REDRAW_EVERY_S
            if live is not None:
                live.update(view.render(now_s, *live.console.size), refresh=True)


def _receive(receiver: socket.socket, reader: TuioReader, wait_s: float) -> list[TouchEvent]:
    """Return what the next datagram changed; nothing if none comes in time."""
    receiver.settimeout(max(wait_s, 0.001))  # 0 would mean not to wait at all, and raise
    try:
        datagram, address = receiver.recvfrom(MAX_DATAGRAM_BYTES)
    except TimeoutError:
        return []
    return reader.feed(datagram, f"{address[0]}:{address[1]}", time.monotonic())


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


def _bound_socket(host: str, port: int) -> socket.socket:
    """Return a socket that receives what is sent to host:port."""
    try:
        family, kind, _, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE
        )[0]
        receiver = socket.socket(family, kind)
    except (OSError, ValueError) as error:
        raise click.ClickException(f"cannot listen on {host}: {error}") from error
    receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
    try:
        receiver.bind(address)
    except OSError as error:
        receiver.close()
        if error.errno == errno.EADDRINUSE:
            raise click.ClickException(
                f"UDP port {port} of {host} is in use: end the other TUIO client, "
                "or choose another port with --port"
            ) from error
        raise click.ClickException(f"cannot listen on {host}:{port}: {error.strerror}") from error
    return receiver


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
