"""`cornertouchd listen` as its user meets it: on a screen, in a pipe, as a picture."""

import contextlib
import io
import os
import pty
import re
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from rich.live import Live

from cornertouchd.cli.listen import _watch, listen
from cornertouchd.cli.monitor_view import MonitorView
from cornertouchd.devices.tuio_listening import datagrams
from cornertouchd.wire.tuio import BundleEncoder, Cursor
from cornertouchd.wire.tuio_reader import TuioReader
from cornertouchd.wire.tuio_record import (
    TRANSPORTS,
    Packet,
    header_line,
    packet_line,
    read_header,
    read_packets,
)
from cornertouchd.wire.tuio_rules import Transport
from cornertouchd.wire.tuio_stream import length_prefixed
from cornertouchd.wire.websocket import binary_message, websocket_dialect

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


# --- other transports, rules, records ------------------------------------------------------------

GOOD = [bundle(1, Cursor(17, 0.25, 0.5, 0.0, 0.0, 0.0)), bundle(2)]
BAD = bundle(3, Cursor(18, 1.25, 0.5, 0.0, 0.0, 0.0))


@contextlib.contextmanager
def serving(tcp: bool, *bundles: bytes) -> Iterator[int]:
    """A server that tells bundles to its first client and goes."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            connection, _ = server.accept()
            with connection:
                if not tcp:
                    conversation = websocket_dialect(()).converse()
                    while not conversation.is_ready:
                        connection.sendall(conversation.receive(connection.recv(4096)))
                for each in bundles:
                    connection.sendall(length_prefixed(each) if tcp else binary_message(each))
                if not tcp:
                    connection.sendall(conversation.farewell())
                connection.shutdown(socket.SHUT_WR)
                while connection.recv(4096):
                    pass

        thread = threading.Thread(target=serve)
        thread.start()
        yield server.getsockname()[1]
        thread.join(DEADLINE_S)


@pytest.mark.parametrize(
    ("tcp", "address"),
    [
        (True, ["tcp://127.0.0.1:{}"]),
        (False, ["ws://127.0.0.1:{}"]),
        (True, ["--transport", "tcp", "--port", "{}"]),
        (False, ["--transport", "websocket", "--host", "127.0.0.1", "--port", "{}"]),
    ],
)
def test_a_server_is_listened_to_until_it_goes(tcp: bool, address: list[str]) -> None:
    with serving(tcp, *GOOD) as port:
        result = CliRunner().invoke(listen, [word.format(port) for word in address])
    assert result.exit_code == 0
    assert result.stdout == (
        "add 17 0.2500 0.5000 hall@10.0.0.5\nremove 17 0.2500 0.5000 hall@10.0.0.5\n"
    )
    assert f"127.0.0.1:{port} has closed the connection" in result.stderr


@pytest.mark.parametrize("scheme", ["tcp", "ws"])
def test_a_server_that_is_not_there_is_an_error(scheme: str, port: int) -> None:
    result = CliRunner().invoke(listen, [f"{scheme}://127.0.0.1:{port}"])
    assert result.exit_code == 1
    assert result.stderr.startswith(f"Error: cannot connect to {scheme}://127.0.0.1:{port}: ")
    assert "refused" in result.stderr


def test_what_is_no_stream_of_bundles_is_said() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:

        def greet() -> None:
            with server.accept()[0] as connection:
                connection.sendall(b"HTTP/1.1 200 OK")

        greeting = threading.Thread(target=greet)
        greeting.start()
        result = CliRunner().invoke(listen, [f"tcp://127.0.0.1:{server.getsockname()[1]}"])
        greeting.join(DEADLINE_S)
    assert "a bundle of 1213486160 bytes, must be 1..65536" in result.stderr


def test_a_stream_that_breaks_rules_is_told_with_place_and_status() -> None:
    with serving(True, *GOOD, BAD) as port:
        result = CliRunner().invoke(listen, [f"tcp://127.0.0.1:{port}", "--check"])
    assert result.exit_code == 1
    assert result.stdout == "packet 3, byte 128: range: x = 1.25, must be 0..1\n"
    assert result.stderr.endswith("3 packets, 1 violations, 0 frames lost on the way\n")


def test_a_stream_that_keeps_the_rules_is_well() -> None:
    with serving(False, *GOOD) as port:
        result = CliRunner().invoke(listen, [f"ws://127.0.0.1:{port}", "--check"])
    assert (result.exit_code, result.stdout) == (0, "")
    assert result.stderr.endswith("2 packets, 0 violations, 0 frames lost on the way\n")


def test_a_check_that_saw_nothing_is_no_success(port: int) -> None:
    result = CliRunner().invoke(listen, ["--port", str(port), "--check", "--seconds", "0.01"])
    assert (result.exit_code, result.stdout) == (1, "")
    assert "0 packets" in result.stderr


def test_a_record_is_replayed_and_checked_like_the_stream(tmp_path: Path) -> None:
    file = tmp_path / "table.jsonl"
    with serving(True, *GOOD, BAD) as port:
        live = CliRunner().invoke(
            listen, [f"tcp://127.0.0.1:{port}", "--plain", "--record", str(file)]
        )
    header, *packets = file.read_text().splitlines()
    assert header == '{"format": "cornertouchd-tuio", "version": 1, "transport": "tcp"}'
    assert len(packets) == 3
    replayed = CliRunner().invoke(listen, [str(file), "--plain"])
    assert replayed.stdout == live.stdout != ""
    checked = CliRunner().invoke(listen, [str(file), "--check"])
    assert checked.exit_code == 1
    assert checked.stdout.startswith("packet 3, byte 128: range: ")
    assert f"{file}: all of it was read" in checked.stderr


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "line 1: no JSON"),
        ("[]", "line 1: no JSON object"),
        ('{"format": "other"}', "line 1: no record of TUIO"),
        ('{"format": "cornertouchd-tuio", "version": 2}', "line 1: version 2, this program reads"),
        (
            header_line("udp").replace('"udp"', '"mail"'),
            "line 1: transport must be one of udp, tcp",
        ),
        (f"{header_line('udp')}\n{{}}", "line 2: needs at_s (from 0), sender and packet"),
        (
            f'{header_line("udp")}\n{{"at_s": 0, "sender": "a", "packet": "0g"}}',
            "line 2: packet is not hexadecimal",
        ),
        (f"{header_line('udp')}\n{{", "line 2: no JSON"),
    ],
)
def test_a_record_that_cannot_be_used_is_an_error(tmp_path: Path, content: str, said: str) -> None:
    file = tmp_path / "table.jsonl"
    file.write_text(content)
    result = CliRunner().invoke(listen, [str(file), "--check"])
    assert result.exit_code in {1, 2}
    assert f"{file}: {said}" in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["http://127.0.0.1"],
        ["ws://"],
        ["tcp://127.0.0.1:70000"],
        ["missing.jsonl"],
        ["udp://127.0.0.1", "--port", "3333"],
        ["--check", "--plain"],
        ["--transport", "sctp"],
    ],
)
def test_what_cannot_be_listened_to_is_wrong_usage(arguments: list[str]) -> None:
    assert CliRunner().invoke(listen, arguments).exit_code == 2


def test_a_record_that_cannot_be_written_is_an_error(port: int) -> None:
    result = CliRunner().invoke(listen, ["--port", str(port), "--record", "/dev/full"])
    assert result.exit_code == 1
    assert "record /dev/full: No space left on device" in result.stderr


@given(
    st.floats(0.0, 1e6), st.text(max_size=30), st.binary(max_size=300), st.sampled_from(TRANSPORTS)
)
def test_a_line_of_a_record_means_what_was_written(
    at_s: float, sender: str, data: bytes, transport: Transport
) -> None:
    assert read_header(header_line(transport)) == transport
    (packet,) = read_packets([packet_line(Packet(at_s, sender, data))])
    assert (packet.sender, packet.data) == (sender, data)
    assert packet.at_s == pytest.approx(at_s, abs=1e-6)
