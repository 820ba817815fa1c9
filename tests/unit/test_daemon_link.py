"""The page's way to the daemon: asked only when somebody looks, and again when it was away."""

import asyncio
import json
import struct
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from cornertouchd.monitor.counters import Counters
from cornertouchd.monitor.daemon_link import DaemonGoneError, DaemonLink, Telling
from cornertouchd.monitor.hub import Hub, Message, Viewer

MOMENT = b"\x01moment"
STRIP = b"\x02\x00strip"


class FakeDaemon:
    """Answers as the daemon's socket does; notes what it was asked."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.asked: list[str] = []
        self.documents: dict[str, Any] = {
            "status": {"state": "healthy"},
            "hello": {"cameras": []},
            "log": {"lines": []},
        }
        self.streams: list[asyncio.StreamWriter] = []
        self.requests: asyncio.Queue[Any] = asyncio.Queue()
        self._server: asyncio.Server | None = None

    async def start(self) -> None:
        self._server = await asyncio.start_unix_server(self._answer, self.path)

    async def stop(self) -> None:
        self._server.close()
        for stream in self.streams:
            stream.close()
        self.streams.clear()
        self.path.unlink(missing_ok=True)

    def tell(self, message: bytes) -> None:
        for stream in self.streams:
            stream.write(struct.pack("<I", len(message)) + message)

    async def _answer(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        request = json.loads(await reader.readline())
        self.asked.append(request["ask"])
        if request["ask"] != "live":
            writer.write(json.dumps(self.documents[request["ask"]]).encode())
            writer.close()
            return
        self.streams.append(writer)
        self.requests.put_nowait(request)
        while line := await reader.readline():
            self.requests.put_nowait(json.loads(line))
        self.requests.put_nowait("left")
        writer.close()


Scenario = Callable[[FakeDaemon, DaemonLink], Awaitable[None]]


@pytest.fixture
def play(tmp_path: Path) -> Callable[[Scenario], None]:
    """Let a scenario happen with a daemon that answers; within ten seconds."""

    async def with_daemon(scenario: Scenario) -> None:
        daemon = FakeDaemon(tmp_path / "status.sock")
        await daemon.start()
        try:
            async with asyncio.timeout(10.0):
                await scenario(daemon, DaemonLink(str(daemon.path)))
        finally:
            await daemon.stop()

    return lambda scenario: asyncio.run(with_daemon(scenario))


async def next_of(viewer: Viewer, wanted: Callable[[Message], bool]) -> Message:
    while not wanted(message := await viewer.take()):
        pass
    return message


def test_many_ask_and_the_daemon_is_asked_once(play):
    async def scenario(daemon: FakeDaemon, link: DaemonLink) -> None:
        answers = await asyncio.gather(*(link.ask("status") for _ in range(20)))
        assert answers == [{"state": "healthy"}] * 20
        assert daemon.asked == ["status"]

    play(scenario)


@pytest.mark.parametrize("answer", [{"error": "unknown"}, ["no object"], 5, None])
def test_an_answer_that_is_none_is_told(play, answer):
    async def scenario(daemon: FakeDaemon, link: DaemonLink) -> None:
        daemon.documents["status"] = answer
        with pytest.raises(DaemonGoneError, match="does not tell status"):
            await link.ask("status")

    play(scenario)


def test_a_daemon_that_is_not_there_is_told_with_its_place(tmp_path):
    link = DaemonLink(str(tmp_path / "none.sock"))
    with pytest.raises(DaemonGoneError, match=r"none\.sock"):
        asyncio.run(link.ask("status"))


def test_a_daemon_that_is_back_is_asked_anew(play):
    async def scenario(daemon: FakeDaemon, link: DaemonLink) -> None:
        await daemon.stop()
        with pytest.raises(DaemonGoneError):
            await link.ask("hello")
        await daemon.start()
        assert await link.ask("hello") == {"cameras": []}

    play(scenario)


def test_what_happens_is_passed_on_while_somebody_looks(play):
    async def scenario(daemon: FakeDaemon, link: DaemonLink) -> None:
        hub = Hub(5, Counters())
        with hub.viewer() as viewer:
            streaming = asyncio.ensure_future(link.stream(hub))
            assert await daemon.requests.get() == {"ask": "live", "strips": False}
            daemon.tell(MOMENT)
            assert await viewer.take() == MOMENT
            hub.set_wants_strips(viewer, wants=True)
            assert await daemon.requests.get() == {"strips": True}
            daemon.tell(STRIP)
            assert await viewer.take() == STRIP
            hub.set_wants_strips(viewer, wants=False)
            assert await daemon.requests.get() == {"strips": False}
        await streaming
        assert await daemon.requests.get() == "left"

    play(scenario)


@pytest.mark.parametrize(
    "nonsense", [b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x05\0\0\0ab"], ids=["empty", "huge", "cut"]
)
def test_what_is_no_stream_ends_it(play, nonsense):
    async def scenario(daemon: FakeDaemon, link: DaemonLink) -> None:
        hub = Hub(5, Counters())
        with hub.viewer():
            streaming = asyncio.ensure_future(link.stream(hub))
            await daemon.requests.get()
            daemon.streams[0].write(nonsense)
            daemon.streams[0].close()
            with pytest.raises(DaemonGoneError):
                await streaming

    play(scenario)


def test_nothing_is_asked_until_somebody_looks_and_it_goes_on_after_the_daemon_was_away(play):
    async def scenario(daemon: FakeDaemon, link: DaemonLink) -> None:
        hub = Hub(5, Counters())
        telling = Telling(link, hub, {"may_act": True})
        working = asyncio.ensure_future(telling.run())
        await asyncio.sleep(0)
        assert daemon.asked == []
        with hub.viewer() as viewer:
            await daemon.requests.get()
            daemon.tell(MOMENT)
            await next_of(viewer, lambda message: message == MOMENT)
            await daemon.stop()
            gone = await next_of(viewer, lambda message: b"gone" in _as_bytes(message))
            assert json.loads(gone)["type"] == "gone"
            await daemon.start()
            while await daemon.requests.get() == "left":
                pass
            daemon.tell(MOMENT)
            await next_of(viewer, lambda message: message == MOMENT)
            hello = await next_of(viewer, lambda message: b"hello" in _as_bytes(message))
            assert json.loads(hello) == {"type": "hello", "cameras": [], "may_act": True}
        working.cancel()

    play(scenario)


def _as_bytes(message: Message) -> bytes:
    return message.encode() if isinstance(message, str) else message
