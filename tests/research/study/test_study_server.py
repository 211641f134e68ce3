"""The study's server: what it tells, what it refuses, and that it never says whose a result is."""

from __future__ import annotations

import http.client
import io
import json
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from objectmorpher_research.evaluation.error import EvaluationError
from objectmorpher_research.evaluation.subjects.folders import read_subjects
from objectmorpher_research.study.pages import Pages, study_of
from objectmorpher_research.study.server import MOST_BODY, StudyServer
from objectmorpher_research.study.store import StudyStore, read_participants
from tests.research.study.study_set import METHODS, SIZE, made, save, small, write_set
from tests.tree import over

JSON = {"Content-Type": "application/json"}


@pytest.fixture
def folder(tmp_path) -> Path:
    return write_set(tmp_path / "set")


@pytest.fixture
def served(folder) -> Iterator[StudyServer]:
    subjects = read_subjects(folder)
    store = StudyStore(folder / "study", study_of(subjects, seed=0, checks=1))
    server = StudyServer(("127.0.0.1", 0), Pages(store, subjects))
    server.start()
    yield server
    server.close()


class Reply:
    def __init__(self, answer: http.client.HTTPResponse) -> None:
        self.status, self.body = answer.status, answer.read()
        self.headers = {name.lower(): value for name, value in answer.getheaders()}

    def json(self):
        return json.loads(self.body)


def ask(server: StudyServer, method: str, path: str, body=None, headers=None) -> Reply:
    connection = http.client.HTTPConnection(*server.address, timeout=20)
    if isinstance(body, dict):
        body, headers = json.dumps(body).encode(), JSON | (headers or {})
    connection.request(method, path, body, headers or {})
    reply = Reply(connection.getresponse())
    connection.close()
    return reply


def post(server: StudyServer, name: str, **said) -> Reply:
    return ask(server, "POST", f"/api/{name}", said)


def begin(server: StudyServer) -> dict:
    reply = post(server, "begin", agreed=True)
    assert reply.status == 200
    return reply.json()


def pixels(server: StudyServer, path: str) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(ask(server, "GET", "/" + path).body)).convert("RGB"))


def test_the_page_loads_nothing_from_elsewhere(served):
    for path in ("/", "/study.css", "/study.js"):
        reply = ask(served, "GET", path)
        assert reply.status == 200 and len(reply.body) > 1000
        text = reply.body.decode().replace("http://www.w3.org/2000/svg", "")
        assert "http:" not in text and "https:" not in text and "//cdn" not in text
        assert "default-src 'none'" in reply.headers["content-security-policy"]
        assert reply.headers["x-content-type-options"] == "nosniff"
        assert "set-cookie" not in reply.headers


def test_a_participant_never_learns_whose_a_result_is(served, folder):
    """Not by a name in any answer, not by names of pictures, not by what is in the files."""
    states = [begin(served), begin(served)]
    urls = [
        item[which] for s in states for item in s["items"] for which in item if which == "result"
    ]
    assert len(urls) == 8 and len(set(urls)) == 8
    seen = [json.dumps(s) for s in states] + [ask(served, "GET", "/study.js").body.decode()]
    seen.append(json.dumps(post(served, "about").json()))
    for url in urls:
        reply = ask(served, "GET", "/" + url)
        picture = Image.open(io.BytesIO(reply.body))
        assert picture.size == SIZE and not picture.info
        seen.append(reply.body.decode("latin-1") + repr(reply.headers))
    for name in (*METHODS, str(folder), "coffee", "chelsea"):
        assert not any(name in text for text in seen), name


def test_pictures_are_those_of_the_page(served, folder):
    state = begin(served)
    (person,) = read_participants(folder / "study")
    for told, item in zip(state["items"], person.items, strict=True):
        if item.check:
            assert told == {"asked": list(item.check)}
            continue
        rgb = small(item.subject)
        assert np.array_equal(pixels(served, told["original"]), rgb)
        assert np.array_equal(pixels(served, told["result"]), made(rgb)[item.method])


def test_results_of_another_size_are_shown_in_the_photo_s(folder):
    half = small("coffee")[::2, ::2]
    save(folder / "coffee" / "results" / f"{METHODS[0]}.png", half)
    subjects = read_subjects(folder)
    pages = Pages(StudyStore(folder / "study", study_of(subjects, 0, 0)), subjects)
    data = pages.pictures.read(pages.pictures.name_result("coffee", METHODS[0]))
    assert data is not None and Image.open(io.BytesIO(data)).size == SIZE
    save(folder / "coffee" / "results" / f"{METHODS[0]}.png", half[:, :20])
    with pytest.raises(EvaluationError, match="of another shape"):
        Pages(StudyStore(folder / "other", study_of(subjects, 0, 0)), subjects)


def test_a_whole_study(served, folder):
    state = begin(served)
    key = state["key"]
    for k, item in enumerate(state["items"]):
        ratings = item.get("asked", [1 + k % 5, 2, 3])
        reply = post(served, "answer", key=key, item=k, ratings=ratings, seconds=2.5)
        assert reply.status == 200
        assert reply.json() == {"finished": k == len(state["items"]) - 1}
        again = post(served, "state", key=key).json()
        assert again["answers"][str(k)] == ratings and again["number"] == 1
    (person,) = read_participants(folder / "study")
    assert person.is_finished and (folder / "study" / "answers.csv").is_file()


@over(
    "path",
    [
        "/../../../../etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/picture/../../../etc/passwd",
        "/picture/", "/picture/coffee", "/picture/..%2fset%2fcoffee%2fimage.png", "//etc/passwd",
        "/study.json", "/participants/0001.json", "/study/study.json", "/page/index.html",
        "/index.html", "/api/state", "/answers.csv", "/\\..\\..\\x", "/" + "a" * 5000,
    ],
)  # fmt: skip
def test_there_is_nothing_else(served, path):
    begin(served)
    reply = ask(served, "GET", path)
    assert reply.status == 404 and "error" in reply.json()


@pytest.mark.parametrize(
    ("method", "path", "body", "headers", "status"),
    [
        ("POST", "/api/begin", b"{}", {}, 415),
        ("POST", "/api/begin", b"agreed=true", {"Content-Type": "text/plain"}, 415),
        ("POST", "/api/begin", b"{", JSON, 400),
        ("POST", "/api/begin", b"[1]", JSON, 400),
        ("POST", "/api/begin", b"[" * 9000, JSON, 400),
        ("POST", "/api/begin", b"x" * (MOST_BODY + 1), JSON, 413),
        ("POST", "/api/begin", b"", JSON | {"Content-Length": "-1"}, 411),
        ("POST", "/api/begin", b"", JSON | {"Content-Length": "9" * 40}, 413),
        ("POST", "/api/begin", b"", JSON | {"Transfer-Encoding": "chunked"}, 411),
        ("POST", "/api/begin", {}, {}, 404),
        ("POST", "/api/begin", {"agreed": "yes"}, {}, 404),
        ("POST", "/api/begin", {"agreed": True}, {"Host": "evil.example"}, 403),
        ("POST", "/api/begin", {"agreed": True}, {"Origin": "http://evil.example"}, 403),
        ("POST", "/api/begin", {"agreed": True}, {"Origin": "null"}, 403),
        ("GET", "/", None, {"Host": "evil.example:8718"}, 403),
        ("GET", "/", None, {"Host": "[bad"}, 403),
        ("POST", "/api/state", {"key": "x"}, {}, 404),
        ("POST", "/api/state", {"key": ["x"]}, {}, 404),
        ("POST", "/api/state", {"key": "x" * 5000}, {}, 404),
        ("POST", "/api/nothing", {}, {}, 404),
        ("POST", "/", {}, {}, 404),
        ("PUT", "/api/begin", b"", {}, 501),
        ("DELETE", "/", None, {}, 501),
    ],
)
def test_what_is_refused(served, folder, method, path, body, headers, status):
    assert ask(served, method, path, body, headers).status == status
    assert not read_participants(folder / "study")
    assert ask(served, "GET", "/").status == 200


@over(
    "said",
    [
        {"item": 1, "ratings": [1, 2, 3], "seconds": 1},
        {"item": -1, "ratings": [1, 2, 3], "seconds": 1},
        {"item": True, "ratings": [1, 2, 3], "seconds": 1},
        {"item": "0", "ratings": [1, 2, 3], "seconds": 1},
        {"item": 0, "ratings": [0, 2, 3], "seconds": 1},
        {"item": 0, "ratings": [1, 2, 3, 4], "seconds": 1},
        {"item": 0, "ratings": [1, 2, None], "seconds": 1},
        {"item": 0, "ratings": [1, 2, [3]], "seconds": 1},
        {"item": 0, "ratings": "123", "seconds": 1},
        {"item": 0, "ratings": [1, 2, 3], "seconds": -5},
        {"item": 0, "ratings": [1, 2, 3], "seconds": 1e300},
        {"item": 0, "ratings": [1, 2, 3], "seconds": True},
        {"item": 0, "ratings": [1, 2, 3]},
        {},
    ],
)
def test_what_is_no_answer_changes_nothing(served, folder, said):
    key = begin(served)["key"]
    reply = post(served, "answer", key=key, **said)
    assert reply.status in (400, 404) and "error" in reply.json()
    assert not read_participants(folder / "study")[0].answers


def test_one_who_says_nothing_does_not_stop_the_others(served):
    silent = [socket.create_connection(served.address) for _ in range(10)]
    try:
        assert ask(served, "GET", "/").status == 200
    finally:
        for connection in silent:
            connection.close()


def test_a_broken_session_goes_on_at_another_start(folder):
    subjects = read_subjects(folder)
    study = study_of(subjects, seed=5, checks=1)
    store = StudyStore(folder / "study", study)
    first = Pages(store, subjects)
    state = first.begin({"agreed": True})
    first.answer({"key": state["key"], "item": 0, "ratings": [1, 2, 3], "seconds": 1})
    second = Pages(StudyStore(folder / "study", study), subjects)
    again = second.state({"key": state["key"]})
    assert again["answers"] == {"0": [1, 2, 3]} and again["number"] == 1
    assert len(again["items"]) == len(state["items"])
