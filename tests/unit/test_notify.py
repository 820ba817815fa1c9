"""What systemd hears of the daemon, on a socket as systemd's."""

import os
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from cornertouchd.runtime.notify import ServiceManager


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[socket.socket]:
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listening.bind(str(tmp_path / "notify"))
    listening.settimeout(5.0)
    yield listening
    listening.close()


def environment(listening: socket.socket, **more: str) -> dict[str, str]:
    return {"NOTIFY_SOCKET": listening.getsockname(), **more}


def heard(listening: socket.socket) -> list[str]:
    return listening.recv(4096).decode().split("\n")


def test_each_message_is_one_datagram_in_systemds_words(systemd: socket.socket) -> None:
    manager = ServiceManager(environment(systemd))
    manager.ready("4 cameras")
    assert heard(systemd) == ["READY=1", "STATUS=4 cameras"]
    manager.status("3 cameras")
    assert heard(systemd) == ["STATUS=3 cameras"]
    manager.alive()
    assert heard(systemd) == ["WATCHDOG=1"]
    manager.stopping()
    assert heard(systemd) == ["STOPPING=1", "STATUS=stopping"]
    manager.close()


def test_a_reload_carries_the_time_that_notify_reload_asks_for(systemd: socket.socket) -> None:
    manager = ServiceManager(environment(systemd))
    before_us = time.monotonic_ns() // 1000
    manager.reloading()
    reloading, stamp = heard(systemd)
    assert reloading == "RELOADING=1"
    name, _, value = stamp.partition("=")
    assert name == "MONOTONIC_USEC"
    assert before_us <= int(value) <= time.monotonic_ns() // 1000
    manager.close()


def test_the_abstract_namespace_is_written_with_an_at_sign() -> None:
    listening = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    listening.bind(f"\0cornertouchd test {os.getpid()}")
    listening.settimeout(5.0)
    manager = ServiceManager({"NOTIFY_SOCKET": f"@cornertouchd test {os.getpid()}"})
    manager.alive()
    assert heard(listening) == ["WATCHDOG=1"]
    manager.close()
    listening.close()


def test_a_status_of_several_lines_cannot_smuggle_another_message(systemd: socket.socket) -> None:
    manager = ServiceManager(environment(systemd))
    manager.status("two lines\nREADY=1")
    assert heard(systemd) == ["STATUS=two lines; READY=1"]
    manager.close()


@pytest.mark.parametrize("address", ["", "/nowhere/notify", "relative"])
def test_without_a_manager_nothing_is_said_and_nothing_fails(address: str) -> None:
    manager = ServiceManager({"NOTIFY_SOCKET": address})
    assert manager.listens == bool(address)
    manager.ready("well")
    manager.close()
    manager.alive()


def test_a_manager_that_does_not_read_blocks_nobody(systemd: socket.socket) -> None:
    manager = ServiceManager(environment(systemd))
    for _ in range(2000):
        manager.alive()
    manager.close()


@pytest.mark.parametrize(
    ("environ", "expected_s"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "5000000"}, 5.0),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
        ({"WATCHDOG_USEC": "5000000", "WATCHDOG_PID": str(os.getpid())}, 5.0),
        ({"WATCHDOG_USEC": "5000000", "WATCHDOG_PID": "1"}, None),
    ],
)
def test_the_watchdog_is_that_of_this_process(
    environ: dict[str, str], expected_s: float | None
) -> None:
    assert ServiceManager(environ).watchdog_s == expected_s
