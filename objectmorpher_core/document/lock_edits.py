"""Locking an object against changes by a slip, as pure functions Document -> Document."""

from __future__ import annotations

from dataclasses import replace

from .model import Document, EditObject

OF_A_ROW = ("name", "is_visible", "is_locked", "layer")  # what also a locked object may change in


def set_locked(document: Document, k: int, is_locked: bool) -> Document:
    """Object `k` kept from changes by a slip, or free to be changed."""
    return document.with_object(k, replace(document.objects[k], is_locked=is_locked))


def locked_change(before: Document, after: Document) -> EditObject | None:
    """The locked object of `before` that is changed or gone in `after`, if there is one.

    Its name, whether it is shown, and which others it covers are not kept from change.
    """
    free = {name: None for name in OF_A_ROW}

    def is_kept(own: EditObject) -> bool:
        kept = vars(own) | free
        return any(
            other is own or all(value is now[name] for name, value in kept.items())
            for other in after.objects
            if (now := vars(other) | free)
        )

    locked = (own for own in before.objects if own.is_locked)
    return next((own for own in locked if not is_kept(own)), None)
