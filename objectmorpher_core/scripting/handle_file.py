"""The handles of an edit as a small JSON file: where they are, for other programs to move them.

    {"camera": {"focal", "cx", "cy"}, "size": [width, height],
     "objects": [{"number", "name", "handles": [{"is_pin", "place": [x, y, z]}]}]}

Places are of the world: the axes of the photo's camera, x to the right, y down, z forward, in the
units in which `--save-mesh` writes the object (docs/formats.md).
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..deform.puppet import puppet_of
from ..document import edits
from ..document.model import Document, EditObject
from .options import ScriptError

MOST_BYTES = 1 << 20
NEAR = 1e-9  # object diameters: a handle that was moved less stays as it is


def encode_handles(document: Document) -> bytes:
    """Return the file of all handles of the lifted objects, where they are now."""
    camera = document.photo.camera
    objects = []
    for k, item in enumerate(document.objects):
        if item.lifted is None:
            continue
        motion = _motion(document, item)
        handles = [
            {"is_pin": handle.is_pin, "place": _moved(motion, handle.target).tolist()}
            for handle in item.handles
        ]
        objects.append({"number": k + 1, "name": item.name, "handles": handles})
    told = {
        "camera": {"focal": camera.focal, "cx": camera.cx, "cy": camera.cy},
        "size": list(document.photo.size), "objects": objects,
    }  # fmt: skip
    return json.dumps(told, indent=1).encode() + b"\n"


def with_handles(document: Document, data: bytes) -> Document:
    """Return the document with its handles where the file has them, and its objects bent so.

    Raises ScriptError for a file that is not of the document's objects and handles.
    """
    for index, places in _places(data).items():
        if not 0 <= index < len(document.objects) or document.objects[index].lifted is None:
            raise ScriptError(f"the handles are of object {index + 1}, which has no shape here")
        item = document.objects[index]
        if len(places) != len(item.handles):
            raise ScriptError(
                f"object {index + 1} has {len(item.handles)} handles, and {len(places)} are given"
            )
        document = _bent(document, index, places)
    return document


def _bent(document: Document, k: int, places: F64) -> Document:
    item = document.objects[k]
    lifted = item.lifted
    assert lifted is not None, "the caller checks"
    back: F64 = np.linalg.inv(_motion(document, item)).astype(np.float64)
    is_moved = False
    for h, (handle, place) in enumerate(zip(item.handles, places, strict=True)):
        target = _moved(back, place)
        if np.linalg.norm(target - handle.target) > NEAR * lifted.diameter:
            document, is_moved = edits.move_handle(document, k, h, target), True
    if not is_moved:
        return document
    item = document.objects[k]
    deformer = puppet_of(item, document.photo.camera).deformer
    return edits.set_pose(document, k, deformer.solve(item.handles, item.footing).pose)


def _motion(document: Document, item: EditObject) -> F64:
    """(4, 4) world from object, where the object is placed."""
    lifted = item.lifted
    assert lifted is not None, "the caller checks"
    return item.placement.matrix(lifted, document.photo.camera) @ lifted.world_from_object


def _moved(motion: F64, point: np.ndarray) -> F64:
    return motion[:3, :3] @ point + motion[:3, 3]


def _places(data: bytes) -> dict[int, F64]:
    """(H, 3) the handles' places by the object's index. Raises ScriptError."""
    try:
        told: Any = json.loads(data) if len(data) <= MOST_BYTES else None
        found = {
            int(thing["number"]) - 1: np.array(
                [handle["place"] for handle in thing["handles"]], np.float64
            ).reshape(len(thing["handles"]), 3)
            for thing in told["objects"]
        }
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ScriptError("this is not a file of handles such as --save-handles writes") from error
    if not all(np.isfinite(places).all() for places in found.values()):
        raise ScriptError("a place of a handle is not finite")
    return found
