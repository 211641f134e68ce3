"""The server's HTTP side: who may ask, how much, and for what. It runs nothing itself.

    GET  /v1/hello           what is served, as JSON
    PUT  /v1/blobs/SHA256    a large array, once
    POST /v1/jobs/NAME       the arguments; the answer is lines of JSON while the job waits and
                             runs, and after {"state": "done", "bytes": N} the N bytes of the answer

A line comes at least every BEAT seconds, so that both sides notice within a moment that the other
one is gone: then the job is stopped, or done elsewhere. Closing the connection is how one cancels.
"""

from __future__ import annotations

import hmac
import json
import logging
import queue
import socket
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from email.message import Message
from functools import partial
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, ClassVar, Generic, TypeVar

from objectmorpher_core.base.limits import CONNECTIONS
from objectmorpher_core.base.limits import KEPT_BYTES as BLOB_LIMIT
from objectmorpher_core.base.limits import REQUEST_BYTES as BODY_LIMIT
from objectmorpher_core.base.limits import WAITING_JOBS as MOST_JOBS
from objectmorpher_core.base.progress import Cancelled

from .. import __version__
from .address import PROTOCOL, check_token, fingerprint, url_at
from .message import MessageError, MissingError, decode, digest
from .running import Call, JobOutcome, Runner, told_offers
from .table import Table, types

# An HTTP server for a few known users: one request per connection, a thread for each.
#
# It bounds how many connections there are, how long they may be silent and how much they may send.
# `Front`, `web_editor.py` and `study/server.py` say who may ask, for what, and what is answered.

IDLE = 30.0  # s that a connection may say nothing
PIECE = 1 << 20  # bytes read at a time
MOST_DIGITS = 18  # of a length that is announced
DRAINING = 2.0  # s that what was refused may go on coming
POLL = 0.1  # s until `close` is noticed
NOTHING = "there is nothing of that name"
FAILED = "the computer that serves this has failed"


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
        return url_at(*self.address)

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


def check_bearer(said: str, expected: bytes) -> None:
    """Raises Refusal where an Authorization header does not bring the token of a fingerprint."""
    scheme, _, brought = said.partition(" ")
    # Latin-1 is how http.server reads headers; what is not ASCII cannot be a token.
    if scheme != "Bearer" or not hmac.compare_digest(fingerprint(brought.strip()), expected):
        raise Refusal(HTTPStatus.UNAUTHORIZED, "the token is missing or wrong")


def announced(headers: Mapping[str, str] | Message, most: int) -> int:
    """The bytes of a body whose length must be said first, at most `most`. Raises Refusal."""
    told = headers.get("Content-Length") or ""
    if "Transfer-Encoding" in headers or not (told.isascii() and told.isdigit()):
        raise Refusal(HTTPStatus.LENGTH_REQUIRED, "how many bytes come must be said first")
    if len(told) > MOST_DIGITS or int(told) > most:
        limit = f"{most >> 20} MB" if most >= 1 << 20 else f"{most >> 10} kB"
        raise Refusal(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"more than {limit} are not taken")
    return int(told)


class Handler(BaseHTTPRequestHandler):
    """The handler of one request. Subclasses have `admit`, and `get` or `post` or both."""

    timeout = IDLE
    protocol_version = "HTTP/1.1"
    server_version = "objectmorpher"
    sys_version = ""
    more_headers: ClassVar[Mapping[str, str]] = {}  # of every answer
    has_begun = False  # to send an answer

    def log_message(self, format: str, *args: Any) -> None:
        log.debug(format, *args)

    def do_GET(self) -> None:
        self.answer(self.get)

    def do_POST(self) -> None:
        self.answer(self.post)

    def admit(self) -> None:
        """Raises Refusal, before anything of the body is read, for whom nothing is done."""
        raise NotImplementedError

    def get(self) -> None:
        """Send the answer to a GET. Raises Refusal."""
        raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)

    def post(self) -> None:
        """Send the answer to a POST. Raises Refusal."""
        raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)

    def admit_with(self, token: str) -> None:
        """Raises Refusal for whoever does not bring the token along."""
        check_bearer(self.headers.get("Authorization", ""), fingerprint(token))

    def answer(self, work: Callable[[], None]) -> None:
        """Does `work`, which sends the answer or raises Refusal, for whoever is admitted."""
        self.close_connection = True  # one request each: what is refused is not read to its end
        try:
            self.admit()
            work()
        except Refusal as refusal:
            log.info("Refused %r: %s", self.path[:80], refusal)
            self.send_json(refusal.status, refusal.answer)
            self._drain()
        except OSError:  # nobody listens any more
            raise
        except Exception:
            log.exception("%r cannot be answered", self.path[:80])
            if not self.has_begun:
                self.send_json(HTTPStatus.INTERNAL_SERVER_ERROR, {"error": FAILED})

    def _drain(self) -> None:
        """Let what still comes run out: a connection closed on it would take the answer along."""
        end = time.monotonic() + DRAINING
        with suppress(OSError):  # it has gone, or says nothing
            self.connection.shutdown(socket.SHUT_WR)
            while (left := end - time.monotonic()) > 0:
                self.connection.settimeout(left)
                if not self.rfile.read1(PIECE):
                    break

    def read_body(self, most: int) -> bytes:
        """Read as many bytes as were announced, at most `most`. Raises Refusal."""
        pieces, left = [], announced(self.headers, most)
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
        self.has_begun = True
        self.send_response(status)
        for name, value in self.head(kind, headers).items():
            self.send_header(name, value)
        self.end_headers()

    def head(self, kind: str, headers: Mapping[str, str]) -> dict[str, str]:
        """All headers of an answer of the media type `kind`."""
        common = {"Content-Type": kind, "X-Content-Type-Options": "nosniff", "Connection": "close"}
        return common | dict(self.more_headers) | dict(headers)


log = logging.getLogger(__name__)

BEAT = 0.1  # s between two lines


@dataclass(frozen=True)
class RequestLimits:
    """Limits on what one may ask for."""

    body: int = BODY_LIMIT
    blobs: int = BLOB_LIMIT
    connections: int = CONNECTIONS
    jobs: int = MOST_JOBS


class Service:
    """A table of job functions, and what is kept between requests for them."""

    def __init__(
        self, token: str, runner: Runner, table: Table, limits: RequestLimits = RequestLimits()
    ) -> None:
        """Raises TokenError."""
        self.token, self.runner, self.table, self.limits = (
            check_token(token), runner, table, limits,
        )  # fmt: skip
        self.blobs: Kept[bytes] = Kept(limits.blobs, len)  # by their SHA-256
        self.places = threading.BoundedSemaphore(limits.jobs)
        self.is_closing = threading.Event()


class Front(HttpServer):
    """Serves a table of job functions from this process to whoever has the token."""

    def __init__(
        self, address: tuple[str, int], token: str, runner: Runner, table: Table,
        limits: RequestLimits = RequestLimits(),
    ) -> None:  # fmt: skip
        """Raises OSError where the address is taken, TokenError."""
        service = Service(token, runner, table, limits)
        super().__init__(address, partial(ServiceHandler, service), limits.connections)
        self.is_closing = service.is_closing


class ServiceHandler(Handler):
    """Answers one request to a service."""

    more_headers: ClassVar = {"X-Accel-Buffering": "no"}  # nginx hands each line on at once

    def __init__(self, service: Service, *connection: Any) -> None:
        self.service = service
        super().__init__(*connection)

    def do_PUT(self) -> None:
        self.answer(self._put)

    def admit(self) -> None:
        """Refuses whoever has not the token."""
        self.admit_with(self.service.token)

    def get(self) -> None:
        if self.path != "/v1/hello":
            raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)
        self.send_json(HTTPStatus.OK, {
            "product": "objectmorpher", "version": __version__, "protocol": PROTOCOL,
            "stages": self.service.runner.stages(), "functions": sorted(self.service.table),
            "backends": told_offers(self.service.runner.offers()),
        })  # fmt: skip

    def _put(self) -> None:
        _, folder, name = ("", *self.path.removeprefix("/v1/").split("/"), "")[:3]
        if folder != "blobs" or len(name) != 64:
            raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)
        body = self.read_body(self.service.limits.body)
        if digest(body) != name:
            raise Refusal(HTTPStatus.BAD_REQUEST, "the bytes are not those of that name")
        self.service.blobs.add(name, body)
        self.send_json(HTTPStatus.CREATED, {})

    def post(self) -> None:
        name = self.path.removeprefix("/v1/jobs/")
        served = self.service.table.get(name)
        if served is None:
            raise Refusal(HTTPStatus.NOT_FOUND, "there is no such function")
        body = self.read_body(self.service.limits.body)
        try:
            blobs = self._blobs(body)
            at_hand = served.at_hand(served.checked(decode(body, types(), blobs)), blobs)
        except MissingError as error:
            raise Refusal(HTTPStatus.CONFLICT, str(error), missing=error.digests) from error
        except MessageError as error:
            raise Refusal(HTTPStatus.BAD_REQUEST, str(error)) from error
        if not self.service.places.acquire(blocking=False):
            raise Refusal(HTTPStatus.SERVICE_UNAVAILABLE, "too many jobs wait already")
        try:
            _Conversation(self, Call(name, body, blobs, at_hand)).hold()
        finally:
            self.service.places.release()

    def _blobs(self, body: bytes) -> dict[str, bytes]:
        """The large arrays that a message names; raises MissingError."""
        try:
            decode(body, types())
        except MissingError as error:
            found = self.service.blobs.found(error.digests)
            lacking = tuple(name for name in error.digests if name not in found)
            if lacking:
                raise MissingError(lacking) from error
            return found
        return {}


class _Conversation:
    """One job: its progress line by line, its answer, and its end with the connection's."""

    def __init__(self, handler: ServiceHandler, call: Call) -> None:
        self._handler, self._call = handler, call
        self._stop = threading.Event()
        self._said: queue.SimpleQueue[tuple[float, str]] = queue.SimpleQueue()
        self._outcome: JobOutcome | None = None
        self._done = threading.Event()

    def hold(self) -> None:
        """Until the answer is sent, or nobody listens any more and the job has stopped."""
        kind, headers = "application/octet-stream", {"Cache-Control": "no-store"}
        self._handler.send_head(HTTPStatus.OK, kind, headers)
        thread = threading.Thread(target=self._run, daemon=True)
        thread.start()
        try:
            state: dict[str, Any] = {"state": "waiting"}
            while not self._done.wait(BEAT):
                state = self._newest(state)
                self._line(state)
                if self._handler.service.is_closing.is_set():
                    return
            self._finish()
        except OSError:
            log.info("%s: nobody listens any more", self._call.name)
        finally:
            self._stop.set()
            thread.join()  # its place is taken until it has stopped

    def _newest(self, state: dict[str, Any]) -> dict[str, Any]:
        while not self._said.empty():
            fraction, note = self._said.get()
            state = {"state": "running", "fraction": fraction, "note": note}
        return state

    def _finish(self) -> None:
        outcome = self._outcome
        if outcome is None:
            self._line({"state": "cancelled"})
        elif outcome.error:
            is_expected = outcome.is_expected
            self._line({"state": "failed", "error": outcome.error, "is_expected": is_expected})
        else:
            self._line({"state": "done", "bytes": len(outcome.body)})
            self._handler.wfile.write(outcome.body)

    def _line(self, value: Any) -> None:
        self._handler.wfile.write(json.dumps(value).encode() + b"\n")

    def _run(self) -> None:
        service = self._handler.service
        served = service.table[self._call.name]
        try:
            tell = self._tell
            self._outcome = service.runner.run(self._call, served, tell, self._stop)
        except Cancelled:
            pass
        except Exception as error:
            log.exception("%s cannot be run", self._call.name)
            self._outcome = JobOutcome(error=str(error) or type(error).__name__)
        finally:
            self._done.set()

    def _tell(self, fraction: float, note: str) -> None:
        self._said.put((fraction, note))


Thing = TypeVar("Thing")


class Kept(Generic[Thing]):
    """A bounded memory by name, for many threads; the least recently used goes first."""

    def __init__(self, most: int, size_of: Callable[[Thing], int]) -> None:
        """`most`: in all, of what `size_of` counts."""
        self._most, self._size_of = most, size_of
        self._kept: OrderedDict[str, Thing] = OrderedDict()
        self._size = 0
        self._lock = threading.Lock()

    def add(self, name: str, thing: Thing) -> None:
        """Keeps it; what was not used for longest is dropped where it does not fit."""
        with self._lock:
            if name not in self._kept:
                self._size += self._size_of(thing)
            self._kept[name] = thing
            self._kept.move_to_end(name)
            while self._size > self._most and len(self._kept) > 1:
                self._size -= self._size_of(self._kept.popitem(last=False)[1])

    def found(self, names: Iterable[str]) -> dict[str, Thing]:
        """Return those of `names` that are stored here."""
        with self._lock:
            here = [name for name in names if name in self._kept]
            for name in here:
                self._kept.move_to_end(name)
            return {name: self._kept[name] for name in here}

    @property
    def size(self) -> int:
        """Return how much of `most` is taken."""
        return self._size
