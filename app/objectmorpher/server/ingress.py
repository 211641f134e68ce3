"""The HTTP side on a cluster: Ray Serve's proxies, one a machine, and the process behind them.

A proxy refuses by itself whoever lacks the token and what is too long, before it reads on. What is
admitted goes to `Ingress`, which answers as the server of one process does: by `ServiceHandler`.
"""

from __future__ import annotations

import asyncio
import json
import logging
import os
from collections.abc import Awaitable, Callable, Mapping, MutableMapping
from concurrent.futures import ThreadPoolExecutor
from email.message import Message
from http import HTTPStatus
from typing import Any

from ..system.logs import show_log
from .address import fingerprint
from .front import (
    IDLE,
    Handler,
    Refusal,
    RequestLimits,
    Service,
    ServiceHandler,
    announced,
    check_bearer,
)
from .running import Offers
from .stages import Stages
from .table import Table

log = logging.getLogger(__name__)

# What of ASGI is used: https://asgi.readthedocs.io/en/latest/specs/www.html
Event = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Event]]
Send = Callable[[Event], Awaitable[None]]
App = Callable[[Event, Receive, Send], Awaitable[None]]

ADMISSION = "OBJECTMORPHER_ADMISSION"  # environment variable of the proxies
CALLBACK = "RAY_SERVE_HTTP_PROXY_CALLBACK_IMPORT_PATH"  # Ray Serve calls it there
PATIENCE = "RAY_SERVE_PROXY_READY_CHECK_TIMEOUT_S"
READY = 50.0  # s that a proxy may take to start on a busy machine; Ray Serve gives up after 60
LAST = {"type": "http.response.body", "body": b""}


class Gate:
    """In each proxy, before all that Ray Serve does."""

    def __init__(self, app: App, token: str, body: int, requests: int) -> None:
        """`token`: its fingerprint in hexadecimal; `body`: bytes at most; `requests`: at a time."""
        self._app, self._most, self._free = app, body, requests
        self._expected = bytes.fromhex(token)

    async def __call__(self, scope: Event, receive: Receive, send: Send) -> None:
        """See ASGI."""
        if scope["type"] != "http":
            return
        try:
            self._admit(headers_of(scope), scope["method"])
        except Refusal as refusal:
            body = json.dumps(refusal.answer).encode()
            said = {"content-type": "application/json", "connection": "close"}
            headers = [(k.encode(), v.encode()) for k, v in said.items()]
            headers.append((b"content-length", str(len(body)).encode()))
            start = {"type": "http.response.start", "status": refusal.status, "headers": headers}
            await send(start)
            await send({**LAST, "body": body})
            return
        self._free -= 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._free += 1

    def _admit(self, headers: Message, method: str) -> None:
        check_bearer(headers.get("Authorization", ""), self._expected)
        if method != "GET" or "Content-Length" in headers or "Transfer-Encoding" in headers:
            announced(headers, self._most)
        if self._free < 1:
            raise Refusal(HTTPStatus.SERVICE_UNAVAILABLE, "too many requests at a time")


def proxy_environment(token: str, limits: RequestLimits) -> dict[str, str]:
    """Variables for Ray Serve's proxies: their gate, and the time that they have to start.

    The token itself is not among them.
    """
    told = {
        "token": fingerprint(token).hex(), "body": limits.body, "requests": limits.connections,
    }  # fmt: skip
    return {
        ADMISSION: json.dumps(told), CALLBACK: f"{__name__}:{gates.__name__}", PATIENCE: str(READY),
    }  # fmt: skip


def gates() -> list[Any]:
    """What Ray Serve asks for in each proxy."""
    from starlette.middleware import Middleware

    return [Middleware(Gate, **json.loads(os.environ[ADMISSION]))]


def headers_of(scope: Event) -> Message:
    """The request's headers, by names in any case."""
    found = Message()
    for name, value in scope["headers"]:
        found[name.decode("latin-1")] = value.decode("latin-1")
    return found


class Ingress:
    """One process for all proxies: it keeps the photos, and hands jobs on to the stages."""

    def __init__(
        self, token: str, limits: RequestLimits, table: Table, handles: Mapping[str, Any],
        offers: Offers, most: int,
    ) -> None:  # fmt: skip
        """`handles`: of each stage's deployment, whose processes are `most`."""
        show_log()
        served = {name: row for name, row in table.items() if row.stage in handles}
        self._service = Service(token, Stages(handles, offers, most), served, limits)
        self._threads = ThreadPoolExecutor(limits.connections)

    def __serve_build_asgi_app__(self) -> App:
        async def app(scope: Event, receive: Receive, send: Send) -> None:
            if scope["type"] == "http":
                await self._answer(AsgiHandler(self._service, scope, receive, send))
                await send({**LAST})

        return app

    async def _answer(self, handler: AsgiHandler) -> None:
        try:
            work = asyncio.get_running_loop().run_in_executor(self._threads, handler.work)
            await asyncio.shield(work)
        finally:
            handler.is_gone = True


class AsgiHandler(ServiceHandler):
    """Answers one request that came by ASGI, from a thread."""

    def __init__(self, service: Service, scope: Event, receive: Receive, send: Send) -> None:
        """To be made in the event loop."""
        self.service = service
        self.path, self.command = scope["raw_path"].decode("latin-1"), scope["method"]
        self.headers: Any = headers_of(scope)
        self.rfile: Any = self
        self.wfile: Any = self
        self.is_gone = False  # whether nobody listens any more
        self._loop = asyncio.get_running_loop()
        self._receive, self._send = receive, send
        self._left, self._is_more = b"", True

    def work(self) -> None:
        """Until the answer is sent, or nobody listens."""
        methods = {"GET": self.do_GET, "PUT": self.do_PUT, "POST": self.do_POST}
        try:
            methods.get(self.command, lambda: self.answer(lambda: Handler.get(self)))()
        except OSError as error:
            log.debug("A request broke off: %s", error)

    def read(self, most: int) -> bytes:
        """Some bytes of the body; none at its end. Raises OSError where none comes for long."""
        while not self._left and self._is_more:
            event = self._done(self._receive())
            self._is_more = event["type"] == "http.request" and event.get("more_body", False)
            self._left = event.get("body", b"")
        piece, self._left = self._left[:most], self._left[most:]
        return piece

    def write(self, data: bytes) -> None:
        """Sends bytes of the answer. Raises OSError where nobody listens."""
        self._tell({"type": "http.response.body", "body": data, "more_body": True})

    def send_head(self, status: HTTPStatus, kind: str, headers: Mapping[str, str]) -> None:
        """See `Handler`."""
        common = self.head(kind, headers)
        raw = [(name.lower().encode(), value.encode()) for name, value in common.items()]
        self._tell({"type": "http.response.start", "status": int(status), "headers": raw})

    def _tell(self, event: Event) -> None:
        if self.is_gone:
            raise BrokenPipeError("nobody listens any more")
        self._done(self._send(event))

    def _done(self, wanted: Awaitable[Any]) -> Any:
        async def awaited() -> Any:
            return await wanted

        return asyncio.run_coroutine_threadsafe(awaited(), self._loop).result(IDLE)
