"""The editor in a browser: what `objectmorpher serve --web` answers.

    GET  /  /web.js                      the page
    GET  /web/about                      {"samples": names of photos, "most": bytes of a photo}
    GET  /web/samples/NAME               a sample photo
    POST /web/edits                      a photo's bytes -> {"id", "size"}
    POST /web/edits/ID/select            {"click": [[x, y]], "not_click": [...], "subject": bool}
    POST /web/edits/ID/lift              {}
    POST /web/edits/ID/render            {"what": one of FILES, "points", "quats", "turn", "shift"}:
                                         the state of the page of `objectmorpher share`
    GET  /web/edits/ID/about             {"id", "size", "is_chosen", "is_lifted"}
    GET  /web/edits/ID/photo|mask|page   pictures, and that page
    GET  /web/edits/ID/files/WHAT        what was rendered last

The last three POST answer with lines of JSON: progress, and at the end {"state": "done"} or a
sentence in "error". Everything of an edit needs the token; one computation runs at a time.
"""

from __future__ import annotations

import base64
import binascii
import json
import logging
import secrets
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote, unquote

import numpy as np

from objectmorpher_core import pipeline, segment
from objectmorpher_core.base import quoting
from objectmorpher_core.base.progress import Cancelled, Progress, part
from objectmorpher_core.base.rotations import matrices_from_quats
from objectmorpher_core.document import edits
from objectmorpher_core.document.edits import EditError
from objectmorpher_core.document.model import Click, Document, Pose, Prompt
from objectmorpher_core.document.placement import placement_of
from objectmorpher_core.document.transparency import colours_of, seen
from objectmorpher_core.pictures.image import (
    Picture,
    at_most,
    encode_coverage,
    encode_picture,
    resized,
    to_u8,
)
from objectmorpher_core.scripting.options import EditScript
from objectmorpher_core.scripting.outputs import encode_output
from objectmorpher_core.scripting.runner import has_left, with_plate
from objectmorpher_core.session.file import encode_session

from ..system.resources import resource
from .address import check_token
from .front import FAILED, NOTHING, Handler, HttpServer, Kept, Refusal
from .share_page import LONGEST, encode_page

log = logging.getLogger(__name__)

MOST_EDITS = 6  # kept at a time; the least recently used goes first
MOST_SAID = 1 << 20  # bytes of a question that is no photo
MOST_CLICKS = 64
BEAT = 0.2  # s between two lines of a computation
QUALITY = 90  # of the WebP that the page shows while one selects
FILES = ("photo", "session", "layers")
QUESTIONS = {  # what may be asked, and what a question of it holds
    "select": {"click", "not_click", "subject"},
    "lift": set[str](),
    "render": {"what", "points", "quats", "turn", "shift"},
}
KEPT_ENDINGS = (".jpg", ".jpeg", ".png")  # as which an opaque photo is given back; else PNG
# The page runs the page of `share` in a frame of its own, which brings its programs along.
POLICY = (
    "default-src 'none'; img-src 'self' data: blob:; style-src 'unsafe-inline'; connect-src 'self';"
    " script-src 'self' 'unsafe-inline' blob:; worker-src blob:; frame-src blob:; base-uri 'none';"
    " form-action 'none'; frame-ancestors 'none'"
)


@dataclass(eq=False)
class WebEdit:
    """A photo that somebody edits in a browser, as far as they have come."""

    opened: Document
    reading: pipeline.Reading | None = None
    chosen: Document | None = None
    lifted: Document | None = None
    files: dict[str, tuple[str, bytes]] = field(default_factory=dict)  # what is to be saved

    @property
    def name(self) -> str:
        """Name of the photo's file, without folders."""
        return Path(self.opened.photo.name).name

    def select(self, asked: Mapping[str, Any], progress: Progress) -> None:
        """Choose the object that the clicks mean, px of the photo."""
        wanted = Prompt(
            tuple(
                Click(x, y, is_foreground=is_meant)
                for name, is_meant in (("click", True), ("not_click", False))
                for x, y in _points(asked.get(name, []), self.opened.photo.size)
            ),
            is_subject=asked.get("subject", False),
        )
        if not isinstance(wanted.is_subject, bool):
            raise EditError("subject is true or false")
        if wanted.is_empty:
            raise EditError("click the object first")
        if self.reading is None:
            read = part(progress, 0.0, 0.8)
            self.reading = pipeline.read_photo(seen(self.opened.photo), segment.load(), read)
        found = self.reading.segment(wanted, part(progress, 0.8, 1.0), self.opened.seed)
        document = edits.set_mask(edits.add_object(self.opened), 0, found.mask, wanted)
        self.chosen = document.with_backend("segment", found.backend)
        self.lifted = None

    def lift(self, asked: Mapping[str, Any], progress: Progress) -> None:
        """Lift the chosen object to 3D and fill in what is behind it."""
        document = self._chosen()
        photo, item = document.photo, document.objects[0]
        assert item.selection is not None, "it was chosen"
        made = pipeline.lift_mask(
            colours_of(photo.picture), photo.camera, item.selection,
            progress=part(progress, 0.0, 0.5), seed=document.seed,
        )  # fmt: skip
        document = edits.set_lifted(document, 0, *made)
        behind = part(progress, 0.5, 1.0)
        self.lifted = with_plate(document, EditScript(), frozenset(), behind).document

    def render(self, asked: Mapping[str, Any], progress: Progress) -> None:
        """Make the file that is to be saved, of the object as the page shows it."""
        document = posed_as_shown(self._lifted(), asked)
        what = asked.get("what")
        if what not in FILES:
            raise EditError(f"what is to be made is one of {', '.join(FILES)}")
        stem, ending = Path(self.name).stem or "photo", Path(self.name).suffix.lower()
        if has_left(document.objects[0], document):  # its shadow in the photo goes along
            step = part(progress, 0.0, 0.6)
            document = with_plate(document, EditScript(), frozenset({0}), step).document
        if what == "session":
            self.files[what] = f"{stem}.omorph", encode_session(document)
            return
        edited = pipeline.replay(document, part(progress, 0.6, 1.0))
        is_kept = ending in KEPT_ENDINGS and document.photo.picture.alpha is None
        usual = ending if is_kept else ".png"
        name = f"{stem} edited{'.psd' if what == 'layers' else usual}"
        self.files[what] = name, encode_output(what, edited, Path(name))

    def show(self, what: str) -> tuple[bytes, str]:
        """The bytes of "photo", "mask", "page" or a file, and their media type."""
        if what == "photo":
            pixels = at_most(to_u8(seen(self.opened.photo)), LONGEST)
            return encode_picture(Picture(pixels), ".webp", webp_quality=QUALITY), "image/webp"
        if what == "mask":
            mask = self._chosen().objects[0].mask
            assert mask is not None, "it was chosen"
            scale = min(LONGEST / max(mask.shape), 1.0)
            height, width = (max(round(side * scale), 1) for side in mask.shape)
            return encode_coverage(resized(mask.astype(np.uint8) * 255, width, height)), "image/png"
        if what == "page":
            return encode_page(self._lifted(), 0), "text/html; charset=utf-8"
        made = self.files.get(what.removeprefix("files/"))
        if made is None:
            raise EditError(NOTHING)
        return made[1], "application/octet-stream"

    def _chosen(self) -> Document:
        if self.chosen is None:
            raise EditError("click the object first")
        return self.chosen

    def _lifted(self) -> Document:
        if self.lifted is None:
            raise EditError("the object is not lifted yet")
        return self.lifted


def posed_as_shown(document: Document, shown: Mapping[str, Any]) -> Document:
    """Return the document with its first object posed and placed as the page shows it.

    `shown` holds "points" (M, 3) and "quats" (M, 4) in wxyz of the control points, object frame,
    little-endian float32 in Base64, and "turn" (3, 3) and "shift" (3,), the motion of the object
    frame into the world. Raises EditError.
    """
    item, camera = document.objects[0], document.photo.camera
    lifted = item.lifted
    assert lifted is not None, "the caller checks"
    count = pipeline.puppet_of(item, camera).deformer.points.shape[0]
    points, quats = _floats(shown, "points", (count, 3)), _floats(shown, "quats", (count, 4))
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    if lengths.min() < 0.5:
        raise EditError("the turns of a pose are unit quaternions")
    turn, shift = _numbers(shown.get("turn")), _numbers(shown.get("shift"))
    if turn is None or shift is None or (turn.size, shift.size) != (9, 3):
        raise EditError("a place is a turn of 9 numbers and a shift of 3")
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn.reshape(3, 3), shift.ravel()
    try:
        place = placement_of(motion @ np.linalg.inv(lifted.world_from_object), lifted, camera)
    except ValueError as error:
        raise EditError(f"that is no place of an object: {error}") from error
    pose = Pose(points, matrices_from_quats(quats / lengths))
    return edits.set_placement(edits.set_pose(document, 0, pose), 0, place)


def _floats(shown: Mapping[str, Any], name: str, shape: tuple[int, int]) -> np.ndarray:
    try:
        values = np.frombuffer(base64.b64decode(shown[name], validate=True), "<f4").reshape(shape)
    except (KeyError, TypeError, ValueError, binascii.Error):
        raise EditError(f"{name} must be {shape[0]} x {shape[1]} numbers in Base64") from None
    if not np.isfinite(values).all() or np.abs(values).max() > 1e6:
        raise EditError(f"{name} must be finite numbers below a million")
    return values.astype(np.float64)


def _numbers(said: Any) -> np.ndarray | None:
    """Numbers of JSON, in lists that are alike; None where they are something else."""
    if not isinstance(said, list):
        return None
    try:
        values = np.array(said)
        is_number = values.size == 0 or (values.dtype.kind in "if" and not _has_truths(said))
        return values.astype(np.float64) if is_number else None
    except (OverflowError, ValueError):
        return None


def _has_truths(said: Any) -> bool:
    """Whether true or false is among them, which NumPy takes for numbers."""
    return any(map(_has_truths, said)) if isinstance(said, list) else isinstance(said, bool)


def _points(said: Any, size: tuple[int, int]) -> list[tuple[float, float]]:
    points = _numbers(said)
    if points is None or not (points.size == 0 or points.shape[1:] == (2,)):
        raise EditError("clicks are pairs of numbers")
    points = points.reshape(-1, 2)
    if len(points) > MOST_CLICKS:
        raise EditError(f"at most {MOST_CLICKS} clicks are taken")
    if not ((points >= 0) & (points < size)).all():
        raise EditError("a click is inside the photo")
    return [(float(x), float(y)) for x, y in points]


class WebServer(HttpServer):
    """Serves the editor to the browsers of whoever has the token."""

    def __init__(self, address: tuple[str, int], token: str, most: int) -> None:
        """`most`: bytes of a photo. Raises OSError where the address is taken, TokenError."""
        self.token, self.most = check_token(token), most
        self.edits: Kept[WebEdit] = Kept(MOST_EDITS, lambda edit: 1)
        self.turn = threading.Lock()  # of the one computation that runs
        self.samples = {p.name: p for p in sorted(resource("assets/samples").glob("*.jpg"))}
        super().__init__(address, partial(_WebHandler, self))

    def add(self, edit: WebEdit) -> str:
        """Keep an edit, and return the name that only its owner knows."""
        name = secrets.token_urlsafe(16)
        self.edits.add(name, edit)
        return name

    def find(self, name: str) -> WebEdit:
        """Return the edit of that name. Raises Refusal."""
        edit = self.edits.found([name]).get(name)
        if edit is None:
            raise Refusal(HTTPStatus.GONE, "this edit is not kept any more: open the photo again")
        return edit


PAGE = {
    "/": ("page.html", "text/html; charset=utf-8"),
    "/web.js": ("web.js", "text/javascript; charset=utf-8"),
}


class _WebHandler(Handler):
    more_headers: ClassVar = {
        "Content-Security-Policy": POLICY,
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
        "X-Accel-Buffering": "no",  # nginx hands each line on at once
    }

    def __init__(self, server: WebServer, *connection: Any) -> None:
        self.web = server
        super().__init__(*connection)

    def admit(self) -> None:
        """Refuse everything but the page itself to whoever has not the token."""
        if self.command != "GET" or self.path not in PAGE:
            self.admit_with(self.web.token)

    def get(self) -> None:
        if self.path in PAGE:
            name, kind = PAGE[self.path]
            self.send_bytes(HTTPStatus.OK, resource(f"assets/web/{name}").read_bytes(), kind)
            return
        if self.path == "/web/about":
            about = {"samples": list(self.web.samples), "most": self.web.most}
            self.send_json(HTTPStatus.OK, about)
            return
        folder, _, name = self.path.rpartition("/")
        if folder == "/web/samples" and name in self.web.samples:
            self.send_bytes(HTTPStatus.OK, self.web.samples[name].read_bytes(), "image/jpeg")
            return
        edit, name, what = self._meant()
        if what == "about":
            self.send_json(HTTPStatus.OK, {
                "id": name, "size": edit.opened.photo.size,
                "is_chosen": edit.chosen is not None, "is_lifted": edit.lifted is not None,
            })  # fmt: skip
            return
        try:
            body, kind = edit.show(what)
        except EditError as error:
            raise Refusal(HTTPStatus.NOT_FOUND, str(error)) from error
        headers = {"Content-Length": str(len(body)), "Cache-Control": "no-store"}
        if what.startswith("files/"):
            name = quote(edit.files[what.removeprefix("files/")][0])
            headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{name}"
        self.send_head(HTTPStatus.OK, kind, headers)
        self.wfile.write(body)

    def post(self) -> None:
        if self.path == "/web/edits":
            self._open()
            return
        edit, _, what = self._meant()
        works: dict[str, Callable[[Mapping[str, Any], Progress], None]] = {
            "select": edit.select, "lift": edit.lift, "render": edit.render,
        }  # fmt: skip
        work = works.get(what)
        if work is None:
            raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)
        try:
            asked = json.loads(self.read_body(MOST_SAID))
        except (ValueError, RecursionError):
            asked = None
        if not isinstance(asked, dict):
            raise Refusal(HTTPStatus.BAD_REQUEST, "a question is one object of JSON")
        for key in sorted(asked.keys() - QUESTIONS[what]):
            known = ", ".join(sorted(QUESTIONS[what])) or "nothing"
            said = quoting.shown(key) + quoting.meant(key, QUESTIONS[what])
            raise Refusal(HTTPStatus.BAD_REQUEST, f"{what} has no {said}; it may have {known}")
        self._carry_out(partial(work, asked))

    def _open(self) -> None:
        name = Path(unquote(self.headers.get("X-Name", "photo"))).name[:200] or "photo"
        try:
            opened = pipeline.open_photo(self.read_body(self.web.most), name)
        except ValueError as error:
            raise Refusal(HTTPStatus.BAD_REQUEST, str(error)) from error
        self.send_json(HTTPStatus.OK, {
            "id": self.web.add(WebEdit(opened)), "size": opened.photo.size,
        })  # fmt: skip

    def _meant(self) -> tuple[WebEdit, str, str]:
        """The edit, its name, and what of it is meant. Raises Refusal."""
        start, _, rest = self.path.partition("/web/edits/")
        name, _, what = rest.partition("/")
        if start or not what:
            raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)
        return self.web.find(name), name, what

    def _carry_out(self, work: Callable[[Progress], None]) -> None:
        """Answer with the progress of `work`, line by line, once it is its turn."""
        self.send_head(HTTPStatus.OK, "application/x-ndjson", {"Cache-Control": "no-store"})
        try:
            with self._turn():
                work(self._teller())
            self._line({"state": "done"})
        except (Cancelled, OSError):
            log.info("Nobody listens any more")
        except ValueError as error:
            self._line({"state": "failed", "error": str(error)})
        except Exception:
            log.exception("A computation failed")
            self._line({"state": "failed", "error": FAILED})

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """Begin when nobody else's computation runs. Raises OSError where nobody waits any more."""
        while not self.web.turn.acquire(timeout=BEAT):
            self._line({"state": "waiting"})
        try:
            yield
        finally:
            self.web.turn.release()

    def _teller(self) -> Progress:
        last = 0.0

        def tell(fraction: float, note: str) -> None:
            nonlocal last
            if self.web.is_closing.is_set():
                raise Cancelled
            if time.monotonic() - last < BEAT:
                return
            last = time.monotonic()
            self._line({"state": "running", "fraction": fraction, "note": note})

        return tell

    def _line(self, value: Any) -> None:
        self.wfile.write(json.dumps(value).encode() + b"\n")
