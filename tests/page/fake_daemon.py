"""A server that speaks the protocol of the live page without a daemon: any scene, any fault."""

import asyncio
import json
import math
import threading
from pathlib import Path
from typing import Any, Self

from aiohttp import WSMsgType, web
from page.scene import (
    CORNERS_MM,
    LOG,
    ROWS_PX,
    SURFACE_MM,
    WIDTH_PX,
    Scene,
    encode_moment,
    encode_strip,
    health,
)

PAGE = Path(__file__).resolve().parents[2] / "cornertouchd" / "monitor" / "page"
TYPES = {
    ".html": "text/html",
    ".css": "text/css",
    ".js": "text/javascript",
    ".svg": "image/svg+xml",
}
POLICY = "default-src 'self'; connect-src 'self'; frame-ancestors 'none'"


class FakeDaemon:
    """Serves a scene at a port of this machine, in a thread of its own."""

    def __init__(self, scene: Scene, port: int = 0) -> None:
        self.scene = scene
        self.port = port
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._ready.wait(10.0)
        return self

    def __exit__(self, *_: object) -> None:
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join(10.0)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def _run(self) -> None:
        self._loop.run_until_complete(self._serve())
        self._loop.close()

    async def _serve(self) -> None:
        self._stop = asyncio.Event()
        app = web.Application(middlewares=[self._guard])
        app.router.add_get("/", self._page)
        app.router.add_get("/page/{name}", self._page)
        app.router.add_get("/api/hello", self._hello)
        app.router.add_post("/api/save", self._save)
        app.router.add_get("/live", self._live)
        runner = web.AppRunner(app, shutdown_timeout=0.1)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", self.port, reuse_address=True)
        await site.start()
        self.port = runner.addresses[0][1]
        self._ready.set()
        await self._stop.wait()
        await runner.cleanup()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Any) -> web.StreamResponse:
        """Everything but the page itself is for those who know the token."""
        self.scene.asked.append(request.path)
        given = request.query.get("token") or request.cookies.get("token")
        refused = web.json_response({"error": "a token is needed"}, status=401)
        is_page = request.path == "/" or request.path.startswith("/page/")
        is_open = not self.scene.token or (is_page and "token" not in request.query)
        if not is_open and given != self.scene.token:
            return refused
        answer: web.StreamResponse = await handler(request)
        if "token" in request.query:
            answer.set_cookie("token", self.scene.token, httponly=True, samesite="Strict")
        return answer

    async def _page(self, request: web.Request) -> web.StreamResponse:
        path = PAGE / request.match_info.get("name", "index.html")
        if not path.is_file():
            raise web.HTTPNotFound
        return web.Response(
            body=path.read_bytes(),
            content_type=TYPES[path.suffix],
            charset="utf-8",
            headers={"Content-Security-Policy": POLICY, "Cache-Control": "no-cache"},
        )

    def _said(self) -> dict[str, Any]:
        return {
            "version": "0.1.0", "surface_mm": SURFACE_MM, "rate_hz": 100.0,
            "source_name": "cornertouchd@fake", "keeps_s": 30, "may_act": self.scene.may_act,
            "destinations": [{"host": "127.0.0.1", "port": 3333}],
            "display": {"left_mm": 15.0, "top_mm": 15.0, "width_mm": 670.0, "height_mm": 370.0},
            "cameras": [
                {"id": f"C{index + 1}", "x_mm": x_mm, "y_mm": y_mm, "width_px": WIDTH_PX,
                 "rows_px": ROWS_PX, "row_offset_px": 200}
                for index, (x_mm, y_mm) in enumerate(CORNERS_MM[: self.scene.cameras])
            ],
        }  # fmt: skip

    async def _hello(self, request: web.Request) -> web.StreamResponse:
        return web.json_response(self._said())

    async def _save(self, request: web.Request) -> web.StreamResponse:
        if not self.scene.may_act:
            return web.json_response({"error": "viewers may look only"}, status=403)
        asked = await request.json()
        self.scene.saved.append(asked)
        return web.json_response(
            {"path": "/var/lib/cornertouchd/recordings/2026-11-22T18-30-00", "bytes": 48_200_000}
        )

    async def _live(self, request: web.Request) -> web.StreamResponse:
        socket = web.WebSocketResponse(compress=False)
        await socket.prepare(request)
        wants = {"strips": False}
        tasks = [
            asyncio.create_task(self._tell_facts(socket)),
            asyncio.create_task(self._tell_moments(socket)),
            asyncio.create_task(self._tell_strips(socket, wants)),
            asyncio.create_task(self._end_with_server(socket)),
        ]
        async for message in socket:
            if message.type is WSMsgType.TEXT:
                wants.update(json.loads(message.data))
                self.scene.strips_wanted.append(wants["strips"])
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        return socket

    async def _end_with_server(self, socket: web.WebSocketResponse) -> None:
        await self._stop.wait()
        await socket.close()

    async def _tell_facts(self, socket: web.WebSocketResponse) -> None:
        lines = [
            {"at": 1795372200.0 + second, "level": level, "text": text}
            for second, (level, text) in enumerate(LOG)
        ]
        await socket.send_json({"type": "hello", **self._said()})
        while True:
            await socket.send_json({"type": "health", **health(self.scene.live)})
            await socket.send_json({"type": "log", "lines": lines})
            await asyncio.sleep(1.0)

    async def _tell_moments(self, socket: web.WebSocketResponse) -> None:
        start_s = self._loop.time()
        for turn in range(10**9):
            now_s = self._loop.time()
            if self.scene.moments:
                touches = self.scene.moving(now_s)
                contacts = self.scene.contacts(touches)
                message = encode_moment(now_s, touches, contacts, self.scene.lines(contacts))
                await socket.send_bytes(message[:-3] if self.scene.malformed else message)
            await asyncio.sleep(max(0.0, start_s + (turn + 1) / self.scene.rate_hz - now_s))

    async def _tell_strips(self, socket: web.WebSocketResponse, wants: dict[str, bool]) -> None:
        while True:
            if wants["strips"] and self.scene.live:
                now_s = self._loop.time()
                for camera in range(self.scene.cameras):
                    left = 80.0 + 60.0 * camera + 40.0 * math.sin(now_s + camera)
                    shadows = [(left, left + 22.0), (left + 210.0, left + 235.0)]
                    await socket.send_bytes(encode_strip(camera, now_s, shadows))
            await asyncio.sleep(0.5)
