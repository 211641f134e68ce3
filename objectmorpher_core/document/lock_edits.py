"""Locking an object against changes by a slip, as pure functions Document -> Document."""

from __future__ import annotations

from dataclasses import fields, replace

from .model import Document, EditObject

OF_A_ROW = ("name", "is_visible", "is_locked", "layer")  # what also a locked object may change in
KEPT = tuple(f.name for f in fields(EditObject) if f.name not in OF_A_ROW)


def set_locked(document: Document, k: int, is_locked: bool) -> Document:
    """Object `k` kept from changes by a slip, or free to be changed."""
    return document.with_object(k, replace(document.objects[k], is_locked=is_locked))


def locked_change(before: Document, after: Document) -> EditObject | None:
    """The locked object of `before` that is changed or gone in `after`, if there is one.

    Its name, whether it is shown, and which others it covers are not kept from change.
    """
    locked = (own for own in before.objects if own.is_locked)
    return next((own for own in locked if not any(_is_same(own, o) for o in after.objects)), None)


def _is_same(one: EditObject, other: EditObject) -> bool:
    """Whether they differ at most in what also a locked object may change in."""
    return one is other or all(getattr(one, name) is getattr(other, name) for name in KEPT)
