"""The daemon's socket: who asks is told, who does not ask or goes away costs nobody anything."""

import json
import logging
import socket
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from cornertouchd.runtime import asking
from cornertouchd.runtime.asking import (
    Answer,
    Asker,
    AskSocket,
    RefusedError,
    document,
    open_stream,
    read_document,
)
from cornertouchd.runtime.log_tail import LogTail

TOLD = document(lambda: b'{"state": "healthy"}')


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "run" / "status.sock"


def raising(asker: Asker) -> None:
    raise ZeroDivisionError("nothing by nothing")


def echo(asker: Asker) -> None:
    """Tell back what he says further, a line at once, until he says stop."""
    while not asker.has_enough:
        for said in asker.further():
            if said == {"stop": True}:
                return
            asker.send(json.dumps(said).encode() + b"\n")


ANSWERS: dict[str, Answer] = {"status": TOLD, "broken": raising, "echo": echo}


@pytest.fixture
def answered(path: Path) -> Iterator[None]:
    with AskSocket(path, ANSWERS):
        yield


def raw(path: Path, said: bytes) -> bytes:
    """Say this and nothing more; return everything that comes back."""
    with socket.socket(socket.AF_UNIX) as connection:
        connection.settimeout(10.0)
        connection.connect(str(path))
        connection.sendall(said)
        parts = []
        while part := connection.recv(65536):
            parts.append(part)
    return b"".join(parts)


@pytest.mark.usefixtures("answered")
def test_who_asks_is_told(path: Path) -> None:
    assert read_document(path, "status") == {"state": "healthy"}


@pytest.mark.usefixtures("answered")
@pytest.mark.parametrize(
    "said", [b"\n", b"status\n", b"[]\n", b'"status"\n', b"[" * 4000 + b"\n", b"x" * 4096]
)
def test_what_is_no_question_is_answered_with_how_to_ask(path: Path, said: bytes) -> None:
    assert 'send one line of JSON first: {"ask": "status"}' in json.loads(raw(path, said))["error"]


@pytest.mark.usefixtures("answered")
def test_a_name_that_nobody_knows_is_refused_with_those_that_are(path: Path) -> None:
    with pytest.raises(RefusedError, match="'secrets': must be one of status, broken, echo"):
        read_document(path, "secrets")


@pytest.mark.usefixtures("answered")
def test_what_cannot_be_told_is_logged_once_and_the_rest_is_told(
    path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    for _ in range(2):
        with pytest.raises(RefusedError, match="nothing by nothing"):
            read_document(path, "broken")
    assert caplog.text.count("Traceback") == 1
    assert read_document(path, "status")


@pytest.mark.usefixtures("answered")
def test_a_stream_hears_what_is_said_further(path: Path) -> None:
    with open_stream(path, "echo") as connection, connection.makefile("rb") as lines:
        connection.sendall(b'{"strips": true}\nno object\n{"stri')
        assert json.loads(lines.readline()) == {"strips": True}
        connection.sendall(b'ps": false}\n')
        assert json.loads(lines.readline()) == {"strips": False}
        connection.sendall(b'{"stop": true}\n')
        assert lines.readline() == b""


def test_a_line_without_an_end_counts_as_leaving() -> None:
    ours, theirs = socket.socketpair()
    with ours, theirs:
        theirs.sendall(b"x" * 100_000)
        asker = Asker(ours, {}, b"", threading.Event())
        assert asker.further() == []
        assert asker.has_enough


def test_what_came_with_the_question_is_not_lost(path: Path) -> None:
    with AskSocket(path, ANSWERS):
        told = raw(path, b'{"ask": "echo"}\n{"n": 1}\n{"stop": true}\n')
    assert json.loads(told) == {"n": 1}


def test_who_hangs_does_not_keep_the_daemon_from_ending(path: Path) -> None:
    stuck = threading.Event()

    def flood(asker: Asker) -> None:
        stuck.set()
        asker.send(bytes(2**24))

    with AskSocket(path, {"status": TOLD, "flood": flood}):
        silent = open_stream(path, "flood")
        assert stuck.wait(30.0)
    assert not [one for one in threading.enumerate() if one.name == "asked"]
    silent.close()


def test_who_is_one_too_many_is_told_so(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(asking, "MOST_ASKERS", 2)
    with AskSocket(path, ANSWERS):
        others = [open_stream(path, "echo") for _ in range(2)]
        with pytest.raises(RefusedError, match="2 are asking already"):
            read_document(path, "status")
        for other in others:
            other.sendall(b'{"stop": true}\n')
            assert other.recv(1) == b""
            other.close()


def test_who_connects_and_says_nothing_keeps_nobody_waiting(path: Path) -> None:
    with AskSocket(path, ANSWERS), socket.socket(socket.AF_UNIX) as silent:
        silent.connect(str(path))
        assert read_document(path, "status")


@pytest.mark.usefixtures("answered")
def test_nobody_else_may_ask(path: Path) -> None:
    assert stat.S_IMODE(path.stat().st_mode) == 0o660


def test_the_socket_of_a_daemon_that_died_is_replaced(path: Path) -> None:
    path.parent.mkdir()
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(path))
    with AskSocket(path, ANSWERS):
        assert read_document(path, "status")
    assert not path.exists()


def test_the_socket_of_another_daemon_is_left_alone(
    path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with AskSocket(path, ANSWERS):
        with AskSocket(path, {"status": document(lambda: b"{}")}):
            assert read_document(path, "status") == {"state": "healthy"}
        assert read_document(path, "status") == {"state": "healthy"}
    assert "is another daemon running" in caplog.text


def test_a_place_where_no_socket_can_be_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with AskSocket(tmp_path / ("x" * 200), ANSWERS):
        pass
    assert "no status can be asked for" in caplog.text


def test_the_last_lines_of_the_log_are_kept() -> None:
    log = logging.getLogger("cornertouchd.part")
    with LogTail(lines_kept=2) as tail:
        for number in range(3):
            log.warning("line %d", number)
    log.warning("after the end")
    told = json.loads(tail.as_json())["lines"]
    assert [(line["level"], line["text"]) for line in told] == [
        ("WARNING", "line 1"),
        ("WARNING", "line 2"),
    ]
    assert told[0]["at"] <= told[1]["at"]
