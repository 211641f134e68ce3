"""An HTTP server for a few known users: one request per connection, a thread for each.

It bounds how many connections there are, how long they may be silent and how much they may send.
`server/front.py` and `study/server.py` say who may ask, for what, and what is answered.
"""

from __future__ import annotations

import json
import logging
import socket
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar

from objectmorpher_core.base.limits import CONNECTIONS

log = logging.getLogger(__name__)

IDLE = 30.0  # s that a connection may say nothing
PIECE = 1 << 20  # bytes read at a time
MOST_DIGITS = 18  # of a length that is announced
POLL = 0.1  # s until `close` is noticed


class HttpServer:
    """Listens on an address; each connection has a thread."""

    def __init__(
        self,
        address: tuple[str, int],
        handler: Callable[..., Handler],
        connections: int = CONNECTIONS,
    ) -> None:
        """`handler` answers one request; `connections`: at a time, more are closed at once.

        Raises OSError where the address is taken.
        """
        self.is_closing = threading.Event()
        self._listener = _Listener(address, handler, connections)
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port."""
        host, port = self._listener.server_address[:2]
        return str(host), int(port)

    @property
    def url(self) -> str:
        """Return the URL that a browser takes."""
        host, port = self.address
        return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"

    def start(self) -> None:
        """Serves from another thread."""
        serve = self._listener.serve_forever
        self._thread = threading.Thread(target=serve, args=(POLL,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening; requests in progress see `is_closing`."""
        self.is_closing.set()
        if self._thread is not None:
            self._listener.shutdown()
            self._thread.join()
        self._listener.server_close()


class _Listener(ThreadingHTTPServer):
    daemon_threads = True
    request_queue_size = 32

    def __init__(
        self, address: tuple[str, int], handler: Callable[..., Handler], connections: int
    ) -> None:
        self._free = threading.BoundedSemaphore(connections)
        if ":" in address[0]:
            self.address_family = socket.AF_INET6
        super().__init__(address, handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        log.debug("A connection broke", exc_info=True)


class Refusal(Exception):
    """A refusal: a status, one sentence, and facts for a program."""

    def __init__(self, status: HTTPStatus, sentence: str, **more: Any) -> None:
        super().__init__(sentence)
        self.status, self.answer = status, {"error": sentence, **more}


class Handler(BaseHTTPRequestHandler):
    """The handler of one request. Subclasses have do_GET and so on, which call `answer`."""

    timeout = IDLE
    protocol_version = "HTTP/1.1"
    server_version = "objectmorpher"
    sys_version = ""
    more_headers: ClassVar[Mapping[str, str]] = {}  # of every answer

    def log_message(self, format: str, *args: Any) -> None:
        log.debug(format, *args)

    def admit(self) -> None:
        """Raises Refusal, before anything of the body is read, for whom nothing is done."""
        raise NotImplementedError

    def answer(self, work: Callable[[], None]) -> None:
        """Does `work`, which sends the answer or raises Refusal, for whoever is admitted."""
        self.close_connection = True  # one request each: what is refused is not read to its end
        try:
            self.admit()
            work()
        except Refusal as refusal:
            log.info("Refused %r: %s", self.path[:80], refusal)
            self.send_json(refusal.status, refusal.answer)

    def read_body(self, most: int) -> bytes:
        """Read as many bytes as were announced, at most `most`. Raises Refusal."""
        told = self.headers.get("Content-Length", "")
        if "Transfer-Encoding" in self.headers or not (told.isascii() and told.isdigit()):
            raise Refusal(HTTPStatus.LENGTH_REQUIRED, "how many bytes come must be said first")
        if len(told) > MOST_DIGITS or int(told) > most:
            limit = f"{most >> 20} MB" if most >= 1 << 20 else f"{most >> 10} kB"
            raise Refusal(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"more than {limit} are not taken")
        pieces, left = [], int(told)
        while left:  # what comes is kept, not what was announced
            piece = self.rfile.read(min(PIECE, left))
            if not piece:
                raise Refusal(HTTPStatus.BAD_REQUEST, "fewer bytes came than were announced")
            pieces.append(piece)
            left -= len(piece)
        return b"".join(pieces)

    def send_json(self, status: HTTPStatus, value: Any) -> None:
        """An answer that is one JSON value."""
        self.send_bytes(status, json.dumps(value).encode(), "application/json")

    def send_bytes(
        self, status: HTTPStatus, body: bytes, kind: str, cache: str = "no-store"
    ) -> None:
        """An answer of the media type `kind`; `cache`: its Cache-Control."""
        self.send_head(status, kind, {"Content-Length": str(len(body)), "Cache-Control": cache})
        self.wfile.write(body)

    def send_head(self, status: HTTPStatus, kind: str, headers: Mapping[str, str]) -> None:
        """Status line and headers; without a length what follows ends with the connection."""
        self.send_response(status)
        common = {"Content-Type": kind, "X-Content-Type-Options": "nosniff", "Connection": "close"}
        for name, value in (common | dict(self.more_headers) | dict(headers)).items():
            self.send_header(name, value)
        self.end_headers()
