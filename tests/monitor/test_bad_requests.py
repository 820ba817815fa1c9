"""Whatever is sent to the live page is refused and counted, and it goes on."""

import asyncio
import json
import os
import socket
import struct
from collections.abc import Iterator
from contextlib import ExitStack

import aiohttp
import pytest
from monitor.conftest import DEADLINE_S, RunningDaemon, free_port, served, simulated, wait_until

from cornertouchd.monitor.process import MOST_CONNECTIONS

WITHIN_S = 25.0
"""Longer than a connection without a whole request is kept."""


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningDaemon]:
    """A daemon with a page, shared by all tests here."""
    yield from served(simulated(tmp_path_factory.mktemp("page"), free_port(), "enabled = true"))


def answer_to(demo: RunningDaemon, request: bytes) -> bytes:
    """Send bytes and return everything until the connection is closed."""
    with socket.create_connection(("127.0.0.1", demo.port), DEADLINE_S) as connection:
        received = b""
        try:
            connection.sendall(request)
            while part := connection.recv(65536):
                received += part
        except ConnectionError:
            pass  # refused before all of it was sent
        return received


def status_of(demo: RunningDaemon, request: bytes) -> int | None:
    """The status of the answer, None if the connection is closed without one."""
    answer = answer_to(demo, request)
    return int(answer.split(b" ", 2)[1]) if answer else None


def request(
    demo: RunningDaemon, line: str, *headers: str, body: bytes = b"", host: str | None = None
) -> bytes:
    lines = [line, f"Host: {host or demo.address}", "Connection: close", *headers]
    return "\r\n".join(lines).encode("latin-1") + b"\r\n\r\n" + body


def refused(demo: RunningDaemon) -> float:
    """How many answers so far were no good news."""
    metrics = demo.get("/metrics")[1].decode().splitlines()
    answers = (line for line in metrics if line.startswith("cornertouchd_page_answers_total{"))
    return sum(float(line.split()[-1]) for line in answers if 'status="4' in line)


@pytest.fixture(autouse=True)
def lives_on(demo: RunningDaemon):
    """After every test the same page is served by the same process."""
    pids = demo.page_pids
    yield
    assert demo.get("/")[0] == 200
    assert demo.page_pids == pids
    assert demo.process.poll() is None


@pytest.mark.parametrize(
    "path",
    [
        "/page/../../access.py",
        "/page/..%2f..%2faccess.py",
        "/page/%2e%2e/%2e%2e/access.py",
        "/page//etc/passwd",
        "/page/....//....//etc/passwd",
        "/page/index.html%00.js",
        "/page/",
        "/../../../../etc/passwd",
        "//etc/passwd",
        "/etc/passwd",
        "/page/..\\..\\access.py",
        "/api/",
        "/api/hello/../../x",
        "/favicon.ico",
    ],
)
def test_paths_that_are_none_of_ours(demo, path):
    answer = answer_to(demo, request(demo, f"GET {path} HTTP/1.1"))
    assert answer.startswith((b"HTTP/1.1 404", b"HTTP/1.1 400")), answer[:200]
    assert b"root:" not in answer
    assert b"import " not in answer


SAVING = b"POST /api/save HTTP/1.1\r\nHost: localhost\r\n"
READING = b"GET / HTTP/1.1\r\nConnection: close\r\n"
NO_REQUESTS = {
    "no HTTP": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(200),
    "garbage": bytes(range(256)) + b"\r\n\r\n",
    "unknown method": b"FOO / HTTP/1.1\r\nHost: localhost\r\n\r\n",
    "endless line": b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n",
    "huge header": READING + b"X: " + b"a" * 100_000 + b"\r\n\r\n",
    "many headers": READING + b"".join(b"X%d: a\r\n" % n for n in range(5000)) + b"\r\n",
    "header without a colon": READING + b"Host localhost\r\n\r\n",
    "two lengths": SAVING + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n",
    "length and chunks": SAVING
    + b"Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n",
    "negative length": SAVING + b"Content-Length: -5\r\n\r\n",
    "HTTP/9": b"GET / HTTP/9.9\r\nHost: localhost\r\n\r\n",
    "no host": READING + b"\r\n",
    "two hosts": READING + b"Host: localhost\r\nHost: evil.example\r\n\r\n",
}


@pytest.mark.parametrize("bad", NO_REQUESTS.values(), ids=NO_REQUESTS)
def test_what_is_no_request(demo, bad):
    before = refused(demo)
    assert status_of(demo, bad) in {400, 414, 421, 431, 505, None}
    assert refused(demo) == before + 1


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "TRACE", "PATCH"])
def test_methods_that_are_not_ours(demo, method):
    before = demo.metric('cornertouchd_page_refused_total{reason="method"}')
    assert status_of(demo, request(demo, f"{method} / HTTP/1.1")) == 405
    assert demo.metric('cornertouchd_page_refused_total{reason="method"}') == before + 1


@pytest.mark.parametrize("host", ["evil.example", "evil.example:8333", "127.0.0.1.evil.example"])
def test_a_name_that_was_bound_to_our_address(demo, host):
    """DNS rebinding: a browser takes us for their server, and tells so in Host."""
    before = demo.metric('cornertouchd_page_refused_total{reason="host"}')
    for line in ("GET / HTTP/1.1", "GET /api/hello HTTP/1.1", "GET /live HTTP/1.1"):
        assert status_of(demo, request(demo, line, host=host)) == 421
    assert demo.metric('cornertouchd_page_refused_total{reason="host"}') == before + 3


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:1"])
def test_a_page_of_others_may_not_watch(demo, origin):
    before = demo.metric('cornertouchd_page_refused_total{reason="origin"}')

    async def watch() -> int:
        async with aiohttp.ClientSession() as session:
            try:
                await session.ws_connect(f"http://{demo.address}/live", origin=origin)
            except aiohttp.WSServerHandshakeError as error:
                return error.status
        return 101

    assert asyncio.run(watch()) == 403
    assert demo.metric('cornertouchd_page_refused_total{reason="origin"}') == before + 1


def test_a_page_of_others_may_not_act(demo):
    acting = request(
        demo,
        "POST /api/save HTTP/1.1",
        "Origin: http://evil.example",
        "Content-Length: 2",
        body=b"{}",
    )
    assert status_of(demo, acting) == 403


def test_viewers_may_not_act_unless_they_are_allowed_to(demo):
    acting = request(
        demo,
        "POST /api/save HTTP/1.1",
        f"Origin: http://{demo.address}",
        "Content-Length: 14",
        body=b'{"last_s": 30}',
    )
    answer = answer_to(demo, acting)
    assert answer.startswith(b"HTTP/1.1 403")
    assert b"monitor.allow_actions" in answer


def test_a_body_that_is_too_large(demo):
    body = b'{"last_s": ' + b" " * 100_000 + b"30}"
    acting = request(
        demo,
        "POST /api/save HTTP/1.1",
        f"Origin: http://{demo.address}",
        f"Content-Length: {len(body)}",
        body=body,
    )
    assert status_of(demo, acting) in {413, 403}


def test_a_request_that_never_ends_is_given_up(demo):
    """Slowloris: a connection is not kept for a request that does not come."""
    with socket.create_connection(("127.0.0.1", demo.port), WITHIN_S + 5.0) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ")
        received = b""
        while part := connection.recv(4096):  # a timeout fails the test
            received += part
        assert received == b""


def test_more_connections_than_all_viewers_need_are_turned_away(demo):
    with ExitStack() as open_ones:
        for _ in range(MOST_CONNECTIONS + 20):
            connection = socket.create_connection(("127.0.0.1", demo.port), DEADLINE_S)
            open_ones.enter_context(connection)
        assert connection.recv(1) == b""
    wait_until(lambda: answer_to(demo, request(demo, "GET / HTTP/1.1")), "an answer")


HANDSHAKE = (
    "Upgrade: websocket",
    "Connection: Upgrade",
    "Sec-WebSocket-Version: 13",
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
)


def opened(demo: RunningDaemon) -> socket.socket:
    """A WebSocket, as far as its handshake."""
    connection = socket.create_connection(("127.0.0.1", demo.port), DEADLINE_S)
    head = "\r\n".join(
        [
            "GET /live HTTP/1.1",
            f"Host: {demo.address}",
            f"Origin: http://{demo.address}",
            *HANDSHAKE,
        ]
    )
    connection.sendall(head.encode() + b"\r\n\r\n")
    answer = b""
    while b"\r\n\r\n" not in answer:
        answer += connection.recv(1)
    assert answer.startswith(b"HTTP/1.1 101"), answer
    return connection


def close_code(connection: socket.socket) -> int | None:
    """Read frames up to the one that closes; None if there is none before the end."""
    reader = connection.makefile("rb")
    with reader:
        while head := reader.read(2):
            length = head[1] & 127
            if length == 126:
                (length,) = struct.unpack(">H", reader.read(2))
            elif length == 127:
                (length,) = struct.unpack(">Q", reader.read(8))
            payload = reader.read(length)
            if head[0] & 15 == 8:
                return int(struct.unpack(">H", payload[:2])[0])
    return None


def frame(first: int, payload: bytes, *, masked: bool = True) -> bytes:
    mask = bytes(4)
    length = len(payload)
    if length < 126:
        head = struct.pack(">BB", first, length | 128 * masked)
    elif length < 65536:
        head = struct.pack(">BBH", first, 126 | 128 * masked, length)
    else:
        head = struct.pack(">BBQ", first, 127 | 128 * masked, length)
    return head + mask * masked + payload


TEXT, BINARY, PING, UNKNOWN = 0x81, 0x82, 0x89, 0x83


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("reserved bits", frame(TEXT | 0x70, b"{}")),
        ("unknown kind", frame(UNKNOWN, b"{}")),
        ("a large ping", frame(PING, bytes(200))),
        ("a ping in parts", frame(PING & 0x7F, b"a")),
        ("a part without a begin", frame(0x80, b"a")),
        ("a huge length", struct.pack(">BBQ", TEXT, 127 | 128, 2**62)),
        ("a message that is too large", frame(TEXT, b'{"strips": true' + b" " * 5000 + b"}")),
        ("no UTF-8", frame(TEXT, b"\xff\xfe\xfd")),
        ("no JSON", frame(TEXT, b"strips")),
        ("no object", frame(TEXT, b"[1]")),
        ("another wish", frame(TEXT, b'{"strips": "yes"}')),
        ("nested without end", frame(TEXT, b"[" * 4000)),
        ("binary", frame(BINARY, b"\x01\x02")),
        ("garbage", os.urandom(300)),
    ],
)
def test_what_is_no_message_ends_that_viewer_only(demo, name, bad):
    with opened(demo) as other:
        with opened(demo) as connection:
            connection.sendall(bad)
            assert close_code(connection) in {1002, 1003, 1007, 1008, 1009, 1011, None}
        assert other.recv(2)
    wait_until(lambda: demo.metric("cornertouchd_page_viewers") == 0, "the end of all viewers")


def test_viewers_that_vanish_leave_nothing_behind(demo):
    for _ in range(50):
        with opened(demo) as connection:
            linger = struct.pack("ii", 1, 0)  # the connection is reset, not closed
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    wait_until(lambda: demo.metric("cornertouchd_page_viewers") == 0, "the end of all viewers")


def test_every_answer_forbids_what_the_page_does_not_need(demo):
    for path in ("/", "/api/hello", "/metrics", "/nothing"):
        answer = answer_to(demo, request(demo, f"GET {path} HTTP/1.1")).decode("latin-1").lower()
        assert "content-security-policy: default-src 'self'; connect-src 'self'" in answer
        assert "frame-ancestors 'none'" in answer
        assert "x-content-type-options: nosniff" in answer
        assert "referrer-policy: no-referrer" in answer
        assert "aiohttp" not in answer


def test_head_tells_what_get_would(demo):
    answer = answer_to(demo, request(demo, "HEAD / HTTP/1.1"))
    assert answer.startswith(b"HTTP/1.1 200")
    assert answer.endswith(b"\r\n\r\n")


def test_health_and_hello_come_as_json(demo):
    assert demo.health()["cameras"][0]["id"] == "C1"
    hello = json.loads(demo.get("/api/hello")[1])
    assert hello["surface_mm"] == [350.0, 400.0]
    assert hello["may_act"] is False
