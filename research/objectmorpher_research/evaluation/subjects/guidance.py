"""The guidance of an edit: as arrows over the photo, as words, and as our own edit script."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from objectmorpher_core.pictures.image import ImageError, read_picture
from objectmorpher_core.scripting.options import NORMAL, XY, EditScript, ScriptError
from objectmorpher_core.scripting.script import BatchItem, beside, parse_scripts

from ..error import EvaluationError

Arrow = tuple[XY, XY]  # px of the image, from -> to
TEXT = "text"  # key of guidance.json beside those of an edit script


@dataclass(frozen=True)
class EditGuidance:
    """An edit that is asked of every method."""

    arrows: tuple[Arrow, ...] = ()
    words: str = ""
    picture: Path | None = None  # one that shows it, in place of the arrows
    item: BatchItem | None = None  # the same for `objectmorpher edit`
    reason: str = "there is no guidance.json"  # why there is no `item`

    @property
    def is_shown(self) -> bool:
        """Return whether it shows a person what is wanted."""
        return bool(self.arrows or self.words or self.picture)


def read_guidance(path: Path) -> EditGuidance:
    """Read a JSON file: an edit script, whose files are beside it, and perhaps a "text".

    Raises EvaluationError: one sentence.
    """
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        text = said.pop(TEXT, "") if isinstance(said, dict) else ""
        (item,) = parse_scripts(json.dumps(said))
    except (OSError, ValueError, RecursionError) as error:
        told = str(error) if isinstance(error, ScriptError) else "it is no JSON object"
        raise EvaluationError(f"{path}: {told}") from error
    if not isinstance(text, str):
        raise EvaluationError(f"{path}: {TEXT!r} is no text")
    return from_item(beside(item, path.parent), text)


def from_item(item: BatchItem, text: str = "") -> EditGuidance:
    """Read an edit script; without a `text` its placement is put into words."""
    words = text or " ".join(filter(None, _sentences(item)))
    arrows = tuple(arrow for script in _scripts(item) for arrow in arrows_of(script))
    return EditGuidance(arrows, words.strip(), item=item, reason="")


def arrows_of(script: EditScript) -> tuple[Arrow, ...]:
    """The drags of its handles, and the way that the whole object is to go in the picture."""
    arrows = [(handle.at, handle.to) for handle in script.handle]
    middle = _middle(script)
    if script.move is not None and middle is not None and any(script.move[:2]):
        (x, y), (dx, dy, _) = middle, script.move
        arrows.append((middle, (x + dx, y + dy)))
    return tuple(arrows)


def _sentences(item: BatchItem) -> Iterator[str]:
    yield words_of(item.script)
    for further in item.others.objects:
        if further.duplicate is None:
            yield words_of(further.script)
        else:
            yield "Add a copy of the object."
            yield words_of(further.script, "the copy")


def words_of(script: EditScript, thing: str = "the object") -> str:
    """Return how a whole thing is placed and finished, for someone who looks at the photo."""
    if script.remove:
        return f"Remove {thing}."
    told = []
    if script.move is not None:
        dx, dy, dz = script.move
        if any((dx, dy)) and _middle(script) is not None:
            told.append("along the arrow")
        else:
            told += _way(dx, "to the right", "to the left", " px")
            told += _way(dy, "down", "up", " px")
        told += _way(dz, "diameters away", "diameters nearer", "")
    told = [f"move {thing} " + " and ".join(told)] if told else []
    # A positive spin or yaw takes what faces us to the left.
    sideways = "so that its front goes left", "so that its front goes right", "°"
    told += [f"turn it where it stands by {way}" for way in _way(script.spin, *sideways)]
    if script.turn is not None:
        yaw, pitch, roll = script.turn
        turned = _way(yaw, *sideways)
        turned += _way(pitch, "so that its top comes nearer", "so that its top goes away", "°")
        turned += _way(roll, "clockwise", "anticlockwise", "°")
        told += ["turn it by " + " and by ".join(turned)] if turned else []
    if script.scale is not None and script.scale != 1:
        told.append(f"scale it to {script.scale:.0%} of its size")
    sentence = ", ".join([*told, *_finish(script)])
    return sentence[:1].upper() + sentence[1:] + "." if sentence else ""


def _finish(script: EditScript) -> Iterator[str]:
    """What is done to its colours, in words."""
    if script.opacity != 1:
        yield f"make it {100 * script.opacity:g}% opaque"
    stops = "stop" if abs(script.exposure) == 1 else "stops"
    for way in _way(script.exposure, "brighter", "darker", f" {stops}"):
        yield f"make it {way}"
    for way in _way(100 * script.warmth, "warmer", "cooler", "%"):
        yield f"make its colours {way}"
    for way in _way(100 * (script.saturation - 1), "stronger", "weaker", "%"):
        yield f"make its colours {way}"
    if script.sharpness:
        yield f"sharpen it by {100 * script.sharpness:g}%"
    if script.blur:
        yield f"blur it by {script.blur:g} px"
    if script.blend_mode != NORMAL:
        yield f"mix it with what is behind it ({script.blend_mode})"


def _middle(script: EditScript) -> XY | None:
    """Where the object is, as far as the script says; px."""
    if script.mask is not None:
        try:
            ys, xs = np.nonzero(read_picture(Path(script.mask).read_bytes()).pixels[..., 0])
        except (OSError, ImageError) as error:
            raise EvaluationError(f"the mask {script.mask} cannot be read: {error}") from error
        return ((xs.min() + xs.max() + 1) / 2, (ys.min() + ys.max() + 1) / 2) if len(xs) else None
    if script.box is not None:
        x0, y0, x1, y1 = script.box
        return (x0 + x1) / 2, (y0 + y1) / 2
    return script.click[0] if script.click else None


def _way(value: float, more: str, less: str, unit: str) -> list[str]:
    return [f"{abs(value):g}{unit} {more if value > 0 else less}"] if value else []


def _scripts(item: BatchItem) -> tuple[EditScript, ...]:
    return item.script, *(further.script for further in item.others.objects)
