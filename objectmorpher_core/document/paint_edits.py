"""Painting on an object, as pure functions Document -> Document."""

from __future__ import annotations

from dataclasses import replace

from .model import Document
from .paint import Paint


def set_paint(document: Document, k: int, paint: Paint | None) -> Document:
    """Object `k` with other paint on it, or none."""
    item = document.objects[k]
    assert item.matte is not None, "only what is lifted is painted on"
    return document.with_object(k, replace(item, matte=replace(item.matte, paint=paint)))
