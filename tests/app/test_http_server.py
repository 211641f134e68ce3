"""What every server of ours bounds: connections, lengths, and what is kept waiting."""

from __future__ import annotations

import http.client
import json
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from http import HTTPStatus

import pytest

from objectmorpher.server.front import Handler, HttpServer, Refusal

MOST = 3 << 10  # bytes of a request
CONNECTIONS = 2


class Counting(Handler):
    """Says how many bytes came."""

    def do_POST(self) -> None:
        self.answer(lambda: self.send_json(HTTPStatus.OK, len(self.read_body(MOST))))

    def admit(self) -> None:
        if self.path != "/":
            raise Refusal(HTTPStatus.FORBIDDEN, "not here", place=self.path)


@pytest.fixture
def server() -> Iterator[HttpServer]:
    server = HttpServer(("127.0.0.1", 0), Counting, CONNECTIONS)
    server.start()
    yield server
    server.close()


def ask(server: HttpServer, length: str, body: bytes = b"", path: str = "/") -> tuple[int, object]:
    """Status and answer where `length` is announced and `body` sent, and no more.

    A busy machine may not have freed the places of the requests before: it is asked again then.
    """
    end = time.monotonic() + 60
    while True:
        try:
            return _asked(server, length, body, path)
        except ConnectionError:  # closed at once
            assert time.monotonic() < end
            time.sleep(0.02)


def _asked(server: HttpServer, length: str, body: bytes, path: str) -> tuple[int, object]:
    connection = http.client.HTTPConnection(*server.address, timeout=10)
    try:
        connection.putrequest("POST", path)
        connection.putheader("Content-Length", length)
        connection.endheaders(body)
        with suppress(OSError):  # the server may have closed it already, which shows below
            connection.sock.shutdown(socket.SHUT_WR)
        response = connection.getresponse()
        return response.status, json.loads(response.read())
    finally:
        connection.close()


def test_as_much_is_read_as_was_announced_and_allowed(server: HttpServer) -> None:
    assert ask(server, "0") == (200, 0)
    assert ask(server, f"{MOST:08}", b"x" * MOST) == (200, MOST)
    assert ask(server, "5", b"123456789") == (200, 5)
    for length in (f"{MOST + 1}", "9" * 18, "9" * 30, "0" * 30):
        assert ask(server, length) == (413, {"error": "more than 3 kB are not taken"})
    for length in ("", "-1", "+1", "1e3", "1_0", "0x1", "\u00b2"):
        assert ask(server, length)[0] == 411
    assert ask(server, "5", b"1234") == (400, {"error": "fewer bytes came than were announced"})


@pytest.mark.parametrize(("path", "status"), [("/", 413), ("/elsewhere", 403)])
def test_who_is_refused_while_sending_can_read_why(
    server: HttpServer, path: str, status: int
) -> None:
    for _ in range(3):
        connection = http.client.HTTPConnection(*server.address, timeout=10)
        connection.request("POST", path, bytes(16 << 20))
        assert connection.getresponse().status == status
        connection.close()


def test_who_is_not_admitted_is_told_before_anything_is_read(server: HttpServer) -> None:
    told = {"error": "not here", "place": "/elsewhere"}
    assert ask(server, "9" * 30, path="/elsewhere") == (403, told)


def test_connections_beyond_the_limit_are_closed_and_places_come_back(server: HttpServer) -> None:
    idle = [socket.create_connection(server.address, timeout=10) for _ in range(CONNECTIONS)]
    with socket.create_connection(server.address, timeout=10) as other:
        assert other.recv(1) == b""
    for connection in idle:
        connection.close()
    assert ask(server, "2", b"ab") == (200, 2)


def test_a_closed_server_says_so_and_listens_no_more(server: HttpServer) -> None:
    assert not server.is_closing.is_set()
    server.close()
    assert server.is_closing.is_set()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(server.address, timeout=10)


def test_an_address_of_ipv6_is_served_and_written_with_brackets() -> None:
    try:
        server = HttpServer(("::1", 0), Counting)
    except OSError as error:
        pytest.skip(f"no IPv6 here: {error}")
    server.start()
    try:
        assert server.url == f"http://[::1]:{server.address[1]}"
        assert ask(server, "3", b"abc") == (200, 3)
    finally:
        server.close()
