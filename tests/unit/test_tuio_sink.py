"""Touches over UDP: what clients receive and when, and what a dead one cannot do."""

import logging
import socket
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pythonosc.osc_bundle import OscBundle

from cornertouchd.devices.tuio_sink import TuioReceiver, TuioSink, local_address
from cornertouchd.devices.udp_destination import (
    Address,
    Resolve,
    UdpDestination,
    resolve_name,
)
from cornertouchd.model import Touch, TouchFrame
from cornertouchd.ports import TouchSink
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio import BundleEncoder

SURFACE = DisplayMapping(0.0, 0.0, 400.0, 200.0)
LEFT_HALF = DisplayMapping(0.0, 0.0, 200.0, 200.0)
TICK_S = 0.025

Told = tuple[list[int], int]  # the ids alive, the frame number
MakeSink = Callable[..., TuioSink]


class Client:
    """A socket that listens like a TUIO client."""

    def __init__(self, port: int = 0) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.port: int = self.socket.getsockname()[1]

    def told(self) -> list[Told]:
        """What has arrived: loopback delivers before `send` returns."""
        self.socket.setblocking(False)
        told: list[Told] = []
        while True:
            try:
                datagram = self.socket.recv(65536)
            except BlockingIOError:
                return told
            messages = [message.params for message in OscBundle(datagram)]
            told.append((messages[1][1:], messages[-1][1]))

    def close(self) -> None:
        self.socket.close()


@pytest.fixture
def client() -> Iterator[Client]:
    listening = Client()
    yield listening
    listening.close()


@pytest.fixture
def second_client() -> Iterator[Client]:
    listening = Client()
    yield listening
    listening.close()


@pytest.fixture
def make_sink() -> Iterator[MakeSink]:
    sinks: list[TuioSink] = []

    def make(
        *destinations: tuple[str, int, DisplayMapping],
        resolve: Resolve = resolve_name,
        **options: Any,
    ) -> TuioSink:
        options = {"sleep": lambda _: None, **options}
        receivers = [
            TuioReceiver(UdpDestination(host, port, resolve), mapping)
            for host, port, mapping in destinations
        ]
        sinks.append(TuioSink(receivers, "test@127.0.0.1", 1000, 500, **options))
        return sinks[-1]

    yield make
    for sink in sinks:
        sink.close()


def to(client: Client, mapping: DisplayMapping = SURFACE) -> tuple[str, int, DisplayMapping]:
    return ("127.0.0.1", client.port, mapping)


def frame(*ids: int, at_s: float = 0.0, x_mm: float = 100.0) -> TouchFrame:
    return TouchFrame(at_s, tuple(Touch(id_, x_mm, 50.0, 0.0, 0.0, 0.0) for id_ in ids))


def greeted(sink: TuioSink, *clients: Client) -> TuioSink:
    """A sink whose greeting at time 0 is over and read."""
    for tick in range(5):
        sink.tick(tick * TICK_S)
    for client in clients:
        client.told()
    return sink


def run(sink: TuioSink, from_s: float, until_s: float) -> None:
    for tick in range(round((until_s - from_s) / TICK_S)):
        sink.tick(from_s + tick * TICK_S)


# --- what is told when ---------------------------------------------------------------------------


def test_it_is_a_touch_sink(make_sink: MakeSink, client: Client) -> None:
    sink: TouchSink = make_sink(to(client))
    sink.send(frame(1), 0.0)
    assert client.told() == [([], -1), ([500], 1000)]


def test_a_start_says_three_times_within_100_ms_that_there_are_no_touches(
    make_sink: MakeSink, client: Client
) -> None:
    sink = make_sink(to(client))
    sink.tick(0.0)
    assert client.told() == [([], -1)]
    run(sink, 0.0, 0.101)
    assert client.told() == [([], -1)] * 2
    run(sink, 0.125, 0.9)
    assert client.told() == []


def test_at_rest_the_state_is_repeated_once_a_second(make_sink: MakeSink, client: Client) -> None:
    sink = greeted(make_sink(to(client)), client)
    run(sink, 0.125, 5.125)
    assert client.told() == [([], -1)] * 5


def test_held_touches_are_repeated_once_a_second_when_no_frames_come(
    make_sink: MakeSink, client: Client
) -> None:
    sink = greeted(make_sink(to(client)), client)
    sink.send(frame(1, 2), 1.0)
    run(sink, 1.0, 3.5)
    assert client.told() == [([500, 501], 1000), ([500, 501], -1), ([500, 501], -1)]


def test_no_frame_is_told_while_nothing_touches(make_sink: MakeSink, client: Client) -> None:
    sink = greeted(make_sink(to(client)), client)
    for tick in range(80):
        sink.send(frame(), 0.125 + 0.01 * tick)
    assert client.told() == []


def test_the_last_lift_is_told_three_times(make_sink: MakeSink, client: Client) -> None:
    sink = greeted(make_sink(to(client)), client)
    sink.send(frame(1), 0.5)
    client.told()
    sink.send(frame(), 0.6)
    run(sink, 0.6, 0.701)
    assert client.told() == [([], 1001), ([], -1), ([], -1)]


def test_a_new_touch_ends_the_repeats(make_sink: MakeSink, client: Client) -> None:
    sink = greeted(make_sink(to(client)), client)
    sink.send(frame(1), 0.50)
    sink.send(frame(), 0.51)
    sink.send(frame(2), 0.52)
    run(sink, 0.52, 1.5)
    assert client.told() == [([500], 1000), ([], 1001), ([501], 1002)]


def test_lost_cameras_lift_all_touches_three_times_and_touches_return_as_new_ones(
    make_sink: MakeSink, client: Client
) -> None:
    sink = greeted(make_sink(to(client)), client)
    sink.send(frame(1), 1.0)
    sink.lift_all(1.01)
    run(sink, 1.01, 1.11)
    sink.send(frame(1), 1.2)
    assert client.told() == [([500], 1000), *[([], -1)] * 3, ([501], 1001)]


def test_lifting_all_over_and_over_does_not_flood_clients(
    make_sink: MakeSink, client: Client
) -> None:
    sink = greeted(make_sink(to(client)), client)
    sink.send(frame(1), 1.0)
    client.told()
    for call in range(1000):
        sink.lift_all(1.0 + call / 1000.0)
    assert set(told := [ids == [] for ids, _ in client.told()]) == {True}
    assert len(told) <= 50


def test_closing_says_farewell_three_times_within_200_ms(
    make_sink: MakeSink, client: Client
) -> None:
    pauses_s: list[float] = []
    sink = greeted(make_sink(to(client), sleep=pauses_s.append), client)
    sink.send(frame(1), 1.0)
    sink.close()
    assert client.told() == [([500], 1000), *[([], -1)] * 3]
    assert sum(pauses_s) < 0.1
    sink.close()
    assert client.told() == []


def test_a_frame_that_does_not_fit_arrives_in_several_packets(
    make_sink: MakeSink, client: Client
) -> None:
    sink = greeted(make_sink(to(client)), client)
    sink.send(frame(*range(60)), 1.0)
    told = client.told()
    assert [fseq for _, fseq in told] == [1000] * 4
    assert told[-1][0] == list(range(500, 560))
    assert sink.destinations[0].packets_sent == 3 + 4


def test_each_display_hears_of_its_own_part(
    make_sink: MakeSink, client: Client, second_client: Client
) -> None:
    sink = make_sink(to(client), to(second_client, LEFT_HALF))
    greeted(sink, client, second_client)
    sink.send(frame(1, x_mm=150.0), 0.20)
    sink.send(frame(1, x_mm=250.0), 0.21)
    sink.send(frame(1, x_mm=150.0), 0.22)
    assert client.told() == [([500], 1000), ([500], 1001), ([500], 1002)]
    assert second_client.told() == [([500], 1000), ([], 1001), ([501], 1002)]


def test_clients_of_the_same_display_share_one_encoding(
    make_sink: MakeSink, client: Client, second_client: Client, monkeypatch: pytest.MonkeyPatch
) -> None:
    sink = greeted(make_sink(to(client), to(second_client)), client, second_client)
    encoded: list[bytes] = []
    encode = BundleEncoder.encode

    def counting(self: BundleEncoder, *arguments: Any) -> bytes:
        encoded.append(encode(self, *arguments))
        return encoded[-1]

    monkeypatch.setattr(BundleEncoder, "encode", counting)
    sink.send(frame(1), 1.0)
    assert client.told() == second_client.told() == [([500], 1000)]
    assert len(encoded) == 1


def test_touches_that_cannot_be_told_are_counted(make_sink: MakeSink, client: Client) -> None:
    sink = make_sink(to(client))
    sink.send(frame(1, x_mm=float("nan")), 0.0)
    assert sink.touches_left_out == 1


# --- destinations that fail ----------------------------------------------------------------------


def test_a_client_that_is_not_there_is_counted_and_the_next_one_misses_nothing(
    make_sink: MakeSink, client: Client, second_client: Client, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    sink = greeted(make_sink(to(client), to(second_client)), client, second_client)
    client.close()
    for tick in range(4):
        sink.send(frame(1), 1.0 + 0.01 * tick)
    assert len(second_client.told()) == 4
    assert sink.destinations[0].errors == 3  # the first one was told only afterwards
    faults = [destination.fault for destination in sink.destinations]
    assert faults == ["Connection refused", None]
    restarted = Client(client.port)
    sink.send(frame(1), 1.04)
    assert restarted.told() == [([500], 1004)]
    run(sink, 1.05, 13.0)
    assert sink.destinations[0].fault is None
    assert [record.getMessage() for record in caplog.records] == [
        f"TUIO destination 127.0.0.1:{client.port}: Connection refused",
        f"TUIO destination 127.0.0.1:{client.port} is reached again",
    ]
    restarted.close()


class NameServer:
    """Answers when it is let to, and not before."""

    def __init__(self, *answers: list[Address] | OSError) -> None:
        self.answers = list(answers)
        self.asked: list[str] = []
        self.let = threading.Event()

    def __call__(self, host: str, port: int) -> list[Address]:
        self.asked.append(host)
        assert self.let.wait(10.0)
        answer = self.answers.pop(0)
        if isinstance(answer, OSError):
            raise answer
        return answer

    def answer(self) -> None:
        """Let it answer, and wait until it has."""
        self.let.set()
        for thread in threading.enumerate():
            if thread.name == "resolve kiosk":
                thread.join(10.0)
        self.let.clear()


def test_a_slow_name_server_delays_nobody(
    make_sink: MakeSink, client: Client, second_client: Client
) -> None:
    names = NameServer([(socket.AF_INET, ("127.0.0.1", client.port))])
    sink = make_sink(("kiosk", 3333, SURFACE), to(second_client), resolve=names)
    sink.send(frame(1), 0.0)
    sink.send(frame(1), 0.1)
    assert second_client.told() == [([], -1), ([500], 1000), ([500], 1001)]
    assert names.asked == ["kiosk"]
    names.answer()
    sink.send(frame(1), 0.2)
    assert client.told() == [([500], 1002)]


def test_an_unknown_name_is_asked_for_again_every_ten_seconds_and_logged_once(
    make_sink: MakeSink, client: Client, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    unknown = socket.gaierror(socket.EAI_NONAME, "Name or service not known")
    names = NameServer(unknown, unknown, [(socket.AF_INET, ("127.0.0.1", client.port))])
    sink = make_sink(("kiosk", 3333, SURFACE), resolve=names)
    for now_s in (0.0, 9.9, 10.0, 19.9, 20.0):
        sink.tick(now_s)
        names.answer()
        sink.tick(now_s)
    assert len(names.asked) == 3
    run(sink, 20.025, 22.0)
    assert client.told() == [([], -1)] * 2
    assert [record.getMessage() for record in caplog.records] == [
        "TUIO destination kiosk:3333: Name or service not known",
        "TUIO destination kiosk:3333 is reached again",
    ]


@pytest.mark.parametrize(
    "host",
    ["a..b", "x" * 300, "\udc80", "a\0b"],
    ids=["empty label", "too long", "surrogate", "NUL"],
)
def test_a_name_that_cannot_be_one_is_a_fault_not_a_crash(make_sink: MakeSink, host: str) -> None:
    sink = make_sink((host, 3333, SURFACE))
    sink.tick(0.0)
    for thread in threading.enumerate():
        if thread.name.startswith("resolve "):
            thread.join(10.0)
    sink.send(frame(1), 0.1)
    assert sink.destinations[0].fault


def test_a_name_without_address_is_a_fault(make_sink: MakeSink) -> None:
    names = NameServer([])
    sink = make_sink(("kiosk", 3333, SURFACE), resolve=names)
    sink.tick(0.0)
    names.answer()
    sink.tick(0.1)
    assert sink.destinations[0].fault == "the name has no address"


def test_destinations_that_cannot_exist_are_refused(make_sink: MakeSink) -> None:
    with pytest.raises(ValueError, match=r"port 70000; give one of 1\.\.65535"):
        make_sink(("127.0.0.1", 70000, SURFACE))
    with pytest.raises(ValueError, match="has no host"):
        make_sink(("", 3333, SURFACE))
    with pytest.raises(ValueError, match=r"127\.0\.0\.1:3333 is given twice; remove one"):
        make_sink(*[("127.0.0.1", 3333, SURFACE)] * 2)


def test_nobody_to_tell_is_fine(make_sink: MakeSink) -> None:
    sink = make_sink()
    sink.send(frame(1), 0.0)
    sink.lift_all(0.1)
    assert sink.destinations == ()


def test_the_local_address_is_the_one_clients_see() -> None:
    assert local_address("127.0.0.1") == "127.0.0.1"
    socket.inet_aton(local_address("not a number"))
