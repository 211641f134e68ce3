"""Pictures that are no files: arrays and Pillow's images, in and out of a `Picture`."""

from __future__ import annotations

import io

import cv2
import numpy as np
from PIL import Image

from .image import ImageError, Picture, encode_picture, to_u8

CHANNELS = {1: "grey", 2: "grey and alpha", 3: "RGB", 4: "RGB and alpha"}
AS_PNG = ("1", "L", "LA", "P", "PA", "RGB", "RGBA")  # modes of Pillow that PNG holds as they are
AS_TIFF = ("CMYK", "LAB")
WITH_ALPHA = ("RGBa", "La")


def encode_array(array: np.ndarray) -> bytes:
    """The PNG file of pixels (H, W) or (H, W, 1..4), u8 or u16, RGB. Raises ImageError."""
    if array.dtype not in (np.uint8, np.uint16):
        raise ImageError(
            f"a photo is an array of uint8 or uint16, not of {array.dtype};"
            " values from 0 to 1 become so by (255 * array).round().astype(np.uint8)"
        )
    samples = array[..., None] if array.ndim == 2 else array
    if samples.ndim != 3 or samples.shape[2] not in CHANNELS or samples.size == 0:
        raise ImageError(f"a photo is (H, W), (H, W, 3) or (H, W, 4), not {array.shape}")
    channels = samples.shape[2]
    pixels = samples[..., :3] if channels > 2 else np.repeat(samples[..., :1], 3, axis=2)
    alpha = samples[..., -1] if channels in (2, 4) else None
    return encode_picture(Picture(pixels, alpha, is_grey=channels < 3), ".png")


def encode_pil(image: Image.Image) -> bytes:
    """A file of Pillow's image, without loss, with its profile and EXIF. Raises ImageError."""
    if image.mode.startswith("I;16"):
        return encode_array(np.asarray(image).astype(np.uint16))
    if image.mode in ("I", "F"):
        raise ImageError(f"an image of mode {image.mode} is no photo; convert it to RGB")
    kind = "TIFF" if image.mode in AS_TIFF else "PNG"
    if image.mode not in (*AS_PNG, *AS_TIFF):
        image = image.convert("RGBA" if image.mode in WITH_ALPHA else "RGB")
    more = {"exif": found} if (found := image.getexif()) else {}
    out = io.BytesIO()
    image.save(out, kind, icc_profile=image.info.get("icc_profile"), **more)
    return out.getvalue()


def array_of(picture: Picture) -> np.ndarray:
    """A copy of its pixels (H, W, 3), or (H, W, 4) where it has an alpha channel."""
    if picture.alpha is None:
        return picture.pixels.copy()
    return np.dstack([picture.pixels, picture.alpha])


def pil_of(picture: Picture) -> Image.Image:
    """Pillow's image of a picture, with its profile and EXIF.

    Of 16 bits a channel Pillow keeps only grey without alpha; other pictures are rounded to 8.
    """
    colours = picture.pixels
    if picture.is_grey:
        colours = cv2.cvtColor(colours, cv2.COLOR_RGB2GRAY)
    if not picture.is_grey or picture.alpha is not None:
        colours = to_u8(colours)
    if picture.alpha is not None:
        colours = np.dstack([colours, to_u8(picture.alpha)])
    image = Image.fromarray(colours)
    known = {"icc_profile": picture.icc, "exif": picture.exif}
    image.info.update({key: value for key, value in known.items() if value})
    return image
