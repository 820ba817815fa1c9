"""TUIO over TCP and WebSocket: what clients receive, and what none of them can do to the others."""

import contextlib
import logging
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator

import pytest
from pythonosc.osc_bundle import OscBundle
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from cornertouchd.devices.stream_hub import StreamHub
from cornertouchd.devices.stream_peer import MAX_INPUT_BYTES_PER_S
from cornertouchd.devices.stream_server import HANDSHAKE_S, STALLED_S, StreamServer
from cornertouchd.devices.tcp_destination import TcpDestination
from cornertouchd.devices.tuio_sink import TuioReceiver, TuioSink
from cornertouchd.devices.udp_destination import DestinationStatus
from cornertouchd.model import Touch, TouchFrame
from cornertouchd.ports import TouchSink
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio_blobs import Profile
from cornertouchd.wire.tuio_stream import TCP, PrefixedBundles
from cornertouchd.wire.websocket import websocket_dialect

SURFACE = DisplayMapping(0.0, 0.0, 400.0, 200.0)
DEADLINE_S = 20.0

Told = tuple[list[int], int]  # the ids alive, the frame number


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


def told(bundle: bytes) -> Told:
    messages = [message.params for message in OscBundle(bundle)]
    return messages[1][1:], messages[-1][1]


def profile_of(bundle: bytes) -> str:
    return next(iter(OscBundle(bundle))).address


class Rig:
    """A sink with servers on ports of their own, and a clock that stands still."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.hub = StreamHub(lambda: self.now_s)
        self.sink: TuioSink
        self.links: list[StreamServer | TcpDestination] = []
        self._profiles: list[tuple[Profile, ...]] = []
        self._open = contextlib.ExitStack()

    def tcp(self, port: int = 0, connections_max: int = 4, *profiles: Profile) -> int:
        return self._serve(
            StreamServer(self.hub, TCP, "127.0.0.1", port or free_port(), connections_max),
            profiles,
        )

    def websocket(
        self, *origins: str, connections_max: int = 4, profiles: tuple[Profile, ...] = ()
    ) -> int:
        dialect = websocket_dialect(origins)
        return self._serve(
            StreamServer(self.hub, dialect, "127.0.0.1", free_port(), connections_max), profiles
        )

    def to(self, port: int) -> None:
        self.links.append(TcpDestination(self.hub, "localhost", port))
        self._profiles.append(("2Dcur",))

    def _serve(self, server: StreamServer, profiles: tuple[Profile, ...]) -> int:
        self.links.append(server)
        self._profiles.append(profiles or ("2Dcur",))
        return server.status.port

    def start(self) -> TouchSink:
        receivers = [
            TuioReceiver(link, SURFACE, profiles)
            for link, profiles in zip(self.links, self._profiles, strict=True)
        ]
        self.sink = TuioSink(
            receivers, "test@127.0.0.1", 1000, 500, hub=self.hub, sleep=lambda _: None
        )
        self.sink.tick(0.0)
        for link in self.links:
            if isinstance(link, StreamServer):
                self.wait_until(lambda link=link: link.listens)
        return self.sink

    def send(self, *ids: int, at_s: float = 0.0) -> None:
        touches = tuple(Touch(id_, 100.0, 50.0, 0.0, 0.0, 0.0, 10.0) for id_ in ids)
        self.sink.send(TouchFrame(at_s, touches), at_s)

    def wait_until(self, condition: Callable[[], bool], *, passing_s: float = 0.0) -> None:
        """Wait for the thread of the hub; let time pass on its clock while that lasts."""
        until_s = time.monotonic() + DEADLINE_S
        while not condition():
            assert time.monotonic() < until_s, [link.status for link in self.links]
            self.now_s += passing_s
            self.hub.ring()
            threading.Event().wait(0.001)

    def join_tcp(self, port: int, receive_buffer: int = 0) -> "TcpClient":
        return self._open.enter_context(TcpClient(port, receive_buffer))

    def join_websocket(self, port: int, origin: str | None = None) -> ClientConnection:
        return self._open.enter_context(
            connect(f"ws://127.0.0.1:{port}/", origin=origin, proxy=None, close_timeout=0.1)
        )

    @property
    def status(self) -> tuple[DestinationStatus, ...]:
        return self.sink.destinations

    def close(self) -> None:
        if hasattr(self, "sink"):
            self.sink.close()
        self._open.close()


class TcpClient:
    """A client that takes what one `recv` gives for one whole bundle, as the reference one does."""

    def __init__(self, port: int, receive_buffer: int = 0) -> None:
        self.socket = socket.socket()
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(DEADLINE_S)
        self.socket.connect(("127.0.0.1", port))

    def __enter__(self) -> "TcpClient":
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def bundle(self) -> bytes:
        data = self.socket.recv(65536)
        (length,) = struct.unpack_from(">i", data)
        assert len(data) == 4 + length, "not one whole bundle"
        return data[4:]

    def told(self) -> Told:
        return told(self.bundle())

    def ends(self) -> bool:
        """Whether the connection has ended, once all is read that came before."""
        try:
            while self.socket.recv(65536):
                pass
        except ConnectionResetError:
            pass
        return True


@pytest.fixture
def rig() -> Iterator[Rig]:
    made = Rig()
    yield made
    made.close()


# --- what clients receive ------------------------------------------------------------------------


def test_over_tcp_every_read_gives_one_whole_bundle(rig: Rig) -> None:
    client_port = rig.tcp()
    rig.start()
    client = rig.join_tcp(client_port)
    assert client.told() == ([], -1)
    rig.send(1)
    assert client.told() == ([500], 1000)
    rig.send(1, 2)
    assert client.told() == ([500, 501], 1001)
    rig.send()
    assert client.told() == ([], 1002)


def test_over_websocket_every_bundle_is_a_binary_message(rig: Rig) -> None:
    port = rig.websocket()
    rig.start()
    client = rig.join_websocket(port)
    for ids, expected in [((), ([], -1)), ((1,), ([500], 1000)), ((), ([], 1001))]:
        if expected[1] >= 0:
            rig.send(*ids)
        message = client.recv(DEADLINE_S)
        assert isinstance(message, bytes)
        assert told(message) == expected


def test_who_joins_is_told_what_touches_now(rig: Rig) -> None:
    tcp, websocket = rig.tcp(), rig.websocket()
    rig.start()
    early = rig.join_tcp(tcp)
    assert early.told() == ([], -1)
    rig.send(1, 2)
    assert early.told() == ([500, 501], 1000)
    late = rig.join_websocket(websocket)
    assert told(late.recv(DEADLINE_S)) == ([500, 501], 1000)
    rig.send(2)
    assert early.told() == told(late.recv(DEADLINE_S)) == ([501], 1001)


def test_profiles_come_in_bundles_of_their_own(rig: Rig) -> None:
    both = rig.websocket(profiles=("2Dcur", "2Dblb"))
    blobs = rig.tcp(0, 4, "2Dblb")
    rig.start()
    client, other = rig.join_websocket(both), rig.join_tcp(blobs)
    assert told(client.recv(DEADLINE_S)) == told(client.recv(DEADLINE_S)) == other.told()
    rig.send(1)
    cursor, blob = client.recv(DEADLINE_S), client.recv(DEADLINE_S)
    assert (profile_of(cursor), profile_of(blob)) == ("/tuio/2Dcur", "/tuio/2Dblb")
    assert told(cursor) == told(blob) == ([500], 1000)
    assert other.bundle() == blob


def test_a_stream_is_told_any_number_of_contacts_in_one_bundle(rig: Rig) -> None:
    port = rig.tcp()
    rig.start()
    client = rig.join_tcp(port)
    client.told()
    rig.send(*range(1, 61))
    assert client.told() == (list(range(500, 560)), 1000)


def test_nothing_to_say_for_a_second_repeats_the_state(rig: Rig) -> None:
    port = rig.tcp()
    rig.start()
    client = rig.join_tcp(port)
    assert client.told() == ([], -1)
    rig.send(1)
    assert client.told() == ([500], 1000)
    rig.sink.tick(1.0)
    assert client.told() == ([500], -1)


def test_the_end_lifts_all_and_says_farewell(rig: Rig) -> None:
    tcp, websocket = rig.tcp(), rig.websocket()
    rig.start()
    page, client = rig.join_websocket(websocket), rig.join_tcp(tcp)
    assert told(page.recv(DEADLINE_S)) == client.told() == ([], -1)
    rig.send(1)
    assert told(page.recv(DEADLINE_S)) == client.told() == ([500], 1000)
    rig.sink.close()
    assert told(page.recv(DEADLINE_S)) == client.told() == ([], -1)
    assert client.socket.recv(1) == b""
    with pytest.raises(ConnectionClosed) as closed:
        page.recv(DEADLINE_S)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1001


def test_a_stream_without_a_hub_is_refused() -> None:
    hub = StreamHub()
    server = StreamServer(hub, TCP, "127.0.0.1", free_port(), 1)
    with pytest.raises(ValueError, match="needs a hub"):
        TuioSink([TuioReceiver(server, SURFACE)], "a@b", 0, 0)


# --- clients that are slow -----------------------------------------------------------------------


def test_a_slow_client_skips_to_the_newest_frame_and_hears_of_the_lift(rig: Rig) -> None:
    port = rig.tcp()
    rig.start()
    slow, quick = rig.join_tcp(port, receive_buffer=2048), rig.join_tcp(port)
    quick.told()
    sent = 0
    while rig.status[0].frames_skipped < 20:
        sent += 1
        rig.send(*range(1, 21))
        assert quick.told() == (list(range(500, 520)), 999 + sent)  # who reads misses nothing
        assert sent < 20_000
    rig.send()
    assert quick.told() == ([], 1000 + sent)
    received: list[Told] = []
    bundles = PrefixedBundles()
    while not received or received[-1][1] < 1000 + sent:
        received += map(told, bundles.feed(slow.socket.recv(65536)))
    assert received[-1] == ([], 1000 + sent)
    assert len(received) <= 1 + sent + 1 - 20
    numbers = [fseq for _, fseq in received[1:]]
    assert numbers == sorted(set(numbers))


def test_a_client_that_is_stuck_makes_room_for_another(rig: Rig) -> None:
    port = rig.tcp(0, 2)
    rig.start()
    stuck, quick = rig.join_tcp(port, receive_buffer=2048), rig.join_tcp(port)
    quick.told()
    while not rig.status[0].frames_skipped:
        rig.send(*range(1, 21))
        quick.told()
    assert rig.join_tcp(port).ends()
    assert rig.status[0].refused == 1
    rig.now_s += STALLED_S
    rig.send(*range(1, 21))  # the clock is looked at
    quick.told()
    newcomer = rig.join_tcp(port)
    assert len(newcomer.told()[0]) == 20
    assert stuck.ends()
    assert (rig.status[0].clients, rig.status[0].errors) == (2, 1)


# --- clients that do what they should not --------------------------------------------------------


@pytest.mark.parametrize(
    ("origins", "origin", "is_let_in"),
    [
        (("http://localhost:*",), "http://localhost:3000", True),
        (("http://localhost:*",), "http://localhost", True),
        (("http://localhost:*",), "http://LOCALHOST:3000", True),
        (("http://localhost:*",), "https://localhost:3000", False),
        (("http://localhost:*",), "http://localhost.evil.example", False),
        (("http://localhost:*",), "http://localhost:3000.evil.example", False),
        (("http://localhost:3000",), "http://localhost:3001", False),
        (("http://localhost:*",), "null", False),
        (("null",), "null", True),
        ((), "http://localhost", False),
        (("*",), "http://evil.example", True),
        ((), None, True),
    ],
)
def test_pages_from_elsewhere_are_refused(
    rig: Rig, origins: tuple[str, ...], origin: str | None, is_let_in: bool
) -> None:
    port = rig.websocket(*origins)
    rig.start()
    if is_let_in:
        assert told(rig.join_websocket(port, origin).recv(DEADLINE_S)) == ([], -1)
        return
    with pytest.raises(InvalidStatus, match="403"):
        rig.join_websocket(port, origin)
    rig.wait_until(lambda: rig.status[0].refused == 1)


def test_a_refused_page_is_named_once(rig: Rig, caplog: pytest.LogCaptureFixture) -> None:
    port = rig.websocket()
    rig.start()
    for _ in range(3):
        with pytest.raises(InvalidStatus):
            rig.join_websocket(port, "https://evil.example")
    rig.wait_until(lambda: rig.status[0].refused == 3)
    assert [record.getMessage() for record in caplog.records] == [
        (
            f"TUIO over websocket at 127.0.0.1:{port}: a client was refused: a page from "
            "'https://evil.example', which is not in tuio.websocket.origins; further ones are "
            "counted only"
        )
    ]


def test_more_than_can_be_served_are_sent_away(rig: Rig) -> None:
    port = rig.tcp(0, 2)
    rig.start()
    clients = [rig.join_tcp(port), rig.join_tcp(port)]
    for client in clients:
        client.told()
    assert rig.join_tcp(port).ends()
    clients[0].socket.close()
    rig.wait_until(lambda: rig.status[0].clients == 1)
    assert rig.join_tcp(port).told() == ([], -1)
    assert rig.status[0].refused == 1


def test_who_shakes_no_hands_is_sent_away(rig: Rig) -> None:
    port = rig.websocket()
    rig.start()
    silent = rig.join_tcp(port)
    rig.wait_until(lambda: rig.status[0].clients == 1)
    rig.now_s += HANDSHAKE_S
    assert silent.ends()
    assert rig.status[0].clients == 0


@pytest.mark.parametrize("scheme", ["tcp", "websocket"])
def test_who_floods_is_sent_away_and_others_go_on(rig: Rig, scheme: str) -> None:
    port = rig.tcp() if scheme == "tcp" else rig.websocket()
    rig.start()
    flooding = rig.join_tcp(port)
    with contextlib.suppress(ConnectionError):
        for _ in range(64):
            flooding.socket.sendall(b"GET / HTTP/1.1\r\n" * (MAX_INPUT_BYTES_PER_S // 256))
    assert flooding.ends()
    if scheme == "tcp":
        assert rig.join_tcp(port).told() == ([], -1)
    else:
        assert told(rig.join_websocket(port).recv(DEADLINE_S)) == ([], -1)


@pytest.mark.parametrize(
    "request_bytes",
    [
        b"GET / HTTP/1.1\r\nHost: a\r\n\r\n",
        b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 3\r\n\r\nabc",
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n",
        b"\0" * 9000,
        b"\r\n\r\n\r\n",
    ],
    ids=["no upgrade", "POST", "TLS", "zeros", "empty lines"],
)
def test_what_is_no_handshake_is_answered_and_ended(rig: Rig, request_bytes: bytes) -> None:
    port = rig.websocket()
    rig.start()
    client = rig.join_tcp(port)
    client.socket.sendall(request_bytes)
    assert client.ends()
    rig.wait_until(lambda: rig.status[0].refused == 1)
    assert rig.hub.faults == 0


def test_a_ping_is_answered_and_messages_are_passed_over(rig: Rig) -> None:
    port = rig.websocket()
    rig.start()
    client = rig.join_websocket(port)
    client.send("hello")
    client.send(b"\0\1\2")
    assert client.ping().wait(DEADLINE_S)
    assert told(client.recv(DEADLINE_S)) == ([], -1)


def test_a_message_that_is_too_large_ends_the_connection(rig: Rig) -> None:
    port = rig.websocket()
    rig.start()
    client = rig.join_websocket(port)
    client.send(b"x" * 2000)
    with pytest.raises(ConnectionClosed) as closed:
        list(client)
    assert closed.value.rcvd is not None
    assert closed.value.rcvd.code == 1009


def test_a_fault_in_the_program_ends_nothing_else(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    port = rig.tcp()
    rig.start()
    client = rig.join_tcp(port)
    client.told()

    class Broken:
        def tell(self, *_: object) -> None:
            raise KeyError("broken")

    for _ in range(3):
        rig.hub.put(Broken(), [b""])  # type: ignore[arg-type]
    rig.send(1)
    assert client.told() == ([500], 1000)
    assert rig.hub.faults == 3
    assert len(caplog.records) == 1


# --- ports and servers that come and go ----------------------------------------------------------


def test_a_port_in_use_is_a_fault_until_it_is_free(
    rig: Rig, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = rig.tcp(other.getsockname()[1])
        server = rig.links[0]
        rig.hub.start([server])
        for _ in range(2):
            tries = server._tries
            rig.now_s += 1.0
            rig.wait_until(lambda tries=tries: server._tries > tries)
        assert server.status.fault == "Address already in use"
    rig.now_s += 1.0
    rig.wait_until(lambda: server.listens)
    assert server.status.fault is None
    assert [record.getMessage() for record in caplog.records] == [
        (
            f"TUIO over tcp at 127.0.0.1:{port}: Address already in use; tried again until it "
            "works, or set another port"
        ),
        f"TUIO over tcp at 127.0.0.1:{port}: clients can connect now",
    ]
    rig.hub.close()


def test_a_server_that_is_not_there_yet_is_told_all_when_it_comes(rig: Rig) -> None:
    port = free_port()
    rig.to(port)
    rig.start()
    rig.send(1)
    rig.wait_until(lambda: rig.status[0].errors >= 3, passing_s=1.0)
    assert rig.status[0].fault == "Connection refused"
    with socket.create_server(("127.0.0.1", port)) as server:
        server.settimeout(DEADLINE_S)
        rig.wait_until(lambda: rig.status[0].clients == 1, passing_s=1.0)
        connection, _ = server.accept()
        with connection:
            connection.settimeout(DEADLINE_S)
            assert told(connection.recv(65536)[4:]) == ([500], 1000)
            rig.send(1, 2)
            assert told(connection.recv(65536)[4:]) == ([500, 501], 1001)
        closed = "the other side has closed the connection"
        rig.wait_until(lambda: rig.status[0].fault == closed)
        assert rig.status[0].clients == 0
        rig.wait_until(lambda: rig.status[0].clients == 1, passing_s=1.0)
        again, _ = server.accept()
        with again:
            again.settimeout(DEADLINE_S)
            assert told(again.recv(65536)[4:]) == ([500, 501], 1001)
            rig.wait_until(lambda: rig.status[0].fault is None, passing_s=1.0)


def test_the_sink_after_a_reload_takes_over_the_port(rig: Rig) -> None:
    port = rig.tcp()
    rig.start()
    client = rig.join_tcp(port)
    client.told()
    after = Rig()
    after.tcp(port)
    try:
        after.sink = TuioSink(
            [TuioReceiver(after.links[0], SURFACE)], "test@127.0.0.1", 9, 9, hub=after.hub
        )
        after.sink.tick(0.0)
        after.wait_until(lambda: after.links[0]._tries == 1)
        rig.sink.close()
        after.now_s += 1.0
        after.wait_until(lambda: after.links[0].listens)
        assert client.ends()
        assert after.join_tcp(port).told() == ([], -1)
    finally:
        after.close()
