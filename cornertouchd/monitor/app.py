"""What is served at which path, to whom."""

import asyncio
import contextlib
import json
import logging
import socket
from collections.abc import Awaitable, Callable, Mapping

from aiohttp import WSCloseCode, WSMsgType, web
from aiohttp.abc import AbstractAccessLogger

from cornertouchd.monitor.access import Access, Asked
from cornertouchd.monitor.counters import Counters
from cornertouchd.monitor.daemon_link import DaemonGoneError, DaemonLink, Telling
from cornertouchd.monitor.files import PageFile, page_files
from cornertouchd.monitor.hub import FullError, Hub, Viewer
from cornertouchd.monitor.metrics import CONTENT_TYPE, render
from cornertouchd.monitor.options import PageOptions
from cornertouchd.monitor.saving import Saving, SavingError

LARGEST_REQUEST = 4096
"""Nothing that a viewer says is longer: a switch, how many seconds to save."""

HEARTBEAT_S = 15.0
"""A browser that does not answer a ping within half of this is gone, or stopped: its place is free
for others."""

SEND_BUFFER_BYTES = 131_072
"""What the system keeps for a viewer who is slow: more, and he sees what was seconds ago."""

COOKIE_S = 30 * 24 * 3600

HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self'; object-src 'none'; "
    "base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), usb=(), serial=()",
    "Cache-Control": "no-store",
}

Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]

_log = logging.getLogger("cornertouchd")


class Page:
    """The page at work, for as long as the process lives."""

    def __init__(self, options: PageOptions) -> None:
        self.counters = Counters()
        self._access = Access(options)
        self._files = page_files()
        self._hub = Hub(options.viewers_max, self.counters)
        self._link = DaemonLink(options.socket)
        self._telling = Telling(self._link, self._hub, {"may_act": options.allow_actions})
        self._saving = Saving(options)
        self._failed: set[str] = set()

    def application(self) -> web.Application:
        """Return what aiohttp serves."""
        app = web.Application(middlewares=[self._guard], client_max_size=LARGEST_REQUEST)
        app.add_routes([web.get(path, self._file) for path in self._files])
        app.add_routes(
            [
                web.get("/live", self._live),
                web.get("/guide", self._guide),
                web.get("/metrics", self._metrics),
                web.get("/api/hello", self._hello),
                web.get("/api/health", self._health),
                web.post("/api/save", self._save),
            ]
        )
        app.on_response_prepare.append(_add_headers)
        return app

    async def tell(self) -> None:
        """Tell viewers what happens, for ever."""
        await self._telling.run()

    @web.middleware
    async def _guard(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        """Refuse what must be refused; whatever fails, the process lives on."""
        refusal = self._access.refusal(_asked(request))
        if refusal is not None:
            self.counters.refused(refusal.reason)
            return _error(refusal.status, refusal.text)
        try:
            return await handler(request)
        except web.HTTPException as error:
            if error.status >= 400:
                self.counters.refused(error.reason.lower())
                return _error(error.status, f"{error.reason}: {request.path[:80]}")
            raise
        except DaemonGoneError as error:
            return _error(503, str(error))
        except (ConnectionError, asyncio.CancelledError):
            raise
        except Exception as error:  # noqa: BLE001  others go on looking
            kind = type(error).__name__
            if kind not in self._failed:
                self._failed.add(kind)
                _log.exception("live page: %s failed", request.path)
            return _error(500, "this has failed; the log of the daemon says why")

    async def _file(self, request: web.Request) -> web.Response:
        if request.path == "/" and "token" in request.query:
            return self._enter(request.query["token"])
        file = self._files[request.path]
        headers = {"ETag": f'"{file.etag}"', "Cache-Control": "no-cache"}
        if request.headers.get("If-None-Match") == headers["ETag"]:
            return web.Response(status=304, headers=headers)
        return _response(file, headers)

    def _enter(self, token: str) -> web.Response:
        """Let a browser in that knows the token, and take the token out of its address line."""
        if not self._access.knows_token(token):
            self.counters.refused("token")
            return _response(self._files["/"], {}, status=401)
        entered = web.Response(status=303, headers={"Location": "/"})
        entered.set_cookie(
            self._access.cookie_name,
            self._access.cookie,
            max_age=COOKIE_S,
            httponly=True,
            samesite="Strict",
        )
        return entered

    async def _hello(self, _: web.Request) -> web.Response:
        return web.json_response(await self._telling.hello())

    async def _health(self, _: web.Request) -> web.Response:
        return web.json_response(await self._link.ask("status"))

    async def _metrics(self, _: web.Request) -> web.Response:
        body = render(await self._link.ask("status")) + self.counters.render()
        return web.Response(body=body, headers={"Content-Type": CONTENT_TYPE})

    async def _save(self, request: web.Request) -> web.Response:
        try:
            saved = await self._saving.save(await request.read())
        except SavingError as error:
            self.counters.refused("save")
            return _error(error.status, str(error))
        return web.json_response(saved)

    async def _live(self, request: web.Request) -> web.StreamResponse:
        try:
            with self._hub.viewer() as viewer:
                return await self._show(request, viewer)
        except FullError:
            self.counters.refused("full")
            return _error(503, "as many browsers look already as monitor.viewers_max allows")

    async def _guide(self, request: web.Request) -> web.StreamResponse:
        """Pass on what a calibration asks for, which may run in place of the daemon."""
        viewing = _web_socket()
        await viewing.prepare(request)
        passing = asyncio.ensure_future(self._pass_guide(viewing))
        try:
            async for _ in viewing:  # it has nothing to say
                self.counters.refused("message")
        finally:
            passing.cancel()
        return viewing

    async def _pass_guide(self, viewing: web.WebSocketResponse) -> None:
        with contextlib.suppress(DaemonGoneError, ConnectionError):
            async with contextlib.aclosing(self._link.lines("guide")) as lines:
                async for line in lines:
                    await viewing.send_str(line)
        await viewing.close(code=WSCloseCode.TRY_AGAIN_LATER, message=b"no calibration runs")

    async def _show(self, request: web.Request, viewer: Viewer) -> web.WebSocketResponse:
        viewing = _web_socket()
        await viewing.prepare(request)
        _keep_buffer_small(request)
        sending = asyncio.ensure_future(self._send(viewing, viewer))
        try:
            async for message in viewing:
                if message.type is not WSMsgType.TEXT or not self._heed(message.data, viewer):
                    self.counters.refused("message")
                    await viewing.close(
                        code=WSCloseCode.POLICY_VIOLATION,
                        message=b'send {"strips": true} or {"strips": false}',
                    )
        finally:
            sending.cancel()
        return viewing

    def _heed(self, text: str, viewer: Viewer) -> bool:
        """Follow what a viewer says; tell whether that could be understood."""
        try:
            said = json.loads(text)
        except (ValueError, RecursionError):
            return False
        if not isinstance(said, dict) or not isinstance(said.get("strips"), bool):
            return False
        self._hub.set_wants_strips(viewer, wants=said["strips"])
        return True

    async def _send(self, viewing: web.WebSocketResponse, viewer: Viewer) -> None:
        for kind, text in await self._telling.greeting():
            viewer.offer(kind, text)
        try:
            while True:
                message = await viewer.take()
                if isinstance(message, str):
                    await viewing.send_str(message)
                else:
                    await viewing.send_bytes(message)
        except ConnectionError:
            return  # the receiving side ends it


class CountingLogger(AbstractAccessLogger):
    """Counts every answer, those to what is no HTTP at all included; writes nothing."""

    counters: Counters

    def log(
        self,
        request: web.BaseRequest,  # noqa: ARG002
        response: web.StreamResponse,
        time: float,  # noqa: ARG002
    ) -> None:
        """Count an answer."""
        self.counters.answered(response.status)


def _web_socket() -> web.WebSocketResponse:
    return web.WebSocketResponse(
        heartbeat=HEARTBEAT_S, max_msg_size=LARGEST_REQUEST, compress=False, timeout=2.0
    )


def _asked(request: web.Request) -> Asked:
    headers = {name.lower(): request.headers[name] for name in request.headers}
    if len(request.headers.getall("Host", [])) != 1:
        headers.pop("host", None)  # of several, nobody knows which counts
    return Asked(request.method, request.path, headers, request.cookies)


def _keep_buffer_small(request: web.Request) -> None:
    connection = request.get_extra_info("socket")
    if connection is not None:  # it is gone already
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)


def _error(status: int, text: str) -> web.Response:
    return web.json_response({"error": text}, status=status)


def _response(file: PageFile, headers: Mapping[str, str], status: int = 200) -> web.Response:
    return web.Response(
        body=file.content,
        status=status,
        content_type=file.content_type,
        charset="utf-8",
        headers=headers,
    )


async def _add_headers(_: web.Request, response: web.StreamResponse) -> None:
    for name, value in HEADERS.items():
        response.headers.setdefault(name, value)
    response.headers["Server"] = "cornertouchd"  # whose versions are nobody's business
