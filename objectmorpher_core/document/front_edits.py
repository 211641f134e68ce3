"""Changes of what stays in front of the edited objects, as it stands in the photo."""

from __future__ import annotations

from dataclasses import replace

from .edits import EditError
from .model import Document, Matte


def keep_in_front(document: Document, k: int, matte: Matte | None = None) -> Document:
    """Object `k` is not edited: it covers what is, by its `matte`, as it stands in the photo.

    The matte may come later. Raises EditError where nothing is selected, or it was moved.
    """
    item = document.objects[k]
    if item.mask is None:
        raise EditError("nothing is selected that could stay in front")
    if item.is_moved:
        raise EditError("what was moved cannot stay where it is")
    kept = replace(item, matte=matte or item.matte, stays_in_front=True)
    return document.with_object(k, kept)


def let_go(document: Document, k: int) -> Document:
    """Object `k` does not stay in front any more."""
    item = replace(document.objects[k], stays_in_front=False)
    return document.with_object(k, item if item.lifted else replace(item, matte=None))
