"""What a script's objects leave behind: the plate of all, their old shadows and reflections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import compose, edits
from .compose.old_reflection import OldReflection
from .compose.old_shadow import OldShadow, traceless_plate
from .compose.old_traces import OldTraces, find_old_traces
from .compose.plate import build_plate, plate_cover
from .document import Document, EditObject, Matte
from .hint import Hint
from .progress import Progress
from .script import EditScript

USUAL_HINT = 0.03  # x the photo's diagonal, radius of a hint that says none


@dataclass(frozen=True, eq=False)
class LeftBehind:
    """A document with its plate, and what of the photo was taken along or off the ground."""

    document: Document
    notes: tuple[str, ...]  # a sentence for each


def with_plate(
    document: Document,
    script: EditScript,
    casting: frozenset[int],
    progress: Progress,
) -> LeftBehind:
    """The document with what is behind all its objects, filled in as the script's hints say.

    Those of the numbers in `casting` take their own shadow along.

    An object that has left its place takes its shadow off the ground, where that is sure. It, and
    every copy of it that is elsewhere, throws one like it. Its reflection goes, and none is drawn.
    """
    document = edits.set_hints(document, _hints(script, document.photo.size))
    covered, pixels = plate_cover(document), document.photo.pixels
    gone: list[OldShadow | OldReflection] = []
    notes: list[str] = []
    for matte in _distinct(document, casting):
        alike = [k for k in casting if document.objects[k].matte is matte]
        old = find_old_traces(pixels, matte, covered)
        for k in alike:
            if old.shadow is not None and document.objects[k].is_visible:
                document = edits.set_shadow(document, k, old.shadow.shadow)
        has_gone = not any(o.matte is matte and not has_left(o) for o in document.objects)
        if has_gone:
            gone += old.found
        notes += _notes(document.objects[alike[0]], old, has_gone)
    inpainter = compose.load(script.inpaint)
    if gone:
        plate = traceless_plate(
            pixels, covered, gone, inpainter, progress, script.seed, document.hints
        )
    else:
        plate = build_plate(pixels, covered, inpainter, progress, script.seed, document.hints)
    return LeftBehind(edits.set_plate(document, plate), tuple(notes))


def _notes(item: EditObject, old: OldTraces, has_gone: bool) -> list[str]:
    """What becomes of an object's traces in the photo, and how to refuse."""
    refuse = "--shadow none leaves the ground as it is in the photo"
    notes = []
    if old.shadow is not None:
        goes = "goes along with it" if item.is_visible else "is removed with it"
        goes = goes if has_gone else "is thrown by its copies, too"
        notes.append(f"the shadow found beside {item.name} {goes}; {refuse}")
    if old.reflection is not None and has_gone:
        notes.append(f"the reflection found below {item.name} is removed; {refuse}")
    return notes


def has_left(item: EditObject) -> bool:
    """Whether it is not where its shadow in the photo is: turned and bent it still stands there."""
    place = item.placement
    return not item.is_visible or place.move != (0, 0) or place.depth != 0 or place.scale != 1


def _hints(script: EditScript, size: tuple[int, int]) -> tuple[Hint, ...]:
    """From where the script has the background filled in, of a photo of `size` (w, h) px."""
    usual = USUAL_HINT * float(np.hypot(*size))
    return tuple(
        Hint(fill.source, fill.to, usual if fill.radius is None else fill.radius)
        for fill in script.fill_from
    )


def _distinct(document: Document, casting: frozenset[int]) -> list[Matte]:
    """Their mattes, each once: copies share theirs."""
    found: dict[int, Matte] = {}
    for k in sorted(casting):
        if (matte := document.objects[k].matte) is not None:
            found.setdefault(id(matte), matte)
    return list(found.values())
