"""DragBench's folders (Shi et al., DragDiffusion, arXiv 2306.14435): CATEGORY/NAME/ with

    original_image.png
    meta_data.pkl       a dict: "prompt", "points" [x, y] px, handle and target in turn, and
                        "mask" (H, W), where the picture may change

The pickle's plain values are read without unpickling it (`plain_pickle`). Its mask is where a
method may change the picture and no outline of an object: our own program is told clicks, where
the drags begin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from objectmorpher_core.scripting.options import XY, EditScript, HandleMove
from objectmorpher_core.scripting.script import BatchItem

from ..error import EvaluationError
from .guidance import EditGuidance, from_item
from .plain_pickle import read_plain
from .subject import EvaluatedEdit

IMAGE, META = "original_image.png", "meta_data.pkl"


def subjects(folder: Path) -> tuple[EvaluatedEdit, ...]:
    """Return all samples below the folder, if it is such a folder. Raises EvaluationError."""
    found = []
    for depth in ("*", "*/*"):
        for meta in sorted(folder.glob(f"{depth}/{META}")):
            image = meta.with_name(IMAGE)
            if not image.is_file():
                raise EvaluationError(f"{meta.parent} has no {IMAGE}")
            name = meta.parent.relative_to(folder).as_posix()
            found.append(EvaluatedEdit(name, image, _guidance(meta)))
    return tuple(found)


def _guidance(path: Path) -> EditGuidance:
    try:
        meta = read_plain(path.read_bytes())
        if not isinstance(meta, dict):
            raise EvaluationError("it is no table of values")
        points = [_point(value) for value in meta.get("points", ())]
    except (EvaluationError, TypeError) as error:
        told = error if isinstance(error, EvaluationError) else "its points are none"
        raise EvaluationError(f"{path}: {told}") from error
    if not points or len(points) % 2:
        raise EvaluationError(f"{path}: it has {len(points)} points, not a start and an end each")
    drags = tuple(HandleMove(a, b) for a, b in zip(points[::2], points[1::2], strict=True))
    script = EditScript(click=tuple(drag.at for drag in drags), handle=drags)
    return from_item(BatchItem(script))


def _point(value: Any) -> XY:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if not isinstance(value, Sequence) or len(value) != 2:
        raise EvaluationError("its points are none")
    try:
        x, y = (float(v) for v in value)
    except (TypeError, ValueError, OverflowError):
        raise EvaluationError("its points are none") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise EvaluationError("its points are none")
    return x, y
