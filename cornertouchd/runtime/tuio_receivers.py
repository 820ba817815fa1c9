"""From settings to those who are told TUIO: destinations, and servers that clients connect to."""

from collections.abc import Callable, Iterator

from cornertouchd.config import (
    DestinationSettings,
    DisplaySettings,
    TcpSettings,
    TuioSettings,
    WebSocketSettings,
)
from cornertouchd.devices.stream_hub import StreamHub, StreamLink
from cornertouchd.devices.tuio_sink import TuioReceiver
from cornertouchd.devices.udp_destination import UdpDestination
from cornertouchd.wire.mapping import DisplayMapping
from cornertouchd.wire.tuio_stream import TCP, Dialect


def make_receivers(
    tuio: TuioSettings, hub: StreamHub, mapping_of: Callable[[DisplaySettings], DisplayMapping]
) -> Iterator[TuioReceiver]:
    """Yield who is told; `hub` is to serve those that are streams.

    What only streams need is imported where there is one: touches would be missing for that time
    after every start.
    """
    for to in tuio.destinations:
        yield TuioReceiver(_way_to(to, hub), mapping_of(to), to.profiles)
    websocket, tcp = tuio.websocket, tuio.tcp
    if websocket.enabled:
        from cornertouchd.wire.websocket import websocket_dialect  # noqa: PLC0415

        server = _server(hub, websocket_dialect(websocket.origins), websocket)
        yield TuioReceiver(server, mapping_of(websocket), websocket.profiles)
    if tcp.enabled:
        yield TuioReceiver(_server(hub, TCP, tcp), mapping_of(tcp), tcp.profiles)


def receivers_in_words(tuio: TuioSettings) -> str:
    """Return who is told, for the log."""
    told = [f"{to.host}:{to.port}" + " (TCP)" * (to.transport == "tcp") for to in tuio.destinations]
    for name, server in (("WebSocket", tuio.websocket), ("TCP", tuio.tcp)):
        if server.enabled:
            told.append(f"{name} clients of {server.host}:{server.port}")
    return ", ".join(told) or "nobody"


def _server(hub: StreamHub, dialect: Dialect, at: TcpSettings | WebSocketSettings) -> StreamLink:
    from cornertouchd.devices.stream_server import StreamServer  # noqa: PLC0415

    return StreamServer(hub, dialect, at.host, at.port, at.connections_max)


def _way_to(to: DestinationSettings, hub: StreamHub) -> UdpDestination | StreamLink:
    if to.transport == "udp":
        return UdpDestination(to.host, to.port)
    from cornertouchd.devices.tcp_destination import TcpDestination  # noqa: PLC0415

    return TcpDestination(hub, to.host, to.port)
