"""Browsers that look at the live page with all its strips; the last of many does not read.

    python benchmarks/viewers.py http://127.0.0.1:8333 20

Says "looking" when all are connected, and ends when its standard input does.
"""

import asyncio
import os
import sys

import aiohttp


async def look(page: str, viewers: int) -> None:
    async with aiohttp.ClientSession() as session:
        eyes = [
            await session.ws_connect(f"{page}/live", origin=page, max_msg_size=0)
            for _ in range(viewers)
        ]
        for eye in eyes:
            await eye.send_json({"strips": True})
        reading = [asyncio.create_task(_read(eye)) for eye in (eyes[:-1] if viewers > 1 else eyes)]
        print("looking", flush=True)
        await asyncio.to_thread(sys.stdin.read)
        for task in reading:
            task.cancel()


async def _read(eye: aiohttp.ClientWebSocketResponse) -> None:
    async for _ in eye:
        pass


if __name__ == "__main__":
    os.nice(19)  # viewers have machines of their own: these take what this one has to spare
    asyncio.run(look(sys.argv[1], int(sys.argv[2])))
