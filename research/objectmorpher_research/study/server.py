"""The study's HTTP side: four files, four questions, pictures by names. Nothing else is there.

    GET  /  /study.css  /study.js     the page
    GET  /picture/NAME                a picture, by a name that was given out for one participant
    POST /api/about|begin|state|answer    JSON in, JSON out

No path of a request is ever joined to one of the disk. Other sites' pages can ask for nothing:
questions must be JSON by POST (which browsers do not send across sites unasked), and while only
this computer is served, the name by which it is asked for must be this computer's.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Mapping
from functools import partial
from http import HTTPStatus
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import urlsplit

from objectmorpher.server.address import LOOPBACK
from objectmorpher.server.front import NOTHING, Handler, HttpServer, Refusal

from ..evaluation.error import EvaluationError
from .pages import Pages, QuestionError

log = logging.getLogger(__name__)

PAGE = Path(__file__).with_name("page")
MOST_BODY = 16 << 10  # bytes of a question
KEPT = "private, max-age=86400, immutable"  # Cache-Control of pictures: a name is given out once
FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/study.css": ("study.css", "text/css; charset=utf-8"),
    "/study.js": ("study.js", "text/javascript; charset=utf-8"),
}
POLICY = (
    "default-src 'none'; img-src 'self' data:; style-src 'self'; script-src 'self';"
    " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class StudyServer(HttpServer):
    """Serves one study."""

    def __init__(self, address: tuple[str, int], pages: Pages) -> None:
        """Raises OSError where the address is taken."""
        self.pages = pages
        self.files = {
            path: ((PAGE / name).read_bytes(), kind) for path, (name, kind) in FILES.items()
        }
        self.is_private = address[0] in LOOPBACK
        super().__init__(address, partial(_Handler, self))


class _Handler(Handler):
    more_headers: ClassVar = {
        "Content-Security-Policy": POLICY,
        "Referrer-Policy": "no-referrer",
        "Cross-Origin-Resource-Policy": "same-origin",
    }

    def __init__(self, study: StudyServer, *connection: Any) -> None:
        self.study = study
        super().__init__(*connection)

    def admit(self) -> None:
        """Refuses who asks for this computer by another name, or from another site's page."""
        host = self.headers.get("Host", "")
        if self.study.is_private and _hostname(f"//{host}") not in LOOPBACK:
            raise Refusal(HTTPStatus.FORBIDDEN, "this study is for this computer only")
        origin = self.headers.get("Origin")
        if origin is not None and urlsplit(origin).netloc != host:
            raise Refusal(HTTPStatus.FORBIDDEN, "another site's page cannot answer")

    def get(self) -> None:
        path = self.path.partition("?")[0]
        if path in self.study.files:
            body, kind = self.study.files[path]
            self.send_bytes(HTTPStatus.OK, body, kind)
            return
        if path.startswith("/picture/"):
            found = self.study.pages.pictures.read(path.removeprefix("/picture/"))
            if found is not None:
                self.send_bytes(HTTPStatus.OK, found, "image/png", KEPT)
                return
        raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)

    def post(self) -> None:
        pages = self.study.pages
        questions: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "/api/about": pages.about, "/api/begin": pages.begin, "/api/state": pages.state,
            "/api/answer": pages.answer,
        }  # fmt: skip
        question = questions.get(self.path)
        if question is None:
            raise Refusal(HTTPStatus.NOT_FOUND, NOTHING)
        said = self._said()
        try:
            told = question(said)
        except QuestionError as error:
            raise Refusal(HTTPStatus.NOT_FOUND, str(error)) from error
        except EvaluationError as error:
            raise Refusal(HTTPStatus.BAD_REQUEST, str(error)) from error
        except OSError as error:
            log.exception("An answer cannot be kept")
            raise Refusal(
                HTTPStatus.INTERNAL_SERVER_ERROR, "Your answer could not be kept."
            ) from error
        self.send_json(HTTPStatus.OK, told)

    def _said(self) -> Mapping[str, Any]:
        """The JSON object of the body."""
        kind = self.headers.get("Content-Type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            raise Refusal(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "questions are JSON")
        body = self.read_body(MOST_BODY)
        try:
            said = json.loads(body)
        except (ValueError, RecursionError) as error:
            raise Refusal(HTTPStatus.BAD_REQUEST, "that is no JSON") from error
        if not isinstance(said, dict):
            raise Refusal(HTTPStatus.BAD_REQUEST, "that is no JSON object")
        return said


def _hostname(url: str) -> str | None:
    try:
        return urlsplit(url).hostname
    except ValueError:
        return None
