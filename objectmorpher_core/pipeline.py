"""The main job without a window: a photo and what to do with it -> pictures and a report.

`open_photo`, `segment_photo`, `lift_mask`, `make_plate` are the costly stages, with plain
arguments and answers so that a worker process can run them; `run_script` strings them together
as the command line does.
"""

from __future__ import annotations

import numpy as np

from . import compose, lift, segment
from .arrays import Mask, Pixels
from .camera import Camera
from .compose.composite import hole_margin
from .document import Document, LiftedObject, Matte, Photo, Plate, Prompt
from .image import ImageError, read_picture, to_u8
from .lift import GAUSSIANS
from .progress import Progress, part, silent
from .segment.matte import band_width, build_matte

MATTE_MARGIN = 4.0  # x the matte's band, kept around the object in the crop
PLATE_CONTEXT = 1.0  # x the hole's longer side, kept around it for the inpainter to copy from
LEAST_CONTEXT = 64  # px


def open_photo(data: bytes, name: str, fov: float | None = None, seed: int = 0) -> Document:
    """A fresh document from the bytes of a picture file.

    The camera comes from `fov` (degrees, horizontal), else from EXIF's 35-mm focal length, else
    it is 50 degrees. Raises ImageError.
    """
    picture = read_picture(data)
    height, width = picture.pixels.shape[:2]
    if fov is not None:
        try:
            camera = Camera.from_fov(width, height, fov)
        except ValueError as error:
            raise ImageError(str(error)) from error
    elif picture.focal_35mm:
        camera = Camera.from_focal_35mm(width, height, picture.focal_35mm)
    else:
        camera = Camera.from_fov(width, height)
    return Document(Photo(picture, camera, data, name), seed=seed)


def segment_photo(
    pixels: Pixels,
    prompt: Prompt,
    backend: str = "auto",
    progress: Progress = silent,
    seed: int = 0,
) -> tuple[Mask, str]:
    """The mask (H, W) that `prompt` means, and the backend that found it."""  # fmt: skip
    segmenter = segment.load(backend)
    rgb = to_u8(pixels)
    embedding = segmenter.encode(rgb, part(progress, 0.0, 0.6))
    mask = segmenter.segment(rgb, prompt, embedding, part(progress, 0.6, 1.0), seed)
    return mask, segmenter.name


def lift_mask(
    pixels: Pixels,
    camera: Camera,
    mask: Mask,
    backend: str = "auto",
    count: int = GAUSSIANS,
    progress: Progress = silent,
    seed: int = 0,
) -> tuple[Matte, LiftedObject]:
    """The object under `mask` (H, W) as a soft cut-out and as `count` Gaussians."""  # fmt: skip
    lifter = lift.load(backend)
    progress(0.0, "Cutting out the object")
    margin = int(np.ceil(MATTE_MARGIN * band_width(camera.width, camera.height))) + 8
    matte = build_matte(pixels, mask, margin)
    progress_rest = part(progress, 0.3, 1.0)
    return matte, lifter.lift(pixels, mask, matte, camera, count, progress_rest, seed)


def make_plate(
    pixels: Pixels,
    hole: Mask,
    backend: str = "auto",
    progress: Progress = silent,
    seed: int = 0,
) -> Plate:
    """The photo with `hole` (H, W) painted out, as a crop around it."""  # fmt: skip
    inpainter = compose.load(backend)
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    extent = max(rows[-1] - rows[0], columns[-1] - columns[0]) + 1
    context = int(max(PLATE_CONTEXT * extent, LEAST_CONTEXT))
    height, width = hole.shape
    top, bottom = max(rows[0] - context, 0), min(rows[-1] + 1 + context, height)
    left, right = max(columns[0] - context, 0), min(columns[-1] + 1 + context, width)
    window = (slice(top, bottom), slice(left, right))
    filled = inpainter.inpaint(pixels[window], hole[window], progress, seed)
    inner = (
        slice(rows[0] - top, rows[-1] + 1 - top),
        slice(columns[0] - left, columns[-1] + 1 - left),
    )
    hole_crop = hole[window][inner]
    return Plate(int(columns[0]), int(rows[0]), filled[inner], hole_crop, inpainter.name)


__all__ = ["hole_margin", "lift_mask", "make_plate", "open_photo", "segment_photo"]
