"""One daemon's sink tells all programs and transports at once, each in its own process."""

import contextlib
import socket
from collections.abc import Iterator

import pytest
from clients.conftest import (
    COMMANDS,
    CONNECTING,
    DIAMETER_MM,
    HEIGHT_MM,
    WIDTH_MM,
    ClientProgram,
    Tracker,
    free_port,
    running,
)

from cornertouchd.devices.stream_hub import StreamHub
from cornertouchd.devices.stream_server import StreamServer
from cornertouchd.devices.udp_destination import UdpDestination
from cornertouchd.wire.tuio_stream import TCP
from cornertouchd.wire.websocket import websocket_dialect


def free_tcp_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.fixture
def everybody() -> Iterator[tuple[Tracker, list[ClientProgram]]]:
    """A tracker, and all the clients that it tells."""
    hub = StreamHub()
    websocket, tcp = free_tcp_port(), free_tcp_port()
    udp = {name: free_port() for name in COMMANDS}
    both = ("2Dcur", "2Dblb")
    tracker = Tracker(
        *(port for name, port in udp.items() if name != "python-tuio"),
        hub=hub,
        links=[
            (UdpDestination("127.0.0.1", udp["python-tuio"]), both),
            (StreamServer(hub, websocket_dialect(()), "127.0.0.1", websocket, 4), both),
            (StreamServer(hub, TCP, "127.0.0.1", tcp, 4), ("2Dcur",)),
        ],
    )
    with contextlib.ExitStack() as stack:
        clients = [
            stack.enter_context(running(name, command(), udp[name]))
            for name, command in COMMANDS.items()
        ]
        stack.callback(tracker.sink.close)
        tracker.rest(0.2)
        for (name, command), port in zip(CONNECTING.items(), (websocket, tcp), strict=True):
            clients.append(stack.enter_context(running(name, command(), port)))
        yield tracker, clients


def test_all_clients_show_the_same_at_once(
    everybody: tuple[Tracker, list[ClientProgram]],
) -> None:
    tracker, clients = everybody
    for places in [
        {1: (0.25, 0.5)},
        {1: (0.27, 0.5), 2: (0.75, 0.125)},
        {1: (0.28, 0.5), 2: (0.75, 0.25)},
        {k: (round(0.01 * k, 3), 0.5) for k in range(1, 60)},
        {2: (0.75, 0.5)},
    ]:
        tracker.send(places)
        for client in clients:
            client.wait_for_places(*places.values())
    tracker.sink.close()
    for client in clients:
        client.wait_for_places()
        assert client.removed == len(client.added) == 59, client.name
        assert not any(line.startswith("torn") for line in client.said)
    told_of_blobs = {client.name for client in clients if blobs_of(client)}
    assert told_of_blobs == {"python-tuio", "npm over WebSocket"}
    for client in clients:
        for _, _, width, height in blobs_of(client):
            assert float(width) == pytest.approx(DIAMETER_MM / WIDTH_MM, rel=1e-6)
            assert float(height) == pytest.approx(DIAMETER_MM / HEIGHT_MM, rel=1e-6)


def blobs_of(client: ClientProgram) -> list[list[str]]:
    return [line.split() for line in client.said if line.startswith("blob ")]
