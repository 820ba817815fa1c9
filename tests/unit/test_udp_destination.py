"""One destination: what goes wrong on the way there costs packets, never more."""

import errno
import logging
import os
import socket

import pytest

from cornertouchd.devices.udp_destination import DestinationStatus, UdpDestination, resolve_name


class StubSocket:
    """A socket that fails as it is told to: always, or once."""

    def __init__(self) -> None:
        self.error: OSError | None = None
        self.old_error: OSError | None = None
        self.sent: list[bytes] = []

    def send(self, payload: bytes) -> int:
        error, self.old_error = self.error or self.old_error, None
        if error is not None:
            raise error
        self.sent.append(payload)
        return len(payload)

    def close(self) -> None:
        self.sent.clear()


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> StubSocket:
    stub = StubSocket()
    monkeypatch.setattr(
        "cornertouchd.devices.udp_destination._connected_socket", lambda family, address: stub
    )
    return stub


def test_a_full_buffer_costs_packets_but_not_the_socket(
    stub: StubSocket, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    destination = UdpDestination("127.0.0.1", 3333)
    stub.error = BlockingIOError(errno.EAGAIN, "would block")
    destination.send(b"lost", 0.0)
    destination.send(b"lost", 0.1)
    stub.error = None
    destination.send(b"1", 0.2)
    destination.send(b"2", 10.2)
    assert stub.sent == [b"1", b"2"]
    assert (destination.status.packets_sent, destination.status.errors) == (2, 2)
    assert len(caplog.records) == 2


@pytest.mark.parametrize("code", [errno.ECONNREFUSED, errno.EHOSTUNREACH, errno.ENETUNREACH])
def test_the_error_of_an_earlier_packet_does_not_cost_this_one(stub: StubSocket, code: int) -> None:
    destination = UdpDestination("127.0.0.1", 3333)
    destination.send(b"1", 0.0)
    stub.old_error = OSError(code, os.strerror(code))
    destination.send(b"2", 0.1)
    assert stub.sent == [b"1", b"2"]
    assert destination.status == DestinationStatus("127.0.0.1", 3333, 2, 1, os.strerror(code))


def test_without_a_route_the_way_is_sought_anew_every_ten_seconds(stub: StubSocket) -> None:
    destination = UdpDestination("127.0.0.1", 3333)
    stub.error = OSError(errno.ENETUNREACH, "Network is unreachable")
    destination.send(b"lost", 0.0)
    stub.error = None
    destination.send(b"still lost", 9.9)
    assert destination.status.fault == "Network is unreachable"
    destination.send(b"arrives", 10.0)
    assert stub.sent == [b"arrives"]
    assert destination.status.errors == 3
    assert destination.status.fault is None


def test_a_socket_that_cannot_be_opened_is_a_fault_like_any_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(family: object, address: object) -> None:
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr("cornertouchd.devices.udp_destination._connected_socket", refuse)
    destination = UdpDestination("::1", 3333)
    destination.send(b"lost", 0.0)
    assert destination.status.fault == "Address family not supported by protocol"


def test_of_the_addresses_of_a_name_those_that_clients_listen_on_come_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = [
        (socket.AF_INET6, socket.SOCK_DGRAM, 17, "", ("::1", 3333, 0, 0)),
        (socket.AF_INET, socket.SOCK_DGRAM, 17, "", ("127.0.0.1", 3333)),
    ]
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: answers)
    assert resolve_name("localhost", 3333) == [
        (socket.AF_INET, ("127.0.0.1", 3333)),
        (socket.AF_INET6, ("::1", 3333, 0, 0)),
    ]
