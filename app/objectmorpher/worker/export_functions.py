"""Exports, in the worker process: what is written is encoded whole, and then replaces the file."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from objectmorpher_core.base.progress import Progress, part
from objectmorpher_core.document.model import Document, EditObject

from ..editor.export_plan import Plan, What

if TYPE_CHECKING:
    from objectmorpher_core.compose.layers import Layer
    from objectmorpher_core.pictures.image import Picture


def write_export(document: Document, plan: Plan, progress: Progress) -> None:
    """Renders what the plan asks for and writes it. Raises OutputError, ImageError."""
    from objectmorpher_core.base.files import make_folder, write_all

    progress(0.02, "drawing")
    if plan.is_folder:
        outputs = _layer_files(document, plan, progress)
        is_new = not plan.path.exists()
        try:
            make_folder(plan.path)
            write_all(outputs)
        except OSError:
            if is_new:
                with suppress(OSError):  # what the disk keeps, it keeps
                    plan.path.rmdir()
            raise
        return
    data = _encoded(document, plan, progress)
    progress(0.95, "writing")
    write_all({plan.path: data})


def _encoded(document: Document, plan: Plan, progress: Progress) -> bytes:
    from objectmorpher_core.pictures.image import encode_mask, encode_picture

    if plan.what is What.MASK:
        mask = document.objects[plan.object].mask
        assert mask is not None, "the window asks for one first"
        return encode_mask(mask)
    draw = part(progress, 0.05, 0.6)
    if plan.what is What.LAYERS:
        return _openraster(document, plan, draw)
    if plan.what is What.VIDEO:
        return _video(document, plan, part(progress, 0.02, 0.95))
    if plan.what is What.CUTOUT:
        picture = _cutout(document, document.objects[plan.object], draw)
    elif plan.what is What.BACKGROUND:
        picture = _background(document)
    elif plan.what is What.DEPTH:
        from objectmorpher_core.compose.depth_map import depth_picture

        picture = depth_picture(document, progress=draw)
    else:
        from objectmorpher_core.pipeline import export

        picture = export(document, progress=draw)
    progress(0.6, "encoding")
    return encode_picture(_with_bits(picture, plan.bits), plan.path.suffix, plan.quality,
                          webp_quality=plan.quality)  # fmt: skip


def _with_bits(picture: Picture, bits: int) -> Picture:
    """The picture with 8 or 16 bits a channel; 0 leaves them."""
    alpha = None if picture.alpha is None else _sampled(picture.alpha, bits)
    return replace(picture, pixels=_sampled(picture.pixels, bits), alpha=alpha)


def _sampled(samples: np.ndarray, bits: int) -> np.ndarray:
    """Samples of any shape with so many bits; 0 leaves them."""
    from objectmorpher_core.pictures.image import to_u8

    if bits == 8:
        return to_u8(samples)
    is_narrow = bits == 16 and samples.dtype == np.uint8
    return samples.astype(np.uint16) * np.uint16(257) if is_narrow else samples  # 255 -> 65535


def _background(document: Document) -> Picture:
    """The photo with its objects painted out."""
    from objectmorpher_core.compose.plate.plate import plate_picture

    pixels = document.photo.pixels if document.plate is None else plate_picture(document)
    return replace(document.photo.picture, pixels=pixels)


def _cutout(document: Document, thing: EditObject, progress: Progress) -> Picture:
    """One object alone where it is now, on nothing: straight colour and alpha."""
    from objectmorpher_core.compose.composite import composite, straight_cutout
    from objectmorpher_core.pictures.image import Picture

    photo = document.photo
    if thing.is_moved:
        objects = (replace(thing, is_visible=True),)
        alone = replace(document, objects=objects, plate=None, refined=None)
        result = composite(alone, progress=progress)
        samples = straight_cutout(result, photo.pixels.dtype, photo.size)
    else:
        samples = _unmoved(document, thing)
    return Picture(samples[..., :3], samples[..., 3], icc=photo.picture.icc)


def _unmoved(document: Document, thing: EditObject) -> np.ndarray:
    """(H, W, 4) an object as it is in the photo: by its matte, else by its mask."""
    from objectmorpher_core.base.pixels import crop, pixels_from_unit

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


def _openraster(document: Document, plan: Plan, progress: Progress) -> bytes:
    from objectmorpher_core.pictures.openraster import encode_openraster

    merged, pile = _layers(document, plan, progress)
    return encode_openraster(pile, merged)


def _video(document: Document, plan: Plan, progress: Progress) -> bytes:
    from objectmorpher_core.pictures.video import encode_video
    from objectmorpher_core.scripting.animation import Clip, frames

    clip = Clip(plan.motion.name.lower(), plan.seconds, object=plan.object)
    return encode_video(frames(document, clip, progress), clip.rate, plan.path.suffix)


def _layer_files(document: Document, plan: Plan, progress: Progress) -> dict[Path, bytes]:
    """The layers from below as large as the photo, and all together; numbered in that order."""
    from objectmorpher_core.base.pixels import crop
    from objectmorpher_core.pictures.image import Picture, encode_picture

    merged, pile = _layers(document, plan, part(progress, 0.05, 0.7))
    pile = [layer for layer in pile if layer.is_shown]
    height, width = merged.pixels.shape[:2]
    stem = Path(document.photo.name).stem
    outputs = {}
    for k, layer in enumerate(pile):
        progress(0.7 + 0.25 * k / len(pile), "encoding")
        samples = layer.pixels
        alpha = None
        if samples.shape[2] == 4:
            samples = crop(samples, layer.box, (0, 0, width, height))
            alpha = samples[..., 3]
        name = re.sub(r"[^\w-]+", "-", layer.name).strip("-").lower() or "object"
        data = encode_picture(Picture(samples[..., :3], alpha, icc=merged.icc), ".png")
        outputs[plan.path / f"{stem}-{k}-{name}.png"] = data
    outputs[plan.path / f"{stem}-{len(pile)}-composite.png"] = encode_picture(merged, ".png")
    return outputs


def _layers(document: Document, plan: Plan, progress: Progress) -> tuple[Picture, list[Layer]]:
    """The edited photo and its layers from below, with the bits that are wanted."""
    from objectmorpher_core.compose.layers import layers

    result, pile = layers(document, progress)
    merged = replace(document.photo.picture, pixels=result.pixels)
    deep = [replace(layer, pixels=_sampled(layer.pixels, plan.bits)) for layer in pile]
    return _with_bits(merged, plan.bits), deep
