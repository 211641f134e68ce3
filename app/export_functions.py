"""Exports, in the worker process: what is written is encoded whole, and then replaces the file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.document import Document, EditObject
from objectmorpher_core.progress import Progress, part

from .export_plan import Plan, What

if TYPE_CHECKING:
    from objectmorpher_core.compose.composite import Composite
    from objectmorpher_core.image import Picture


def write_export(document: Document, plan: Plan, progress: Progress) -> None:
    """Renders what the plan asks for and writes it. Raises OutputError, ImageError."""
    from objectmorpher_core.files import write_all

    progress(0.02, "drawing")
    if plan.what is What.LAYERS:
        outputs = _layers(document, plan, progress)
        is_new = not plan.path.exists()
        try:
            plan.path.mkdir(exist_ok=True)
            write_all(outputs)
        except OSError:
            if is_new and plan.path.is_dir():
                plan.path.rmdir()
            raise
        return
    data = _encoded(document, plan, progress)
    progress(0.95, "writing")
    write_all({plan.path: data})


def _encoded(document: Document, plan: Plan, progress: Progress) -> bytes:
    from objectmorpher_core.image import encode_mask, encode_picture

    if plan.what is What.MASK:
        mask = document.objects[plan.object].mask
        assert mask is not None, "the window asks for one first"
        return encode_mask(mask)
    draw = part(progress, 0.05, 0.6)
    if plan.what is What.CUTOUT:
        picture = _cutout(document, document.objects[plan.object], draw)
    elif plan.what is What.BACKGROUND:
        picture = _background(document)
    else:
        from objectmorpher_core.pipeline import export

        picture = export(document, progress=draw)
    progress(0.6, "encoding")
    return encode_picture(_with_bits(picture, plan.bits), plan.path.suffix, plan.quality,
                          webp_quality=plan.quality)  # fmt: skip


def _with_bits(picture: Picture, bits: int) -> Picture:
    """The picture with 8 or 16 bits a channel; 0 leaves them."""
    from objectmorpher_core.image import to_u8

    def turned(samples: np.ndarray) -> np.ndarray:
        if bits == 8:
            return to_u8(samples)
        is_narrow = bits == 16 and samples.dtype == np.uint8
        return samples.astype(np.uint16) * np.uint16(257) if is_narrow else samples  # 255 -> 65535

    alpha = None if picture.alpha is None else turned(picture.alpha)
    return replace(picture, pixels=turned(picture.pixels), alpha=alpha)


def _background(document: Document) -> Picture:
    """The photo with its objects painted out."""
    from objectmorpher_core.compose.plate import plate_picture

    pixels = document.photo.pixels if document.plate is None else plate_picture(document)
    return replace(document.photo.picture, pixels=pixels)


def _cutout(document: Document, thing: EditObject, progress: Progress) -> Picture:
    """One object alone where it is now, on nothing: straight colour and alpha."""
    from objectmorpher_core.compose.composite import composite, straight_cutout
    from objectmorpher_core.image import Picture

    photo = document.photo
    if thing.is_moved:
        alone = replace(document, objects=(replace(thing, is_visible=True),), plate=None)
        result = composite(alone, progress=progress)
        samples = straight_cutout(result, photo.pixels.dtype, photo.size)
    else:
        samples = _unmoved(document, thing)
    return Picture(samples[..., :3], samples[..., 3], icc=photo.picture.icc)


def _unmoved(document: Document, thing: EditObject) -> np.ndarray:
    """(H, W, 4) an object as it is in the photo: by its matte, else by its mask."""
    from objectmorpher_core.pixels import crop, pixels_from_unit

    pixels = document.photo.pixels
    height, width = pixels.shape[:2]
    if thing.matte is None:
        assert thing.mask is not None, "the window asks for one first"
        alpha = thing.mask * np.array(np.iinfo(pixels.dtype).max, pixels.dtype)
        return np.dstack([pixels, alpha])
    matte = thing.matte
    box = (max(matte.left, 0), max(matte.top, 0), min(matte.box[2], width),
           min(matte.box[3], height))  # fmt: skip
    soft = np.dstack([crop(matte.foreground, matte.box, box), crop(matte.alpha, matte.box, box)])
    soft[soft[..., 3] <= 0] = 0
    samples = np.zeros((height, width, 4), pixels.dtype)
    samples[box[1] : box[3], box[0] : box[2]] = pixels_from_unit(soft, pixels.dtype)
    return samples


def _layers(document: Document, plan: Plan, progress: Progress) -> dict[Path, bytes]:
    """Background, the objects from back to front, and all together; numbered in that order."""
    from objectmorpher_core.compose.composite import composite
    from objectmorpher_core.image import encode_picture

    result = composite(document, progress=part(progress, 0.05, 0.3))
    shown = [thing for thing in _back_to_front(document, result) if thing.is_visible]
    layers: list[tuple[str, Picture]] = [("background", _background(document))]
    for k, thing in enumerate(shown):
        progress(0.3 + 0.4 * k / len(shown), "drawing")
        name = re.sub(r"[^\w-]+", "-", thing.name).strip("-").lower() or "object"
        layers.append((name, _cutout(document, thing, part(progress, 0.3, 0.3))))
    layers.append(("composite", replace(document.photo.picture, pixels=result.pixels)))
    stem = Path(document.photo.name).stem
    outputs = {}
    for k, (name, picture) in enumerate(layers):
        progress(0.7 + 0.25 * k / len(layers), "encoding")
        data = encode_picture(_with_bits(picture, plan.bits), ".png")
        outputs[plan.path / f"{stem}-{k}-{name}.png"] = data
    return outputs


def _back_to_front(document: Document, result: Composite) -> list[EditObject]:
    """The moved objects as they are drawn, over those that are as in the photo."""
    moved = [thing.item for thing in result.moved]
    still = [o for o in document.objects if o.mask is not None and not o.is_moved]
    return still + moved
