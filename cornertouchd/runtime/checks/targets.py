"""Checks of the receivers of TUIO: whether they can be reached, whether anybody listens."""

import ipaddress
import socket
from collections.abc import Iterator
from pathlib import Path

from cornertouchd.devices.udp_destination import resolve_name
from cornertouchd.guiding.finding import Finding, doubtful, well, wrong
from cornertouchd.runtime.checks.installation import Installation

CONNECT_S = 2.0


def targets_of(installation: Installation) -> Iterator[Finding]:
    """Yield what is to be said of each receiver."""
    tuio = installation.settings.tuio
    if not (tuio.destinations or tuio.websocket.enabled or tuio.tcp.enabled):
        yield doubtful("TUIO", "touches are sent to nobody", "add [[tuio.destinations]]")
    for to in tuio.destinations:
        if to.transport == "tcp":
            yield _tcp_target(to.host, to.port)
        else:
            yield _target(to.host, to.port, installation.proc)


def _tcp_target(host: str, port: int) -> Finding:
    try:
        socket.create_connection((host, port), CONNECT_S).close()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        return wrong("TUIO", f"{host}:{port} (TCP): {reason}", "start the client, check host, port")
    return well("TUIO", f"{host}:{port} (TCP): a client listens")


def _target(host: str, port: int, proc: Path) -> Finding:
    try:
        family, address = resolve_name(host, port)[0]
    except (OSError, ValueError) as error:
        return wrong(
            "TUIO", f"{host}:{port}: the name is not known: {error}", "correct host, or the DNS"
        )
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            probe.connect(address)  # sends nothing
    except OSError as error:
        return wrong("TUIO", f"{host}:{port}: {error.strerror}", "check network and address")
    here = ipaddress.ip_address(str(address[0]).partition("%")[0]).is_loopback
    if here and port not in _listening_ports(proc):
        return doubtful(
            "TUIO",
            f"{host}:{port}: nobody listens on this machine",
            "start the client, or see `cornertouchd listen`",
        )
    return well("TUIO", f"{host}:{port} at {address[0]}" + (", a client listens" * here))


def _listening_ports(proc: Path) -> set[int]:
    """Return the UDP ports that are bound; columns as in proc_net(5)."""
    ports = set()
    for table in ("udp", "udp6"):
        try:
            lines = (proc / "net" / table).read_text().splitlines()[1:]
        except OSError:
            continue
        ports |= {int(line.split()[1].rpartition(":")[2], 16) for line in lines}
    return ports
