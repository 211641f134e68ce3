"""A document of a smaller photo: the same edit where fewer pixels will do, as in a video.

Only by whole numbers: then each new pixel is the mean of a square of old ones, in the photo, the
plate and the mattes alike, and what was aligned stays so.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..base.arrays import F32, Mask
from ..base.camera import Camera
from ..base.pixels import crop, pixels_from_unit, unit_pixels
from .model import Document, EditObject, Matte, Photo, Placement, Plate

Box = tuple[int, int, int, int]


def shrunk(document: Document, times: int) -> Document:
    """The document of its photo, `times` smaller in width and height. Whole squares are kept.

    Raises ValueError where no pixel would be left.
    """
    width, height = (side // times for side in document.photo.size)
    if times < 1 or width < 1 or height < 1:
        raise ValueError(f"a photo of {document.photo.size} px cannot be {times} times smaller")
    if times == 1:
        return document
    photo = document.photo
    pixels = photo.pixels[: height * times, : width * times]
    picture = replace(
        photo.picture, pixels=pixels_from_unit(_means(unit_pixels(pixels), times), pixels.dtype),
        alpha=None,
    )  # fmt: skip
    camera = _camera(photo.camera, times, width, height)
    return replace(
        document,
        photo=Photo(picture, camera, photo.source, photo.name),
        objects=tuple(_object(item, times, width, height) for item in document.objects),
        plate=None if document.plate is None else _plate(document.plate, times, picture.pixels),
        horizon=None if document.horizon is None else document.horizon / times,
    )


def _camera(camera: Camera, times: int, width: int, height: int) -> Camera:
    return Camera(camera.focal / times, camera.cx / times, camera.cy / times, width, height)


def _object(item: EditObject, times: int, width: int, height: int) -> EditObject:
    mask = item.mask
    if mask is not None:
        mask = _means(mask[: height * times, : width * times].astype(np.float32), times) > 0.5
    matte, lifted, placement = item.matte, item.lifted, item.placement
    if lifted is not None:
        texture = replace(lifted.texture, u0=lifted.texture.u0 / np.float32(times))
        lifted = replace(lifted, texture=texture, middle=None)
    return replace(
        item, mask=mask, coverage=None, found=None, lifted=lifted,
        matte=None if matte is None else _matte(matte, times), mixed=None, contaminated=None,
        placement=smaller(placement, times),
    )  # fmt: skip


def smaller(placement: Placement, times: int) -> Placement:
    """Return the same of a photo that is smaller by this factor."""
    x, y = placement.move
    return replace(placement, move=(x / times, y / times))


def _matte(matte: Matte, times: int) -> Matte:
    box = _aligned(matte.box, times)
    alpha = crop(matte.alpha, matte.box, box)
    inner = matte.box[1] - box[1], matte.box[0] - box[0]
    outer = box[3] - matte.box[3], box[2] - matte.box[2]
    edges = (inner[0], outer[0], inner[1], outer[1])
    foreground = cv2.copyMakeBorder(matte.foreground, *edges, cv2.BORDER_REPLICATE)
    own = _means(np.asarray(foreground * alpha[..., None], np.float32), times)
    small = _means(alpha, times)
    beyond = _means(np.asarray(foreground, np.float32), times)
    straight = np.where(small[..., None] > 0, own / np.maximum(small, 1e-6)[..., None], beyond)
    return Matte(box[0] // times, box[1] // times, small, straight)


def _plate(plate: Plate, times: int, photo: np.ndarray) -> Plate:
    """What is even in part invented is mixed so."""
    x0, y0, x1, y1 = _aligned(plate.box, times)
    height, width = photo.shape[:2]
    box = (max(x0, 0), max(y0, 0), min(x1, width * times), min(y1, height * times))
    own = plate.box
    clipped = (max(own[0], box[0]), max(own[1], box[1]), min(own[2], box[2]), min(own[3], box[3]))
    hole = crop(crop(plate.hole, own, clipped), clipped, box)
    share = _means(hole.astype(np.float32), times)[..., None]
    invented = unit_pixels(crop(plate.pixels, own, box)) * hole[..., None]
    left, top = box[0] // times, box[1] // times
    around = unit_pixels(photo[top : top + len(share), left : left + share.shape[1]])
    # Of a square that is invented in part the rest is the photo's; it holds the object there, so
    # that the invented part stands for all of it.
    mean = _means(np.asarray(invented, np.float32), times) / np.maximum(share, 1e-6)
    pixels = pixels_from_unit(np.where(share > 0, mean, around), plate.pixels.dtype)
    painted = None
    if plate.painted is not None:
        painted = _any(crop(plate.painted, own, box), times)
    return Plate(left, top, pixels, share[..., 0] > 0, plate.backend, plate.seed, painted)


def _aligned(box: Box, times: int) -> Box:
    """The smallest box around it whose sides lie between squares."""
    x0, y0, x1, y1 = box
    return (
        x0 // times * times,
        y0 // times * times,
        -(-x1 // times) * times,
        -(-y1 // times) * times,
    )


def _means(values: F32, times: int) -> F32:
    height, width = values.shape[:2]
    size = (width // times, height // times)
    return np.asarray(cv2.resize(values, size, interpolation=cv2.INTER_AREA), np.float32)


def _any(there: Mask, times: int) -> Mask:
    return _means(there.astype(np.float32), times) > 0
