"""Asks a server to run a job function; with the standard library."""

from __future__ import annotations

import http.client
import json
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from objectmorpher_core.base.limits import ANSWER_BYTES as MOST_ANSWER
from objectmorpher_core.base.limits import ANSWER_LINE as MOST_LINE
from objectmorpher_core.base.progress import Progress

from .address import PROTOCOL, NotServed, ServedError, Server, ServerLost, TooMuch
from .fitting import fits, is_sound
from .message import MessageError, WireMessage, decode, encode
from .table import table, types

CONNECT = 3.0  # s until there is a connection
SILENCE = 10.0  # s without a word, after which the server counts as gone
QUEUE = 30.0  # s that a job may wait there: by then it may be done here
PIECE = 1 << 18  # bytes sent between two looks at whether the job is still wanted
ROUNDS = 3  # of sending what is missing: the server may have dropped it meanwhile


def hello(server: Server) -> dict[str, Any]:
    """Ask the server for its description. Raises ServerLost."""
    with _connection(server) as connection:
        connection.request("GET", _path(server, "hello"), headers=_headers(server))
        response = connection.getresponse()
        told = _json(response)
        if response.status != 200:
            raise _refusal(server, response.status, told)
    if told.get("product") != "objectmorpher" or told.get("protocol") != PROTOCOL:
        raise ServerLost(f"{server.address} is no server of this version")
    return told


def call(server: Server, name: str, arguments: tuple[Any, ...], progress: Progress) -> Any:
    """The answer of the job function `name`.

    Raises ServerLost where the server gave none, NotServed where it never will, TooMuch where it
    takes smaller requests only, ServedError where the job failed, and Cancelled out of `progress`,
    which ends the job over there, too.
    """
    served = table()[name]
    message = encode(arguments, types(), is_split=True)
    for _ in range(ROUNDS):
        progress(0.0, "asking the server")
        with _connection(server) as connection:
            path, headers = _path(server, f"jobs/{name}"), _headers(server)
            response = _answer(connection, "POST", path, message.body, headers)
            if response.status == 200:
                body = _listen(server, response, progress)
                break
            told = _json(response)
        if response.status == 404 and told:  # its own word, not that of a proxy before it
            raise NotServed(f"{server.address} does not {served.stage}")
        if response.status != 409:
            raise _refusal(server, response.status, told)
        _send_blobs(server, message, told.get("missing"), progress)
    else:
        raise ServerLost(f"{server.address} keeps losing the photo")
    try:
        answer = decode(body, types())
    except MessageError as error:
        raise ServerLost(f"{server.address} answers what cannot be read: {error}") from error
    if not fits(answer, served.gives) or not is_sound(answer, arguments):
        raise ServerLost(f"{server.address} answers something else")
    return answer


def _send_blobs(server: Server, message: WireMessage, names: Any, progress: Progress) -> None:
    """The large arrays that the server lacks."""
    if not isinstance(names, list) or not set(names) <= set(message.blobs):
        raise ServerLost(f"{server.address} asks for what there is not")
    for name in names:
        body = message.blobs[name]
        with _connection(server) as connection:
            headers = _headers(server) | {"Content-Length": str(len(body))}
            pieces = _pieces(body, progress)
            path = _path(server, f"blobs/{name}")
            response = _answer(connection, "PUT", path, pieces, headers)
            told = _json(response)
            if response.status != 201:
                raise _refusal(server, response.status, told)


def _answer(
    connection: http.client.HTTPConnection, method: str, path: str,
    body: bytes | Iterator[memoryview], headers: dict[str, str],
) -> http.client.HTTPResponse:  # fmt: skip
    """The answer, which a server that refuses may have given before all was sent."""
    with suppress(BrokenPipeError, ConnectionResetError):
        connection.request(method, path, body, headers)
    return connection.getresponse()


def _pieces(body: bytes, progress: Progress) -> Iterator[memoryview]:
    view = memoryview(body)
    for start in range(0, len(body), PIECE):
        progress(0.1 * start / len(body), "sending the photo")
        yield view[start : start + PIECE]


def _listen(server: Server, response: http.client.HTTPResponse, progress: Progress) -> bytes:
    """Passes on the lines of a job that waits or runs; the bytes of its answer."""
    began = time.monotonic()
    while True:
        line = response.readline(MOST_LINE)
        try:
            told = json.loads(line)
            state = told["state"]
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ServerLost(f"{server.address} broke off") from error
        if state == "waiting":
            if time.monotonic() - began > QUEUE:
                raise ServerLost(f"{server.address} has too much to do")
            progress(0.0, "waiting for the server")
        elif state == "running":
            progress(*_step(told))
        elif state == "done":
            return _body(server, response, told.get("bytes"), progress)
        elif state == "failed" and told.get("is_expected") is True:
            raise ServedError(_text(told.get("error")))
        else:
            raise ServerLost(f"{server.address}: {_text(told.get('error', state))}")


def _step(told: dict[str, Any]) -> tuple[float, str]:
    fraction, note = told.get("fraction"), told.get("note")
    is_number = isinstance(fraction, int | float) and 0 <= fraction <= 1
    return float(fraction) if is_number else 0.0, _text(note)  # type: ignore[arg-type]


def _body(
    server: Server, response: http.client.HTTPResponse, length: Any, progress: Progress
) -> bytes:
    if not isinstance(length, int) or not 0 <= length <= MOST_ANSWER:
        raise ServerLost(f"{server.address} answers more than there is room for")
    pieces, left = [], length
    while left:
        piece = response.read(min(PIECE, left))
        if not piece:
            raise ServerLost(f"{server.address} broke off")
        pieces.append(piece)
        left -= len(piece)
        progress(1.0 - 0.05 * left / length, "receiving")
    return b"".join(pieces)


@contextmanager
def _connection(server: Server) -> Iterator[http.client.HTTPConnection]:
    """Closed in any case, which is how a job is cancelled. Raises ServerLost for what it meets."""
    address = server.address
    kind = http.client.HTTPSConnection if address.is_safe else http.client.HTTPConnection
    connection = kind(address.host, address.port, timeout=CONNECT)
    try:
        connection.connect()
        connection.sock.settimeout(SILENCE)
        yield connection
    except TimeoutError as error:
        raise ServerLost(f"{address} does not answer") from error
    except (OSError, http.client.HTTPException, ValueError) as error:
        if isinstance(error, ServedError):
            raise
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ServerLost(f"{address} cannot be reached ({_text(reason)})") from error
    finally:
        connection.close()


def _path(server: Server, name: str) -> str:
    return f"{server.address.path}/v1/{name}"


def _headers(server: Server) -> dict[str, str]:
    return {"Authorization": f"Bearer {server.token}"}


def _json(response: http.client.HTTPResponse) -> dict[str, Any]:
    """What a short answer says; {} where it is something else."""
    try:
        value = json.loads(response.read(MOST_LINE))
    except (ValueError, RecursionError):
        return {}
    return value if isinstance(value, dict) else {}


def _refusal(server: Server, status: int, told: dict[str, Any]) -> ServerLost | TooMuch:
    if status == 401:
        return ServerLost(f"{server.address} does not accept the token")
    reason = told.get("error")
    sentence = f"{server.address} refused: {_text(reason) if reason else f'HTTP {status}'}"
    return TooMuch(sentence) if status == 413 else ServerLost(sentence)


def _text(value: Any) -> str:
    """A stranger's sentence, of a length that fits a line, without control characters."""
    return "".join(c for c in str(value)[:300] if c.isprintable())
