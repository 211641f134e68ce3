"""The server's two HTTP sides and their client: who may ask, how much, and for what."""

from __future__ import annotations

import http.client
import io
import json
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import served_jobs
from served_by_ray import PLACED
from test_message import HOSTILE

from objectmorpher.editor.settings import STAGES
from objectmorpher.server import client
from objectmorpher.server.address import Address, ServedError, Server, ServerLost, TooMuch
from objectmorpher.server.client import hello
from objectmorpher.server.front import Front, RequestLimits
from objectmorpher.server.message import LARGE, digest, encode
from objectmorpher.server.running import Alone
from objectmorpher.server.table import types
from objectmorpher_core.base.progress import Cancelled, silent
from objectmorpher_core.model_sets import DRIVER, Card, need_of
from objectmorpher_core.models import hub_model
from objectmorpher_core.models.ledger import SPARE, Ledger, Model
from tests.research.spread.ray_apart import claim_gpu, environment, own_folder
from tests.tree import over

TOKEN = "a-token-that-is-long-enough"
MOST = 4 << 20  # bytes of a request
LIMITS = {"body": MOST, "connections": 16, "jobs": 3}
PATIENCE = 60  # s until a test gives up: other work may hold the machine
CARD = 12 << 30  # bytes of the GPU that Ray Serve believes in


@dataclass(frozen=True)
class Listening:
    """Job functions that are served, by this process or by Ray Serve."""

    address: tuple[str, int]
    stages: tuple[str, ...]
    taken: float = 0.0  # of a GPU

    def done(self) -> tuple[str, ...]:
        """What its process has done so far."""
        return client.call(Server(Address(*self.address), TOKEN), "look", (), silent)


@pytest.fixture(
    scope="module",
    params=[
        "this process",
        pytest.param("Ray Serve", marks=[
            pytest.mark.slow, pytest.mark.skipif(find_spec("ray") is None, reason="no Ray"),
        ]),
    ],
)  # fmt: skip
def front(request: pytest.FixtureRequest) -> Iterator[Listening]:
    if request.param == "this process":
        own = Front(("127.0.0.1", 0), TOKEN, Alone(), served_jobs.TABLE, RequestLimits(**LIMITS))
        own.start()
        yield Listening(own.address, STAGES)
        own.close()
        return
    with own_folder() as folder:
        own = environment(folder, **claim_gpu(folder, CARD))
        with subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("served_by_ray.py")),
             json.dumps(LIMITS), TOKEN],
            env=own, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        ) as process:  # fmt: skip
            assert process.stdin is not None and process.stdout is not None
            told = json.loads(process.stdout.readline())
            yield Listening(("127.0.0.1", told["port"]), ("segment", "lift"), told["taken"])
            process.stdin.close()
            process.wait(60)


@pytest.fixture(autouse=True)
def test_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    """The client knows the same functions, and waits for a machine that has other work."""
    monkeypatch.setattr(client, "table", lambda: served_jobs.TABLE)
    monkeypatch.setattr(client, "CONNECT", PATIENCE)
    monkeypatch.setattr(client, "SILENCE", PATIENCE)


@pytest.fixture
def server(front: Listening) -> Server:
    return Server(Address(*front.address), TOKEN)


def ask(
    front: Listening, method: str, path: str, body: bytes | None = None, **headers: str
) -> tuple[int, dict]:
    """Status and answer of a request as anyone might send it."""
    connection = http.client.HTTPConnection(*front.address, timeout=PATIENCE)
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    try:
        connection.request(method, path, body, {"Authorization": f"Bearer {TOKEN}"} | given)
        response = connection.getresponse()
        return response.status, json.loads(response.read().splitlines()[-1])
    finally:
        connection.close()


def wait_until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_it_tells_what_it_serves(front: Listening, server: Server) -> None:
    told = hello(server)
    assert told["functions"] == sorted(served_jobs.TABLE)
    assert told["stages"] == dict.fromkeys(front.stages, 1)


def test_on_ray_each_process_asks_for_what_its_networks_take_of_a_gpu(front: Listening) -> None:
    if "refine" not in front.stages:
        ledger, wanted = Ledger(Card(CARD, 1 << 40)), []
        for id in PLACED:
            need = need_of(hub_model(id))
            assert need is not None
            peak = ledger.plan(Model(id, id, need, lambda plan: plan)).peak
            wanted.append((peak / SPARE + DRIVER) / CARD)
        assert sum(wanted) < front.taken < sum(wanted) + 0.01


def test_requests_beyond_the_limit_are_refused_and_places_come_back(front: Listening) -> None:
    begun = (
        f"POST /v1/jobs/halve HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {TOKEN}\r\n"
        "Content-Length: 1000\r\n\r\n"
    )
    held: list[socket.socket] = []

    def hold() -> None:
        held.append(socket.create_connection(front.address, timeout=PATIENCE))
        held[-1].sendall(begun.encode())

    def has_place() -> bool:
        with suppress(ConnectionError):  # this process closes the connection without a word
            return ask(front, "GET", "/v1/hello")[0] == 200
        return False

    def waiting() -> int:
        """How many of them are neither answered nor closed."""
        return len(held) - len(select.select(held, [], [], 0)[0])

    def is_full() -> bool:
        if waiting() < LIMITS["connections"]:  # a question took its place, and it was refused
            hold()
        return not has_place() and waiting() == LIMITS["connections"]

    try:
        for _ in range(LIMITS["connections"]):
            hold()
        wait_until(is_full)
        with suppress(ConnectionError):
            assert ask(front, "GET", "/v1/hello")[0] == 503
    finally:
        for connection in held:
            connection.close()
    wait_until(has_place)


def test_an_answer_comes_back_and_steps_are_told(server: Server) -> None:
    steps: list[tuple[float, str]] = []
    assert client.call(server, "count", (40,), lambda *s: steps.append(s)) == 40
    fractions = [fraction for fraction, note in steps if note.startswith("step")]
    assert len(fractions) >= 3
    assert fractions == sorted(fractions)


def test_large_arrays_are_sent_once(server: Server) -> None:
    values = np.random.default_rng(0).normal(size=LARGE // 4).astype(np.float32)
    notes: list[str] = []
    for _ in range(2):
        answer = client.call(server, "halve", (values,), lambda _, note: notes.append(note))
        np.testing.assert_array_equal(answer, values / np.float32(2))
    assert notes.count("sending the photo") == -(-(values.nbytes + 200) // client.PIECE)


@pytest.mark.parametrize(
    "said", ["", "Bearer", "Bearer ", "Bearer wrong", f"Basic {TOKEN}", f"Bearer {TOKEN}x", "ÿ"]
)
def test_without_the_token_nothing_is_answered_and_nothing_read(
    front: Listening, said: str
) -> None:
    for method, path in (
        ("GET", "/v1/hello"), ("GET", "/"), ("POST", "/v1/jobs/halve"), ("PUT", "/v1/blobs/x"),
    ):  # fmt: skip
        connection = http.client.HTTPConnection(*front.address, timeout=PATIENCE)
        connection.putrequest(method, path)
        connection.putheader("Authorization", said.encode("latin-1"))
        connection.putheader("Content-Length", "100000000000")  # of which nothing is sent
        connection.endheaders()
        response = connection.getresponse()
        assert response.status == 401
        assert b"token" in response.read()
        connection.close()


def test_no_header_is_no_token(front: Listening) -> None:
    connection = http.client.HTTPConnection(*front.address, timeout=PATIENCE)
    connection.request("GET", "/v1/hello")
    assert connection.getresponse().status == 401
    connection.close()


def test_too_large_a_body_is_refused_before_it_is_read(front: Listening) -> None:
    for length in (MOST + 1, 10**17):
        status, told = ask(front, "POST", "/v1/jobs/halve", b"", Content_Length=str(length))
        assert status == 413
        assert "MB" in told["error"]


def test_what_is_too_large_is_said_to_be_so_and_nothing_is_lost(server: Server) -> None:
    large = np.zeros(MOST, np.float32)
    for _ in range(3):
        with pytest.raises(TooMuch, match="refused: more than 4 MB are not taken"):
            client.call(server, "halve", (large,), silent)
    small = large[: MOST // 8]
    np.testing.assert_array_equal(client.call(server, "halve", (small,), silent), small)


@pytest.mark.parametrize("length", ["", "-1", "1e3", "0x10", "²"])
def test_a_body_without_a_length_is_refused(front: Listening, length: str) -> None:
    connection = http.client.HTTPConnection(*front.address, timeout=PATIENCE)
    connection.putrequest("POST", "/v1/jobs/halve")
    connection.putheader("Authorization", f"Bearer {TOKEN}")
    connection.putheader("Content-Length", length.encode("latin-1"))
    connection.endheaders()
    assert connection.getresponse().status in (400, 411)
    connection.close()


def test_chunks_are_refused(front: Listening) -> None:
    status, _ = ask(front, "POST", "/v1/jobs/halve", None, Transfer_Encoding="chunked")
    assert status == 411


def test_a_body_that_breaks_off_is_refused(front: Listening) -> None:
    with socket.create_connection(front.address, timeout=PATIENCE) as connection:
        connection.sendall(
            f"POST /v1/jobs/halve HTTP/1.1\r\nAuthorization: Bearer {TOKEN}\r\n"
            "Content-Length: 1000\r\n\r\nabc".encode()
        )
        connection.shutdown(socket.SHUT_WR)
        said = connection.recv(1000)
        # Ray's proxy hangs up where its client has.
        assert b" 400 " in said or (front.taken and not said)


@pytest.mark.parametrize(
    "path", ["/v1/jobs/os.system", "/v1/jobs/", "/v1/jobs/__init__", "/v1/jobs/../hello", "/etc"]
)
def test_what_is_not_in_the_table_is_not_found(front: Listening, path: str) -> None:
    assert ask(front, "POST", path, encode((), types()).body)[0] == 404


@over("name", HOSTILE)
def test_what_is_no_message_is_refused(front: Listening, name: str) -> None:
    if len(HOSTILE[name]) <= MOST:
        before = front.done()
        status, told = ask(front, "POST", "/v1/jobs/halve", HOSTILE[name])
        assert status == 400, told
        assert front.done() == before


def test_arguments_of_another_type_are_refused(front: Listening) -> None:
    for arguments in ((1,), (), (np.zeros(3),), [np.zeros(3, np.float32)]):
        assert ask(front, "POST", "/v1/jobs/halve", encode(arguments, types()).body)[0] == 400
    status, told = ask(front, "POST", "/v1/jobs/count", encode((-1,), types()).body)
    assert (status, told["error"]) == (400, "-1 steps")


def test_bytes_under_another_name_are_refused(front: Listening) -> None:
    status, _ = ask(front, "PUT", f"/v1/blobs/{digest(b'a')}", b"b")
    assert status == 400
    assert ask(front, "PUT", "/v1/blobs/../../etc/passwd", b"b")[0] == 404


def test_a_job_that_fails_as_it_should_is_an_error_of_the_users(server: Server) -> None:
    with pytest.raises(ServedError, match="nothing is selected"):
        client.call(server, "refuse", (), silent)


def test_a_server_that_breaks_down_is_lost_for_the_job(server: Server) -> None:
    with pytest.raises(ServerLost, match="out of memory"):
        client.call(server, "break_down", (), silent)


def test_cancelling_ends_the_job_over_there(front: Listening, server: Server) -> None:
    before = front.done().count("counted")
    start = time.monotonic()

    def progress(fraction: float, note: str) -> None:
        if note.startswith("step"):
            raise Cancelled

    with pytest.raises(Cancelled):
        client.call(server, "count", (5000,), progress)
    assert client.call(server, "count", (1,), silent) == 1  # its place is free again
    assert time.monotonic() - start < 50  # the first one would take 100
    assert front.done().count("counted") == before + 1


def test_jobs_queue_and_the_first_that_finds_no_place_is_told_so(
    front: Listening, server: Server
) -> None:
    notes: list[str] = []
    stop = threading.Event()

    def progress(fraction: float, note: str) -> None:
        notes.append(note)
        if stop.is_set():
            raise Cancelled

    def work() -> None:
        with pytest.raises(Cancelled):
            client.call(server, "count", (5000,), progress)

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    try:
        wait_until(
            lambda: (
                notes.count("waiting for the server") >= 2
                and any(n.startswith("step") for n in notes)
            )
        )
        with pytest.raises(ServerLost, match="too many jobs"):
            client.call(server, "count", (1,), silent)
    finally:
        stop.set()
        for thread in threads:
            thread.join(PATIENCE)

    def is_free() -> bool:
        with suppress(ServerLost):
            return client.call(server, "count", (1,), silent) == 1
        return False

    wait_until(is_free)  # when the jobs have stopped over there


def test_whoever_waits_too_long_goes_elsewhere(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = threading.Event()

    def progress(fraction: float, note: str) -> None:
        if note.startswith("step"):
            runs.set()

    thread = threading.Thread(target=lambda: client.call(server, "count", (60,), progress))
    thread.start()
    assert runs.wait(PATIENCE)
    monkeypatch.setattr(client, "QUEUE", 0.3)
    with pytest.raises(ServerLost, match="too much to do"):
        client.call(server, "count", (1,), silent)
    thread.join()


@pytest.mark.parametrize(
    "answer",
    [
        b"", b"nonsense\r\n\r\n", b"HTTP/1.1 200 OK\r\n\r\n",
        b"HTTP/1.1 200 OK\r\n\r\n" + b"[" * 70_000 + b"\n",
        b'HTTP/1.1 200 OK\r\n\r\n{"state": "done", "bytes": 1000000000000}\n',
        b'HTTP/1.1 200 OK\r\n\r\n{"state": "done", "bytes": 100}\nabc',
        b'HTTP/1.1 200 OK\r\n\r\n{"state": "done", "bytes": 3}\nabc',
        b'HTTP/1.1 200 OK\r\n\r\n{"state": "odd"}\n',
        b'HTTP/1.1 409 Conflict\r\nContent-Length: 15\r\n\r\n{"missing":["x"',
        b'HTTP/1.1 409 Conflict\r\nContent-Length: 17\r\n\r\n{"missing":["x"]}',
        b"HTTP/1.1 302 Found\r\nLocation: http://127.0.0.1:1/\r\nContent-Length: 0\r\n\r\n",
    ],
)  # fmt: skip
def test_a_server_that_talks_nonsense_is_lost_and_not_believed(answer: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def talk() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(answer)

        thread = threading.Thread(target=talk)
        thread.start()
        with pytest.raises(ServerLost) as caught:
            client.call(Server(Address(*listener.getsockname()), TOKEN), "count", (1,), silent)
        thread.join()
    assert "\n" not in str(caught.value)
    assert TOKEN not in str(caught.value)


def test_an_answer_of_another_type_is_not_taken(server: Server) -> None:
    body = io.BytesIO()
    message = encode("forty", types()).body
    body.write(b"HTTP/1.1 200 OK\r\n\r\n")
    body.write(json.dumps({"state": "done", "bytes": len(message)}).encode() + b"\n" + message)
    test_a_server_that_talks_nonsense_is_lost_and_not_believed(body.getvalue())


def test_nobody_there_and_nobody_answering_are_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(client, "SILENCE", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as listener:
        silent_one = Server(Address(*listener.getsockname()), TOKEN)
        with pytest.raises(ServerLost, match="does not answer"):
            client.call(silent_one, "count", (1,), silent)
    with pytest.raises(ServerLost, match="cannot be reached"):
        client.call(silent_one, "count", (1,), silent)


def test_a_wrong_token_is_said_to_be_one(server: Server) -> None:
    with pytest.raises(ServerLost, match="does not accept the token"):
        client.call(Server(server.address, "another-long-token"), "count", (1,), silent)
