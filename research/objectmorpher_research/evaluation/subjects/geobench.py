"""GeoBench's folders (FreeFine, arXiv 2507.23300): annotations.json, and pictures beside it:

    {PHOTO: {"instances": {OBJECT: {EDIT: {"ori_img_path", "ori_mask_path", "edit_param",
                                           "edit_prompt", ...}}}}}

edit_param is dx, dy, dz, rx, ry, rz, sx, sy, sz: px of the picture at 512 x 512 px, degrees, and
shares of the size, about the middle of the mask's box; positive rz is clockwise in the picture. The
paths are those of its authors' disks: the end of each that exists below the folder is taken. An
edit out of the picture's plane has no published signs: it is shown, and our program is not told it.
"""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from objectmorpher_core.pictures.image import ImageError, read_picture
from objectmorpher_core.scripting.options import EditScript
from objectmorpher_core.scripting.script import BatchItem

from ..error import EvaluationError
from .guidance import EditGuidance, from_item
from .subject import EvaluatedEdit

ANNOTATIONS = "annotations.json"
SIDE = 512  # px of the pictures that edit_param means
NUMBERS = 9


def subjects(folder: Path) -> tuple[EvaluatedEdit, ...]:
    """Return all edits of the annotations, if there are any. Raises EvaluationError."""
    path = folder / ANNOTATIONS
    if not path.is_file():
        return ()
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        edits = [
            (f"{photo}/{thing}/{edit}", told)
            for photo, entry in data.items()
            for thing, edits in entry["instances"].items()
            for edit, told in edits.items()
        ]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise EvaluationError(
            f"{path} is not GeoBench's: instances of edits are missing"
        ) from error
    sizes: dict[Path, tuple[int, int]] = {}
    return tuple(_subject(folder, name, told, sizes) for name, told in edits)


def _subject(
    folder: Path, name: str, told: Any, sizes: dict[Path, tuple[int, int]]
) -> EvaluatedEdit:
    if not isinstance(told, dict) or ".." in PurePosixPath(name).parts:
        raise EvaluationError(f"{folder / ANNOTATIONS}: {name} is no edit")
    image = _below(folder, told.get("ori_img_path"), name)
    mask = _below(folder, told.get("ori_mask_path"), name)
    if image not in sizes:
        sizes[image] = _size(image)
    words = told.get("edit_prompt", "")
    guidance = _guidance(_numbers(folder, name, told), mask, sizes[image])
    if isinstance(words, str) and words:
        guidance = replace(guidance, words=words)
    return EvaluatedEdit(name, image, guidance)


def _guidance(numbers: list[float], mask: Path, size: tuple[int, int]) -> EditGuidance:
    dx, dy, dz, rx, ry, rz, sx, sy, _ = numbers
    if dz or rx or ry:
        return EditGuidance(
            reason="it is out of the picture's plane, and its signs are not published"
        )
    if not math.isclose(sx, sy):
        return EditGuidance(reason="it stretches the object along the picture's axes")
    if sx <= 0:
        return EditGuidance(reason="its scale is not above zero")
    script = EditScript(mask=str(mask))
    if dx or dy:
        script = replace(script, move=(dx * size[0] / SIDE, dy * size[1] / SIDE, 0.0))
    if rz:
        script = replace(script, turn=(0.0, 0.0, rz))
    if sx != 1:
        script = replace(script, scale=sx)
    return from_item(BatchItem(script))


def _numbers(folder: Path, name: str, told: dict[str, Any]) -> list[float]:
    numbers = told.get("edit_param")
    is_list = isinstance(numbers, list) and len(numbers) == NUMBERS
    if not is_list or not all(
        isinstance(n, int | float) and not isinstance(n, bool) and math.isfinite(n)
        for n in numbers  # type: ignore[union-attr]
    ):
        raise EvaluationError(f"{folder / ANNOTATIONS}: edit_param of {name} is not 9 numbers")
    return [float(n) for n in numbers]  # type: ignore[union-attr]


def _below(folder: Path, named: Any, name: str) -> Path:
    """The file whose path ends as `named` does, inside the folder."""
    parts = PurePosixPath(named).parts if isinstance(named, str) else ()
    if ".." not in parts:
        for k in range(len(parts)):
            path = folder.joinpath(*(part for part in parts[k:] if part != "/"))
            if path.is_file():
                return path
    raise EvaluationError(f"{folder} has not the file {named!r} of {name}")


def _size(image: Path) -> tuple[int, int]:
    """Width and height, px."""
    try:
        height, width = read_picture(image.read_bytes()).pixels.shape[:2]
    except ImageError as error:
        raise EvaluationError(f"{image}: {error}") from error
    return width, height
