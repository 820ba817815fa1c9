"""What a page is told of a guided calibration, over a real socket."""

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cornertouchd.guiding.checking import CameraCheck, Finding
from cornertouchd.guiding.status import Status
from cornertouchd.ports import CameraError
from cornertouchd.runtime.asking import AskSocket, document, open_stream, read_document
from cornertouchd.runtime.clock import MonotonicClock
from cornertouchd.runtime.guide_feed import GuideFeed

SURFACE_MM = (350.0, 400.0)


class Listener:
    """Whoever asked, line by line."""

    def __init__(self, connection: socket.socket) -> None:
        self._lines = connection.makefile("rb")

    def heard(self) -> dict[str, Any]:
        return dict(json.loads(self._lines.readline()))

    def heard_at_last(self, key: str, value: object) -> dict[str, Any]:
        """Return the first thing told in which `key` has this value."""
        while (told := self.heard())[key] != value:
            pass
        return told


@pytest.fixture
def feed() -> GuideFeed:
    return GuideFeed(SURFACE_MM, MonotonicClock(), inset=0.1)


@pytest.fixture
def path(feed: GuideFeed, tmp_path: Path) -> Iterator[Path]:
    with AskSocket(tmp_path / "s", {"guide": feed, "hello": document(feed.hello)}):
        yield tmp_path / "s"


@pytest.fixture
def listener(path: Path) -> Iterator[Listener]:
    with open_stream(path, "guide") as connection:
        yield Listener(connection)


def test_it_tells_what_is_asked_for_now_and_then(feed: GuideFeed, listener: Listener) -> None:
    feed.begin(("cameras", "taps"))
    feed.show(Status("taps", "tap", 0.5, target_mm=(25.0, 30.0), number=2, of=4, held=0.25))
    told = listener.heard_at_last("step", "taps")
    assert told["steps"] == ["cameras", "taps"]
    assert (told["surface_mm"], told["inset"]) == ([350.0, 400.0], 0.1)
    assert (told["target_mm"], told["number"], told["of"]) == ([25.0, 30.0], 2, 4)
    assert (told["progress"], told["held"], told["missing"]) == (0.5, 0.25, [])
    feed.show(Status("taps", "lift", 0.75, tapped_mm=((25.0, 30.0),)))
    assert listener.heard_at_last("hint", "lift")["tapped_mm"] == [[25.0, 30.0]]


def test_who_asks_late_is_told_the_newest(feed: GuideFeed, path: Path) -> None:
    for share in (0.1, 0.2, 0.3):
        feed.show(Status("scribble", "scribble", share))
    with open_stream(path, "guide") as connection:
        assert Listener(connection).heard()["progress"] == 0.3


def test_it_tells_what_a_scribble_has_covered(feed: GuideFeed, listener: Listener) -> None:
    visited = np.array([[True, False, True], [False, False, True]])
    feed.show(Status("scribble", "scribble", 0.5, visited=visited, finger_mm=(1.0, 2.0)))
    told = listener.heard_at_last("step", "scribble")
    assert told["visited"] == {"rows": 2, "columns": 3, "cells": "101001"}
    assert told["finger_mm"] == [1.0, 2.0]


def test_it_tells_which_cameras_are_not_there_until_they_are(
    feed: GuideFeed, listener: Listener
) -> None:
    feed.missing([CameraError("C2", "not plugged in")])
    told = listener.heard_at_last("missing", ["camera C2: not plugged in"])
    assert told["step"] == "cameras"
    check = CameraCheck("C2", None, (Finding("strip", "bad", "no strip"),))
    feed.show(Status("cameras", "see to C2", checks=(check,)))
    told = listener.heard_at_last("missing", [])
    assert told["checks"] == [
        {"camera": "C2", "findings": [{"severity": "bad", "text": "no strip"}]}
    ]


def test_its_end_is_told(feed: GuideFeed, listener: Listener) -> None:
    feed.finish("saved")
    assert listener.heard_at_last("step", "done")["hint"] == "saved"


def test_a_page_is_told_that_no_daemon_runs_here(path: Path) -> None:
    told = read_document(path, "hello")
    assert told["calibrating"] is True
    assert told["cameras"] == []
