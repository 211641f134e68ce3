"""OpenRaster files (.ora): layers that GIMP, Krita and MyPaint open.

https://www.freedesktop.org/wiki/Specifications/OpenRaster/: a zip of one PNG a layer, what they
look like together, and a list of them in XML.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np

from ..compose.layers import Layer
from ..document.bounds import MULTIPLY, NORMAL, SCREEN, SOFT_LIGHT
from .image import Picture, at_most, encode_picture, to_u8

ENDING = ".ora"
MIME = "image/openraster"
VERSION = "0.0.6"
THUMBNAIL = 256  # px, its longer side
TRANSPARENCY = "Photo, transparency"
INSIDE = "svg:dst-in"  # how a layer lies on those below
MIXED = {
    NORMAL: "svg:src-over", MULTIPLY: "svg:multiply", SCREEN: "svg:screen",
    SOFT_LIGHT: "svg:soft-light",
}  # fmt: skip
BORN = (1980, 1, 1, 0, 0, 0)  # of all that is in the file: two exports are alike, byte for byte


def encode_openraster(layers: Sequence[Layer], merged: Picture) -> bytes:
    """The file of `layers` from below, which together look like `merged`.

    Where `merged` is not opaque, a last layer cuts out what is under it (`svg:dst-in`).
    """
    height, width = merged.pixels.shape[:2]
    pile = [(layer, MIXED[layer.mode]) for layer in layers]
    if merged.alpha is not None:
        solid = np.dstack([np.zeros_like(merged.pixels), merged.alpha])
        pile.append((Layer(TRANSPARENCY, solid), INSIDE))
    root = ElementTree.Element("image", version=VERSION, w=str(width), h=str(height))
    stack = ElementTree.SubElement(root, "stack")
    files: dict[str, bytes] = {}
    for number, (layer, how) in reversed(list(enumerate(pile))):  # the uppermost is named first
        name = f"data/layer{number}.png"
        files[name] = encode_picture(_picture(layer, merged), ".png")
        ElementTree.SubElement(
            stack, "layer", {
                "name": _printable(layer.name), "src": name,
                "x": str(layer.left), "y": str(layer.top), "opacity": "1.0",
                "visibility": "visible" if layer.is_shown else "hidden", "composite-op": how,
            },
        )  # fmt: skip
    listed = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_STORED) as archive:  # pictures are packed already
        _add(archive, "mimetype", MIME.encode())  # first, and not packed: the kind is read off it
        _add(archive, "stack.xml", listed)
        for name, data in sorted(files.items()):
            _add(archive, name, data)
        _add(archive, "mergedimage.png", encode_picture(merged, ".png"))
        _add(archive, "Thumbnails/thumbnail.png", encode_picture(_thumbnail(merged), ".png"))
    return out.getvalue()


def _picture(layer: Layer, merged: Picture) -> Picture:
    alpha = layer.pixels[..., 3] if layer.pixels.shape[2] == 4 else None
    return Picture(layer.pixels[..., :3], alpha, icc=merged.icc)


def _printable(name: str) -> str:
    """XML cannot hold the rest."""
    return "".join(letter for letter in name if letter.isprintable())


def _thumbnail(merged: Picture) -> Picture:
    alpha = None if merged.alpha is None else at_most(to_u8(merged.alpha), THUMBNAIL)
    return Picture(at_most(to_u8(merged.pixels), THUMBNAIL), alpha, icc=merged.icc)


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    archive.writestr(zipfile.ZipInfo(name, BORN), data)
