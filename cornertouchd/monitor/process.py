"""The process of the live page: begins with what the daemon tells it, ends with the daemon."""

import argparse
import asyncio
import contextlib
import json
import logging
import os
import signal
import sys

from aiohttp import web

from cornertouchd.monitor.app import CountingLogger, Page
from cornertouchd.monitor.options import PageOptions

LARGEST_HEADERS = 8190
MOST_HEADERS = 64
IDLE_S = 20.0
"""A connection without a whole request for so long is closed."""

MOST_CONNECTIONS = 200
"""Browsers open six each; more than all viewers need is an attack or an accident."""

LINGERING_S = 1.0
"""What is left of a request that was refused is read for so long."""


def main() -> None:
    """Serve until SIGTERM comes or the other end of standard input is closed.

    Standard input begins with a line of options; a line of JSON on standard output says that the
    page is served, or why not.
    """
    parser = argparse.ArgumentParser(prog="python -m cornertouchd.monitor", description=__doc__)
    parser.add_argument("--socket", required=True, help="where the daemon is asked")
    parser.parse_args()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the daemon, which ends the page
    options = PageOptions.from_line(sys.stdin.buffer.readline())
    logging.getLogger("aiohttp").setLevel(logging.CRITICAL)  # bad requests are counted, not told
    try:
        asyncio.run(_serve(options))
    except OSError as error:
        where = f"{options.host}:{options.port}"
        _say({"failed": f"{where}: {error}; set monitor.port or host, or end what is there"})
        sys.exit(1)


async def _serve(options: PageOptions) -> None:
    page = Page(options)
    CountingLogger.counters = page.counters
    runner = web.AppRunner(
        page.application(),
        access_log_class=CountingLogger,
        access_log=logging.getLogger("cornertouchd.page"),
        keepalive_timeout=IDLE_S,
        lingering_time=LINGERING_S,
        max_line_size=LARGEST_HEADERS,
        max_field_size=LARGEST_HEADERS,
        max_headers=MOST_HEADERS,
    )
    await runner.setup()
    listening = await _listen(runner.server, options)
    _say({"serving": options.address})
    telling = asyncio.ensure_future(page.tell())
    await _end()
    # Nobody is said farewell to: browsers see that the page is gone, as when the daemon is killed.
    telling.cancel()
    listening.close()


async def _listen(server: web.Server | None, options: PageOptions) -> asyncio.Server:
    """Return what accepts connections, so many at once.  Raises `OSError` if it may not."""
    if server is None:
        raise RuntimeError("the runner was not set up")

    def accept() -> asyncio.Protocol:
        is_full = len(server.connections) >= MOST_CONNECTIONS
        return _TurnedAway() if is_full else server()

    return await asyncio.get_running_loop().create_server(accept, options.host, options.port)


class _TurnedAway(asyncio.Protocol):
    """A connection for which there is no room."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """End it."""
        transport.close()


async def _end() -> None:
    """Return when the daemon closes our standard input, or has died, or on SIGTERM."""
    loop, over = asyncio.get_running_loop(), asyncio.Event()
    loop.add_signal_handler(signal.SIGTERM, over.set)
    loop.add_reader(sys.stdin.fileno(), over.set)
    await over.wait()
    loop.remove_reader(sys.stdin.fileno())


def _say(said: dict[str, str]) -> None:
    with contextlib.suppress(OSError):
        os.write(sys.stdout.fileno(), json.dumps(said).encode() + b"\n")
