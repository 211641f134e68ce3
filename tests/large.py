"""Photos of many megapixels, made by enlarging a small scene, and what their export costs.

`python -m tests.large 600 400 10` exports an edited photo of 6000 x 4000 px in a process of its
own and prints what came out as JSON: the memory of other tests must not count.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from time import perf_counter

import cv2
import numpy as np

from objectmorpher_core.base.arrays import Mask, Pixels, unit_pixels
from objectmorpher_core.base.camera import Camera
from objectmorpher_core.compose.composite import composite
from objectmorpher_core.compose.plate.plate import hole_margin
from objectmorpher_core.deform.puppet import puppet_of
from objectmorpher_core.document import edits
from objectmorpher_core.document.model import (
    GAUSSIANS,
    Document,
    EditObject,
    Matte,
    Photo,
    PhotoTexture,
    Placement,
    Plate,
    Pose,
)
from objectmorpher_core.pictures.image import Picture, encode_picture, read_picture
from objectmorpher_core.scripting.report import peak_memory_mb
from tests import shapes

ROWS = 500  # that are compared at a time: the tests need memory, too


def large_document(width: int, height: int, factor: int) -> Document:
    """An ellipse on a quarter of a photo of `factor` x (width, height) px, lifted, not moved."""
    inside = shapes.mask("disc", width, height)
    small = shapes.picture(inside)
    scene = shapes.lifted_scene(small, inside, GAUSSIANS)
    pixels = np.tile(small, (factor, factor, 1))
    lifted, texture = scene.lifted, scene.lifted.texture
    seen = PhotoTexture(texture.u0 * factor, texture.visibility, texture.solidity)
    item = EditObject("Object 1", mask=_enlarged(inside, factor).astype(bool))
    item = item.with_lifted(_matte(scene.matte, pixels, factor), replace(lifted, texture=seen))
    camera = Camera.from_fov(width * factor, height * factor)
    photo = Photo(Picture(pixels), camera, b"", "large.png")
    return replace(Document(photo, (item,)), plate=_plate(inside, factor))


def _enlarged(image: np.ndarray, factor: int, method: int = cv2.INTER_NEAREST) -> np.ndarray:
    height, width = image.shape[:2]
    size = (width * factor, height * factor)
    return cv2.resize(image.astype(np.float32), size, interpolation=method)


def _matte(small: Matte, pixels: Pixels, factor: int) -> Matte:
    x0, y0, x1, y1 = (factor * side for side in small.box)
    foreground = unit_pixels(pixels[y0:y1, x0:x1])
    return Matte(x0, y0, _enlarged(small.alpha, factor, cv2.INTER_LINEAR), foreground)


def _plate(inside: Mask, factor: int) -> Plate:
    """Plain grey."""
    height, width = inside.shape
    reach = round(hole_margin(width, height))
    hole = cv2.dilate(inside.astype(np.uint8), np.ones((2 * reach + 1,) * 2)) > 0
    grey = np.full((height * factor, width * factor, 3), 128, np.uint8)
    return Plate(0, 0, grey, _enlarged(hole, factor) > 0, "made")


def edited(document: Document) -> Document:
    """Bent at one end, moved and turned."""
    puppet = puppet_of(document.objects[0], document.photo.camera)
    points = puppet.deformer.points.copy()
    points[:, 1] -= 0.3 * np.maximum(points[:, 0], 0) ** 2
    document = edits.set_pose(document, 0, Pose(points, puppet.deformer.rest().rotations))
    width, height = document.photo.size
    move = (0.05 * width, 0.03 * height)
    return edits.set_placement(document, 0, Placement(move=move, turn=(10.0, 5.0, 20.0)))


def export_cost(document: Document) -> dict[str, float]:
    """Composites and encodes; what that took, and whether all is as it should be."""
    photo, before, start = document.photo.pixels, peak_memory_mb(), perf_counter()
    result = composite(document)
    drawn = perf_counter()
    data = encode_picture(replace(document.photo.picture, pixels=result.pixels), ".png")
    figures = {
        "before_mb": before,
        "peak_mb": peak_memory_mb(),
        "composite_s": round(drawn - start, 2),
        "encode_s": round(perf_counter() - drawn, 2),
        "file_mb": len(data) / 1e6,
        "changed": result.changed,
        "footprint": int(result.footprint.sum()),
    }
    stored = read_picture(data).pixels
    outside = misread = 0
    for top in range(0, len(photo), ROWS):
        part = slice(top, top + ROWS)
        is_changed = (result.pixels[part] != photo[part]).any(-1)
        outside += int((is_changed & ~result.footprint[part]).sum())
        misread += int((result.pixels[part] != stored[part]).any(-1).sum())
    return figures | {"outside": outside, "misread": misread}


if __name__ == "__main__":
    large = edited(large_document(*(int(argument) for argument in sys.argv[1:4])))
    print(json.dumps(export_cost(large)))
