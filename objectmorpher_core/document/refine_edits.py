"""What is changed about the refinement of an edit, as pure functions Document -> Document."""

from __future__ import annotations

from dataclasses import replace

from .edits import EditError
from .model import Document, is_shown_alike
from .refinement import Refined


def set_refined(document: Document, refined: Refined | None) -> Document:
    """The edit as a refiner made it look; None: as it was put together."""
    changed = replace(document, refined=refined)
    if refined is not None:
        return changed.with_backend("refine", refined.backend)
    others = tuple((stage, name) for stage, name in document.backends if stage != "refine")
    return replace(changed, backends=others)


def set_strength(document: Document, strength: float) -> Document:
    """How much of the refinement is shown, in [0, 1]."""
    if not 0 <= strength <= 1:
        raise EditError(f"a strength of {strength:g} is not between 0 and 1")
    if document.refined is None:
        raise EditError("the edit is not refined")
    return replace(document, refined=replace(document.refined, strength=float(strength)))


def show_the_same(one: Document, other: Document) -> bool:
    """Whether a refinement of one edit is one of the other, too."""
    if one.photo is not other.photo or one.plate is not other.plate:
        return False
    if (one.horizon, one.feather) != (other.horizon, other.feather):
        return False
    if len(one.objects) != len(other.objects):
        return False
    return all(map(is_shown_alike, one.objects, other.objects))
