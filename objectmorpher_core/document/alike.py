"""Whether two edits look the same: then a refinement of one is one of the other, too."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .model import Document, EditObject

# Of an object, what its picture depends on; what else changes leaves a refinement as it is.
SHOWN = (
    "mask", "coverage", "matte", "lifted", "pose", "placement", "is_visible", "layer", "shadow",
    "harmony", "relight", "grain", "defocus", "stays_in_front", "finish", "seen_from",
)  # fmt: skip


def is_shown_alike(one: EditObject, other: EditObject) -> bool:
    """Whether two objects look the same; arrays do only where they are one and the same."""

    def is_same(a: object, b: object) -> bool:
        is_plain = not isinstance(a, np.ndarray) and not isinstance(b, np.ndarray)
        return a is b or (is_plain and a == b)

    return all(is_same(getattr(one, name), getattr(other, name)) for name in SHOWN)


def show_the_same(one: Document, other: Document) -> bool:
    """Whether a refinement of one edit is one of the other, too."""
    if one.photo is not other.photo or one.plate is not other.plate:
        return False
    if (one.horizon, one.feather) != (other.horizon, other.feather):
        return False
    if one.depth is not other.depth or len(one.objects) != len(other.objects):
        return False
    return all(map(is_shown_alike, one.objects, other.objects))
