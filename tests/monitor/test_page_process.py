"""The process of the live page: watched, slow viewers, ended with its daemon."""

import asyncio
import json
import os
import signal
import socket
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path

import aiohttp
import pytest
from live_messages import ToldMoment, ToldStrip, read_message
from monitor.conftest import (
    DEADLINE_S,
    RunningDaemon,
    Start,
    free_port,
    wait_until,
    write_config,
)

from cornertouchd.monitor.access import Access
from cornertouchd.monitor.app import HEARTBEAT_S
from cornertouchd.monitor.options import PageOptions

TOKEN = "0123456789abcdef"
SERVED = "live page: http://127.0.0.1"
SPAN_S = 6.0
"""Long enough for a stopped viewer to fill what the system buffers for it."""


def is_running(pid: int) -> bool:
    """Whether a process is there and is more than an entry that nobody has asked for yet."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def memory_mb(pid: int) -> float:
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    raise AssertionError(pid)


def view(
    demo: RunningDaemon,
    scenario: Callable[[aiohttp.ClientSession], Awaitable[None]],
    **headers: str,
) -> None:
    """Let a scenario happen with a session of this page's origin."""

    async def with_session() -> None:
        async with (
            asyncio.timeout(2 * DEADLINE_S),
            aiohttp.ClientSession(
                f"http://{demo.address}",
                headers={"Origin": f"http://{demo.address}"},
                cookie_jar=aiohttp.CookieJar(unsafe=True),
            ) as session,
        ):
            await scenario(session)

    asyncio.run(with_session())


def test_a_viewer_is_told_what_happens(demo):
    async def scenario(session: aiohttp.ClientSession) -> None:
        moments: list[ToldMoment] = []
        strips: dict[int, ToldStrip] = {}
        texts = set()
        async with session.ws_connect("/live") as viewing:
            await viewing.send_str('{"strips": true}')
            while len(moments) < 60 or len(strips) < 4 or len(texts) < 3:
                message = await viewing.receive()
                if message.type is aiohttp.WSMsgType.TEXT:
                    texts.add(json.loads(message.data)["type"])
                    continue
                told = read_message(message.data)
                if isinstance(told, ToldMoment):
                    moments.append(told)
                else:
                    strips[told.camera] = told
        assert texts == {"hello", "health", "log"}
        times = [moment.captured_at_s for moment in moments]
        assert times == sorted(set(times))
        touched = [moment for moment in moments if moment.touches]
        assert touched
        for moment in touched:
            assert len(moment.lines) >= 2
            assert all(-20 < touch.x_mm < 370 for touch in moment.touches)
            assert all(-20 < touch.y_mm < 420 for touch in moment.touches)
        for strip in strips.values():
            assert (strip.width_px, len(strip.state)) == (640, 640)
            assert strip.rows <= 64
            assert 40 < strip.level < 255
            assert 0.5 < strip.contrast <= 1.0
            assert strip.state.count(0) > 400  # columns that are known
            assert len(strip.edges_px) % 2 == 0

    view(demo, scenario)


def test_strips_end_when_they_are_no_longer_wanted(demo):
    async def scenario(session: aiohttp.ClientSession) -> None:
        async with session.ws_connect("/live") as viewing:
            await viewing.send_str('{"strips": true}')
            while (await viewing.receive()).data[0] != 2:
                pass
            await viewing.send_str('{"strips": false}')
            without = 0
            while without < 60:  # a second of moments without a strip among them
                message = await viewing.receive()
                if message.type is aiohttp.WSMsgType.BINARY:
                    without = without + 1 if message.data[0] == 1 else 0

    view(demo, scenario)


def test_one_more_viewer_than_there_are_places_is_turned_away(demo):
    async def scenario(session: aiohttp.ClientSession) -> None:
        async with AsyncExitStack() as looking:
            for _ in range(20):
                await looking.enter_async_context(session.ws_connect("/live"))
            with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
                await session.ws_connect("/live")
            assert refusal.value.status == 503
        await asyncio.sleep(0)
        async with session.get("/metrics") as answer:
            assert 'cornertouchd_page_refused_total{reason="full"} 1.0' in await answer.text()

    view(demo, scenario)


def test_twenty_viewers_one_of_them_stopped_cost_no_frame_set_and_no_memory(demo):
    """The stopped one loses messages; the others and the daemon do not notice."""

    def lost_sets() -> tuple[int, int]:
        fusion = demo.health()["fusion"]
        return fusion["skipped"] + fusion["dropped"], fusion["frame_sets"]

    async def span() -> tuple[int, int]:
        lost, done = await asyncio.to_thread(lost_sets)
        await asyncio.sleep(SPAN_S)
        lost_then, done_then = await asyncio.to_thread(lost_sets)
        return lost_then - lost, done_then - done

    async def look(session: aiohttp.ClientSession, counts: dict[int, int], number: int) -> None:
        async with session.ws_connect("/live") as viewing:
            await viewing.send_str('{"strips": true}')
            async for message in viewing:
                counts[number] = counts.get(number, 0) + (message.type is aiohttp.WSMsgType.BINARY)

    async def scenario(session: aiohttp.ClientSession) -> None:
        (pid,) = demo.page_pids
        counts: dict[int, int] = {}
        alone = await span()
        stopped = await _stopped_viewer(demo)
        looking = [asyncio.create_task(look(session, counts, number)) for number in range(19)]
        with stopped:
            while len(counts) < 19:
                await asyncio.sleep(0.05)
            await span()  # buffers fill
            before_mb = memory_mb(pid)
            counts.clear()
            watched = await span()
            after_mb = memory_mb(pid)
        for task in looking:
            task.cancel()
        print(
            f"lost of all frame sets: {alone[0]} of {sum(alone)} alone, {watched[0]} of "
            f"{sum(watched)} watched; messages to each of 19: {min(counts.values())} to "
            f"{max(counts.values())} in {SPAN_S:g} s; memory {before_mb:.1f}, {after_mb:.1f} MB"
        )
        # other tests take their share; benchmarks/latency.py has the machine for itself
        assert watched[0] <= 2 * alone[0] + 0.25 * sum(alone)
        assert min(counts.values()) > 10 * SPAN_S
        assert after_mb < before_mb + 5.0

    lost_before = demo.metric("cornertouchd_page_messages_lost_total")
    view(demo, scenario)
    assert demo.metric("cornertouchd_page_messages_lost_total") > lost_before + 100


def test_a_viewer_who_has_stopped_loses_his_place(demo):
    """No answer to a ping: the browser is gone without a word, or its machine sleeps."""
    viewers = "cornertouchd_page_viewers"
    with asyncio.run(_stopped_viewer(demo)):
        wait_until(lambda: demo.metric(viewers) == 1, "the viewer")
        wait_until(lambda: demo.metric(viewers) == 0, "his end", 2 * HEARTBEAT_S)


async def _stopped_viewer(demo: RunningDaemon) -> socket.socket:
    """A viewer who asks for everything and then reads nothing."""
    from monitor.test_bad_requests import TEXT, frame, opened

    connection = await asyncio.to_thread(opened, demo)
    connection.sendall(frame(TEXT, b'{"strips": true}'))
    return connection


def test_a_page_that_is_killed_comes_back(start: Start):
    daemon = start()
    daemon.wait_for(SERVED)
    (pid,) = daemon.page_pids
    os.kill(pid, signal.SIGKILL)
    daemon.wait_for(SERVED, times=2, within_s=DEADLINE_S)
    assert daemon.get("/")[0] == 200
    assert daemon.page_pids != [pid]
    assert daemon.times_said("live page: not served: ended with status -9; touches go on") == 1


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_the_page_ends_with_its_daemon_whatever_ends_that(start: Start, number):
    daemon = start()
    daemon.wait_for(SERVED)
    (pid,) = daemon.page_pids
    daemon.process.send_signal(number)
    daemon.process.wait(DEADLINE_S)
    wait_until(lambda: not is_running(pid), "the end of the page", 2.0)


def test_a_port_that_is_taken_is_told_once_and_the_page_comes_when_it_is_free(start: Start):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        daemon = start(port=port)
        daemon.wait_for("live page: not served")
        daemon.wait_for("frame sets/s   4 cameras", times=3)
    daemon.wait_for(f"live page: http://127.0.0.1:{port}/", within_s=DEADLINE_S)
    told = [line for line in daemon.said if "not served" in line]
    assert len(told) == 1
    assert f"127.0.0.1:{port}" in told[0]
    assert "address already in use" in told[0].lower()
    assert "monitor.port" in told[0]


def test_a_demo_without_a_page_has_none(start: Start):
    daemon = start(arguments=("--no-monitor",))
    daemon.wait_for("4 cameras", times=4)
    assert daemon.times_said("live page") == 0
    assert daemon.page_pids == []


def test_a_token_opens_everything_once_it_is_known(start: Start):
    daemon = start('host = "0.0.0.0"', f'token = "{TOKEN}"', 'names = ["kiosk.local"]')
    daemon.wait_for(SERVED)

    assert daemon.get("/")[0] == 200
    for path in ("/live", "/metrics", "/api/hello", "/api/health", "/nothing"):
        assert daemon.get(path)[0] == 401
        assert daemon.get(path, Authorization="Bearer 0123456789abcdee")[0] == 401
    assert daemon.get("/api/hello", Authorization=f"Bearer {TOKEN}")[0] == 200
    assert daemon.get("/?token=0123456789abcdee")[0] == 401
    assert daemon.get("/", Host="evil.example")[0] == 421
    assert daemon.get("/", Host="kiosk.local")[0] == 200

    async def scenario(session: aiohttp.ClientSession) -> None:
        with pytest.raises(aiohttp.WSServerHandshakeError) as refusal:
            await session.ws_connect("/live")
        assert refusal.value.status == 401
        async with session.get("/", params={"token": TOKEN}, allow_redirects=False) as answer:
            assert (answer.status, answer.headers["Location"]) == (303, "/")
            cookie = answer.headers["Set-Cookie"]
            assert "HttpOnly" in cookie
            assert "SameSite=Strict" in cookie
            assert TOKEN not in cookie
        async with session.ws_connect("/live") as viewing:
            while (await viewing.receive()).type is not aiohttp.WSMsgType.BINARY:
                pass

    view(daemon, scenario)
    (pid,) = daemon.page_pids
    assert TOKEN not in Path(f"/proc/{pid}/cmdline").read_text()
    assert TOKEN not in Path(f"/proc/{pid}/environ").read_text()
    assert not any(TOKEN in line for line in daemon.said)


def test_another_configuration_is_followed_while_the_daemon_goes_on(start: Start, tmp_path):
    daemon = start("enabled = true")
    daemon.wait_for(SERVED)
    before = daemon.health()["up_s"]
    moved_to = free_port()
    write_config(tmp_path / "touch.toml", moved_to, "viewers_max = 1")
    daemon.process.send_signal(signal.SIGHUP)
    daemon.wait_for(f"live page: http://127.0.0.1:{moved_to}/", within_s=DEADLINE_S)
    daemon.port = moved_to
    assert daemon.health()["up_s"] >= before


def test_a_viewer_who_may_act_saves_what_just_happened(start: Start, tmp_path):
    daemon = start("allow_actions = true")
    daemon.wait_for(SERVED)
    wait_until(lambda: daemon.health()["up_s"] > 3.0, "something to save")

    async def scenario(session: aiohttp.ClientSession) -> None:
        for wrong in ({}, {"last_s": "30"}, {"last_s": -1}, {"last_s": True}, [], {"last_s": 1e9}):
            async with session.post("/api/save", json=wrong) as answer:
                assert answer.status == 400
        async with session.post("/api/save", data=b"x" * 5000) as answer:
            assert answer.status == 413
        async with session.post("/api/save", json={"last_s": 2}) as answer:
            said = await answer.json()
            assert answer.status == 200, said
        recording = Path(said["path"])
        assert recording.parent == tmp_path / "recordings"
        assert recording.name == said["name"]
        assert said["bytes"] == sum(file.stat().st_size for file in recording.iterdir())
        assert {file.name for file in recording.iterdir()} >= {"recording.json", "c1.mkv"}

    view(daemon, scenario)


def test_the_page_is_a_small_process_that_lets_the_daemon_go_first(demo):
    (pid,) = demo.page_pids
    assert os.getpriority(os.PRIO_PROCESS, pid) >= 10
    assert memory_mb(pid) < 80


def test_no_other_cookie_is_taken(start: Start):
    daemon = start(f'token = "{TOKEN}"')
    daemon.wait_for(SERVED)
    access = Access(PageOptions("", port=daemon.port, token=TOKEN))
    good = f"{access.cookie_name}={access.cookie}"
    assert daemon.get("/api/hello", Cookie=good)[0] == 200
    for bad in (good[:-1], f"{access.cookie_name}=", f"{access.cookie_name}={TOKEN}", "a=b;;;=x"):
        assert daemon.get("/api/hello", Cookie=bad)[0] == 401
