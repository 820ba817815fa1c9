"""`cornertouchd listen` as its user meets it: on a screen, in a pipe, as a picture."""

import io
import os
import pty
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner
from rich.console import Console
from rich.live import Live

from cornertouchd.cli.listen import _watch, listen
from cornertouchd.cli.monitor_view import MonitorView
from cornertouchd.devices.tuio_listening import datagrams
from cornertouchd.wire.tuio import BundleEncoder, Cursor
from cornertouchd.wire.tuio_reader import TuioReader

COMMAND = [sys.executable, "-c", "from cornertouchd.cli.listen import listen; listen()"]
DEADLINE_S = 20.0


def bundle(fseq: int, *cursors: Cursor, source: str = "hall@10.0.0.5") -> bytes:
    return BundleEncoder(source).encode([c.id for c in cursors], cursors, fseq)


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        free: int = probe.getsockname()[1]
        return free


@pytest.fixture
def tracker(port: int) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.connect(("127.0.0.1", port))
        yield sender


# --- in a pipe -----------------------------------------------------------------------------------


def test_in_a_pipe_every_event_is_a_line_and_ctrl_c_ends_well(
    port: int, tracker: socket.socket, tmp_path: Path
) -> None:
    picture = tmp_path / "screen.svg"
    with subprocess.Popen(
        [*COMMAND, "--port", str(port), "--svg", str(picture)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as program:
        assert program.stderr is not None
        assert program.stdout is not None
        assert program.stderr.readline() == f"listening on 127.0.0.1:{port}\n"
        tracker.send(bundle(1, Cursor(17, 0.25, 0.5, 0.0, 0.0, 0.0)))
        tracker.send(b"/tuio/2Dcur\0,x\0\0")  # nothing that python-osc knows
        tracker.send(bundle(2, Cursor(17, 0.26, 0.5, 0.0, 0.0, 0.0)))
        tracker.send(bundle(3))
        tracker.send(bundle(4, Cursor(18, 0.75, 0.125, 0.0, 0.0, 0.0)))
        assert [program.stdout.readline() for _ in range(4)] == [
            "add 17 0.2500 0.5000 hall@10.0.0.5\n",
            "update 17 0.2600 0.5000 hall@10.0.0.5\n",
            "remove 17 0.2600 0.5000 hall@10.0.0.5\n",
            "add 18 0.7500 0.1250 hall@10.0.0.5\n",
        ]
        program.send_signal(signal.SIGINT)
        out, err = program.communicate(timeout=DEADLINE_S)
        assert (program.returncode, out, err) == (0, "", "")
    svg = picture.read_text()
    assert svg.startswith("<svg")
    assert "hall@10.0.0.5" in svg
    assert "●" in svg


def test_a_port_in_use_is_an_error_that_says_what_to_do(port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", port))
        result = CliRunner().invoke(listen, ["--port", str(port)])
    assert result.exit_code == 1
    assert result.stderr == (
        f"Error: UDP port {port} of 127.0.0.1 is in use: end the other TUIO client, "
        "or choose another port with --port\n"
    )


@pytest.mark.parametrize("host", ["192.0.2.1", "a..b"])
def test_an_address_that_is_not_ours_is_an_error(host: str) -> None:
    result = CliRunner().invoke(listen, ["--host", host])
    assert result.exit_code == 1
    assert result.stderr.startswith(f"Error: cannot listen on {host}")


def test_it_ends_after_the_seconds_asked_for(port: int, tmp_path: Path) -> None:
    picture = tmp_path / "screen.svg"
    arguments = ["--port", str(port), "--seconds", "0.01", "--svg", str(picture)]
    result = CliRunner().invoke(listen, arguments)
    assert (result.exit_code, result.stdout) == (0, "")
    assert "waiting" in picture.read_text()


def test_a_picture_that_cannot_be_saved_is_an_error(port: int, tmp_path: Path) -> None:
    picture = tmp_path / "missing" / "screen.svg"
    arguments = ["--port", str(port), "--seconds", "0", "--svg", str(picture)]
    result = CliRunner().invoke(listen, arguments)
    assert result.exit_code == 1
    assert f"picture {picture}: No such file or directory" in result.stderr


# --- on a screen ---------------------------------------------------------------------------------


def test_on_a_terminal_it_draws_and_leaves_the_terminal_as_it_was(
    port: int, tracker: socket.socket
) -> None:
    terminal, screen = pty.openpty()
    environment = {**os.environ, "TERM": "xterm-256color", "COLUMNS": "120", "LINES": "30"}
    with subprocess.Popen(
        [*COMMAND, "--port", str(port)], stdin=screen, stdout=screen, stderr=screen, env=environment
    ) as program:
        os.close(screen)
        drawn = read_until(terminal, "waiting")
        tracker.send(bundle(1, Cursor(4711, 0.25, 0.5, 0.0, 0.0, 0.0)))
        drawn += read_until(terminal, "4711")
        program.send_signal(signal.SIGINT)
        drawn += read_until(terminal, "\x1b[?1049l")
        assert program.wait(DEADLINE_S) == 0
    os.close(terminal)
    assert "Traceback" not in drawn


def test_what_has_just_arrived_is_drawn_at_once(port: int, tracker: socket.socket) -> None:
    out = io.StringIO()
    console = Console(file=out, width=120, height=30, force_terminal=True)
    reader = TuioReader()
    view = MonitorView(reader, "127.0.0.1:3333")
    with datagrams("127.0.0.1", port) as receiver:
        tracker.send(bundle(1, Cursor(4711, 0.25, 0.5, 0.0, 0.0, 0.0)))
        with Live(console=console, screen=True, auto_refresh=False) as live:
            _watch(receiver, reader, view, live, 0.001)
    assert "4711" in out.getvalue()


def read_until(terminal: int, text: str) -> str:
    """Return what is drawn up to and with `text`; the test's time-out ends a wait in vain."""
    drawn = b""
    while text.encode() not in drawn:
        drawn += os.read(terminal, 65536)
    return drawn.decode(errors="replace")


def screen_of(reader: TuioReader, now_s: float, width: int = 120, height: int = 30) -> list[str]:
    view = MonitorView(reader, "127.0.0.1:3333")
    view.note([], now_s)
    out = io.StringIO()
    console = Console(file=out, width=width, height=height)
    console.print(view.render(now_s, width, height), end="")
    return out.getvalue().splitlines()


def fed(*datagrams: bytes) -> TuioReader:
    reader = TuioReader()
    for datagram in datagrams:
        reader.feed(datagram, "10.0.0.9:1", 100.0)
    return reader


def test_the_plan_shows_each_touch_with_its_id_where_it_is() -> None:
    left_top = Cursor(11, 0.0, 0.0, 0.0, 0.0, 0.0)
    right_bottom = Cursor(12, 1.0, 1.0, 0.0, 0.0, 0.0)
    screen = screen_of(fed(bundle(1, left_top, right_bottom)), 100.0)
    plan = [line.split("│")[1] for line in screen[1:-2]]
    assert re.match(r"●\W+11\b", plan[0])
    assert re.search(r"\b12\W+●$", plan[-1])
    assert "".join(plan).count("●") == 2


def test_touches_far_outside_are_shown_on_the_border() -> None:
    reader = TuioReader()
    view = MonitorView(reader, "127.0.0.1:3333")
    for step, x in enumerate((0.5, 1e30, -1e30)):
        view.note(reader.feed(bundle(step, Cursor(1, x, x, 0.0, 0.0, 0.0)), "s", 1.0), 1.0)
    console = Console(file=io.StringIO(), width=120, height=30, record=True)
    console.print(view.render(1.0, 120, 30))
    assert console.export_text().splitlines()[1].startswith("│●")


def test_the_numbers_of_each_touch_and_tracker_are_shown() -> None:
    reader = fed(
        bundle(8, Cursor(5, 0.1, 0.2, 0.0, 0.0, 0.0)),
        bundle(10, Cursor(5, 0.125, 0.75, 1.5, -0.25, 2.0)),
        bundle(9),
        bundle(3, Cursor(5, 0.5, 0.5, 0.0, 0.0, 0.0), source="stair@10.0.0.6"),
        b"nonsense",
    )
    text = "\n".join(screen_of(reader, 101.5))
    assert re.search(r"\b5 +0\.125 +0\.750 +\+1\.50 +-0\.25 +\+2\.0 +1\.5 s", text)
    assert "hall@10.0.0.5" in text
    assert "fseq 10   1 lost, 1 late" in text
    assert "stair@10.0.0.6" in text
    assert "fseq 3   0 lost" in text
    assert "5 packets   1 malformed (neither an OSC message nor a bundle)" in text


def test_the_packet_rate_is_that_of_the_last_two_seconds() -> None:
    reader = TuioReader()
    view = MonitorView(reader, "127.0.0.1:3333")
    for step in range(500):
        now_s = 100.0 + 0.01 * step
        view.note(reader.feed(bundle(step, Cursor(1, 0.5, 0.5, 0, 0, 0)), "s", now_s), now_s)
    console = Console(file=io.StringIO(), width=120, height=30, record=True)
    console.print(view.render(now_s, 120, 30))
    rate_hz = re.search(r"(\d+)/s", console.export_text())
    assert rate_hz is not None
    assert 98 <= int(rate_hz[1]) <= 102


def test_a_tracker_that_fell_silent_is_shown_as_such() -> None:
    reader = fed(bundle(1, Cursor(5, 0.5, 0.5, 0.0, 0.0, 0.0)))
    assert "silent" not in "\n".join(screen_of(reader, 102.9))
    assert "silent for 7 s" in "\n".join(screen_of(reader, 107.0))


@pytest.mark.parametrize(("width", "height"), [(20, 5), (40, 12), (80, 24), (300, 90)])
def test_every_size_of_terminal_is_filled_and_not_exceeded(width: int, height: int) -> None:
    cursors = [Cursor(k, 0.05 * k, 0.95, 0.0, 0.0, 0.0) for k in range(21)]
    screen = screen_of(fed(bundle(1, *cursors)), 100.0, width, height)
    assert len(screen) == height
    assert max(map(len, screen)) <= width
