"""Viewers of the live page: a slow one loses what is old, holds up nobody, and needs no memory."""

import asyncio
import struct
from collections.abc import Callable, Iterator
from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cornertouchd.monitor.counters import Counters
from cornertouchd.monitor.hub import FullError, Hub, Message, Viewer


def moment(number: int) -> bytes:
    return struct.pack("<BI", 1, number)


def strip(camera: int, number: int) -> bytes:
    return struct.pack("<BBI", 2, camera, number)


Take = Callable[[Viewer], list[Message]]


def taken_in(loop: asyncio.Runner, viewer: Viewer) -> list[Message]:
    """Take all that waits."""

    async def take_all() -> list[Message]:
        messages = []
        while True:
            try:
                async with asyncio.timeout(0):
                    messages.append(await viewer.take())
            except TimeoutError:
                return messages

    return loop.run(take_all())


@pytest.fixture
def taken() -> Iterator[Take]:
    with asyncio.Runner() as loop:
        yield partial(taken_in, loop)


@pytest.fixture
def counters() -> Counters:
    return Counters()


@pytest.fixture
def hub(counters: Counters) -> Hub:
    return Hub(3, counters)


def counted(counters: Counters, name: str) -> float:
    lines = counters.render().decode().splitlines()
    (value,) = [line.split()[-1] for line in lines if line.startswith(f"cornertouchd_page_{name} ")]
    return float(value)


def test_every_viewer_is_told_the_same_message(hub, taken):
    with hub.viewer() as one, hub.viewer() as other:
        message = moment(1)
        hub.tell_live(message)
        assert taken(one)[0] is message
        assert taken(other)[0] is message


def test_a_slow_viewer_gets_the_newest_and_the_loss_is_counted(hub, counters, taken):
    with hub.viewer() as slow, hub.viewer() as quick:
        for number in range(100):
            hub.tell_live(moment(number))
            assert taken(quick) == [moment(number)]
        assert taken(slow) == [moment(99)]
    assert counted(counters, "messages_lost_total") == 99


def test_strips_come_to_those_who_want_them_the_newest_of_each_camera(hub, taken):
    with hub.viewer() as looking, hub.viewer() as reading:
        assert not hub.wants_strips
        hub.set_wants_strips(looking, wants=True)
        assert hub.wants_strips
        for number in range(3):
            hub.tell_live(strip(0, number))
            hub.tell_live(strip(1, number))
        assert taken(looking) == [strip(0, 2), strip(1, 2)]
        assert taken(reading) == []


def test_texts_of_one_kind_take_each_others_place(hub, taken):
    with hub.viewer() as viewer:
        hub.tell("health", "old")
        hub.tell("log", "lines")
        hub.tell("health", "new")
        assert taken(viewer) == ["lines", "new"]


def test_there_is_room_for_so_many_and_again_when_one_goes(hub, counters):
    with hub.viewer(), hub.viewer():
        with hub.viewer():
            assert hub.is_full
            assert counted(counters, "viewers") == 3
            with pytest.raises(FullError), hub.viewer():
                pass
        with hub.viewer():
            pass
    assert not hub.is_watched
    assert counted(counters, "viewers") == 0


def test_whoever_waits_for_changes_hears_of_each_kind(hub):
    async def changes() -> int:
        heard = 0

        async def hear() -> None:
            nonlocal heard
            async with asyncio.timeout(1.0):
                await hub.change()
            heard += 1

        with hub.viewer() as viewer:
            await hear()
            hub.set_wants_strips(viewer, wants=True)
            await hear()
            hub.set_wants_strips(viewer, wants=True)
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(0):
                    await hub.change()
        await hear()
        return heard

    assert asyncio.run(changes()) == 3


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("moment"), st.integers(0, 3)),
            st.tuples(st.just("strip"), st.integers(0, 3)),
            st.tuples(st.just("health"), st.integers(0, 3)),
            st.just(("take", 0)),
        ),
        max_size=60,
    )
)
def test_what_waits_is_the_newest_of_each_kind_whatever_comes(steps):
    """Against a model that keeps everything: so what waits has a bound."""
    viewer = Viewer(Counters())
    kept: list[tuple[object, Message]] = []
    with asyncio.Runner() as loop:
        for serial, (what, camera) in enumerate(steps):
            if what == "take":
                last_of = {kind: number for number, (kind, _) in enumerate(kept)}
                expected = [kept[number][1] for number in sorted(last_of.values())]
                assert taken_in(loop, viewer) == expected
                kept.clear()
                continue
            kind = (what, camera) if what == "strip" else what
            message = f"{what} {serial}"
            viewer.offer(kind, message)
            kept.append((kind, message))
            assert len(viewer._waiting) == len(dict(kept))
