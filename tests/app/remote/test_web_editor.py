"""The editor in a browser: a stranger gets nothing, a visitor clicks, lifts, drags and saves."""

from __future__ import annotations

import base64
import http.client
import io
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from objectmorpher.cli.parser import main
from objectmorpher.server.web_editor import MOST_EDITS, WebEdit, WebServer, posed_as_shown
from objectmorpher_core.base.progress import silent
from objectmorpher_core.base.rotations import quats_from_matrices
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.model import Document, Placement
from objectmorpher_core.document.placement import placement_of
from objectmorpher_core.session.file import decode_session
from tests import shapes
from tests.browser import Browser, opened_browser
from tests.tree import over

SAMPLES = Path(__file__).parents[3] / "assets" / "samples"
TOKEN = "a token that only this test knows".replace(" ", "-")
MOST = 1 << 20


@cache
def scene() -> Document:
    return shapes.scene("ellipse").document()


@pytest.fixture(scope="module")
def server() -> Iterator[WebServer]:
    server = WebServer(("127.0.0.1", 0), TOKEN, MOST)
    server.start()
    yield server
    server.close()


def ask(
    server: WebServer, method: str, path: str, body: bytes = b"", token: str | None = TOKEN
) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(*server.address, timeout=120)
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    try:
        connection.request(method, path, body or None, headers)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()


def opened(server: WebServer, data: bytes) -> str:
    status, body = ask(server, "POST", "/web/edits", data)
    assert status == 200
    return f"/web/edits/{json.loads(body)['id']}"


def last_line(server: WebServer, path: str, question: Any) -> dict[str, Any]:
    status, body = ask(server, "POST", path, json.dumps(question).encode())
    assert status == 200
    return json.loads(body.splitlines()[-1])


def test_without_the_token_only_the_page_is_there(server: WebServer) -> None:
    for path in ("/", "/web.js"):
        assert ask(server, "GET", path, token=None)[0] == 200
    photo = (SAMPLES / "bowl.jpg").read_bytes()
    edit = opened(server, photo)
    for token in (None, "wrong-but-of-the-right-length"):
        for method, path in (
            ("GET", "/web/about"), ("GET", f"{edit}/photo"), ("POST", "/web/edits"),
            ("POST", f"{edit}/select"), ("GET", "/../pyproject.toml"),
        ):  # fmt: skip
            assert ask(server, method, path, token=token)[0] == 401


def test_nonsense_is_answered_with_a_sentence_and_hurts_nobody(server: WebServer) -> None:
    assert ask(server, "POST", "/web/edits", b"no picture")[0] == 400
    edit = opened(server, (SAMPLES / "bowl.jpg").read_bytes())
    for body in (b"", b"[]", b"{", b"\xff", b"[" * 100_000, b'{"clicks": [[5, 5]]}'):
        status, answer = ask(server, "POST", f"{edit}/select", body)
        assert status in (400, 411) and json.loads(answer)["error"]
    for asked in (
        {}, {"click": [[1]]}, {"click": "here"}, {"click": [[-1, 5]]}, {"click": [[1e9, 5]]},
        {"click": [["a", "b"]]}, {"click": [[1, 1]] * 1000}, {"click": [[float("nan"), 1]]},
        {"click": [["5", "6"]]}, {"click": [[True, 5]]}, {"click": [[10**400, 1]]},
        {"click": [5, 5]}, {"click": {"x": 5}}, {"subject": "yes"}, {"click": None},
    ):  # fmt: skip
        told = last_line(server, f"{edit}/select", asked)
        assert told["state"] == "failed" and told["error"] and "failed" not in told["error"]
    assert last_line(server, f"{edit}/lift", {})["error"] == "click the object first"
    for what in ("mask", "page", "files/photo", "files/x", "elsewhere"):
        assert ask(server, "GET", f"{edit}/{what}")[0] == 404
    assert ask(server, "GET", f"{edit}/photo")[0] == 200


def test_a_few_edits_are_kept_and_the_oldest_gives_way(server: WebServer) -> None:
    photo = (SAMPLES / "bowl.jpg").read_bytes()
    first, *others = [opened(server, photo) for _ in range(MOST_EDITS + 1)]
    assert ask(server, "GET", f"{first}/photo")[0] == 410
    assert all(ask(server, "GET", f"{edit}/photo")[0] == 200 for edit in others)


angles = st.floats(-80, 80)


@settings(deadline=None)  # the first example lifts the scene
@given(st.tuples(angles, angles, angles), st.floats(0.2, 4), st.floats(-0.5, 2),
       st.tuples(st.floats(-90, 90), st.floats(-90, 90)))  # fmt: skip
def test_a_placement_comes_back_from_its_matrix(
    turn: tuple[float, float, float], scale: float, depth: float, move: tuple[float, float]
) -> None:
    lifted, camera = scene().objects[0].lifted, scene().photo.camera
    assert lifted is not None
    motion = Placement(move, depth, turn, scale).matrix(lifted, camera)
    found = placement_of(motion, lifted, camera)
    np.testing.assert_allclose(found.matrix(lifted, camera), motion, atol=1e-9)
    np.testing.assert_allclose((*found.turn, found.scale), (*turn, scale), atol=1e-6)


def shown(count: int, **more: Any) -> dict[str, Any]:
    lifted = scene().objects[0].lifted
    assert lifted is not None
    rest = puppet_of(scene().objects[0], scene().photo.camera).deformer.points
    quats = np.tile([1.0, 0, 0, 0], (len(rest), 1))
    world = lifted.world_from_object
    told = {
        "points": base64.b64encode(rest[:count].astype("<f4").tobytes()).decode(),
        "quats": base64.b64encode(quats[:count].astype("<f4").tobytes()).decode(),
        "turn": world[:3, :3].ravel().tolist(), "shift": world[:3, 3].tolist(),
    }  # fmt: skip
    return told | more


@over("wrong", [
    {"turn": [0] * 9}, {"turn": [1] * 8}, {"shift": ["a", 1, 2]},
    {"turn": [-1, 0, 0, 0, 1, 0, 0, 0, 1]}, {"turn": [2, 0, 0, 0, 1, 0, 0, 0, 1]},
    {"shift": [0, 0, float("nan")]}, {"shift": [0, 0, -1e5]}, {"quats": "*"},
    {"shift": None}, {"turn": [10**400] * 9}, {"turn": {"a": 1}}, {"shift": ["1", "2", "3"]},
])  # fmt: skip
def test_a_pose_that_cannot_be_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(EditError):
        posed_as_shown(scene(), shown(9999, **wrong))


def test_a_pose_of_too_few_points_or_of_nothing_is_refused() -> None:
    for wrong in (shown(3), {}):
        with pytest.raises(EditError):
            posed_as_shown(scene(), wrong)


def test_the_pose_of_the_page_is_the_documents() -> None:
    lifted = scene().objects[0].lifted
    assert lifted is not None
    posed = posed_as_shown(scene(), shown(9999)).objects[0]
    assert posed.pose is not None
    rest = puppet_of(scene().objects[0], scene().photo.camera).deformer.points
    np.testing.assert_allclose(posed.pose.points, rest, atol=1e-5)
    turns = quats_from_matrices(posed.pose.rotations)
    np.testing.assert_allclose(turns, np.tile([1.0, 0, 0, 0], (len(rest), 1)), atol=1e-9)
    motion = posed.placement.matrix(lifted, scene().photo.camera)
    np.testing.assert_allclose(motion, np.eye(4), atol=1e-9)


@pytest.mark.slow
@pytest.mark.usefixtures("networks")  # without them the bowl stands, and turns about its foot
def test_an_edit_by_http_gives_the_very_pixels_of_the_command_line(
    server: WebServer, tmp_path: Path
) -> None:
    source = SAMPLES / "bowl.jpg"
    edit = opened(server, source.read_bytes())
    assert last_line(server, f"{edit}/select", {"click": [[500, 340]]})["state"] == "done"
    assert last_line(server, f"{edit}/lift", {})["state"] == "done"
    document = server.find(edit.rpartition("/")[2]).lifted
    assert document is not None
    item, camera = document.objects[0], document.photo.camera
    assert item.lifted is not None
    rest = puppet_of(item, camera).deformer.points
    motion = Placement(turn=(20.0, 0.0, 0.0)).matrix(item.lifted, camera)
    motion = motion @ item.lifted.world_from_object
    question = {
        "what": "photo", "points": base64.b64encode(rest.astype("<f4").tobytes()).decode(),
        "quats": base64.b64encode(np.tile([1, 0, 0, 0], (len(rest), 1)).astype("<f4")).decode(),
        "turn": motion[:3, :3].ravel().tolist(), "shift": motion[:3, 3].tolist(),
    }  # fmt: skip
    assert last_line(server, f"{edit}/render", question)["state"] == "done"
    made = ask(server, "GET", f"{edit}/files/photo")[1]
    out = tmp_path / "out.png"
    assert main(["edit", str(source), "--click", "500,340", "--turn", "20", "-o", str(out)]) == 0
    assert np.array_equal(np.asarray(Image.open(io.BytesIO(made))), np.asarray(Image.open(out)))


# ---- with a browser ---------------------------------------------------------------------------


@over("name", ["cut.jpg", "cut.png"])
def test_a_photo_with_transparency_is_saved_whatever_its_name(name: str) -> None:
    """A PNG file may be called .jpg."""
    document = scene()
    picture = document.photo.picture
    alpha = np.full(picture.pixels.shape[:2], 255, np.uint8)
    alpha[:4] = 0
    photo = replace(document.photo, name=name, picture=replace(picture, alpha=alpha), source=b"")
    document = replace(document, photo=photo)
    edit = WebEdit(document, lifted=document)
    edit.render(shown(9999, what="photo"), silent)
    saved, data = edit.files["photo"]
    assert saved == "cut edited.png"
    assert (np.asarray(Image.open(io.BytesIO(data)))[:4, :, 3] == 0).all()


def screen_place(page: Browser, x: float, y: float) -> tuple[float, float]:
    """Where a part of the photo, as shares of its sides, is in the window."""
    left, top, width, height = page.run(
        "const b = document.getElementById('photo').getBoundingClientRect();"
        "return [b.left, b.top, b.width, b.height]"
    )
    return left + x * width, top + y * height


@pytest.mark.slow
def test_a_visitor_opens_clicks_lifts_turns_and_saves(server: WebServer) -> None:
    with opened_browser() as page:
        page.open(f"{server.url}/#token={TOKEN}")
        page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
        assert TOKEN not in page.run("return location.href")
        page.run("document.querySelector('#samples img[alt=flower]').parentElement.click()")
        page.wait("document.body.dataset.step === 'select'", "the photo")
        place = screen_place(page, 0.5, 0.55)
        page.drag(place, place)  # a click
        page.wait("!document.getElementById('lift').disabled", "the selection")
        page.run("document.getElementById('lift').click()")
        page.wait("document.body.dataset.step === 'drag'", "lifting")
        frame = "document.getElementById('frame').contentWindow"
        page.wait(f"{frame}.objectmorpher && {frame}.objectmorpher.isStill", "drawing")
        page.run(f"{frame}.objectmorpher.thing.rotate(15, 0)")
        page.run(  # in place of the browser's own downloads
            "const make = URL.createObjectURL; let blob;"
            "URL.createObjectURL = (made) => { blob = made; return make(made); };"
            "HTMLAnchorElement.prototype.click = function () { const reader = new FileReader();"
            " reader.onload = () => { window.saved = [this.download, reader.result]; };"
            " reader.readAsDataURL(blob); };"
        )
        files = {}
        for button in ("save", "session"):
            page.run(f"window.saved = null; document.getElementById('{button}').click()")
            name, url = page.wait("window.saved", "saving")
            files[button] = name, base64.b64decode(url.partition(",")[2])
    assert [name for name, _ in files.values()] == ["flower edited.jpg", "flower.omorph"]
    edited = np.asarray(Image.open(io.BytesIO(files["save"][1]))).astype(float)
    photo = np.asarray(Image.open(SAMPLES / "flower.jpg")).astype(float)
    changed = np.abs(edited - photo).max(2) > 30
    assert edited.shape == photo.shape and 0.02 < changed.mean() < 0.6
    item = decode_session(files["session"][1]).objects[0]
    np.testing.assert_allclose(item.placement.turn, (15, 0, 0), atol=1e-3)


def choose(page: Browser, name: str) -> None:
    page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
    page.run(f"document.querySelector('#samples img[alt={name}]').parentElement.click()")


def select_middle(page: Browser) -> None:
    place = screen_place(page, 0.5, 0.5)
    page.drag(place, place)
    page.wait("!document.getElementById('lift').disabled", "the selection")


STEP = "document.body.dataset.step"
# What is asked for waits so long, ms, by how its address ends; each is taken once.
SLOWLY = """
    const real = window.fetch, waits = %s;
    window.fetch = async (path, options) => {
      const end = Object.keys(waits).find((end) => String(path).endsWith(end));
      const [ms] = end ? waits[end].splice(0, 1) : [0];
      await new Promise((go) => setTimeout(go, ms || 0));
      return real(path, options);
    };
"""


@pytest.mark.slow
def test_a_page_that_is_loaded_again_goes_on_with_its_edit(server: WebServer) -> None:
    with opened_browser() as page:
        page.open(f"{server.url}/#token={TOKEN}")
        choose(page, "coffee")
        page.wait(f"{STEP} === 'select'", "the photo")
        page.open(f"{server.url}/")
        page.wait(f"{STEP} === 'select'", "the photo")
        select_middle(page)
        page.open(f"{server.url}/")
        page.wait("edit?.isChosen", "the selection")
        page.run("document.getElementById('lift').click()")
        page.wait(f"{STEP} === 'drag'", "lifting")
        page.open(f"{server.url}/")
        page.wait(f"{STEP} === 'drag'", "the object")
        frame = "document.getElementById('frame').contentWindow"
        page.wait(f"{frame}.objectmorpher && {frame}.objectmorpher.isStill", "drawing")
        page.run("document.getElementById('other').click()")
        page.wait(f"{STEP} === 'open'", "leaving")
        page.open(f"{server.url}/")
        page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
        assert page.run(f"return {STEP}") == "open"
        page.run("sessionStorage.setItem('edit', JSON.stringify({id: 'gone', isSent: false}))")
        page.open(f"{server.url}/")
        page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
        assert page.run(f"return {STEP}") == "open"


@pytest.mark.slow
def test_what_arrives_late_does_not_replace_what_was_opened_or_left_since(
    server: WebServer,
) -> None:
    with opened_browser() as page:
        page.open(f"{server.url}/#token={TOKEN}")
        page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
        page.run(SLOWLY % "{'web/edits': [2500, 0], '/page': [2500]}")
        choose(page, "coffee")
        choose(page, "flower")
        page.wait(f"{STEP} === 'select'", "the photo")
        shown = "[edit.size[0], document.getElementById('photo').naturalWidth]"
        assert page.run(f"return {shown}") == [640, 640]
        time.sleep(4)
        assert page.run(f"return {shown}") == [640, 640], "the coffee came last"
        select_middle(page)
        page.run("document.getElementById('lift').click()")
        page.wait("stop === null", "lifting")
        page.run("document.getElementById('other').click()")
        time.sleep(4)
        assert page.run(f"return {STEP}") == "open"


@pytest.mark.slow
def test_in_a_narrow_window_nothing_lies_over_anything_else(server: WebServer) -> None:
    with opened_browser() as page:
        page.resize(400, 760)
        page.open(f"{server.url}/#token={TOKEN}")
        page.wait("document.querySelectorAll('#samples button').length > 3", "the samples")
        below = "const b = (id) => document.getElementById(id).getBoundingClientRect();"
        assert page.run(f"{below} return b('drop').bottom <= b('hint').top")
        choose(page, "coffee")
        page.wait(f"{STEP} === 'select'", "the photo")
        select_middle(page)
        page.run("document.getElementById('lift').click()")
        page.wait(f"{STEP} === 'drag'", "lifting")
        assert page.run("return document.documentElement.scrollWidth <= innerWidth")
        assert page.run(f"{below} return b('frame').bottom <= b('hint').top")
