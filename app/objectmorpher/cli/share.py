"""`objectmorpher share`: a session as one web page in which its object can be dragged."""

from __future__ import annotations

import argparse

from objectmorpher_core.base.files import write_all
from objectmorpher_core.document.model import Document

from .terminal import UsageError, progress_bar


def run_share(options: argparse.Namespace) -> None:
    """`objectmorpher share`"""
    from objectmorpher_core.session.file import load_session

    from ..server.share_page import encode_page
    from .commands import check_outputs

    check_outputs([options.session], {options.out: (".html",)})
    with progress_bar("Reading") as progress:
        document = load_session(options.session)
        index = object_to_share(document, options.object)
        progress(0.3, "Writing")
        page = encode_page(document, index)
    write_all({options.out: page})


def object_to_share(document: Document, number: int | None) -> int:
    """Return the index of object `number`, or of the first that is lifted. Raises UsageError."""
    objects = enumerate(document.objects)  # the page has one photo
    lifted = [k for k, item in objects if item.lifted is not None and not item.is_visitor]
    if document.plate is None or not lifted:
        raise UsageError("no object of the session is lifted, so there is nothing to drag")
    if number is None:
        return lifted[0]
    if number - 1 not in lifted:
        told = ", ".join(str(k + 1) for k in lifted)
        raise UsageError(f"--object must be the number of a lifted object: {told}")
    return number - 1
