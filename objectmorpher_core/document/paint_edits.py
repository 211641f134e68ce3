"""Painting on an object, as pure functions Document -> Document."""

from __future__ import annotations

from dataclasses import replace

from .model import Document, Matte


def set_painted(document: Document, k: int, matte: Matte) -> Document:
    """Object `k` with other paint on its `matte`, see `compose.paint`."""
    return document.with_object(k, replace(document.objects[k], matte=matte))


def without_paint(document: Document, k: int) -> Document:
    """Object `k` without any paint."""
    matte = document.objects[k].matte
    assert matte is not None, "only what is lifted is painted on"
    return set_painted(document, k, replace(matte, paint=None))
