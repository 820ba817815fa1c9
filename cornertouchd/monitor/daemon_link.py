"""The way to the daemon: its Unix socket, asked again and again, and streamed from."""

import asyncio
import contextlib
import json
import struct
from collections.abc import AsyncGenerator, Mapping
from typing import Any

from cornertouchd.monitor.hub import Hub

ANSWER_WITHIN_S = 5.0
LONGEST_MESSAGE = 4_000_000
"""Several times the largest strip; more means that something else talks."""

LONGEST_DOCUMENT = 4_000_000

FRESH_FOR_S = 0.5
"""What was told so recently is not asked for again, however many viewers want it."""

LOOK_EVERY_S = 1.0
"""The daemon counts its rates over a second."""

RETRY_S, LONGEST_RETRY_S = 0.2, 2.0

_LENGTH = struct.Struct("<I")


class DaemonGoneError(Exception):
    """The daemon does not answer; the text says why."""


class DaemonLink:
    """Asks the daemon at `path`.  For the thread of the event loop only."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._asked: dict[str, tuple[float, asyncio.Future[dict[str, Any]]]] = {}

    async def ask(self, name: str) -> dict[str, Any]:
        """Return one document, at most half a second old.  Raises `DaemonGoneError`."""
        now_s = asyncio.get_running_loop().time()
        asked_at_s, answer = self._asked.get(name, (float("-inf"), None))
        failed = answer is not None and answer.done() and answer.exception() is not None
        if answer is None or failed or now_s - asked_at_s > FRESH_FOR_S:
            answer = asyncio.ensure_future(self._read_document(name))
            self._asked[name] = now_s, answer
        return await asyncio.shield(answer)

    async def stream(self, hub: Hub) -> None:
        """Pass on what happens while anybody looks; return when nobody does.

        Raises `DaemonGoneError`.
        """
        wants_strips = hub.wants_strips
        async with self._connection("live", strips=wants_strips) as (reader, writer):
            reading = asyncio.ensure_future(_pass_on(reader, hub))
            try:
                while hub.is_watched:
                    change = asyncio.ensure_future(hub.change())
                    await asyncio.wait({reading, change}, return_when=asyncio.FIRST_COMPLETED)
                    change.cancel()
                    if reading.done():
                        reading.result()
                    if hub.wants_strips != wants_strips:
                        wants_strips = hub.wants_strips
                        writer.write(json.dumps({"strips": wants_strips}).encode() + b"\n")
            finally:
                reading.cancel()
                with contextlib.suppress(asyncio.CancelledError, DaemonGoneError):
                    await reading

    async def lines(self, name: str) -> AsyncGenerator[str]:
        """Yield what is told line by line.  Raises `DaemonGoneError`, also when there is no more.

        Use with `contextlib.aclosing`.
        """
        async with self._connection(name) as (reader, _):
            try:
                while line := await reader.readline():
                    if line.startswith(b'{"error"'):
                        break
                    yield line.decode(errors="replace")
            except (OSError, ValueError) as error:
                raise DaemonGoneError(f"{name} is told no more: {error}") from None
            raise DaemonGoneError(f"{name} is told no more")

    async def _read_document(self, name: str) -> dict[str, Any]:
        async with self._connection(name) as (reader, _):
            try:
                async with asyncio.timeout(ANSWER_WITHIN_S):
                    content = await reader.read(LONGEST_DOCUMENT)
                    while more := await reader.read(LONGEST_DOCUMENT - len(content)):
                        content += more
                told = json.loads(content)
            except (OSError, ValueError, TimeoutError) as error:
                raise DaemonGoneError(f"the daemon does not tell {name}: {error!r}") from None
        if not isinstance(told, dict) or "error" in told:
            raise DaemonGoneError(f"the daemon does not tell {name}: {content[:200]!r}")
        return told

    @contextlib.asynccontextmanager
    async def _connection(self, ask: str, **arguments: object) -> Any:
        try:
            async with asyncio.timeout(ANSWER_WITHIN_S):
                reader, writer = await asyncio.open_unix_connection(self._path)
        except (OSError, TimeoutError) as error:
            raise DaemonGoneError(f"the daemon does not answer at {self._path}: {error}") from None
        try:
            writer.write(json.dumps({"ask": ask, **arguments}).encode() + b"\n")
            yield reader, writer
        finally:
            writer.close()


async def _pass_on(reader: asyncio.StreamReader, hub: Hub) -> None:
    """Tell the hub every message.  Raises `DaemonGoneError` when there are no more."""
    try:
        while True:
            (length,) = _LENGTH.unpack(await reader.readexactly(_LENGTH.size))
            if not 0 < length <= LONGEST_MESSAGE:
                raise DaemonGoneError(f"the daemon tells {length} bytes at once; is it another?")
            hub.tell_live(await reader.readexactly(length))
    except (OSError, asyncio.IncompleteReadError) as error:
        raise DaemonGoneError(f"the daemon tells no more: {error}") from None


class Telling:
    """Tells all viewers what the daemon says, for as long as the process lives.

    Nothing is asked while nobody looks.
    """

    def __init__(self, link: DaemonLink, hub: Hub, more: Mapping[str, object]) -> None:
        self._link = link
        self._hub = hub
        self._more = more

    async def run(self) -> None:
        """Go on for ever."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._live())
            tasks.create_task(self._documents())

    async def hello(self) -> dict[str, Any]:
        """Return what a viewer has to know first, and whether he may act."""
        return {**await self._link.ask("hello"), **self._more}

    async def greeting(self) -> list[tuple[str, str]]:
        """Return the texts that a new viewer is told, each with its kind."""
        try:
            texts = {
                "hello": await self.hello(),
                "health": await self._link.ask("status"),
                "log": await self._link.ask("log"),
            }
        except DaemonGoneError as error:
            texts = {"gone": {"text": str(error)}}
        return [(kind, _text(kind, said)) for kind, said in texts.items()]

    async def _live(self) -> None:
        loop, wait_s = asyncio.get_running_loop(), RETRY_S
        while True:
            if not self._hub.is_watched:
                await self._hub.change()
                continue
            began_at_s = loop.time()
            try:
                await self._link.stream(self._hub)
            except DaemonGoneError:
                lasted = loop.time() - began_at_s > LONGEST_RETRY_S
                wait_s = RETRY_S if lasted else min(2.0 * wait_s, LONGEST_RETRY_S)
                await asyncio.sleep(wait_s)

    async def _documents(self) -> None:
        told: dict[str, str] = {}
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            if not self._hub.is_watched:
                told.clear()
                continue
            for kind, text in await self.greeting():
                if told.get(kind) != text:
                    told[kind] = text
                    self._hub.tell(kind, text)


def _text(kind: str, said: Mapping[str, object]) -> str:
    return json.dumps({"type": kind, **said})
